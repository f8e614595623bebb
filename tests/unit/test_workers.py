"""Workers: processes of this machine that compute for their caller."""

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from patience import is_alive, wait_until
from teleop_core.base.errors import SessionError
from teleop_core.base.workers import apart, workers

_LONG = """
import os, signal, sys, tempfile
from pathlib import Path
from teleop_core.base.workers import apart, workers

def long(folder):
    own = tempfile.mkdtemp()
    Path(folder, str(os.getpid())).symlink_to(own)
    while True:
        signal.pause()

if __name__ == "__main__":
    with workers(2) as pool:
        list(pool.map(long, 6 * sys.argv[1:]))
"""


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGKILL])
def test_processes_that_compute_end_at_once_with_their_caller(number: int, tmp_path: Path) -> None:
    """Ctrl-C reaches all processes of a terminal; a task that runs for ever is not awaited."""
    (begun := tmp_path / "begun").mkdir()
    (tmp_path / "long.py").write_text(_LONG)
    command = [sys.executable, str(tmp_path / "long.py"), str(begun)]
    caller = subprocess.Popen(command, start_new_session=True, stderr=subprocess.PIPE, text=True)
    marks = wait_until(lambda: len(found := list(begun.iterdir())) == 2 and found, "two tasks", 60)
    if number == signal.SIGINT:
        os.killpg(caller.pid, number)
    else:
        caller.kill()
    _, said = caller.communicate(timeout=60)
    wait_until(lambda: not any(is_alive(int(mark.name)) for mark in marks), "the end of all", 60)
    if number == signal.SIGINT:
        assert said.splitlines()[-1] == "KeyboardInterrupt"
        assert [mark.readlink() for mark in marks if mark.exists()] == []


def test_a_process_that_dies_is_told_in_a_line() -> None:
    with pytest.raises(SessionError, match="want of memory"), workers(1) as pool:
        pool.submit(os._exit, 1).result()


def test_a_copy_of_this_process_has_what_it_has_and_changes_nothing_in_it() -> None:
    own: list[int] = [1]

    def work() -> tuple[int, list[int]]:
        own.append(2)
        return os.getpid(), own

    number, found = apart(work)
    assert number != os.getpid()
    assert found == [1, 2]
    assert own == [1]


def test_a_copy_that_fails_is_an_error_of_its_caller(capfd: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SessionError, match="died"):
        apart(lambda: 1 // 0)
    assert "ZeroDivisionError" in capfd.readouterr().err
