"""Reading recordings: ours, those of others, and what cannot be read."""

import shutil
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mcap.writer import CompressionType, IndexType, Writer
from numpy.typing import NDArray
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as RosbagsWriter

from teleop_core.bags import ros_types
from teleop_core.bags.messages import layout, layout_of, report
from teleop_core.bags.reader import Bag, recover
from teleop_core.bags.writer import BagWriter
from teleop_core.base import RecordingError
from teleop_core.graph import topics
from teleop_core.kernels.geometry import Array

JOINTS = ("a", "b", "c")
MS = 1_000_000
STREAMS = (topics.SLAVE_MEASURED_CP, topics.SLAVE_MEASURED_JS, topics.MASTER_BUTTONS)


def samples(count: int = 60) -> tuple[NDArray[np.int64], dict[topics.Topic, Array]]:
    """Stamps, and values per topic, of one recording."""
    rng = np.random.default_rng(5)
    values = {topic: rng.normal(size=(count, topic.width(3))).round(3) for topic in STREAMS}
    values[topics.MASTER_BUTTONS] = rng.integers(0, 2, (count, 3)).astype(float)
    return np.arange(count) * MS + 3, values


def ours(path: Path, parts: int = 3, **options: Any) -> Path:
    stamps, values = samples()
    with BagWriter(path, topics.ALL, JOINTS, **options) as writer:
        for part in np.array_split(np.arange(len(stamps)), parts):
            writer.write_block({t: (stamps[part], v[part], stamps[part]) for t, v in values.items()})
        writer.write(topics.TELEOP_STATE, 9, report(8, "scaling", 1, "fine", {"mode": "fine"}))
    return path


def foreign(
    path: Path, *, frame_id: str | None = None, joint_names: tuple[str, str, str] = JOINTS, **options: Any
) -> Path:
    """A file that the mcap library wrote."""
    stamps, values = samples()
    with path.open("wb") as file:
        writer = Writer(file, **options)
        writer.start("ros2")
        channels = {}
        for topic in values:
            name = topic.kind.ros_type
            schema = writer.register_schema(name, "ros2msg", ros_types.definition(name).encode())
            channels[topic] = writer.register_channel("/" + topic.name, "cdr", schema)
        order = [JOINTS.index(name) for name in joint_names]
        for i, stamp in enumerate(stamps.tolist()):
            for topic, channel in channels.items():
                row = values[topic][i]
                if topic.kind is topics.Kind.STATE:
                    row = row.reshape(3, -1)[:, order].ravel()
                data = layout(topic, joint_names, frame_id).encode_one(stamp, row)
                writer.add_message(channel, stamp, data, stamp)
        writer.finish()
    return path


@contextmanager
def another(path: Path, kind: str, *names: str, **options: Any) -> Iterator[list[Callable[[int, bytes], None]]]:
    """What adds a message to each topic of a file of the mcap library."""
    with path.open("wb") as file:
        writer = Writer(file, **options)
        writer.start("ros2")
        schema = writer.register_schema(kind, "ros2msg", b"string data")
        channels = [writer.register_channel(name, "cdr", schema) for name in names]
        yield [lambda log_ns, data, c=c: writer.add_message(c, log_ns, data, log_ns) for c in channels]  # type: ignore[misc]
        writer.finish()


def assert_holds_samples(bag: Bag) -> None:
    stamps, values = samples()
    for name, series in bag.read_many(STREAMS, JOINTS).items():
        np.testing.assert_array_equal(series.stamp_ns, stamps)
        np.testing.assert_array_equal(series.log_ns, stamps)
        np.testing.assert_array_equal(series.values, values[topics.BY_NAME[name]])


@pytest.mark.parametrize("compression", ["zstd", "lz4", "none"])
def test_our_recordings_are_read_as_they_were_written(tmp_path: Path, compression: str) -> None:
    bag = Bag(ours(tmp_path / "bag", compression=compression, metadata={"seed": "4"}))
    assert_holds_samples(bag)
    assert bag.metadata == {"seed": "4"}
    assert (bag.start_ns, bag.end_ns) == (3, 59 * MS + 3)
    assert bag.topics["slave/measured_js"].type == "sensor_msgs/msg/JointState"
    assert bag.topics["slave/measured_js"].count == 60
    assert bag.read("/slave/measured_js").names == JOINTS
    assert bag.read("slave/measured_cp").frame_id == "slave_base"
    assert [r.message for r in bag.reports(topics.TELEOP_STATE)] == ["fine"]


FOREIGN = {
    "small chunks": {"chunk_size": 700},
    "lz4": {"chunk_size": 2000, "compression": CompressionType.LZ4},
    "uncompressed": {"compression": CompressionType.NONE},
    "no chunks": {"use_chunking": False},
    "no message index": {"index_types": IndexType.CHUNK, "chunk_size": 2000},
    "no index": {"index_types": IndexType.NONE, "chunk_size": 2000},
    "no summary": {
        "index_types": IndexType.NONE,
        "use_statistics": False,
        "use_summary_offsets": False,
        "repeat_channels": False,
        "repeat_schemas": False,
    },
    "other frame": {"frame_id": "somewhere_else"},
    "other joint order": {"joint_names": ("c", "a", "b")},
}


@pytest.mark.parametrize("options", FOREIGN.values(), ids=FOREIGN)
def test_files_of_other_writers_are_read_too(tmp_path: Path, options: Mapping[str, Any]) -> None:
    bag = Bag(foreign(tmp_path / "other.mcap", **options))
    assert bag.metadata == {}
    assert_holds_samples(bag)
    times = [log_ns for _, _, log_ns, _ in bag.raw()]
    assert times == sorted(times)
    assert len(times) == 180


def test_a_recording_of_rosbags_is_read_with_joints_of_changing_order(tmp_path: Path) -> None:
    path = tmp_path / "bag"
    orders = [("a", "b", "c"), ("c", "b", "a")]
    with RosbagsWriter(path, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        connection = writer.add_connection(
            "/slave/measured_js", "sensor_msgs/msg/JointState", typestore=ros_types.typestore()
        )
        for i in range(10):
            names = orders[i % 2]
            row = np.array([JOINTS.index(name) + i for name in names] * 3, float)
            data = layout_of(topics.Kind.STATE, names, "x" * i).encode_one(i * MS, row)
            writer.write(connection, i * MS, data)
    series = Bag(path).read(topics.SLAVE_MEASURED_JS)
    assert series.names == ("a", "b", "c")
    np.testing.assert_array_equal(series.values[:, :3], np.arange(10)[:, None] + np.arange(3))


def test_joints_are_read_in_the_order_that_is_asked_for(tmp_path: Path) -> None:
    bag = Bag(ours(tmp_path / "bag"))
    plain = bag.read(topics.SLAVE_MEASURED_JS).values
    series = bag.read(topics.SLAVE_MEASURED_JS, ("c", "a"))
    assert series.names == ("c", "a")
    np.testing.assert_array_equal(series.values, plain[:, [2, 0, 5, 3, 8, 6]])


def test_a_topic_unknown_to_us_is_read_by_its_type(tmp_path: Path) -> None:
    path = tmp_path / "other.mcap"
    with another(path, "sensor_msgs/msg/JointState", "/arm/positions", "/arm/state") as adds:
        for add, kind in zip(adds, (topics.Kind.JOINTS, topics.Kind.STATE), strict=True):
            add(5, layout_of(kind, JOINTS, "").encode_one(4, np.arange(kind.width(3), dtype=float)))
    bag = Bag(path)
    assert bag.read("/arm/positions").values.tolist() == [[0, 1, 2]]
    assert bag.read("arm/state").values.tolist() == [list(range(9))]


def test_several_files_of_one_recording_follow_each_other(tmp_path: Path) -> None:
    first, second = ours(tmp_path / "bag"), ours(tmp_path / "second")
    shutil.copy(second / "second_0.mcap", first / "bag_1.mcap")
    text = (first / "metadata.yaml").read_text()
    text = text.replace("  - bag_0.mcap\n", "  - bag_0.mcap\n  - bag_1.mcap\n")
    (first / "metadata.yaml").write_text(text)
    bag = Bag(first)
    assert bag.topics["slave/measured_cp"].count == 120
    assert len(bag.read(topics.SLAVE_MEASURED_CP)) == 120


@pytest.mark.parametrize("parts", [1, 7])
def test_blocks_are_the_whole_series_piece_by_piece(tmp_path: Path, parts: int) -> None:
    bag = Bag(ours(tmp_path / "bag", parts))
    blocks = [block["slave/measured_cp"] for block in bag.blocks([topics.SLAVE_MEASURED_CP])]
    assert len(blocks) == parts
    joined = np.concatenate([block.values for block in blocks])
    np.testing.assert_array_equal(joined, bag.read(topics.SLAVE_MEASURED_CP).values)


@settings(max_examples=25, deadline=None)
@given(st.lists(st.integers(0, 40), min_size=1, max_size=50), st.integers(1, 300), st.booleans())
def test_messages_come_in_log_time_order_even_if_chunks_overlap(
    tmp_path_factory: pytest.TempPathFactory, times: list[int], chunk_size: int, is_loose: bool
) -> None:
    path = tmp_path_factory.mktemp("raw") / "other.mcap"
    with another(path, "std_msgs/msg/String", "/text", chunk_size=chunk_size, use_chunking=not is_loose) as (add,):
        for number, log_ns in enumerate(times):
            add(log_ns, bytes([number]))
    found = [(log_ns, data[0]) for _, _, log_ns, data in Bag(path).raw()]
    assert found == sorted((log_ns, number) for number, log_ns in enumerate(times))


def test_raw_messages_are_those_of_the_chosen_topics(tmp_path: Path) -> None:
    bag = Bag(ours(tmp_path / "bag"))
    messages = list(bag.raw([topics.TELEOP_STATE]))
    state = ("teleop/state", "diagnostic_msgs/msg/DiagnosticArray", 9)
    assert [message[:3] for message in messages] == [state]
    assert messages[0][3] == report(8, "scaling", 1, "fine", {"mode": "fine"})


# -- what cannot be read ---------------------------------------------------------------------------


def test_a_topic_of_another_type_counts_as_missing(tmp_path: Path) -> None:
    path = tmp_path / "other.mcap"
    with another(path, "std_msgs/msg/String", "/slave/measured_cp") as (add,):
        add(1, b"\0\1\0\0")
    bag = Bag(path)
    with pytest.raises(RecordingError, match="not std_msgs/msg/String"):
        bag.read(topics.SLAVE_MEASURED_CP)
    with pytest.raises(RecordingError, match="cannot be read as numbers"):
        bag.read("slave/measured_cp")


def test_reports_are_not_read_as_numbers_nor_numbers_as_reports_and_missing_joints_are_named(tmp_path: Path) -> None:
    bag = Bag(ours(tmp_path / "bag"))
    with pytest.raises(RecordingError, match="cannot be read as numbers"):
        bag.read(topics.TELEOP_STATE)
    with pytest.raises(RecordingError, match="slave/measured_cp"):
        bag.reports("slave/measured_cp")
    with pytest.raises(RecordingError, match="lacks joints z; it has a, b, c"):
        bag.read(topics.SLAVE_MEASURED_JS, ("a", "z"))


# -- recovery --------------------------------------------------------------------------------------


@pytest.mark.parametrize("compression", ["zstd", "none"])
@settings(max_examples=25, deadline=None)
@given(kept=st.floats(0.0, 1.0))
def test_recovery_saves_every_whole_chunk_and_leaves_the_old_file(
    tmp_path_factory: pytest.TempPathFactory, compression: str, kept: float
) -> None:
    path = tmp_path_factory.mktemp("cut") / "bag"
    ours(path, 10, compression=compression, metadata={"seed": "4"})
    whole = Bag(path).read(topics.SLAVE_MEASURED_JS)
    file = path / "bag_0.mcap"
    cut = file.read_bytes()[: int(file.stat().st_size * kept)]
    file.write_bytes(cut)
    (path / "metadata.yaml").unlink()
    try:
        out, count = recover(path)
    except RecordingError as error:
        assert kept < 0.6, error  # noqa: PT017 (nothing but schemas before the first chunk)
        return
    bag = Bag(out)
    saved = bag.read(topics.SLAVE_MEASURED_JS)
    assert len(saved) % 6 == 0
    assert count == sum(info.count for info in bag.topics.values())
    np.testing.assert_array_equal(saved.values, whole.values[: len(saved)])
    assert bag.metadata == {"seed": "4"}
    assert file.read_bytes() == cut


def test_recovery_reads_files_of_other_writers_without_an_end(tmp_path: Path) -> None:
    file = foreign(tmp_path / "other.mcap", use_chunking=False)
    data = file.read_bytes()
    file.write_bytes(data[: len(data) // 2])
    out, count = recover(file)
    assert out == tmp_path / "other_recovered"
    bag = Bag(out)
    assert count == sum(info.count for info in bag.topics.values()) > 60
    _, values = samples()
    series = bag.read(topics.SLAVE_MEASURED_CP)
    np.testing.assert_array_equal(series.values, values[topics.SLAVE_MEASURED_CP][: len(series.stamp_ns)])


def test_recovery_never_overwrites(tmp_path: Path) -> None:
    path = ours(tmp_path / "bag")
    (tmp_path / "bag_recovered").mkdir()
    with pytest.raises(RecordingError, match="exists already"):
        recover(path)
    out, _ = recover(path, tmp_path / "elsewhere")
    assert_holds_samples(Bag(out))
