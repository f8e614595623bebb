"""Files that want to hurt: bombs, pipes, paths that lead outside, codes that terminals obey."""

import os
import struct
import tracemalloc
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import lz4.frame
import numpy as np
import pytest
import zstandard
from mcap.opcode import Opcode
from mcap.records import DataEnd, Footer, Header

from teleop_core.bags import mcap_file, reader, rosbag2
from teleop_core.bags.reports import report
from teleop_core.bags.writer import BagWriter
from teleop_core.base.errors import RecordingError, TeleopError, UnknownNameError
from teleop_core.base.texts import LONGEST_LINE, one_line, printable, shown
from teleop_core.commands import cli
from teleop_core.graph import topics
from teleop_core.graph.layers import load_file
from teleop_core.robots.arms.dh import load_table
from teleop_core.session.master_bag import as_master_bag

MS = 1_000_000
GIGABYTE = 1 << 30
ESCAPES = "\x1b]0;owned\x07\x1b[2J\x1b[31m\x9b\u202e"
STREAMS = (topics.SLAVE_MEASURED_CP, topics.SLAVE_SETPOINT_CP, topics.SLAVE_SERVO_CP, topics.MASTER_MEASURED_CP)


@pytest.fixture
def little_memory() -> Iterator[None]:
    """A test in which no more than 100 MB may be taken, at any time."""
    tracemalloc.start()
    yield
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert peak < 100e6


def bomb(path: Path, name: str, packed: bytes, told: int) -> Path:
    """A recording of one chunk that says that it unpacks to ``told`` bytes."""
    schemas, channels = rosbag2.records_of([topics.SLAVE_MEASURED_CP])
    head = struct.pack("<QQQI", 1, 2, told, 0) + struct.pack("<I", len(name)) + name.encode()
    body = head + struct.pack("<Q", len(packed)) + packed
    chunk = struct.pack("<BQ", Opcode.CHUNK, len(body)) + body
    start = mcap_file.MAGIC + mcap_file.encode(Header("ros2", "x"), *schemas, *channels)
    path.write_bytes(start + chunk + mcap_file.encode(DataEnd(0), Footer(0, 0, 0)) + mcap_file.MAGIC)
    return path


def zeros(compress: Any, size: int) -> bytes:
    """So many zero bytes, packed bit by bit."""
    block = bytes(1 << 20)
    return b"".join([*(compress.compress(block) for _ in range(size >> 20)), compress.flush()])


def lz4_zeros(size: int) -> bytes:
    with lz4.frame.LZ4FrameCompressor() as compress:
        parts = [compress.begin(), *(compress.compress(bytes(1 << 20)) for _ in range(size >> 20))]
        return b"".join([*parts, compress.flush()])


BOMBS = {
    "zstd": lambda size: zeros(zstandard.ZstdCompressor().compressobj(size=size), size),
    "zstd of no told size": lambda size: zeros(zstandard.ZstdCompressor().compressobj(), size),
    "lz4": lz4_zeros,
}


@pytest.fixture(scope="module")
def packed(kind: str) -> bytes:
    return BOMBS[kind](200 << 20)


@pytest.mark.parametrize("told", [3 * GIGABYTE, 1000], ids=["told", "not told"])
@pytest.mark.parametrize("kind", BOMBS, scope="module")
def test_a_small_chunk_that_unpacks_to_gigabytes_is_refused(
    tmp_path: Path, packed: bytes, little_memory: None, kind: str, told: int
) -> None:
    path = bomb(tmp_path / "bomb.mcap", kind.partition(" ")[0], packed, told)
    with pytest.raises(RecordingError, match="is damaged") as error:
        reader.Bag(path)
    assert len(str(error.value)) <= LONGEST_LINE
    with pytest.raises(RecordingError, match="nothing can be recovered"):
        reader.recover(path)


def test_a_pipe_in_the_place_of_a_file_is_refused_and_not_waited_for(tmp_path: Path) -> None:
    pipe = tmp_path / "pipe.mcap"
    os.mkfifo(pipe)
    for attempt in (load_file, load_table, reader.Bag, reader.recover, as_master_bag):
        with pytest.raises(TeleopError):
            attempt(pipe)
    bag = tmp_path / "bag"
    with BagWriter(bag, [STREAMS[0]], ()) as writer:
        writer.write_block({STREAMS[0]: (np.arange(2), np.ones((2, 7)), np.arange(2))})
    (bag / "metadata.yaml").unlink()
    os.mkfifo(bag / "metadata.yaml")
    with pytest.raises(RecordingError, match="pipe"):
        reader.Bag(bag)


def test_a_length_that_a_file_claims_is_never_allocated(
    tmp_path: Path, little_memory: None, capsys: pytest.CaptureFixture[str]
) -> None:
    recorded(tmp_path / "bag")
    file = tmp_path / "bag" / "bag_0.mcap"
    whole = bytearray(file.read_bytes())
    start = struct.unpack_from("<Q", whole, len(whole) - 28)[0]  # of the index, by the footer
    struct.pack_into("<Q", whole, start + 1, 3 * GIGABYTE)
    file.write_bytes(whole)
    with pytest.raises(RecordingError, match="its index is damaged"):
        reader.Bag(file)
    ros1 = tmp_path / "old.bag"
    ros1.write_bytes(b"#ROSBAG V2.0\n" + struct.pack("<I", 3 * GIGABYTE) + bytes(5000))
    assert cli.main(["import", str(ros1), "--out", str(tmp_path / "out")]) == 2
    assert len(capsys.readouterr().err.splitlines()) == 1


def recorded(path: Path, **metadata: str) -> Path:
    times = np.arange(1, 1500) * MS
    values = np.zeros((len(times), 7))
    values[:, 3] = 1.0
    values[:, 0] = 0.01 * np.sin(times * 1e-9)
    with BagWriter(path, topics.ALL, tuple("abcdef"), metadata=metadata) as writer:
        writer.write_block(dict.fromkeys(STREAMS, (times, values, times)))
        for level in (0, 2):
            text = report(MS, f"node{ESCAPES}", level, ESCAPES, {f"late{ESCAPES}": ESCAPES})
            writer.write(topics.DIAGNOSTICS, MS, text)
    return path


def test_no_command_prints_codes_that_stand_in_a_recording(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = recorded(tmp_path / "bag", scenario=ESCAPES, robot=ESCAPES, seed=ESCAPES)
    assert cli.main(["evaluate", str(path), "--html", str(tmp_path / "page.html")]) == 0
    said = "".join(capsys.readouterr())
    assert "\u241b" in said  # shown, not obeyed
    assert not set(ESCAPES) & set("\x1b\x07\x9b\u202e") & set(said)
    reports = reader.Bag(path).reports(topics.DIAGNOSTICS)
    assert all(printable(text) == text for one in reports for text in (one.name, one.message))


VALUES = {"number": 10**5000, "numbers": [10**5000], "text": "x" * 10**6, "texts": ["y" * 99] * 9999, "codes": ESCAPES}


@pytest.mark.parametrize("value", VALUES.values(), ids=VALUES)
def test_every_value_is_shown_in_a_few_printable_words(value: str | int | Sequence[str | int]) -> None:
    text = str(UnknownNameError("name", value, ["a", "b"]))
    assert len(text) <= LONGEST_LINE
    assert printable(text) == text
    assert len(shown(value)) <= 250


def test_a_long_message_keeps_its_beginning_and_its_end() -> None:
    line = one_line("begin " + "middle " * 1000 + "end")
    assert line.startswith("begin")
    assert line.endswith("end")
    assert len(line) <= LONGEST_LINE
