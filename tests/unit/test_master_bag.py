"""Recordings of others can be replayed and followed as they are."""

import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.writer import Writer
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

import teleop_core as tc
from teleop_core.bags import layouts, memory, series
from teleop_core.bags.reader import Bag
from teleop_core.bags.writer import BagWriter
from teleop_core.graph.topics import MASTER_BUTTONS, MASTER_MEASURED_CP, Kind, Topic
from teleop_core.kernels.geometry import Array
from teleop_core.session.master_bag import as_master_bag

START_NS = 1_700_000_000_000_000_000
COUNT = 200
STAMPS = START_NS + np.arange(COUNT) * 10_000_000
LOGS = STAMPS + 5_000_000
T = np.arange(COUNT) * 0.01
TURNS = Rotation.from_rotvec(0.3 * np.column_stack((np.sin(T), T, np.cos(T))))
POSES = np.column_stack((0.02 * np.sin(T), 0.01 * T, 0.0 * T, TURNS.as_quat(scalar_first=True)))
PRESSED = np.zeros((2, 3))


def bag(
    path: Path,
    poses: Array = POSES,
    stamps: NDArray[np.int64] = STAMPS,
    topic: Topic = MASTER_MEASURED_CP,
    pressed: Array | None = None,
) -> Path:
    """Recording of poses and, if wanted, of two presses."""
    topics = [topic] + ([MASTER_BUTTONS] if pressed is not None else [])
    with BagWriter(path, topics, ()) as writer:
        block = {topic: (np.asarray(stamps), poses, LOGS)}
        if pressed is not None:
            block[MASTER_BUTTONS] = STAMPS[:2], pressed, LOGS[:2]
        writer.write_block(block)
    return path


def converted(path: Path) -> tuple[memory.MemoryBag, str]:
    """Bag in memory, and the note about it."""
    with pytest.warns(UserWarning, match=Path(path).name) as notes:
        found = as_master_bag(path)
    assert isinstance(found, memory.MemoryBag)
    return found, " ".join(str(note.message) for note in notes)


def poses_of(found: Any) -> series.Series:
    return found.read(MASTER_MEASURED_CP)


def test_a_sound_recording_is_taken_as_it_is(tmp_path: Path) -> None:
    path = bag(tmp_path / "bag", pressed=PRESSED)
    opened = Bag(path)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert as_master_bag(opened) is opened
        assert type(as_master_bag(path)) is Bag


def test_a_recording_in_memory_is_taken_as_it_is(tmp_path: Path) -> None:
    found, _ = converted(bag(tmp_path / "bag", stamps=np.zeros(COUNT, np.int64)))
    assert as_master_bag(found) is found


@pytest.mark.parametrize("stamp", [0, START_NS])
def test_stamps_that_never_change_become_log_times(stamp: int, tmp_path: Path) -> None:
    found, note = converted(bag(tmp_path / "bag", stamps=np.full(COUNT, stamp)))
    assert np.array_equal(poses_of(found).stamp_ns, LOGS)
    assert "time of recording" in note


def test_nan_is_left_out_with_a_note(tmp_path: Path) -> None:
    poses = POSES.copy()
    poses[[3, 50], 1] = np.nan
    found, note = converted(bag(tmp_path / "bag", poses))
    assert np.array_equal(poses_of(found).stamp_ns, np.delete(STAMPS, [3, 50]))
    assert np.isfinite(poses_of(found).values).all()
    assert "2 with missing numbers left out" in note


def test_quaternions_that_are_nearly_unit_are_made_so(tmp_path: Path) -> None:
    poses = POSES.copy()
    poses[:, 3:] *= 1.02
    found, note = converted(bag(tmp_path / "bag", poses))
    assert "0.02 off unit length" in note
    assert np.allclose(poses_of(found).values, POSES, rtol=0, atol=1e-15)


def test_a_topic_of_another_name_is_the_master(tmp_path: Path) -> None:
    other = Topic("stylus/pose", Kind.POSE)
    found, note = converted(bag(tmp_path / "bag", topic=other))
    assert np.allclose(poses_of(found).values, POSES, rtol=0, atol=1e-15)
    assert "stylus/pose" in note


def test_every_arm_keeps_its_topic_and_stamps(tmp_path: Path) -> None:
    left = MASTER_MEASURED_CP.of_arm("left")
    rotten = POSES.copy()
    rotten[7, 0] = np.nan
    with BagWriter(tmp_path / "bag", [MASTER_MEASURED_CP, left], ()) as writer:
        late = STAMPS + 2_000_000
        writer.write_block({MASTER_MEASURED_CP: (STAMPS, rotten, LOGS), left: (late, POSES, LOGS)})
    with pytest.warns(UserWarning, match="missing numbers"):
        found = as_master_bag(tmp_path / "bag")
    assert np.array_equal(found.read(left).stamp_ns, STAMPS + 2_000_000)
    assert len(poses_of(found)) == COUNT - 1


def test_what_cannot_be_read_is_told(tmp_path: Path) -> None:
    with pytest.raises(tc.RecordingError, match="does not exist"):
        as_master_bag(tmp_path / "nothing")
    both = [Topic(f"{name}/pose", Kind.POSE) for name in "ab"]
    with BagWriter(tmp_path / "two", both, ()) as writer:
        writer.write_block(dict.fromkeys(both, (STAMPS, POSES, LOGS)))
    with pytest.raises(tc.UnknownNameError, match=r"a/pose, b/pose.*option of `teleop import"):
        as_master_bag(tmp_path / "two")


def test_replay_takes_a_bag_without_buttons_of_another_name_and_rate(tmp_path: Path) -> None:
    path = bag(tmp_path / "bag", topic=Topic("stylus/pose", Kind.POSE))
    with pytest.warns(UserWarning, match="stylus/pose"):
        again = tc.replay(path)
    stream = again["master/measured_cp"]
    answered = np.unique(stream.stamp_ns[stream.stamp_ns >= STAMPS[0]], return_index=True)
    assert np.isin(STAMPS, answered[0]).all()
    assert len(again["slave/measured_cp"]) >= 2000
    moved = np.ptp(again["slave/measured_cp"][["x", "y", "z"]], axis=0).max()
    assert moved > 5e-3


def test_a_recording_whose_frame_changes_is_told(tmp_path: Path) -> None:
    place, path = MASTER_MEASURED_CP, tmp_path / "bag.mcap"
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start()
        schema = writer.register_schema(place.kind.ros_type, "ros2msg", b"")
        channel = writer.register_channel(place.name, "cdr", schema)
        for i, stamp in enumerate(STAMPS.tolist()):
            message = layouts.layout(place, (), "camera" if i >= 50 else "base").encode_one(stamp, POSES[i])
            writer.add_message(channel, stamp, message, stamp)
        writer.finish()
    with pytest.warns(UserWarning, match=r"150 messages are in the frame 'camera'.*'base'"):
        assert len(Bag(path).read(place)) == COUNT
