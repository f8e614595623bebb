"""Ends of recordings when their directory is moved, removed or in the way, and on a full disk."""

import os
import queue
import resource
import shutil
import signal
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rosbags.highlevel import AnyReader

from teleop_core.bags.mcap_source import McapSource
from teleop_core.bags.reader import Bag, recover
from teleop_core.bags.writer import BagWriter
from teleop_core.base.background import System
from teleop_core.base.errors import RecordingError
from teleop_core.graph import topics

JOINTS = tuple("abcdef")
TOPIC = topics.SLAVE_MEASURED_JS
SECONDS = 4
MS = 1_000_000


def second(number: int) -> Any:
    times = np.arange(number * 1000, (number + 1) * 1000) * MS
    values = np.random.default_rng(number).normal(size=(1000, TOPIC.width(6)))
    return {TOPIC: (times, values, times)}


def record(path: Path, meanwhile: Callable[..., object], **options: Any) -> str:
    """Record some seconds, do something before the last, and return what the writer told."""
    writer = BagWriter(path, [TOPIC], JOINTS, compression="none", **options)
    for number in range(SECONDS):
        if number == SECONDS - 1:
            meanwhile(path)
        writer.write_block(second(number))
    with pytest.raises(RecordingError) as told:
        writer.close()
    return str(told.value)


def assert_holds(path: Path, count: int = SECONDS * 1000) -> None:
    """Every reader finds all messages."""
    series = Bag(path).read(TOPIC)
    np.testing.assert_array_equal(series.stamp_ns, np.arange(count) * MS)
    with AnyReader([path]) as reader:
        assert sum(1 for _ in reader.messages()) == count


class Jobs(queue.Queue[Any]):
    """Queue of a writer that knows when a job is done: the writer then asks for the next."""

    has_given = False

    def get(self, *arguments: Any, **options: Any) -> Any:
        if self.has_given:
            self.task_done()
        self.has_given = True
        return super().get(*arguments, **options)


class Waiting(System):
    """Threads and files of the system; :meth:`wait` returns when all that was given has been written."""

    def queue(self, size: int) -> Jobs:
        self.jobs = Jobs(size)
        return self.jobs

    def wait(self) -> None:
        self.jobs.join()


@pytest.mark.parametrize("size", [0, 100, 300_000, 600_000])
@pytest.mark.parametrize("compression", ["none", "zstd"])
def test_a_file_that_is_truncated_while_it_is_recorded_goes_on_and_its_loss_is_told(
    size: int, compression: str, tmp_path: Path
) -> None:
    path, written, background = tmp_path / "bag", SECONDS * 1000, Waiting()
    writer = BagWriter(path, [TOPIC], JOINTS, compression=compression, background=background)
    for number in range(SECONDS):
        writer.write_block(second(number))
    (file,) = path.glob("*.mcap")
    background.wait()  # a chunk that is being written would fill the file again
    os.truncate(file, size)
    writer.write_block(second(SECONDS))
    with pytest.raises(RecordingError, match="was truncated by another program during the recording") as told:
        writer.close()
    stamps = Bag(path).read(TOPIC).stamp_ns // MS
    kept = len(stamps) - 1000
    assert 0 <= kept < written
    assert np.array_equal(stamps, [*range(kept), *range(written, written + 1000)])
    assert f"{written - kept} messages are lost; {len(stamps)} messages are safe" in str(told.value)
    with AnyReader([path]) as reader:
        assert sum(1 for _ in reader.messages()) == len(stamps)


def test_a_file_that_is_truncated_just_before_its_end_is_no_whole_recording(tmp_path: Path) -> None:
    background = Waiting()
    writer = BagWriter(tmp_path / "bag", [TOPIC], JOINTS, compression="none", background=background)
    writer.write_block(second(0))
    writer.write_block(second(1))
    (file,) = (tmp_path / "bag").glob("*.mcap")
    background.wait()
    os.truncate(file, 0)
    with pytest.raises(RecordingError, match="2000 messages are lost; 0 messages are safe"):
        writer.close()


def test_a_moved_directory_is_finished_where_it_is_and_its_new_place_told(tmp_path: Path) -> None:
    told = record(tmp_path / "bag", lambda path: path.rename(tmp_path / "elsewhere"))
    assert f"all 4000 messages are in {tmp_path / 'elsewhere'}" in told
    assert "\n" not in told
    assert_holds(tmp_path / "elsewhere")


def test_a_removed_directory_is_made_again_with_every_message(tmp_path: Path) -> None:
    told = record(tmp_path / "bag", shutil.rmtree)
    assert "was removed during the recording and is created again with all 4000 messages" in told
    assert_holds(tmp_path / "bag")


def test_a_removed_directory_whose_name_is_taken_is_made_beside_it(tmp_path: Path) -> None:
    def replace(path: Path) -> None:
        shutil.rmtree(path)
        path.write_text("taken")

    told = record(tmp_path / "bag", replace)
    assert f"all 4000 messages are in {tmp_path / 'bag_rescued'}" in told
    assert_holds(tmp_path / "bag_rescued")


def test_metadata_that_cannot_be_written_cost_no_message(tmp_path: Path) -> None:
    told = record(tmp_path / "bag", lambda path: (path / "metadata.yaml").mkdir())
    assert "contains all 4000 messages" in told
    assert f"`teleop recover {tmp_path / 'bag'}/bag_0.mcap` completes it" in told
    assert (tmp_path / "bag" / "bag_0.mcap").stat().st_size > 4000 * TOPIC.width(6) * 8
    out, count = recover(tmp_path / "bag" / "bag_0.mcap")
    assert count == 4000
    assert_holds(out)


def test_a_file_moved_into_another_recording_leaves_that_one_alone(tmp_path: Path) -> None:
    with BagWriter(tmp_path / "other", [TOPIC], JOINTS) as writer:
        writer.write_block(second(0))
    before = (tmp_path / "other" / "metadata.yaml").read_bytes()
    told = record(tmp_path / "bag", lambda path: (path / "bag_0.mcap").rename(tmp_path / "other" / "bag_0.mcap"))
    assert (tmp_path / "other" / "metadata.yaml").read_bytes() == before
    assert f"teleop recover {tmp_path / 'other' / 'bag_0.mcap'}" in told
    out, count = recover(tmp_path / "other" / "bag_0.mcap", tmp_path / "saved")
    assert (out, count) == (tmp_path / "saved", 4000)


@pytest.fixture
def file_limit() -> Iterator[None]:
    """Files that a test makes may have a certain size from some time on."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    handler = signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    yield
    resource.setrlimit(resource.RLIMIT_FSIZE, before)
    signal.signal(signal.SIGXFSZ, handler)


@pytest.mark.parametrize("room", [10, 2000, 20_000, 100_000])
def test_a_full_disk_costs_no_message_that_was_written_whole(file_limit: None, tmp_path: Path, room: int) -> None:
    """However little room is left: chunks are whole, and recover finds them all."""

    def fill(path: Path) -> None:
        file = path / "bag_0.mcap"
        while McapSource(file, is_whole=False).contents.counts.total() < 3000:
            writer.flush()
        size = file.stat().st_size + room
        resource.setrlimit(resource.RLIMIT_FSIZE, (size, resource.RLIM_INFINITY))

    path = tmp_path / "bag"
    writer = BagWriter(path, [TOPIC], JOINTS, compression="none")
    for number in range(SECONDS):
        if number == SECONDS - 1:
            fill(path)
        writer.write_block(second(number))
    with pytest.raises(RecordingError) as told:
        writer.close()
    resource.setrlimit(resource.RLIMIT_FSIZE, (resource.RLIM_INFINITY, resource.RLIM_INFINITY))
    assert "(3000 of 4000 messages)" in str(told.value)
    if "recover" in str(told.value):
        path, count = recover(path)
        assert count == 3000
    assert_holds(path, 3000)
