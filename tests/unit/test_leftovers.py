"""Leftovers of the middleware's shared memory: who is dead is told by locks."""

import fcntl
import mmap
import os
from collections.abc import Callable
from pathlib import Path

import pytest

from teleop_core.nodes.leftovers import remove_leftovers

SEGMENT, PORT = "fastrtps_0123456789abcdef", "fastrtps_port7411"


@pytest.fixture
def place(tmp_path: Path) -> Callable[..., Path]:
    """Maker of files that are some minutes old."""

    def make(*names: str) -> Path:
        for name in names:
            (tmp_path / name).write_bytes(b"0" * 4096)
            os.utime(tmp_path / name, (1e9, 1e9))
        return tmp_path

    return make


def names(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


def test_a_segment_of_a_dead_process_goes_with_its_lock(place: Callable[..., Path]) -> None:
    assert remove_leftovers(place(SEGMENT, f"{SEGMENT}_el", "other")) == 1
    assert names(place()) == ["other"]


def test_a_segment_whose_owner_lives_stays(place: Callable[..., Path]) -> None:
    folder = place(SEGMENT, f"{SEGMENT}_el")
    with (folder / f"{SEGMENT}_el").open() as owner:
        fcntl.flock(owner, fcntl.LOCK_EX)
        assert remove_leftovers(folder) == 0
        assert names(folder) == [SEGMENT, f"{SEGMENT}_el"]
    assert remove_leftovers(folder) == 1


def test_a_port_that_one_process_still_reads_stays_whole(place: Callable[..., Path]) -> None:
    folder = place(PORT, f"{PORT}_el", f"{PORT}_sl", f"sem.{PORT}_mutex")
    with (folder / f"{PORT}_sl").open() as reader:
        fcntl.flock(reader, fcntl.LOCK_SH)
        assert remove_leftovers(folder) == 0
        assert len(names(folder)) == 4
    assert remove_leftovers(folder) == 1
    assert names(folder) == []


def test_a_port_without_a_lock_stays_while_it_is_in_the_memory_of_a_process(place: Callable[..., Path]) -> None:
    folder = place(PORT, f"sem.{PORT}_mutex")
    with (folder / PORT).open("rb") as file:
        held = mmap.mmap(file.fileno(), 0, prot=mmap.PROT_READ)
    assert remove_leftovers(folder) == 0
    held.close()
    assert remove_leftovers(folder) == 1
    assert names(folder) == []


def test_what_was_just_made_stays_for_its_owner_may_be_about_to_lock_it(place: Callable[..., Path]) -> None:
    folder = place(SEGMENT)
    (folder / f"{SEGMENT}_el").touch()
    assert remove_leftovers(folder) == 0
    assert names(folder) == [SEGMENT, f"{SEGMENT}_el"]


def test_a_machine_without_shared_memory_has_no_leftovers(tmp_path: Path) -> None:
    assert remove_leftovers(tmp_path / "none") == 0
