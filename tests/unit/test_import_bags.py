"""Importing bags of others: any pose, any storage, ROS 1 and 2, read beside the rosbags library."""

import gzip
import sqlite3
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import zstandard
from mcap.reader import NonSeekingReader
from mcap.writer import Writer as McapWriter
from numpy.typing import ArrayLike, NDArray
from rosbags.highlevel import AnyReader
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import CompressionMode, StoragePlugin
from scipy.spatial.transform import Rotation

import teleop_core as tc
import teleop_exchange
from foreign_bags import Maker, types_of, write1, write2
from teleop_core.bags.reader import Bag
from teleop_core.kernels.geometry import Array

START_NS = 1_700_000_000_000_000_000
COUNT = 300
STAMPS = START_NS + np.arange(COUNT) * 10_000_000
LOGS = STAMPS + 3_000_000
T = np.arange(COUNT) * 0.01
PLACES = 0.03 * np.column_stack((np.sin(T), np.cos(T), T))
XYZW = Rotation.from_rotvec(np.column_stack((np.sin(T), 0.2 * T, np.cos(T)))).as_quat()
POSES = np.column_stack((PLACES, XYZW[:, [3, 0, 1, 2]]))
KINDS = ("PoseStamped", "PoseWithCovarianceStamped", "TransformStamped", "Odometry", "Pose", "Transform", "TFMessage")


def poses(
    kind: str = "PoseStamped",
    topic: str = "/hand/pose",
    is_ros2: bool = True,
    stamps: NDArray[np.int64] = STAMPS,
    logs: NDArray[np.int64] = LOGS,
    **more: str,
) -> list[tuple[str, int, Any]]:
    maker = Maker(is_ros2)
    return [(topic, logs[i], maker.pose(POSES[i], kind, stamps[i], i=i, **more)) for i in range(len(logs))]


def presses(
    buttons: Callable[..., Any], topic: str = "/joy", stamps: NDArray[np.int64] = STAMPS, is_ros2: bool = True
) -> Any:
    maker = Maker(is_ros2)
    return [(topic, LOGS[i], maker.joy(stamps[i], buttons(i))) for i in range(COUNT)]


def in_order(*parts: list[tuple[str, int, object]]) -> list[tuple[str, int, object]]:
    return sorted((m for part in parts for m in part), key=lambda message: message[1])


def imported(path: Path, tmp_path: Path, **options: Any) -> tuple[teleop_exchange.ImportReport, tc.Stream]:
    report = teleop_exchange.import_recording(path, tmp_path / "out", **options)
    return report, report.recording["master/measured_cp"]


def assert_same(stream: tc.Stream, stamps: ArrayLike = STAMPS, rows: Array = POSES) -> None:
    assert np.array_equal(stream.stamp_ns, stamps)
    assert np.allclose(stream[["x", "y", "z"]], rows[:, :3], rtol=0, atol=1e-16)
    turn = ["qw", "qx", "qy", "qz"]
    signs = np.sign(np.sum(stream[turn] * rows[:, 3:], axis=1))[:, None]
    assert np.allclose(signs * stream[turn], rows[:, 3:], rtol=0, atol=1e-15)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("version", ["mcap", "db3", "ros1"])
def test_every_message_of_a_pose_is_read_from_every_storage(kind: str, version: str, tmp_path: Path) -> None:
    messages = poses(kind, is_ros2=version != "ros1")
    if version == "ros1":
        path = write1(tmp_path / "user.bag", messages)
    else:
        storage = StoragePlugin.MCAP if version == "mcap" else StoragePlugin.SQLITE3
        path = write2(tmp_path / "bag", messages, storage)
    has_header = kind not in {"Pose", "Transform"}
    _, stream = imported(path, tmp_path)
    assert_same(stream, STAMPS if has_header else LOGS)


@pytest.mark.parametrize("mode", [CompressionMode.FILE, CompressionMode.MESSAGE])
@pytest.mark.parametrize("storage", list(StoragePlugin))
def test_compressed_recordings_are_read(mode: CompressionMode, storage: StoragePlugin, tmp_path: Path) -> None:
    if mode is CompressionMode.FILE and storage is StoragePlugin.MCAP:
        mode = CompressionMode.STORAGE
    assert_same(imported(write2(tmp_path / "bag", poses(), storage, mode), tmp_path)[1])


@pytest.mark.parametrize("form", list(Writer1.CompressionFormat))
def test_compressed_bags_of_ros_1_are_read(form: Writer1.CompressionFormat, tmp_path: Path) -> None:
    messages = poses(is_ros2=False)
    assert_same(imported(write1(tmp_path / "user.bag", messages, form), tmp_path)[1])


def test_single_files_are_recordings_too(tmp_path: Path) -> None:
    for number, storage in enumerate(StoragePlugin):
        folder = write2(tmp_path / f"bag{number}", poses(), storage)
        (file,) = [path for path in folder.iterdir() if path.suffix != ".yaml"]
        report = teleop_exchange.import_recording(file, tmp_path / f"out{number}")
        assert_same(report.recording["master/measured_cp"])


def test_rows_are_those_of_the_rosbags_library(tmp_path: Path) -> None:
    path = write2(tmp_path / "bag", poses("Odometry"), StoragePlugin.SQLITE3)
    expected = []
    with AnyReader([path], default_typestore=types_of(True)) as reader:
        for connection, log_ns, data in reader.messages():
            message: Any = reader.deserialize(data, connection.msgtype)
            p, q = message.pose.pose.position, message.pose.pose.orientation
            expected.append((log_ns, p.x, p.y, p.z, q.w, q.x, q.y, q.z))
    _, stream = imported(path, tmp_path, stamps="log")
    rows = np.array([row[1:] for row in expected])
    assert_same(stream, [row[0] for row in expected], rows)


def test_messages_need_not_be_alike(tmp_path: Path) -> None:
    messages = poses("TFMessage", "/tf")
    cameras = poses("TFMessage", "/tf", child="camera")
    for i in range(0, COUNT, 3):
        messages[i][2].transforms.append(cameras[i][2].transforms[0])
    path = write2(tmp_path / "bag", messages, StoragePlugin.SQLITE3)
    assert_same(imported(path, tmp_path, frame="tool")[1])


# In which order.


@pytest.mark.parametrize("storage", list(StoragePlugin))
def test_messages_count_in_the_order_of_their_recording(storage: StoragePlugin, tmp_path: Path) -> None:
    rng = np.random.default_rng(3)
    messages = poses()
    shuffled = [messages[i] for i in rng.permutation(COUNT)]
    assert_same(imported(write2(tmp_path / "bag", shuffled, storage), tmp_path)[1])


@pytest.mark.parametrize("storage", list(StoragePlugin))
def test_splits_may_be_listed_in_any_order(storage: StoragePlugin, tmp_path: Path) -> None:
    messages = poses()
    first = write2(tmp_path / "bag", messages[:200], storage)
    second = write2(tmp_path / "second", messages[200:], storage)
    (one,), (two,) = ([p for p in d.iterdir() if p.suffix != ".yaml"] for d in (first, second))
    two.rename(first / f"later{one.suffix}")
    index = first / "metadata.yaml"
    listed = index.read_text().replace("message_count: 200", f"message_count: {COUNT}")
    name = f"- {one.name}\n"
    index.write_text(listed.replace(name, f"- later{one.suffix}\n  {name}", 1))
    assert_same(imported(first, tmp_path)[1])


def test_messages_that_the_metadata_promise_and_no_file_holds_are_told(tmp_path: Path) -> None:
    path = write2(tmp_path / "bag", poses(), StoragePlugin.SQLITE3)
    index = path / "metadata.yaml"
    index.write_text(index.read_text().replace(f"count: {COUNT}", f"count: {2 * COUNT}"))
    with pytest.warns(UserWarning, match=f"{COUNT} messages of {2 * COUNT} that are listed"):
        assert_same(imported(path, tmp_path)[1])


@pytest.mark.parametrize("end", ["-wal", "-journal"])
def test_messages_that_lie_beside_a_db3_are_told(end: str, tmp_path: Path) -> None:
    (file,) = write2(tmp_path / "bag", poses(), StoragePlugin.SQLITE3).glob("*.db3")
    log = file.with_name(file.name + end)
    log.write_bytes(b"")
    assert_same(imported(file, tmp_path)[1])
    log.write_bytes(b"changes of a recorder that was killed")
    for path in (file, file.parent):
        with pytest.raises(tc.RecordingError, match=log.name):
            teleop_exchange.import_recording(path, tmp_path / "other")


@pytest.mark.parametrize("kind", ["Pose", "TFMessage"])
def test_messages_of_ros_1_in_mcap_are_read(kind: str, tmp_path: Path) -> None:
    messages, types = poses(kind, is_ros2=False), types_of(False)
    path = tmp_path / "ros1.mcap"
    with path.open("wb") as file:
        writer = McapWriter(file)
        writer.start(profile="ros1", library="")
        name = messages[0][2].__msgtype__
        text, _ = types.generate_msgdef(name, ros_version=1)
        schema = writer.register_schema(name.replace("/msg/", "/"), "ros1msg", text.encode())
        channel = writer.register_channel("/hand/pose", "ros1", schema)
        for _, log_ns, message in messages:
            data = types.serialize_ros1(message, name)
            writer.add_message(channel, int(log_ns), bytes(data), int(log_ns))
        writer.finish()
    _, stream = imported(path, tmp_path)
    assert_same(stream, LOGS if kind in {"Pose", "Transform"} else STAMPS)


def written_beside_chunks(path: Path, is_beside: Callable[[int], bool]) -> Path:
    """MCAP whose index is whole, and of which some messages are between the chunks, as the format allows."""
    types, name = types_of(True), "geometry_msgs/msg/PoseStamped"
    with path.open("wb") as file:
        writer = McapWriter(file)
        writer.start(profile="ros2", library="")
        text, _ = types.generate_msgdef(name)
        builder = writer._Writer__chunk_builder  # type: ignore[attr-defined]
        writer._Writer__chunk_builder = None  # type: ignore[attr-defined]
        schema = writer.register_schema(name, "ros2msg", text.encode())
        channel = writer.register_channel("/hand/pose", "cdr", schema)
        for i, (_, log_ns, message) in enumerate(poses()):
            if is_beside(i):
                writer._Writer__finalize_chunk()  # type: ignore[attr-defined]
            writer._Writer__chunk_builder = None if is_beside(i) else builder  # type: ignore[attr-defined]
            writer.add_message(channel, int(log_ns), bytes(types.serialize_cdr(message, name)), int(log_ns))
        writer._Writer__chunk_builder = builder  # type: ignore[attr-defined]
        writer.finish()
    return path


BESIDE: dict[str, Callable[[int], bool]] = {
    "before the first chunk": lambda i: i < 100,
    "between the chunks": lambda i: 100 <= i < 200,
    "after the last chunk": lambda i: i >= 250,
    "every third": lambda i: i % 3 == 1,
    "one": lambda i: i == 150,
}


@pytest.mark.parametrize("case", BESIDE)
def test_messages_beside_the_chunks_are_read_too(case: str, tmp_path: Path) -> None:
    path = written_beside_chunks(tmp_path / "hand.mcap", BESIDE[case])
    with path.open("rb") as file:
        assert sum(1 for _ in NonSeekingReader(file).iter_messages()) == COUNT
    assert_same(imported(path, tmp_path)[1])
    assert [log for _, _, log, _ in Bag(path).raw()] == LOGS.tolist()
    assert np.array_equal(Bag(path).read("hand/pose").log_ns, LOGS)


# Which time.


def batched(size: int, child: str = "tool", rows: range = range(COUNT)) -> list[tuple[str, int, Any]]:
    """Messages of several samples each, as a tracker sends them."""
    messages = poses("TFMessage", "/tf", child=child)
    out = []
    for begin in range(rows.start, rows.stop, size):
        own = messages[begin : begin + size]
        message = own[-1][2]
        message.transforms[:0] = [one.transforms[0] for _, _, one in own[:-1]]
        out.append(("/tf", own[-1][1], message))
    return out


@pytest.mark.parametrize("version", ["mcap", "db3", "ros1"])
@pytest.mark.parametrize("size", [2, 7])
def test_every_sample_of_a_message_of_transforms_is_read(version: str, size: int, tmp_path: Path) -> None:
    if version == "ros1":
        messages = poses("TFMessage", "/tf", is_ros2=False)
        for i in range(0, COUNT - 1, 2):
            messages[i + 1][2].transforms.insert(0, messages[i][2].transforms[0])
        path = write1(tmp_path / "user.bag", messages[1::2])
    else:
        path = write2(tmp_path / "bag", batched(size), StoragePlugin[{"db3": "SQLITE3"}.get(version, "MCAP")])
    report, stream = imported(path, tmp_path)
    assert_same(stream)
    assert report.counts.rows == COUNT


@pytest.mark.parametrize("offset", [1_699_999_988, -1_600_000_000, 3600, -20])
@pytest.mark.parametrize("topics", [("/hand/pose", "/joy"), ("/master/measured_cp", "/master/buttons")])
def test_buttons_of_another_clock_come_at_the_time_of_their_recording(
    offset: int, topics: tuple[str, str], tmp_path: Path
) -> None:
    earlier = STAMPS - abs(offset) * 1_000_000_000
    stamps, others = (earlier, STAMPS) if offset > 0 else (STAMPS, earlier)
    pressed = presses(lambda i: [int(100 <= i < 200), 0, 0], topics[1], others)
    path = write2(tmp_path / "bag", in_order(poses(topic=topics[0], stamps=stamps), pressed))
    report, stream = imported(path, tmp_path)
    begin = stream.stamp_ns[0]
    buttons = report.recording["master/buttons"]
    assert (buttons.stamp_ns - begin).tolist() == [0, 1_000_000_000, 2_000_000_000]
    assert buttons["clutch"].tolist() == [0.0, 1.0, 0.0]
    assert any("another clock" in text for text in report.told)
    with pytest.warns(UserWarning, match="another clock"):
        answer = tc.replay(path)
    assert answer["master/buttons"]["clutch"].max() == 1.0


def test_buttons_that_no_clock_brings_to_the_poses_are_told(tmp_path: Path) -> None:
    late = 3600 * 1_000_000_000
    pressed = [(t, log + late, m) for t, log, m in presses(lambda i: [i % 2], stamps=STAMPS + late)]
    report, _ = imported(write2(tmp_path / "bag", in_order(poses(), pressed)), tmp_path)
    assert any("buttons are outside" in text for text in report.warnings)


# What is missing.


@pytest.mark.parametrize("value", [0.0, np.nan, 3.0])
@pytest.mark.parametrize("storage", list(StoragePlugin))
def test_positions_without_an_orientation_come_on_request(value: float, storage: StoragePlugin, tmp_path: Path) -> None:
    messages = poses()
    for _, _, message in messages:
        turn = message.pose.orientation
        turn.w = turn.x = turn.y = turn.z = value
    path = write2(tmp_path / "bag", messages, storage)
    with pytest.raises(tc.RecordingError, match="--orientation none") as error:
        teleop_exchange.import_recording(path, tmp_path / "other")
    assert "--quaternion" not in str(error.value)
    report, stream = imported(path, tmp_path, orientation="none")
    assert_same(stream, rows=np.column_stack((PLACES, np.tile([1.0, 0.0, 0.0, 0.0], (COUNT, 1)))))
    assert "orientation: constant" in report.told


@pytest.mark.parametrize(
    "options", [{"quaternion_order": "xyzw"}, {"time_unit": "ms"}, {"angles": "deg"}, {"episode": 3}, {"skip": 1}]
)
def test_an_option_of_tables_is_refused_for_a_bag(options: dict[str, Any], tmp_path: Path) -> None:
    path = write2(tmp_path / "bag", poses())
    with pytest.raises(tc.ParameterError, match="--topic"):
        teleop_exchange.import_recording(path, tmp_path / "out", **options)


def refused(path: Path, tmp_path: Path) -> str:
    with pytest.raises(tc.RecordingError) as error:
        teleop_exchange.import_recording(path, tmp_path / "refused")
    assert not (tmp_path / "refused").exists()
    return str(error.value)


@pytest.mark.parametrize(("pack", "name"), [(zstandard.compress, "zstd -d"), (gzip.compress, "gzip -d")])
@pytest.mark.parametrize("storage", list(StoragePlugin))
def test_a_packed_file_of_a_recording_says_how_it_is_read(
    pack: Callable[[bytes], bytes], name: str, storage: StoragePlugin, tmp_path: Path
) -> None:
    folder = write2(tmp_path / "bag", poses(), storage)
    (file,) = [path for path in folder.iterdir() if path.suffix != ".yaml"]
    packed = tmp_path / f"{file.name}.packed"
    packed.write_bytes(pack(file.read_bytes()))
    text = refused(packed, tmp_path)
    assert name in text
    assert "metadata.yaml" in text
    assert str(folder) in refused(packed.rename(folder / packed.name), tmp_path)


def test_a_recording_is_known_by_its_first_bytes(tmp_path: Path) -> None:
    folder = write2(tmp_path / "bag", poses())
    (file,) = folder.glob("*.mcap")
    assert "must end in .mcap" in refused(file.rename(tmp_path / "hand.mcap.backup"), tmp_path)
    bag = write1(tmp_path / "user.bag", poses(is_ros2=False))
    assert "rosbag reindex" in refused(bag.rename(tmp_path / "user.bag.active"), tmp_path)


@pytest.mark.parametrize("mode", [CompressionMode.NONE, CompressionMode.FILE])
def test_a_folder_without_its_list_of_files_says_what_to_give(mode: CompressionMode, tmp_path: Path) -> None:
    folder = write2(tmp_path / "bag", poses(), StoragePlugin.SQLITE3, mode)
    (folder / "metadata.yaml").unlink()
    (folder / "._metadata.yaml").write_bytes(b"")
    text = refused(folder, tmp_path)
    assert "lacks metadata.yaml" in text
    assert "ros2 bag reindex" in text
    assert next(folder.glob("bag*.db3*")).name in text


# Which topic.


def test_several_topics_of_poses_are_listed_in_one_line(tmp_path: Path) -> None:
    path = write2(tmp_path / "bag", in_order(poses(topic="/left"), poses("Pose", "/right")))
    with pytest.raises(tc.UnknownNameError, match="left, right") as error:
        teleop_exchange.import_recording(path, tmp_path / "out")
    assert "--topic" in str(error.value)
    assert not (tmp_path / "out").exists()
    assert_same(imported(path, tmp_path, topic="/left")[1])


def test_topics_that_are_no_poses_are_told(tmp_path: Path) -> None:
    path = write2(tmp_path / "bag", in_order(poses(), presses(lambda i: [0])))
    with pytest.raises(tc.UnknownNameError, match="hand/pose"):
        teleop_exchange.import_recording(path, tmp_path / "out", topic="foot/pose")
    with pytest.raises(tc.RecordingError, match="hand/pose"):
        teleop_exchange.import_recording(path, tmp_path / "out", topic="joy")
    only = write2(tmp_path / "joys", presses(lambda i: [0]))
    with pytest.raises(tc.RecordingError, match="no topic of poses; it has joy"):
        teleop_exchange.import_recording(only, tmp_path / "out")


def test_of_several_transforms_one_frame_is_taken(tmp_path: Path) -> None:
    both = in_order(poses("TFMessage", "/tf"), poses("TFMessage", "/tf", child="camera"))
    path = write2(tmp_path / "bag", both)
    with pytest.raises(tc.UnknownNameError, match="camera, tool"):
        teleop_exchange.import_recording(path, tmp_path / "out")
    assert_same(imported(path, tmp_path, frame="tool")[1])


@pytest.mark.parametrize("kind", ["TFMessage", "PoseStamped", "Odometry"])
@pytest.mark.parametrize("second", ["every other", "from the middle on"])
def test_poses_in_two_frames_are_never_mixed(kind: str, second: str, tmp_path: Path) -> None:
    messages = poses(kind)
    others = np.arange(COUNT) % 2 if second == "every other" else np.arange(COUNT) >= COUNT // 2
    for i in np.flatnonzero(others):
        message = messages[i][2]
        (message.transforms[0] if kind == "TFMessage" else message).header.frame_id = "camera"
    path = write2(tmp_path / "bag", messages)
    with pytest.raises(tc.UnknownNameError, match=r"--parent.*base, camera"):
        teleop_exchange.import_recording(path, tmp_path / "out")
    with pytest.raises(tc.RecordingError, match=r"no pose of.*table"):
        teleop_exchange.import_recording(path, tmp_path / "out", parent="table")
    report, stream = imported(path, tmp_path, parent="camera")
    kept = np.flatnonzero(others)
    assert_same(stream, STAMPS[kept], POSES[kept])
    assert kind == "PoseStamped" or "poses of tool in camera" in report.told


def test_poses_of_two_frames_on_one_topic_are_never_mixed(tmp_path: Path) -> None:
    messages = poses("TransformStamped")
    for _, _, message in messages[200:]:
        message.child_frame_id = "probe"
    path = write2(tmp_path / "bag", messages)
    with pytest.raises(tc.UnknownNameError, match=r"--frame.*probe, tool"):
        teleop_exchange.import_recording(path, tmp_path / "out")
    assert_same(imported(path, tmp_path, frame="probe")[1], STAMPS[200:], POSES[200:])


@pytest.mark.parametrize("version", ["mcap", "db3", "ros1"])
def test_a_frame_may_appear_after_any_number_of_messages(version: str, tmp_path: Path) -> None:
    maker, late = Maker(version != "ros1"), 1500
    often = [("/tf", int(STAMPS[0] + i), maker.pose(POSES[0], "TFMessage", STAMPS[0] + i)) for i in range(late)]
    messages = often + poses("TFMessage", "/tf", is_ros2=version != "ros1", child="camera")[1:]
    storage = StoragePlugin.SQLITE3 if version == "db3" else StoragePlugin.MCAP
    bag = tmp_path / "user.bag"
    path = write1(bag, messages) if version == "ros1" else write2(tmp_path / "bag", messages, storage)
    with pytest.raises(tc.UnknownNameError, match="camera, tool"):
        teleop_exchange.import_recording(path, tmp_path / "other")
    assert_same(imported(path, tmp_path, frame="camera")[1], STAMPS[1:], POSES[1:])


def carried(parent: str, child: str, rows: range | None = None) -> list[tuple[str, int, Any]]:
    """Messages of ``/tf`` of a child in a parent, of some of the stamps."""
    messages = poses("TFMessage", "/tf", child=child)
    for _, _, message in messages:
        message.transforms[0].header.frame_id = parent
    return [messages[i] for i in rows or range(COUNT)]


def matrices(rows: Array) -> Array:
    T = np.tile(np.eye(4), (len(rows), 1, 1))
    T[:, :3, :3] = Rotation.from_quat(rows[:, [4, 5, 6, 3]]).as_matrix()
    T[:, :3, 3] = rows[:, :3]
    return T


def assert_composed(stream: tc.Stream, stamps: NDArray[np.int64], expected: Array) -> None:
    np.testing.assert_array_equal(stream.stamp_ns, stamps)
    np.testing.assert_allclose(matrices(stream.values), expected, atol=1e-12)


@pytest.mark.parametrize("place", [0, 1, 2])
def test_transforms_on_the_way_to_the_root_are_composed(place: int, tmp_path: Path) -> None:
    """Times are those of the one with most poses; of the others the newest that is not later."""
    names, steps = ("room", "base", "arm", "tool"), [7, 5, 3]
    steps[place] = 1
    edges = [carried(names[i], names[i + 1], range(4, COUNT, steps[i])) for i in range(3)]
    still = carried("tool", "tip", range(50, 51))
    static = [("/tf_static", LOGS[50], still[0][2])]
    path = write2(tmp_path / "bag", in_order(*edges, static))
    report, stream = imported(path, tmp_path, frame="tip")
    expected = matrices(POSES[[50]])
    for step in steps[::-1]:
        newest = np.arange(COUNT - 4) // step * step + 4
        expected = matrices(POSES[newest]) @ expected
    assert_composed(stream, STAMPS[4:], expected)
    assert any(
        text.startswith("poses of tip in room, composed of tip in tool (constant), tool in arm (")
        for text in report.told
    )


def test_a_parent_on_the_way_ends_the_chain(tmp_path: Path) -> None:
    edges = [carried("room", "base"), carried("base", "arm"), carried("arm", "tool")]
    path = write2(tmp_path / "bag", in_order(*edges))
    _, stream = imported(path, tmp_path, frame="tool", parent="base")
    assert_composed(stream, STAMPS, matrices(POSES) @ matrices(POSES))
    report, stream = imported(path, tmp_path / "direct", frame="tool", parent="arm")
    assert_same(stream)
    assert "poses of tool in arm" in report.told


def test_poses_before_the_first_of_a_carrier_are_left_out_and_told(tmp_path: Path) -> None:
    edges = [carried("base", "arm", range(30, COUNT, 2)), carried("arm", "tool")]
    path = write2(tmp_path / "bag", in_order(*edges))
    report, stream = imported(path, tmp_path, frame="tool")
    np.testing.assert_array_equal(stream.stamp_ns, STAMPS[30:])
    assert "30 poses before the first of all of these are left out" in report.told


def test_frames_with_two_parents_or_in_a_circle_are_not_composed(tmp_path: Path) -> None:
    two = [carried("arm", "tool"), carried("base", "arm"), carried("room", "arm")]
    path = write2(tmp_path / "two", in_order(*two))
    with pytest.raises(tc.UnknownNameError, match=r"--parent.*poses of arm.*base, room"):
        teleop_exchange.import_recording(path, tmp_path / "out", frame="tool")
    _, stream = imported(path, tmp_path, frame="tool", parent="room")
    assert_composed(stream, STAMPS, matrices(POSES) @ matrices(POSES))
    path = write2(tmp_path / "circle", in_order(carried("arm", "tool"), carried("tool", "arm")))
    with pytest.raises(tc.ParameterError, match="its own ancestor"):
        teleop_exchange.import_recording(path, tmp_path / "other", frame="tool")


def test_options_of_columns_do_not_fit_a_bag(tmp_path: Path) -> None:
    path = write2(tmp_path / "bag", poses())
    with pytest.raises(tc.ParameterError, match="topics, not columns"):
        teleop_exchange.import_recording(path, tmp_path / "out", position=("x", "y", "z"))


# Stamps.


@pytest.mark.parametrize("stamp", [0, START_NS])
def test_header_stamps_that_never_change_give_way_to_the_log(stamp: int, tmp_path: Path) -> None:
    path = write2(tmp_path / "bag", poses(stamps=np.full(COUNT, stamp)))
    report, stream = imported(path, tmp_path)
    assert_same(stream, LOGS)
    assert any("time of recording" in text for text in report.told)


def test_single_messages_without_a_stamp_are_left_out(tmp_path: Path) -> None:
    stamps = STAMPS.copy()
    stamps[[0, 1, 77]] = 0
    report, stream = imported(write2(tmp_path / "bag", poses(stamps=stamps)), tmp_path)
    kept = np.delete(np.arange(COUNT), [0, 1, 77])
    assert_same(stream, STAMPS[kept], POSES[kept])
    assert report.counts.missing == 3


def test_log_times_are_taken_on_request(tmp_path: Path) -> None:
    assert_same(imported(write2(tmp_path / "bag", poses()), tmp_path, stamps="log")[1], LOGS)


# Buttons.


@pytest.mark.parametrize(
    ("count", "text", "expected"),
    [
        (1, "", (0, -1, -1)),
        (2, "", (0, 1, -1)),
        (3, "", (0, 1, 2)),
        (11, "clutch=4, mode=9", (4, -1, 9)),
        (11, "none", None),
    ],
)
@pytest.mark.parametrize("is_ros2", [True, False])
def test_any_joy_has_its_buttons_mapped(
    count: int, text: str, expected: tuple[int, int, int] | None, is_ros2: bool, tmp_path: Path
) -> None:
    def buttons(i: int) -> list[int]:
        return [(i // (7 * (n + 1))) % 2 for n in range(count)]

    messages = in_order(poses(is_ros2=is_ros2), presses(buttons, is_ros2=is_ros2))
    path = write2(tmp_path / "bag", messages) if is_ros2 else write1(tmp_path / "a.bag", messages)
    report, _ = imported(path, tmp_path, buttons=text)
    if expected is None:
        assert report.recording.topics == ("master/measured_cp",)
        return
    found = report.recording["master/buttons"]
    held = found.values[np.searchsorted(found.stamp_ns, STAMPS, side="right") - 1]
    rows = np.array([buttons(i) for i in range(COUNT)])
    for column, number in enumerate(expected):
        assert np.array_equal(held[:, column], rows[:, number] if number >= 0 else np.zeros(COUNT))


def test_a_button_that_the_joy_lacks_is_told(tmp_path: Path) -> None:
    path = write2(tmp_path / "bag", in_order(poses(), presses(lambda i: [0, 1])))
    with pytest.raises(tc.ParameterError, match="below 2"):
        teleop_exchange.import_recording(path, tmp_path / "out", buttons="clutch=2")


def test_buttons_follow_the_poses_to_the_log_times(tmp_path: Path) -> None:
    zero = np.zeros(COUNT, np.int64)
    both = in_order(poses(stamps=zero), presses(lambda i: [int(i >= 100)], stamps=zero))
    report, _ = imported(write2(tmp_path / "bag", both), tmp_path)
    buttons = report.recording["master/buttons"]
    assert buttons.stamp_ns.tolist() == [LOGS[0], LOGS[100]]
    assert buttons["clutch"].tolist() == [0.0, 1.0]


# Damage.


def test_nan_and_strange_quaternions_are_left_out_and_counted(tmp_path: Path) -> None:
    messages = poses()
    for i in (10, 11, 12):
        messages[i][2].pose.position.y = float("nan")
    messages[20][2].pose.orientation.w += 3.0
    report, stream = imported(write2(tmp_path / "bag", messages), tmp_path)
    kept = np.delete(np.arange(COUNT), [10, 11, 12, 20])
    assert report.counts.missing == 4
    assert_same(stream, STAMPS[kept], POSES[kept])
    assert any("orientation" in text for text in report.warnings)


def test_an_entry_that_a_recording_lacks_is_named(tmp_path: Path) -> None:
    (file,) = write2(tmp_path / "bag", poses(), StoragePlugin.SQLITE3).glob("*.db3")
    with sqlite3.connect(file) as storage:
        storage.execute("UPDATE topics SET offered_qos_profiles = '- history: 1'")
    with pytest.raises(tc.RecordingError, match="it lacks 'depth'"):
        teleop_exchange.import_recording(file, tmp_path / "out")


def test_a_bag_that_was_cut_off_is_told(tmp_path: Path) -> None:
    path = write1(tmp_path / "user.bag", poses(is_ros2=False))
    data = path.read_bytes()
    path.write_bytes(data[: len(data) // 2])
    with pytest.raises(tc.RecordingError):
        teleop_exchange.import_recording(path, tmp_path / "out")
    folder = write2(tmp_path / "bag", poses())
    (file,) = folder.glob("*.mcap")
    file.write_bytes(file.read_bytes()[:-50])
    with pytest.raises(tc.RecordingError, match="teleop recover"):
        teleop_exchange.import_recording(folder, tmp_path / "out")


@pytest.mark.parametrize("is_ros2", [True, False])
def test_both_masters_of_the_da_vinci_kit_and_its_pedal_are_two_arms(tmp_path: Path, is_ros2: bool) -> None:
    maker = Maker(is_ros2)
    messages: Any = []
    for i, (stamp, log) in enumerate(zip(STAMPS, LOGS, strict=True)):
        for arm in ("MTML", "MTMR", "PSM1"):
            messages.append((f"/{arm}/measured_cp", log, maker.pose(POSES[i], "PoseStamped", stamp)))
        if i % 50 == 0:
            pedal = maker.joy(stamp, [int(i >= 100)])
            messages += [("/console/clutch", log, pedal), ("/footpedals/camera", log, pedal)]
    write, name = (write2, "kit") if is_ros2 else (write1, "kit.bag")
    report = teleop_exchange.import_recording(
        write(tmp_path / name, messages),
        tmp_path / "bag",
        buttons_topic="console/clutch",
        arms={"left": {"topic": "MTML/measured_cp"}, "right": {"topic": "MTMR/measured_cp"}},
    )
    assert [one.arm for one in (report, *report.others)] == ["left", "right"]
    for prefix in ("", "right/"):
        values = report.recording[f"{prefix}master/measured_cp"].values
        np.testing.assert_allclose(values, POSES, atol=1e-12)
        assert report.recording[f"{prefix}master/buttons"]["clutch"].tolist() == [0.0, 1.0]
