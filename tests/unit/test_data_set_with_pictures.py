"""Data sets with pictures hold what the cameras took, under the age that each picture had; read back by PyAV."""

import io
import json
import os
from collections.abc import Callable, Sequence
from fractions import Fraction
from pathlib import Path
from typing import Any

import av
import numpy as np
import pyarrow.parquet as pq
import pytest
from PIL import Image
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

import teleop_core as tc
import teleop_exchange
from teleop_core.commands.cli import main
from teleop_core.kernels.geometry import Array
from teleop_exchange.videos import Video

TYPES, TYPES1 = get_typestore(Stores.ROS2_JAZZY), get_typestore(Stores.ROS1_NOETIC)
SIZE = 96, 128  # height, width
MS = 1_000_000
LEVEL = 8  # largest error [1/255] of a flat colour after JPEG and video


def colour(number: int) -> tuple[int, int, int]:
    """Colour of a picture: tells its number, at steps that a video keeps apart."""
    return 40 + 20 * (number % 10), 40 + 20 * (number // 10 % 10), 120


def number_in(pixels: Array) -> int:
    """Number of the picture that a frame shows, from its colour."""
    red, green, _ = pixels[8:-8, 8:-8].mean(axis=(0, 1))
    return round((red - 40) / 20) + 10 * round((green - 40) / 20)


def flat(number: int) -> Any:
    return np.full((*SIZE, 3), colour(number), np.uint8)


def packed(pixels: Any, kind: str) -> Any:
    file = io.BytesIO()
    Image.fromarray(pixels).save(file, kind, **({"quality": 95} if kind == "JPEG" else {}))
    return np.frombuffer(file.getvalue(), np.uint8)


def header(types: Any, stamp_ns: int) -> Any:
    stamp = types.types["builtin_interfaces/msg/Time"](*divmod(stamp_ns, 1_000_000_000))
    kind = types.types["std_msgs/msg/Header"]
    return kind(0, stamp, "camera") if types is TYPES1 else kind(stamp, "camera")


def compressed(stamp_ns: int, data: Any, types: Any = TYPES, form: str = "jpeg") -> Any:
    return types.types["sensor_msgs/msg/CompressedImage"](header(types, stamp_ns), form, data)


def raw(stamp_ns: int, pixels: Any, encoding: str, types: Any = TYPES, pad: int = 0) -> Any:
    rows = np.ascontiguousarray(pixels).view(np.uint8).reshape(len(pixels), -1)
    rows = np.pad(rows, ((0, 0), (0, pad)), constant_values=255)
    kind, (height, width) = types.types["sensor_msgs/msg/Image"], pixels.shape[:2]
    return kind(header(types, stamp_ns), height, width, encoding, 0, rows.shape[1], rows.ravel())


def joints(stamp_ns: int, value: float, types: Any = TYPES) -> Any:
    kind, none = types.types["sensor_msgs/msg/JointState"], np.empty(0)
    return kind(header(types, stamp_ns), ["a", "b"], np.array([value, -value], float), none, none)


Message = tuple[int, str, Any]
"""Time of recording [ns], topic and message."""


def write(path: Path, messages: Sequence[Message], storage: str = "mcap") -> Path:
    """A recording as the rosbags library writes it."""
    if storage == "bag":
        with Writer1(path.with_suffix(".bag")) as old:
            used: dict[str, Any] = {}
            for log_ns, topic, message in sorted(messages, key=lambda m: m[0]):
                kind = message.__msgtype__
                if topic not in used:
                    used[topic] = old.add_connection(topic, kind, typestore=TYPES1)
                old.write(used[topic], log_ns, TYPES1.serialize_ros1(message, kind))
        return path.with_suffix(".bag")
    plugin = StoragePlugin.MCAP if storage == "mcap" else StoragePlugin.SQLITE3
    with Writer(path, version=9, storage_plugin=plugin) as writer:
        known: dict[str, Any] = {}
        for log_ns, topic, message in sorted(messages, key=lambda m: m[0]):
            kind = message.__msgtype__
            if topic not in known:
                known[topic] = writer.add_connection(topic, kind, typestore=TYPES)
            writer.write(known[topic], log_ns, TYPES.serialize_cdr(message, kind))
    return path


def arm(count: int = 100, types: Any = TYPES, begin_ns: int = 10**9) -> list[Message]:
    """States and commands at 100 Hz for one second."""
    out: list[Message] = []
    for k in range(count):
        at = begin_ns + 10 * MS * k
        out += [(at, "/arm/joint_states", joints(at, k / 100, types)), (at, "/arm/joint_command", joints(at, k, types))]
    return out


def frames_of(out: Path, key: str) -> list[Any]:
    """Decoded pictures (h, w, 3) of a feature."""
    with av.open(str(out / f"videos/{key}/chunk-000/file-000.mp4")) as file:
        return [frame.to_ndarray(format="rgb24") for frame in file.decode(video=0)]


def table_of(out: Path) -> Any:
    return pq.read_table(out / "data/chunk-000/file-000.parquet")


def info_of(out: Path) -> Any:
    return json.loads((out / "meta/info.json").read_text(encoding="utf-8"))


def exported(bag: Path | tc.Recording | list[Path], out: Path, **options: Any) -> teleop_exchange.ExportReport:
    return teleop_exchange.export_recording(bag, out, "lerobot", **options)


FRONT, AGE = "observation.images.front", "observation.age.front"


def filmed(stamps: Sequence[int], logs: Sequence[int]) -> list[Message]:
    """Picture k of a camera with stamp ``stamps[k]``, recorded at ``logs[k]``."""
    topic = "/camera/front/image_raw/compressed"
    return [
        (log, topic, compressed(at, packed(flat(k), "JPEG")))
        for k, (at, log) in enumerate(zip(stamps, logs, strict=True))
    ]


@pytest.mark.parametrize("codec", ["av1", "h264"])
def test_each_frame_shows_the_newest_picture_taken_before_it_and_tells_its_age(codec: str, tmp_path: Path) -> None:
    """Pictures late, lost and out of order: the choice goes by the time of capture alone."""
    rng = np.random.default_rng(1)
    stamps = 10**9 + 33 * MS * np.arange(30) + rng.integers(0, 5 * MS, 30)
    logs = stamps + rng.integers(5, 90, 30) * MS
    kept = rng.random(30) > 0.2
    kept[0] = True
    messages = [m for m, is_kept in zip(filmed(stamps.tolist(), logs.tolist()), kept, strict=True) if is_kept]
    bag = write(tmp_path / "bag", arm() + messages)
    out = tmp_path / "set"
    report = exported(bag, out, rate=20.0, video=codec)
    table = table_of(out)
    times = 10**9 + np.rint(np.arange(20) * 5e7).astype(np.int64)
    usable = np.flatnonzero(kept)
    expected = np.array([usable[stamps[usable] <= at][-1] for at in times[times >= stamps[0]]])
    shown = [number_in(pixels) for pixels in frames_of(out, FRONT)]
    assert shown == expected.tolist()
    first = len(times) - len(expected)
    age = (times[first:] - stamps[expected]) * 1e-9
    assert np.allclose(np.array(table[AGE]), age, rtol=0, atol=1e-6)
    assert np.allclose(np.array(table["observation.state"].to_pylist())[:, 0], 0.05 * np.arange(first, 20), atol=1e-6)
    repeated = len(expected) - len(set(expected.tolist()))
    assert f"{repeated} frames without a new picture" in report.notes[0]
    assert info_of(out)["features"][FRONT]["info"]["video.codec"] == codec


@pytest.mark.parametrize("codec", ["av1", "h264"])
def test_an_export_never_comes_before_a_loop_of_the_machine(codec: str, tmp_path: Path) -> None:
    """The AV1 encoder takes SCHED_FIFO 99 for its process where it may."""
    video = Video(tmp_path, FRONT, 30, codec)
    video.begin()
    video.add(av.VideoFrame.from_ndarray(flat(0)), 0, 1)
    policies = {os.sched_getscheduler(int(thread)) for thread in os.listdir("/proc/self/task")}
    video.close()
    assert os.sched_getscheduler(0) == os.SCHED_OTHER
    assert policies.isdisjoint({os.SCHED_FIFO, os.SCHED_RR})


def uyvy(pixels: Any) -> Any:
    """ITU-R BT.601 with 16 to 235, two pixels in four bytes."""
    red, green, blue = (pixels[:, :, i].astype(float) for i in range(3))
    y = 16 + (65.738 * red + 129.057 * green + 25.064 * blue) / 256
    u = 128 + (-37.945 * red - 74.494 * green + 112.439 * blue) / 256
    v = 128 + (112.439 * red - 94.154 * green - 18.285 * blue) / 256
    out = np.empty((*y.shape, 2))
    out[:, :, 1], out[:, ::2, 0], out[:, 1::2, 0] = y, u[:, ::2], v[:, 1::2]
    return np.rint(out).astype(np.uint8)


def bayer(pixels: Any) -> Any:
    out = pixels[:, :, 1].copy()
    out[::2, ::2], out[1::2, 1::2] = pixels[::2, ::2, 0], pixels[1::2, 1::2, 2]
    return out


ENCODED: dict[str, Callable[[Any], Any]] = {
    "rgb8": lambda a: a,
    "bgr8": lambda a: a[:, :, ::-1],
    "rgba8": lambda a: np.dstack([a, a[:, :, :1]]),
    "bgra8": lambda a: np.dstack([a[:, :, ::-1], a[:, :, :1]]),
    "yuv422": uyvy,
    "bayer_rggb8": bayer,
    "JPEG": lambda a: packed(a, "JPEG"),
    "PNG": lambda a: packed(a, "PNG"),
}


@pytest.mark.parametrize("encoding", ENCODED)
def test_colours_survive_every_encoding_and_padded_rows(encoding: str, tmp_path: Path) -> None:
    made, messages = ENCODED[encoding], arm()
    for k in range(10):
        at = 10**9 + 100 * MS * k
        data = made(flat(10 * k + k))
        image = compressed(at, data) if data.ndim == 1 else raw(at, data, encoding, pad=32)
        messages.append((at, "/cam/image", image))
    out = tmp_path / "set"
    exported(write(tmp_path / "bag", messages), out)
    found = frames_of(out, "observation.images.cam")
    assert len(found) == 10
    for k, pixels in enumerate(found):
        assert np.abs(pixels[8:-8, 8:-8].mean(axis=(0, 1)) - colour(11 * k)).max() < LEVEL
    (stats,) = pq.read_table(out / "meta/episodes/chunk-000/file-000.parquet").to_pylist()
    mean = np.mean([colour(11 * k) for k in range(10)], axis=0) / 255
    for found_mean in (
        stats["stats/observation.images.cam/mean"],
        json.loads((out / "meta/stats.json").read_text())["observation.images.cam"]["mean"],
    ):
        assert np.shape(found_mean) == (3, 1, 1)
        assert np.allclose(np.ravel(found_mean), mean, atol=LEVEL / 255)


@pytest.mark.parametrize("storage", ["mcap", "db3", "bag"])
def test_recordings_of_other_writers_in_any_storage_give_the_same_data_set(storage: str, tmp_path: Path) -> None:
    types, messages = (TYPES1 if storage == "bag" else TYPES), []
    for k in range(10):
        at = 10**9 + 100 * MS * k
        messages.append((at, "/wrist/image_raw", raw(at, flat(k), "rgb8", types)))
    bag = write(tmp_path / "bag", arm(types=types) + messages, storage)
    out = tmp_path / "set"
    assert main(["export", str(bag), "--to", "lerobot", str(out), "--video", "h264"]) == 0
    assert [number_in(pixels) for pixels in frames_of(out, "observation.images.wrist")] == list(range(10))
    features, table = info_of(out)["features"], table_of(out)
    assert features["observation.state"]["names"] == features["action"]["names"] == ["a", "b"]
    assert np.array_equal(np.array(table["action"].to_pylist())[:, 0], np.arange(0.0, 100.0, 10.0))
    assert info_of(out)["fps"] == 10


def test_episodes_share_a_video_and_each_knows_its_part(tmp_path: Path) -> None:
    bags = []
    for episode, count in enumerate((12, 20)):
        stamps = [10**9 + 50 * MS * k for k in range(count)]
        messages = [(at, topic, m) for at, topic, m in filmed(stamps, stamps)]
        bags.append(write(tmp_path / f"bag{episode}", arm(5 * count) + messages))
    out = tmp_path / "set"
    report = exported(bags, out, task="look")
    rows = pq.read_table(out / "meta/episodes/chunk-000/file-000.parquet").to_pylist()
    found, fps = frames_of(out, FRONT), info_of(out)["fps"]
    assert (fps, report.rows, len(found)) == (20, 32, 32)
    with av.open(str(out / f"videos/{FRONT}/chunk-000/file-000.mp4")) as file:
        frames = list(file.decode(video=0))
    assert [(frame.pts or 0) * (frame.time_base or 0) for frame in frames] == [Fraction(k, 20) for k in range(32)]
    assert np.flatnonzero([frame.key_frame for frame in frames]).tolist() == list(range(0, 32, 5))
    for row, count in zip(rows, (12, 20), strict=True):
        begin = round(row[f"videos/{FRONT}/from_timestamp"] * fps)
        assert round(row[f"videos/{FRONT}/to_timestamp"] * fps) == begin + count == begin + row["length"]
        assert [number_in(pixels) for pixels in found[begin : begin + count]] == list(range(count))
        assert (row[f"videos/{FRONT}/chunk_index"], row[f"videos/{FRONT}/file_index"]) == (0, 0)


def test_broken_pictures_are_counted_and_never_shown_under_a_wrong_age(tmp_path: Path) -> None:
    stamps = [10**9 + 100 * MS * k for k in range(10)]
    messages = filmed(stamps, stamps)
    for k, data in ((3, packed(flat(3), "JPEG")[:200]), (5, np.zeros(50, np.uint8))):
        messages[k] = (stamps[k], messages[k][1], compressed(stamps[k], data))
    hollow = packed(flat(7), "JPEG").copy()
    hollow[4:-2] = 0  # begins and ends as a JPEG does
    messages[7] = (stamps[7], messages[7][1], compressed(stamps[7], hollow))
    out = tmp_path / "set"
    report = exported(write(tmp_path / "bag", arm() + messages), out)
    shown = [number_in(pixels) for pixels in frames_of(out, FRONT)]
    assert shown == [0, 1, 2, 2, 4, 4, 6, 6, 8, 9]
    assert np.allclose(np.array(table_of(out)[AGE]), 0.1 * (np.arange(10) - shown), atol=1e-6)
    assert "3 frames without a new picture" in report.notes[0]
    assert "1 messages left out: cut off" in report.notes[0]
    assert "neither JPEG, PNG nor WebP" in report.notes[0]


def test_frames_before_the_first_picture_are_left_out_and_a_dead_camera_only_ages(tmp_path: Path) -> None:
    stamps = [10**9 + 300 * MS + 100 * MS * k for k in range(4)]
    out = tmp_path / "set"
    exported(write(tmp_path / "bag", arm() + filmed(stamps, stamps)), out)
    age = np.array(table_of(out)[AGE])
    assert len(age) == 7
    assert np.allclose(age, [0.0, 0.0, 0.0, 0.0, 0.1, 0.2, 0.3], atol=1e-6)


def test_stamps_of_another_clock_give_way_to_the_times_of_recording(tmp_path: Path) -> None:
    logs = [10**9 + 100 * MS * k for k in range(10)]
    out = tmp_path / "set"
    report = exported(write(tmp_path / "bag", arm() + filmed([s + 10**18 for s in logs], logs)), out)
    assert [number_in(pixels) for pixels in frames_of(out, FRONT)] == list(range(10))
    assert "another clock" in report.notes[0]


def test_depth_is_no_video_and_one_camera_raw_and_compressed_is_one_camera(tmp_path: Path) -> None:
    messages = arm()
    for k in range(5):
        at = 10**9 + 200 * MS * k
        messages += [
            (at, "/camera/front/image_raw", raw(at, flat(k), "rgb8")),
            (at, "/camera/front/image_raw/compressed", compressed(at, packed(flat(k), "JPEG"))),
            (at, "/camera/depth/image", raw(at, np.full(SIZE, 700, np.uint16), "16UC1")),
        ]
    bag, out = write(tmp_path / "bag", messages), tmp_path / "set"
    exported(bag, out)
    assert [key for key, one in info_of(out)["features"].items() if one["dtype"] == "video"] == [FRONT]
    exported(bag, tmp_path / "bare", cameras=())
    bare = info_of(tmp_path / "bare")
    assert bare["video_path"] is None
    assert not any("images" in key or "age" in key for key in bare["features"])
    assert not (tmp_path / "bare/videos").exists()
    with pytest.raises(tc.UnknownNameError, match="camera/front/image_raw"):
        exported(bag, tmp_path / "wrong", cameras=["nowhere"])
    assert not (tmp_path / "wrong").exists()


def test_own_recordings_with_pictures_of_another_node_keep_their_state(tmp_path: Path) -> None:
    """A bag that has the slave's topics needs no option: state and action are those of the slave."""
    made = tc.run("coarse_box", duration=1.0)
    messages = [
        (log, f"/{name}", TYPES.deserialize_cdr(data, kind))
        for name in ("slave/measured_js", "slave/measured_cp", "slave/servo_jp")
        for _, kind, log, data in made.bag.raw([name])
    ]
    begin = min(log for log, _, _ in messages)
    at = [begin + 100 * MS * k for k in range(10)]
    out = tmp_path / "set"
    exported(write(tmp_path / "bag", messages + filmed(at, at)), out, state=(), rate=10.0)
    exported(made, tmp_path / "bare", rate=10.0)
    ours, bare = table_of(out), table_of(tmp_path / "bare")
    assert ours["action"].to_pylist()[-3:] == bare["action"].to_pylist()[: len(ours)][-3:]


def test_topics_of_any_numbers_can_be_state_and_action(tmp_path: Path) -> None:
    kind, vector = TYPES.types["geometry_msgs/msg/Twist"], TYPES.types["geometry_msgs/msg/Vector3"]
    messages = arm()
    for k in range(50):
        at = 10**9 + 20 * MS * k
        messages.append((at, "/base/cmd_vel", kind(vector(k, 0.0, 0.0), vector(0.0, 0.0, -k))))
    out = tmp_path / "set"
    bag = write(tmp_path / "bag", messages)
    words = ["--state", "arm/joint_states", "arm/joint_command", "--action", "base/cmd_vel", "--rate", "50"]
    assert main(["export", str(bag), "--to", "lerobot", str(out), *words]) == 0
    features, table = info_of(out)["features"], table_of(out)
    assert features["observation.state"]["names"] == [
        "arm.joint_states.a", "arm.joint_states.b", "arm.joint_command.a", "arm.joint_command.b",
    ]  # fmt: skip
    assert features["action"]["names"] == [f"{v}.{c}" for v in ("linear", "angular") for c in "xyz"]
    action = np.array(table["action"].to_pylist())
    assert np.array_equal(action[:, 0], np.arange(50.0))
    assert np.array_equal(action[:, 5], -np.arange(50.0))
    with pytest.raises(tc.UnknownNameError, match="--state"):
        exported(bag, tmp_path / "other", state=["nowhere"])


def test_grade_grades_a_data_set_with_videos_as_one_without(tmp_path: Path) -> None:
    import teleop_lab

    bags = []
    for seed in range(3):
        made = tc.run("coarse_box", duration=2.0, seed=seed).save(tmp_path / f"own{seed}")
        messages = [
            (log, f"/{name}", TYPES.deserialize_cdr(data, kind))
            for name in ("slave/measured_js", "slave/measured_cp", "slave/servo_jp")
            for _, kind, log, data in made.bag.raw([name])
        ]
        begin = made.bag.start_ns
        at = [begin + 100 * MS * k for k in range(15)]
        bags.append(write(tmp_path / f"bag{seed}", messages + filmed(at, at)))
    exported(bags, tmp_path / "seen", rate=50.0)
    exported(bags, tmp_path / "blind", rate=50.0, cameras=())
    columns = ("observation.state.6", "observation.state.7", "observation.state.8")
    options = teleop_exchange.ImportOptions(position=columns, unit="m")
    found = [teleop_lab.grade(tmp_path / name, options=options) for name in ("seen", "blind")]
    assert list(found[0].index) == list(found[1].index)
    assert found[0]["path_mm"].to_numpy() == pytest.approx(found[1]["path_mm"].to_numpy(), rel=0.05)
