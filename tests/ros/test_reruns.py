"""Only what the middleware is known for is rerun, and each rerun is counted and named."""

import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

TESTS = Path(__file__).resolve().parents[1]
HEAD = """
import ctypes, pathlib, threading, time
import pytest
from middleware_faults import MiddlewareLossError

pytestmark = pytest.mark.ros
runs = pathlib.Path(__file__).with_suffix(".runs")

def count():
    with runs.open("a") as file:
        file.write("x")
    return len(runs.read_text())

def abort_outside_python():
    libc, thread = ctypes.CDLL(None), ctypes.c_ulong()
    start = ctypes.cast(libc.abort, ctypes.c_void_p)
    libc.pthread_create(ctypes.byref(thread), None, start, None)
    time.sleep(10)

"""


@pytest.fixture
def run(tmp_path: Path) -> Callable[..., Any]:
    """Run a test of this body in a pytest of its own: its output, and how often the test ran."""

    def result(body: Any, *options: object) -> Any:
        file = tmp_path / "test_it.py"
        file.write_text(HEAD + body)
        (tmp_path / "pytest.ini").write_text("[pytest]\nmarkers = ros\n")
        command: Any = [sys.executable, "-m", "pytest", "-p", "middleware_faults", *options, str(file)]
        done = subprocess.run(
            command,
            cwd=tmp_path,
            env=dict(os.environ) | {"PYTHONPATH": str(TESTS / "support")},
            capture_output=True,
            text=True,
            timeout=120,
            check=False,
        )
        return done.returncode, done.stdout, len(file.with_suffix(".runs").read_text())

    return result


def test_any_failure_of_ours_is_not_rerun(run: Callable[..., Any]) -> None:
    faults = ("assert False", "raise TimeoutError", "raise AssertionError")
    tests = (f"def test_{k}():\n    count()\n    {fault}\n\n" for k, fault in enumerate(faults))
    code, out, runs = run("".join(tests))
    assert (code, runs) == (1, 3)
    assert "reruns because of the middleware" not in out


def test_a_proven_loss_is_rerun_counted_and_named(run: Callable[..., Any]) -> None:
    body = "def test_it():\n    if count() == 1:\n        raise MiddlewareLossError('3 of a/b')\n"
    code, out, runs = run(body)
    assert (code, runs) == (0, 2)
    assert "reruns because of the middleware: MiddlewareLossError 1" in out
    assert "test_it: middleware_faults.MiddlewareLossError: 3 of a/b" in out


def test_a_loss_that_comes_every_time_is_a_failure(run: Callable[..., Any]) -> None:
    code, out, runs = run("def test_it():\n    count()\n    raise MiddlewareLossError('all')\n")
    assert (code, runs) == (1, 3)
    assert "MiddlewareLossError 2" in out


def test_a_crash_in_a_thread_of_the_middleware_is_rerun_and_named(run: Callable[..., Any]) -> None:
    body = "def test_it():\n    if count() == 1:\n        abort_outside_python()\n"
    code, out, runs = run(body, "-n", "1")
    assert (code, runs) == (0, 2), out
    assert "reruns because of the middleware: MiddlewareCrashError 1" in out


def test_a_crash_in_our_own_code_is_a_failure(run: Callable[..., Any]) -> None:
    body = "def test_it():\n    if count() == 1:\n        ctypes.string_at(0)\n"
    code, out, _ = run(body, "-n", "1")
    assert code == 1
    assert "Segmentation fault" in out
    assert "1 failed" in out
