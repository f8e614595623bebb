"""Recordings carry robots and frames that tools of others read and place where the tip is."""

from collections import defaultdict
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio
import pytest
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from rosbags.highlevel import AnyReader
from rosbags.typesys import Stores, get_typestore

import teleop_core as tc
from teleop_core.bags.markers import Marker, MarkerShape, marker_message
from teleop_core.bags.transforms import TransformMessages
from teleop_core.base import ShapeError, UnknownNameError, values_of
from teleop_core.graph import TICK_NS
from teleop_core.kernels.axes import axis_map
from teleop_core.session.markers import FORCE_SCALE, TAIL, ArmMarkers
from teleop_core.shapes import SHAPES

TYPES = get_typestore(Stores.ROS2_JAZZY)
ROUNDING = 1e-12
SOLID = ("box", "sphere")
DRAWN = sorted(set(SHAPES) - {"mesh", "height_field", "hole", *SOLID})


def messages(path: Path, topic: str) -> list[Any]:
    """Messages of a topic, as rosbags reads them."""
    with AnyReader([path], default_typestore=TYPES) as reader:
        wanted = [c for c in reader.connections if c.topic == topic]
        return [reader.deserialize(data, c.msgtype) for c, _, data in reader.messages(wanted)]


def frames(path: Path) -> dict[str, dict[int, np.ndarray]]:
    """Pose (7,) of every frame in its parent by stamp [ns]."""
    found: dict[str, dict[int, np.ndarray]] = defaultdict(dict)
    for message in messages(path, "/tf"):
        for one in message.transforms:
            stamp, t, r = one.header.stamp, one.transform.translation, one.transform.rotation
            row = np.array([t.x, t.y, t.z, r.w, r.x, r.y, r.z])
            key = f"{one.header.frame_id}>{one.child_frame_id}"
            found[key][stamp.sec * 10**9 + stamp.nanosec] = row
    return found


@pytest.fixture(scope="module")
def bag(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("models") / "bag"
    tc.run("coarse_box", duration=1.0, out=path, settings={"plant": "ideal"})
    return path


@pytest.mark.parametrize("robot", ["rcrt1", "rps3"])
def test_the_recorded_tip_frame_is_the_measured_tip(tmp_path: Path, robot: str) -> None:
    recording = tc.run("coarse_box", duration=0.3, robot=robot, out=tmp_path / "bag", settings={"plant": "ideal"})
    tips, tip = frames(tmp_path / "bag")["slave_base>slave_tip"], recording["slave/measured_cp"]
    measured = dict(zip(tip.stamp_ns.tolist(), tip.values, strict=True))
    assert len(tips) > 10
    tips.pop(max(measured) + TICK_NS, None)  # a pose is told a tick after its joints
    for stamp_ns, pose in tips.items():
        sign = np.sign(pose[3:] @ measured[stamp_ns][3:])
        assert pose[:3] == pytest.approx(measured[stamp_ns][:3], abs=1e-9)
        assert sign * pose[3:] == pytest.approx(measured[stamp_ns][3:], abs=1e-9)


def test_the_stylus_frame_is_the_measured_stylus(bag: Path) -> None:
    stylus = frames(bag)["master_base>master_stylus"]
    hand = tc.open_recording(bag)["master/measured_cp"]
    measured = dict(zip(hand.stamp_ns.tolist(), hand.values, strict=True))
    for stamp_ns, pose in stylus.items():
        assert pose == pytest.approx(measured[stamp_ns], abs=ROUNDING)


def test_stylus_and_tip_move_alike_in_the_world(bag: Path) -> None:
    """The drawn master is turned so that a push of the hand and of the tip have one direction."""
    base = frames(bag)["world>master_base"].popitem()[1]
    recording = tc.open_recording(bag)
    state = recording["teleop/state"]
    follows = state.stamp_ns[state["is_following"] == 1.0][0]
    hand, goal = recording["master/measured_cp"], recording["slave/servo_cp"]
    begin = int(np.searchsorted(hand.stamp_ns, follows)) + 10
    pushes = np.diff(hand.values[[begin, -1], :3], axis=0)[0]
    first = int(np.searchsorted(goal.stamp_ns, hand.stamp_ns[begin]))
    moved = np.diff(goal.values[[first, -1], :3], axis=0)[0]
    turned = pinocchio.Quaternion(*base[3:]).toRotationMatrix() @ pushes
    cosine = turned @ moved / np.linalg.norm(turned) / np.linalg.norm(moved)
    assert cosine > 0.99


def test_an_engine_loads_the_recorded_description_and_finds_every_frame(bag: Path) -> None:
    (description,) = messages(bag, "/robot_description")
    model = pinocchio.buildModelFromXML(description.data)
    links = {f.name for f in model.frames if f.type == pinocchio.FrameType.BODY}
    told = {name.partition(">")[2] for name in frames(bag)}
    assert links - {"universe"} <= told
    assert "slave_base" in told


def test_readers_of_mcap_without_ros_decode_both(bag: Path) -> None:
    (file,) = bag.glob("*.mcap")
    counts: dict[str, int] = defaultdict(int)
    with file.open("rb") as stream:
        reader = make_reader(stream, decoder_factories=[DecoderFactory()])
        for _, channel, _, _ in reader.iter_decoded_messages(["/tf", "/robot_description"]):
            counts[channel.topic] += 1
    assert counts["/robot_description"] == 1
    assert counts["/tf"] >= 50


@pytest.mark.parametrize(("rate", "apart_ns"), [(20.0, 50_000_000), (1000.0, 1_000_000)])
def test_frames_come_at_the_wanted_rate(tmp_path: Path, rate: float, apart_ns: int) -> None:
    tc.run("free_motion", duration=0.2, out=tmp_path / "bag", recorder__tf_rate=rate)
    stamps = np.array(list(frames(tmp_path / "bag")["slave_base>slave_tip"]))
    assert (np.diff(stamps)[1:] == apart_ns).all()


def test_a_rate_of_zero_leaves_both_out(tmp_path: Path) -> None:
    made = tc.run("free_motion", duration=0.1, out=tmp_path / "bag", recorder__tf_rate=0.0)
    assert not {"tf", "robot_description"} & set(made.topics)


def test_who_chooses_topics_chooses_the_model_too(tmp_path: Path) -> None:
    chosen = ["slave/measured_js", "master/measured_cp", "tf"]
    made = tc.run("free_motion", duration=0.1, out=tmp_path / "bag", settings={"recorder.topics": chosen})
    assert set(made.topics) == set(chosen)
    with pytest.raises(UnknownNameError):
        tc.run("free_motion", duration=0.1, out=tmp_path / "other", settings={"recorder.topics": ["tff"]})


@pytest.mark.slow
def test_each_arm_has_its_own_robot_and_frames(tmp_path: Path) -> None:
    made = tc.run("free_motion", duration=0.2, arms=["right", "left"], out=tmp_path / "bag")
    told = frames(tmp_path / "bag")
    assert {"robot_description", "left/robot_description", "tf"} <= set(made.topics)
    assert "left/slave_base>left/slave_tip" in told
    apart = told["world>left/slave_base"].popitem()[1] - told["world>slave_base"].popitem()[1]
    assert np.linalg.norm(apart[:3]) > 0.5
    (left,) = messages(tmp_path / "bag", "/left/robot_description")
    assert 'link name="left/slave_base"' in left.data


@pytest.mark.parametrize("arms", [[], ["right", "left"]])
def test_what_is_saved_from_memory_has_the_frames_of_what_was_recorded(tmp_path: Path, arms: list[str]) -> None:
    tc.run("free_motion", duration=0.2, arms=arms, out=tmp_path / "recorded")
    tc.run("free_motion", duration=0.2, arms=arms).save(tmp_path / "saved")
    recorded, saved = (frames(tmp_path / name) for name in ("recorded", "saved"))
    assert recorded.keys() == saved.keys()
    for name, poses in recorded.items():
        assert list(poses) == list(saved[name])
        assert np.array_equal(list(poses.values()), list(saved[name].values()))
    topics = [f"/{arm}/robot_description" for arm in arms[1:]] + ["/robot_description"]
    for topic in topics:
        first, second = (messages(tmp_path / name, topic) for name in ("recorded", "saved"))
        assert [one.data for one in first] == [one.data for one in second]
        assert len(first) == 1


def test_tables_of_numbers_pass_over_the_model(bag: Path) -> None:
    frame = tc.open_recording(bag).frame()
    assert not [name for name in frame.columns if name.startswith(("tf", "robot_description"))]


def test_transforms_refuse_poses_of_other_frames() -> None:
    with pytest.raises(ShapeError):
        TransformMessages((("a", "b"),)).encode(np.array([1]), np.zeros((1, 2, 7)))


# -- markers -------------------------------------------------------------------------------------

STATE = {"is_fixture_on": 1.0} | {
    f"fixture_{what}_{axis}": value
    for what, row in (("center", (0.1, 0.2, 0.3)), ("size", (0.02, 0.03, 0.04)))
    for axis, value in zip("xyz", row, strict=True)
}


def read_markers(markers: list[Marker]) -> Any:
    data = marker_message(1_500_000_001, markers)
    message: Any = TYPES.deserialize_cdr(data, "visualization_msgs/msg/MarkerArray")
    # Byte for byte what another serialiser makes of it.
    assert bytes(TYPES.serialize_cdr(message, "visualization_msgs/msg/MarkerArray")) == data
    return message.markers


def test_markers_are_read_as_they_were_drawn() -> None:
    points = np.arange(12.0).reshape(4, 3)
    path, box = read_markers(
        [
            Marker("path", "slave_base", MarkerShape.LINE_STRIP, points=points),
            Marker("odd", "left/master_base", MarkerShape.CUBE, scale=(1.0, 2.0, 3.0), is_shown=False),
        ]
    )
    assert [(p.x, p.y, p.z) for p in path.points] == [tuple(row) for row in points]
    assert (path.header.stamp.sec, path.header.stamp.nanosec) == (1, 500_000_001)
    assert (path.type, path.action, path.ns, path.pose.orientation.w) == (4, 0, "path", 1.0)
    assert (box.action, box.header.frame_id, box.scale.z) == (2, "left/master_base", 3.0)


def test_a_fixture_is_drawn_where_the_state_says_and_red_while_it_is_touched() -> None:
    arm = ArmMarkers("left")
    free = arm.fixture(STATE, {})
    touched = arm.fixture(STATE, {"fixture": "sphere", "fixture.radius": "0.015"}, force=1.0)
    assert free.frame == "left/slave_base"
    assert (free.pose[:3].tolist(), free.scale) == ([0.1, 0.2, 0.3], (0.02, 0.03, 0.04))
    assert (free.shape, touched.shape) == (MarkerShape.CUBE, MarkerShape.SPHERE)
    assert touched.color[0] > touched.color[2]
    assert free.color[0] < free.color[2]
    assert not arm.fixture({}, {}).is_shown
    assert arm.fixture(STATE, {"fixture": "of another program"}).shape == MarkerShape.CUBE


@pytest.mark.parametrize("kind", DRAWN)
def test_other_fixtures_are_drawn_along_their_edges_around_the_slave(kind: str) -> None:
    part = SHAPES.find(kind)
    values = {f"fixture.{n}": repr(v) for n, v in values_of(part.parameters()).items()}
    axes = axis_map("axes", ("+y", "-x", "+z"))
    marker = ArmMarkers("left", axes).fixture(STATE | {"gain": 0.5}, {"fixture": kind} | values)
    assert (marker.shape, marker.pose[:3].tolist()) == (MarkerShape.LINE_LIST, [0.1, 0.2, 0.3])
    outline = part.outline(part.parameters())
    outline = outline[np.isfinite(outline).all(axis=1)]
    places = 2.0 * marker.points @ axes  # back to the master's axes and the hand's size
    near = np.linalg.norm(places[:, None] - outline, axis=2).min(axis=1)
    assert near.max() < ROUNDING
    np.testing.assert_allclose(np.ptp(places, axis=0), np.ptp(outline, axis=0), atol=ROUNDING)
    assert len(marker.points) % 2 == 0


def test_a_force_is_an_arrow_from_the_stylus_of_its_length() -> None:
    stylus = np.array([0.1, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0])
    arrow = ArmMarkers().force(stylus, np.array([0.0, 0.0, 3.0]))
    assert arrow.points[1] - arrow.points[0] == pytest.approx([0.0, 0.0, 3.0 * FORCE_SCALE])
    assert arrow.points[0] == pytest.approx(stylus[:3])
    assert not ArmMarkers().force(stylus, np.zeros(3)).is_shown


def test_a_path_forgets_its_oldest_points() -> None:
    arm = ArmMarkers()
    for number in range(TAIL + 10):
        marker = arm.path("measured", np.full(3, float(number)))
    assert len(marker.points) == TAIL
    assert marker.points[0, 0] == 10.0
    arm.forget()
    assert not arm.path("measured", np.zeros(3)).is_shown
