"""Sessions: a ROS domain of a machine has one at most, and nobody's mark outlives its process."""

import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from present import present
from teleop_core.base.errors import SessionError
from teleop_core.nodes.sessions import announced, domains

HOLD = """
import os, sys
from teleop_core.nodes.sessions import announced
with announced(int(sys.argv[1])):
    print(os.getpid(), flush=True)
    sys.stdin.read()
"""


@pytest.fixture(autouse=True)
def own_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    monkeypatch.setenv("TMPDIR", str(tmp_path))


@pytest.fixture
def other() -> Iterator[subprocess.Popen[str]]:
    """Another process that has domain 7."""
    process = subprocess.Popen(
        [sys.executable, "-c", HOLD, "7"], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    )
    assert int(present(process.stdout).readline()) == process.pid
    yield process
    process.kill()
    process.communicate()


def test_a_second_session_of_a_domain_is_refused_with_the_first_ones_process(other: subprocess.Popen[str]) -> None:
    assert domains() == (7,)
    said = f"domain 7 has a session already, process {other.pid}:"
    with pytest.raises(SessionError, match=said), announced(7):
        raise AssertionError("two sessions")
    with announced(8):
        assert domains() == (7, 8)


@pytest.mark.parametrize("is_killed", [True, False])
def test_a_domain_is_free_again_when_its_process_has_ended_however_that_was(
    other: subprocess.Popen[str], is_killed: bool
) -> None:
    if is_killed:
        other.kill()
    other.communicate()
    assert domains() == ()
    with announced(7):
        assert domains() == (7,)
    assert domains() == ()


def test_a_session_is_not_lost_where_no_mark_can_be_made(tmp_path: Path) -> None:
    (tmp_path / f"teleop_core_{os.getuid()}").write_text("a file in the way")
    with announced(7):
        assert domains() == ()
