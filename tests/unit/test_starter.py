"""Starter: copies of a process that has loaded already, and what is known of their ends."""

import os
import signal
import socket
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from patience import wait_until
from teleop_core.base.errors import SessionError
from teleop_core.nodes.children import environment
from teleop_core.nodes.starter import LOST, Started, Starter

PATIENCE = 60.0


@pytest.fixture(scope="module")
def starter() -> Iterator[Starter]:
    with Starter("", environment()) as made:
        yield made


@pytest.fixture
def start(starter: Starter, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[..., Started]]:
    """Start something, with a file ``given`` beside those for what it writes."""
    monkeypatch.chdir(tmp_path)
    with (tmp_path / "written").open("wb") as written, tempfile.TemporaryFile() as given:
        given.write(b"what was given")
        given.flush()
        files = {"out": written.fileno(), "err": written.fileno(), "given": given.fileno()}

        def started(*command: str, main: str = "", **env: str) -> Started:
            return starter.start(command, os.environ | env, files, main=main)

        yield started


def written(tmp_path: Path) -> str:
    return (tmp_path / "written").read_text()


def test_a_program_has_the_words_environment_folder_and_files_that_it_was_given(
    start: Callable[..., Started], tmp_path: Path
) -> None:
    text = "import os, sys; print(os.environ['COLOUR'], os.getcwd(), open(sys.argv[1]).read(), 'numba' in sys.modules)"
    process = start(sys.executable, "-c", text, "/dev/fd/<given>", COLOUR="blue")
    assert process.wait(PATIENCE) == 0
    assert written(tmp_path) == f"blue {tmp_path} what was given False\n"


def test_a_copy_runs_what_it_is_told_with_nothing_on_its_standard_input(
    start: Callable[..., Started], tmp_path: Path
) -> None:
    process = start("a copy", main="code:interact", PYTHON_BASIC_REPL="1")
    assert process.wait(PATIENCE) == 0  # at the end of the input
    assert "InteractiveConsole" in written(tmp_path)


def test_a_copy_is_found_by_what_it_runs(start: Callable[..., Started]) -> None:
    process = start("teleop_core.nodes", "slave", main="signal:pause")
    title = Path(f"/proc/{process.pid}/cmdline")
    wait_until(lambda: " slave" in title.read_text().replace("\0", " "), "its title", PATIENCE)
    process.kill()
    assert process.wait(PATIENCE) == -signal.SIGKILL


@pytest.mark.parametrize(
    ("main", "code", "words"),
    [
        ("teleop_core.nodes.start:main", 2, "stage is 'nobody'"),
        ("this:nothing", 1, "AttributeError"),
        ("no_such_module:main", 1, "ModuleNotFoundError"),
    ],
)
def test_the_code_of_a_copy_is_told_and_what_it_raised_is_written(
    start: Callable[..., Started], tmp_path: Path, main: str, code: int, words: str
) -> None:
    assert start("teleop_core.nodes", "nobody", main=main).wait(PATIENCE) == code
    assert words in written(tmp_path)


def test_a_program_that_there_is_not_ends_with_its_reason(start: Callable[..., Started], tmp_path: Path) -> None:
    assert start("/no/such/program").wait(PATIENCE) == 1
    assert "FileNotFoundError" in written(tmp_path)


def test_a_process_is_known_to_run_until_a_signal_ends_it(start: Callable[..., Started]) -> None:
    process = start(sys.executable, "-c", "import signal; signal.pause()")
    with pytest.raises(subprocess.TimeoutExpired):
        process.wait(0.0)
    assert process.poll() is None
    process.kill()
    assert process.wait(PATIENCE) == -signal.SIGKILL
    process.terminate()  # nobody any more
    assert process.poll() == -signal.SIGKILL


def test_what_a_starter_that_was_killed_has_started_goes_on_and_nobody_knows_its_end(tmp_path: Path) -> None:
    waits = (sys.executable, "-c", "import signal; signal.pause()")
    with Starter("", environment()) as starter, (tmp_path / "log").open("wb") as log:
        files = {"out": log.fileno(), "err": log.fileno()}
        process = starter.start(waits, os.environ, files)
        os.kill(starter.pid, signal.SIGKILL)
        assert process.wait(PATIENCE) == LOST
        os.kill(process.pid, signal.SIGKILL)  # it is there
        with pytest.raises(SessionError, match="ended"):
            starter.start(waits, os.environ, files)


def test_a_starter_that_cannot_load_says_why() -> None:
    with Starter("robot: [", environment()) as broken:

        def wait() -> None:
            while not broken.is_ready(PATIENCE):
                pass

        with pytest.raises(SessionError, match="the configuration"):
            wait()


def test_a_starter_that_gets_no_further_is_given_up(tmp_path: Path) -> None:
    with Starter("", environment(), patience=0.5) as starter, (tmp_path / "log").open("wb") as log:
        os.kill(starter.pid, signal.SIGSTOP)
        try:
            with pytest.raises(SessionError, match=r"no progress for 0\.5 s"):
                starter.start(["true"], os.environ, {"out": log.fileno(), "err": log.fileno()})
        finally:
            os.kill(starter.pid, signal.SIGCONT)


def test_a_signal_to_a_process_that_has_ended_unheard_is_nothing() -> None:
    gone = subprocess.Popen([sys.executable, "-c", ""])
    gone.wait()
    ours, theirs = socket.socketpair()
    with theirs:
        theirs.send(str(gone.pid).encode())
        started = Started(ours)
        assert started.poll() is None  # the starter has not told of the end yet
        started.send_signal(signal.SIGTERM)
        theirs.send(b"-9")
        assert started.wait(PATIENCE) == -signal.SIGKILL
