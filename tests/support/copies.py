"""Copies of a process that has loaded: a program begins in a tenth of a second, where a new process loads for two."""

import atexit
import os
import subprocess
import sys
from collections.abc import Mapping, Sequence
from functools import cache
from importlib import import_module
from pathlib import Path
from runpy import run_path
from tempfile import TemporaryFile

from teleop_core.nodes.starter import Starter
from teleop_core.session.configuration import configure

PROGRAM = "copies:be_program"


@cache
def _starter() -> Starter:
    """Process that has loaded what commands and most examples need; it ends with this one."""
    paths = [path for path in (os.environ.get("PYTHONPATH"), str(Path(__file__).parent)) if path]
    made = Starter(configure("coarse_box").text(), os.environ | {"PYTHONPATH": os.pathsep.join(paths)})
    atexit.register(made.close)
    return made


def run_copy(
    command: Sequence[str], main: str = PROGRAM, env: Mapping[str, str] = os.environ
) -> "subprocess.CompletedProcess[str]":
    """Run a function, or the program that a command names, in a copy, in the working directory of the caller."""
    with TemporaryFile("w+") as out, TemporaryFile("w+") as err:
        files = {"out": out.fileno(), "err": err.fileno()}
        process = _starter().start(command, env, files, main=main)
        try:
            code = process.wait(300)
        finally:
            process.kill()
        out.seek(0)
        err.seek(0)
        return subprocess.CompletedProcess(command, code, out.read(), err.read())


def be_program() -> int:
    """Be the program that ``sys.argv`` names, as if the copy had begun with it."""
    if "numba" in sys.modules:  # whoever compiles reads the environment anew
        import_module("numba.core.config").reload_config()
    sys.dont_write_bytecode = "PYTHONDONTWRITEBYTECODE" in os.environ
    sys.path.insert(0, str(Path(sys.argv[0]).resolve().parent))
    run_path(sys.argv[0], run_name="__main__")
    return 0
