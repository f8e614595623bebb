"""Writing recordings: what rosbags and the mcap library find in them."""

import hashlib
import struct
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st
from mcap.opcode import Opcode
from mcap.reader import make_reader
from mcap.records import Channel, Chunk, Message, MessageIndex
from mcap.stream_reader import StreamReader
from mcap_ros2.decoder import DecoderFactory
from numpy.typing import NDArray
from rosbags.highlevel import AnyReader
from rosbags.interfaces import QosDurability, QosReliability
from rosbags.rosbag2 import Reader

from present import present
from teleop_core.bags import messages, recording, ros_types
from teleop_core.bags.reader import Bag
from teleop_core.bags.writer import BagWriter
from teleop_core.base import ParameterError, RecordingError, ShapeError, UnknownNameError
from teleop_core.graph import topics
from teleop_core.kernels.geometry import Array

JOINTS = ("a", "b", "c")
MS = 1_000_000
EVERY_COMPRESSION = pytest.mark.parametrize("compression", ["zstd", "lz4", "none"])


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(11)


def block(
    rng: Any, begin: int, count: int, chosen: Any = topics.STREAMS
) -> dict[topics.Topic, tuple[NDArray[np.int64], Array, NDArray[np.int64]]]:
    """Samples of one block; stamps lie a little before log times."""
    log_ns = np.arange(begin, begin + count) * MS + 10
    return {
        topic: (log_ns - 10, rng.integers(-9, 9, (count, topic.width(3))) * 0.5, log_ns)
        if topic.kind is not topics.Kind.BUTTONS
        else (log_ns - 10, rng.integers(0, 2, (count, 3)).astype(float), log_ns)
        for topic in chosen
    }


def record(path: Path, rng: np.random.Generator, blocks: int = 3, count: int = 50, **options: Any) -> dict[str, int]:
    with BagWriter(path, topics.ALL, JOINTS, **options) as writer:
        for number in range(blocks):
            begin = number * count
            data = messages.report(begin * MS, "scaling", 0, "fine", {"mode": str(number)})
            writer.write(topics.TELEOP_STATE, begin * MS + 20, data)
            writer.write_block(block(rng, begin, count))
        return writer.counts


def mcap_file(path: Path) -> Path:
    return path / f"{path.name}_0.mcap"


@EVERY_COMPRESSION
def test_rosbags_reads_every_value_that_was_written(tmp_path: Path, rng: np.random.Generator, compression: str) -> None:
    written = block(rng, 5, 40)
    with BagWriter(tmp_path / "bag", topics.ALL, JOINTS, compression=compression) as writer:
        writer.write_block(written)
    found: Any
    found = {topic.name: [] for topic in topics.STREAMS}
    with AnyReader([tmp_path / "bag"]) as reader:
        for connection, log_ns, data in reader.messages():
            message = reader.deserialize(data, connection.msgtype)
            assert ros_types.serialise(message) == bytes(data)
            found[connection.topic[1:]].append((log_ns, bytes(data)))
    for topic, (stamps, values, logs) in written.items():
        rows = messages.layout(topic, JOINTS).encode(stamps, values)
        assert found[topic.name] == [(t, r.tobytes()) for t, r in zip(logs, rows, strict=True)]


@settings(max_examples=30, deadline=None)
@given(
    begin_ns=st.sampled_from([0, 1_764_000_000_123_456_789]),
    missing=st.lists(st.sets(st.integers(0, 5)), min_size=4, max_size=4),
    late=st.sampled_from([0, 1, MS // 2]),
    at=st.lists(st.integers(0, 6), max_size=4),
)
def test_streams_out_of_step_stand_at_their_times_among_the_others(
    tmp_path_factory: pytest.TempPathFactory, begin_ns: int, missing: list[set[int]], late: int, at: list[int]
) -> None:
    path, rng = tmp_path_factory.mktemp("steps") / "bag", np.random.default_rng(5)
    chosen, expected = topics.STREAMS[:4], []
    samples: dict[topics.Topic, Any] = {}
    for place, (topic, holes) in enumerate(zip(chosen, missing, strict=True)):
        ticks = np.array([i for i in range(6) if i not in holes], np.int64)
        logs = begin_ns + ticks * MS + late * (place == 2)
        samples[topic] = (logs, rng.integers(0, 2, (len(logs), topic.width(3))) * 1.0, logs)
        expected += [(log, place, topic.name) for log in logs.tolist()]
    with BagWriter(path, topics.ALL, JOINTS, compression="none") as writer:
        for number, tick in enumerate(sorted(at)):
            log = begin_ns + tick * MS
            writer.write(topics.DIAGNOSTICS, log, messages.report(log, "a", 0, str(number), {}))
            expected.append((log, len(chosen), "diagnostics"))
        writer.write_block(samples)
    if not expected:
        return
    with mcap_file(path).open("rb") as file:
        records = list(StreamReader(file).records)
    names = {r.id: r.topic.removeprefix("/") for r in records if isinstance(r, Channel)}
    found = [(r.log_time, names[r.channel_id]) for r in records if isinstance(r, Message)]
    assert found == [(log, name) for log, _, name in sorted(expected)]
    bag = Bag(path)
    for topic, (stamps, values, _) in samples.items():
        if len(stamps):
            np.testing.assert_array_equal(bag.read(topic).stamp_ns, stamps)
            np.testing.assert_array_equal(bag.read(topic).values, values)


@pytest.mark.parametrize("begin_ns", [0, 1_764_000_000_123_456_789])
def test_chunks_are_cut_between_times_whatever_the_clock(
    tmp_path: Path, rng: np.random.Generator, begin_ns: int
) -> None:
    samples = block(rng, 0, 9000)
    samples = {t: (s, v, begin_ns + log) for t, (s, v, log) in samples.items()}
    stamps, values, logs = samples[topics.STREAMS[0]]
    samples[topics.STREAMS[0]] = (stamps[::7], values[::7], logs[::7])
    with BagWriter(tmp_path / "bag", topics.ALL, JOINTS) as writer:
        writer.write_block(samples)
    with mcap_file(tmp_path / "bag").open("rb") as file:
        chunks = present(make_reader(file).get_summary()).chunk_indexes
    assert len(chunks) > 5
    assert all(a.message_end_time < b.message_start_time for a, b in pairwise(chunks))
    assert max(chunk.uncompressed_size for chunk in chunks) < 3 << 20
    assert len(Bag(tmp_path / "bag").read(topics.SLAVE_MEASURED_JS)) == 9000


@EVERY_COMPRESSION
def test_the_mcap_library_decodes_and_validates_the_file(
    tmp_path: Path, rng: np.random.Generator, compression: str
) -> None:
    counts = record(tmp_path / "bag", rng, compression=compression, metadata={"seed": "7"})
    with mcap_file(tmp_path / "bag").open("rb") as file:
        reader = make_reader(file, validate_crcs=True, decoder_factories=[DecoderFactory()])
        times = [m.message.log_time for m in reader.iter_decoded_messages()]
        summary = present(reader.get_summary())
        metadata = list(reader.iter_metadata())
    assert len(times) == sum(counts.values())
    assert times == sorted(times)
    assert present(summary.statistics).message_count == len(times)
    assert [(entry.name, entry.metadata) for entry in metadata] == [("teleop_core", {"seed": "7"})]


def test_message_indexes_point_at_their_messages(tmp_path: Path, rng: np.random.Generator) -> None:
    counts = record(tmp_path / "bag", rng, compression="none")
    with mcap_file(tmp_path / "bag").open("rb") as file:
        records = list(StreamReader(file, emit_chunks=True, validate_crcs=True).records)
    indexed = 0
    for entry in records:
        if isinstance(entry, Chunk):
            chunk = entry
        elif isinstance(entry, MessageIndex):
            for log_ns, offset in entry.records:
                head = chunk.data[offset : offset + 31]
                assert head[0] == Opcode.MESSAGE
                assert int.from_bytes(head[9:11], "little") == entry.channel_id
                assert int.from_bytes(head[15:23], "little") == log_ns
            indexed += len(entry.records)
    assert indexed == sum(counts.values())


def test_the_directory_says_what_rosbag2_says(tmp_path: Path, rng: np.random.Generator) -> None:
    counts = record(tmp_path / "bag", rng)
    text = (tmp_path / "bag" / "metadata.yaml").read_text()
    assert "&id" not in text
    about = yaml.safe_load(text)["rosbag2_bagfile_information"]
    assert (about["version"], about["storage_identifier"]) == (9, "mcap")
    assert about["relative_file_paths"] == ["bag_0.mcap"]
    assert about["message_count"] == sum(counts.values())
    assert about["starting_time"]["nanoseconds_since_epoch"] == 10
    assert about["duration"]["nanoseconds"] == 149 * MS
    entries = {t["topic_metadata"]["name"]: t for t in about["topics_with_message_count"]}
    assert {name[1:]: t["message_count"] for name, t in entries.items()} == counts
    with Reader(tmp_path / "bag") as reader:
        by_topic: Any = {c.topic: c for c in reader.connections}
    pose: Any
    state: Any
    state, pose = by_topic["/teleop/state"], by_topic["/slave/measured_cp"]
    assert pose.digest == ros_types.type_hash("geometry_msgs/msg/PoseStamped")
    assert pose.ext.offered_qos_profiles[0].reliability is QosReliability.RELIABLE
    assert state.ext.offered_qos_profiles[0].reliability is QosReliability.RELIABLE
    assert state.ext.offered_qos_profiles[0].durability is QosDurability.TRANSIENT_LOCAL
    assert by_topic["/diagnostics"].ext.offered_qos_profiles[0].depth == 10


@EVERY_COMPRESSION
def test_the_same_calls_give_the_same_bytes(tmp_path: Path, compression: str) -> None:
    digests = set()
    for attempt in ("first", "second"):
        path = tmp_path / attempt / "bag"
        record(path, np.random.default_rng(3), compression=compression, metadata={"b": "1"})
        files = sorted(path.iterdir())
        assert [file.name for file in files] == ["bag_0.mcap", "metadata.yaml"]
        digests.add(tuple(hashlib.sha256(file.read_bytes()).hexdigest() for file in files))
    assert len(digests) == 1


def test_arrays_may_be_reused_as_soon_as_a_block_is_written(tmp_path: Path, rng: np.random.Generator) -> None:
    samples = block(rng, 0, 20, [topics.SLAVE_MEASURED_CP])
    stamps, values, logs = samples[topics.SLAVE_MEASURED_CP]
    expected = values.copy()
    with BagWriter(tmp_path / "bag", topics.ALL, JOINTS) as writer:
        writer.write_block(samples)
        values[:] = stamps[:] = logs[:] = 0
    np.testing.assert_array_equal(Bag(tmp_path / "bag").read("slave/measured_cp").values, expected)


@settings(max_examples=20, deadline=None)
@given(every=st.integers(1, 7), of=st.integers(1, 7), sizes=st.lists(st.integers(0, 30), min_size=1, max_size=5))
def test_every_nth_sample_is_recorded_whatever_the_blocks(
    tmp_path_factory: pytest.TempPathFactory, every: int, of: int, sizes: list[int]
) -> None:
    path = tmp_path_factory.mktemp("every") / "bag"
    options = recording.RecordingParameters(every=every, every_of=(f"slave/measured_js={of}",))
    rng, begin = np.random.default_rng(1), 0
    with BagWriter(path, topics.ALL, JOINTS, parameters=options) as writer:
        writer.write(topics.DIAGNOSTICS, 0, messages.report(0, "a", 0, "b", {}))
        for size in sizes:
            writer.write_block(block(rng, begin, size))
            begin += size
    bag = Bag(path)
    for topic, step in ((topics.SLAVE_MEASURED_CP, every), (topics.SLAVE_MEASURED_JS, of)):
        expected = np.arange(0, begin, step) * MS
        assert writer.counts[topic.name] == len(expected)
        if len(expected):
            np.testing.assert_array_equal(bag.read(topic).stamp_ns, expected)


def test_single_messages_are_thinned_out_like_samples_of_blocks(tmp_path: Path) -> None:
    form = messages.layout(topics.SLAVE_MEASURED_CP, JOINTS)
    options = recording.RecordingParameters(every=4)
    with BagWriter(tmp_path / "bag", topics.ALL, JOINTS, parameters=options) as writer:
        for i in range(10):
            writer.write(topics.SLAVE_MEASURED_CP, i, form.encode_one(i, np.zeros(7)))
            writer.write(topics.DIAGNOSTICS, i, messages.report(i, "a", 0, "b", {}))
    bag = Bag(tmp_path / "bag")
    np.testing.assert_array_equal(bag.read(topics.SLAVE_MEASURED_CP).stamp_ns, [0, 4, 8])
    assert bag.topics["diagnostics"].count == 10


def test_only_chosen_topics_are_recorded(tmp_path: Path, rng: np.random.Generator) -> None:
    options = recording.RecordingParameters(topics=("slave/measured_cp", "teleop/state"))
    counts = record(tmp_path / "bag", rng, parameters=options)
    assert counts == {"slave/measured_cp": 150, "teleop/state": 3}
    assert set(Bag(tmp_path / "bag").topics) == set(counts)


@pytest.mark.parametrize("values", [{"topics": ("slave/measured",)}, {"every_of": ("slave=2",)}])
def test_topics_that_nobody_announced_are_refused_and_leave_no_folder(tmp_path: Path, values: dict[str, Any]) -> None:
    parameters = recording.RecordingParameters(**values)
    with pytest.raises(UnknownNameError, match=r"one of: .*slave/\w+, "):
        BagWriter(tmp_path / "bag", topics.ALL, JOINTS, parameters=parameters)
    assert not (tmp_path / "bag").exists()


def test_an_existing_recording_is_never_overwritten(tmp_path: Path, rng: np.random.Generator) -> None:
    record(tmp_path / "bag", rng)
    before = mcap_file(tmp_path / "bag").read_bytes()
    with pytest.raises(RecordingError, match="choose another --out") as caught:
        BagWriter(tmp_path / "bag", topics.ALL, JOINTS)
    assert caught.value.path == tmp_path / "bag"
    assert mcap_file(tmp_path / "bag").read_bytes() == before


def test_a_place_that_cannot_be_written_is_named(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(RecordingError, match="Not a directory") as caught:
        BagWriter(tmp_path / "file" / "bag", topics.ALL, JOINTS)
    assert caught.value.path == tmp_path / "file" / "bag"


@pytest.mark.parametrize(("log_ns", "error"), [(5, KeyboardInterrupt), (-1, struct.error)], ids=["session", "message"])
def test_a_recording_is_finished_when_its_session_fails_or_a_message_cannot_be_stored(
    tmp_path: Path, rng: np.random.Generator, log_ns: int, error: type[BaseException]
) -> None:
    def fail() -> None:
        with BagWriter(tmp_path / "bag", topics.ALL, JOINTS) as writer:
            writer.write_block(block(rng, 0, 10))
            writer.write(topics.DIAGNOSTICS, log_ns, messages.report(5, "a", 2, "broken", {}))
            raise KeyboardInterrupt

    with pytest.raises(error):
        fail()
    bag = Bag(tmp_path / "bag")
    assert bag.topics["slave/measured_cp"].count == 10
    assert bag.topics["diagnostics"].count == (log_ns > 0)


def test_a_recording_in_progress_does_not_look_complete(tmp_path: Path, rng: np.random.Generator) -> None:
    with BagWriter(tmp_path / "bag", topics.ALL, JOINTS) as writer:
        writer.write_block(block(rng, 0, 10))
        assert not (tmp_path / "bag" / "metadata.yaml").exists()
    assert (tmp_path / "bag" / "metadata.yaml").exists()


def test_a_closed_recording_takes_nothing_more(tmp_path: Path, rng: np.random.Generator) -> None:
    writer = BagWriter(tmp_path / "bag", topics.ALL, JOINTS)
    writer.close()
    writer.close()
    with pytest.raises(RecordingError, match="closed"):
        writer.write_block(block(rng, 0, 3))


def test_blocks_that_do_not_fit_are_refused_at_once(tmp_path: Path) -> None:
    stamps = np.arange(3)
    with BagWriter(tmp_path / "bag", topics.STREAMS, JOINTS) as writer:
        with pytest.raises(ShapeError) as caught:
            writer.write_block({topics.SLAVE_MEASURED_CP: (stamps, np.zeros((3, 6)), stamps)})
        assert caught.value.expected == (3, 7)
        with pytest.raises(ShapeError):
            writer.write_block({topics.SLAVE_MEASURED_CP: (stamps[:2], np.zeros((3, 7)), stamps)})
        with pytest.raises(UnknownNameError):
            writer.write(topics.DIAGNOSTICS, 0, b"")
    with BagWriter(tmp_path / "other", topics.ALL, JOINTS) as writer:
        with pytest.raises(ParameterError) as refused:
            writer.write_block({topics.DIAGNOSTICS: (stamps, np.zeros((3, 0)), stamps)})
        assert refused.value.value == "diagnostics"


@pytest.mark.parametrize("log_ns", [[-1, 0, 1], [0, 2, 1]])
def test_log_times_never_go_back_within_a_block(tmp_path: Path, log_ns: list[int]) -> None:
    times = np.array(log_ns)
    with BagWriter(tmp_path / "bag", topics.ALL, JOINTS) as writer:
        with pytest.raises(ParameterError) as caught:
            writer.write_block({topics.SLAVE_MEASURED_CP: (times, np.zeros((3, 7)), times)})
        assert caught.value.requirement == "not negative, not decreasing"


def test_live_messages_wait_for_a_chunk_no_longer_than_a_second_of_log_time(tmp_path: Path) -> None:
    data = messages.layout(topics.SLAVE_MEASURED_CP, JOINTS).encode_one(0, np.zeros(7))
    with BagWriter(tmp_path / "bag", topics.ALL, JOINTS) as writer:
        for i in range(2500):
            writer.write(topics.SLAVE_MEASURED_CP, i * MS, data, publish_ns=i)
    with mcap_file(tmp_path / "bag").open("rb") as file:
        reader = make_reader(file)
        chunks = present(reader.get_summary()).chunk_indexes
        assert [c.message_end_time // MS for c in chunks] == [1000, 2001, 2499]
        assert [m.publish_time for _, _, m in reader.iter_messages()] == list(range(2500))
