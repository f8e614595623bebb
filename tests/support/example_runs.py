"""Runs of the examples, as a user runs them."""

import atexit
import os
import re
import subprocess
import sys
from contextlib import chdir
from functools import cache
from pathlib import Path
from runpy import run_path
from tempfile import TemporaryFile

from teleop_core.nodes.starter import Starter
from teleop_core.session.configuration import configure

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"
NAMES = sorted(path.stem for path in EXAMPLES.glob("*.py"))


def run(name: str, folder: Path, **env: str) -> str:
    """What an example prints; run in a folder of its own, in which it must leave nothing."""
    done = subprocess.run(
        [sys.executable, str(EXAMPLES / f"{name}.py")],
        cwd=folder,
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
        env=os.environ | env,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert not list(folder.iterdir())
    return done.stdout


@cache
def _starter() -> Starter:
    """Process that has loaded what most examples need, and is copied for each of them."""
    tests = {"PYTHONPATH": os.pathsep.join((str(Path(__file__).parent), str(EXAMPLES)))}
    made = Starter(configure("coarse_box").text(), os.environ | tests)
    atexit.register(made.close)
    return made


def run_again(name: str, folder: Path) -> str:
    """As :func:`run`, in a copy of a process that has loaded: a second less each."""
    path = EXAMPLES / f"{name}.py"
    with TemporaryFile("w+") as out, TemporaryFile("w+") as err, chdir(folder):
        files = {"out": out.fileno(), "err": err.fileno()}
        process = _starter().start([str(path)], os.environ, files, main="example_runs:be_program")
        code = process.wait(300)
        out.seek(0)
        err.seek(0)
        said, told = out.read(), err.read()
    assert code == 0, said + told
    assert not list(folder.iterdir())
    return said


def be_program() -> int:
    """Be the program that ``sys.argv`` names."""
    run_path(sys.argv[0], run_name="__main__")
    return 0


def numbers(pattern: str, text: str) -> list[float]:
    """Every number that a pattern finds."""
    return [float(found) for found in re.findall(pattern, text)]
