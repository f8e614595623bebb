"""Recordings, their chunks and their metadata, broken in many ways."""

import shutil
import warnings
from pathlib import Path
from typing import Any

import lz4.frame
import numpy as np
import pytest
import yaml
import zstandard
from hypothesis import strategies as st
from mcap.writer import CompressionType, IndexType, Writer

from fuzzing import NASTY, TEXTS, damaged, fuzz
from teleop_core.bags import compression, reader, reports, ros_types, series
from teleop_core.bags.writer import BagWriter
from teleop_core.graph import topics

TOPICS = (topics.SLAVE_MEASURED_CP, topics.SLAVE_SERVO_JP, topics.TELEOP_STATE)
MS = 1_000_000


def made(path: Path, packing: str) -> bytes:
    """A recording of two chunks with poses, joints and reports."""
    with BagWriter(path, TOPICS, ("a", "b"), compression=packing, metadata={"seed": "1"}) as writer:
        for begin in (0, 10):
            times = np.arange(begin, begin + 10) * MS
            blocks = {t: (times, np.ones((10, t.width(2))), times) for t in TOPICS[:2]}
            writer.write_block(blocks)
            data = reports.report(begin * MS, "teleop", 0, "fine", {"is_fine": "1.0", "x": "abc"})
            writer.write(TOPICS[2], begin * MS, data)
    return (path / f"{path.name}_0.mcap").read_bytes()


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("fuzz")


def read_all(path: Path) -> None:
    """Everything that can be read of a recording."""
    bag = reader.Bag(path)
    for name, info in bag.topics.items():
        kind = series.kind_of(name, info.type)
        if info.count and kind is not None:
            bag.reports(name) if kind is topics.Kind.REPORT else bag.read(name)
    for _ in bag.raw():
        pass


def unchecked(path: Path) -> bytes:
    """The same recording without checksums and index, as of another writer."""
    made(path, "none")
    file = path.with_suffix(".mcap")
    with file.open("wb") as stream:
        writer = Writer(
            stream,
            chunk_size=1000,
            compression=CompressionType.NONE,
            index_types=IndexType.NONE,
            enable_crcs=False,
            use_statistics=False,
        )
        writer.start("ros2")
        channels = {}
        for name, ros_type, log_ns, data in reader.Bag(path).raw():
            if name not in channels:
                text = ros_types.definition(ros_type).encode()
                schema = writer.register_schema(ros_type, "ros2msg", text[:80])
                channels[name] = writer.register_channel("/" + name, "cdr", schema)
            writer.add_message(channels[name], log_ns, data, log_ns)
        writer.finish()
    return file.read_bytes()


@pytest.mark.parametrize("packing", ["none", "zstd", "lz4", "unchecked"])
def test_any_recording_is_read_recovered_or_refused(folder: Path, packing: str) -> None:
    path = folder / packing
    whole = unchecked(path) if packing == "unchecked" else made(path, packing)
    file, out = folder / "broken.mcap", folder / "recovered"
    file.write_bytes(whole)
    read_all(file)

    @fuzz("recordings", 4, data=damaged(whole), is_recovered=st.booleans())
    def attempt(data: bytes, is_recovered: bool) -> None:
        file.write_bytes(data)
        shutil.rmtree(out, ignore_errors=True)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            if is_recovered:
                reader.recover(file, out)
                read_all(out)
            else:
                read_all(file)

    attempt()


PACKED = {
    "zstd": [zstandard.ZstdCompressor(level=1).compress(bytes(n)) for n in (0, 10, 5000)]
    + [zstandard.ZstdCompressor(write_content_size=False).compress(bytes(3000))],
    "lz4": [lz4.frame.compress(bytes(n)) for n in (0, 10, 5000)],
    "": [b"", b"abc"],
}
SIZES = st.one_of(st.sampled_from((0, 10, 3000, 5000, 2**31, 2**40, 2**63)), st.integers(0, 10**4))


@st.composite
def chunks(draw: st.DrawFn) -> tuple[str, bytes]:
    name = draw(st.sampled_from(sorted(PACKED)))
    return name, draw(damaged(draw(st.sampled_from(PACKED[name])), most=2))


@pytest.mark.slow
@fuzz("chunks", chunk=chunks(), size=SIZES)
def test_any_chunk_is_unpacked_to_its_size_or_refused(chunk: Any, size: Any) -> None:
    name, data = chunk
    try:
        out = compression.decompress(name, data, size)
    except compression.DamagedError:
        return
    assert len(out) == size


NAMES = st.one_of(
    st.sampled_from(("bag_0.mcap", "../bag_0.mcap", "/etc/passwd", "..", ".", "", "a" * 300, "\0")), TEXTS
)
VALUES = st.one_of(
    st.none(),
    st.integers(),
    st.text(max_size=9),
    NAMES,
    st.lists(NAMES, max_size=4),
    st.dictionaries(st.text(max_size=3), st.integers(), max_size=2),
    st.just(["bag_0.mcap"] * 3000),
)
ENTRIES = ("relative_file_paths", "compression_mode", "version", "files", "storage_identifier")


@pytest.mark.slow
def test_any_metadata_leads_to_the_file_beside_it_or_is_refused(folder: Path) -> None:
    made(folder / "bag", "none")
    index = folder / "bag" / "metadata.yaml"
    content = yaml.safe_load(index.read_text())["rosbag2_bagfile_information"]
    content["topics_with_message_count"] = []
    plain = yaml.safe_dump({"rosbag2_bagfile_information": content}).encode()

    @st.composite
    def texts(draw: st.DrawFn) -> bytes:
        kind = draw(st.sampled_from(("bytes", "entry", "whole")))
        if kind == "bytes":
            return draw(damaged(plain))
        if kind == "whole":
            text = draw(st.one_of(TEXTS, st.sampled_from(NASTY)))
            start = draw(st.sampled_from(("", "rosbag2_bagfile_information: ")))
            return (start + text).encode("utf-8", "surrogatepass")
        changed = content | {draw(st.sampled_from(ENTRIES)): draw(VALUES)}
        return yaml.safe_dump({"rosbag2_bagfile_information": changed}).encode()

    @fuzz("metadata", text=texts())
    def attempt(text: bytes) -> None:
        index.write_bytes(text)
        assert reader.Bag(folder / "bag").topics[TOPICS[0].name].count == 20

    attempt()
