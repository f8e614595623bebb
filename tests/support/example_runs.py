"""Runs of the examples, as a user runs them."""

import os
import re
import subprocess
import sys
from contextlib import chdir
from pathlib import Path

from copies import run_copy

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


def run_again(name: str, folder: Path) -> str:
    """As :func:`run`, in a copy of a process that has loaded: a second less each."""
    with chdir(folder):
        done = run_copy([str(EXAMPLES / f"{name}.py")])
    assert done.returncode == 0, done.stdout + done.stderr
    assert not list(folder.iterdir())
    return done.stdout


def numbers(pattern: str, text: str) -> list[float]:
    """Every number that a pattern finds."""
    return [float(found) for found in re.findall(pattern, text)]
