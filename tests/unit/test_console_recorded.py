"""Recorded link: a recording is seen at any time as it was, and takes no command."""

import bisect
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from rosbags.highlevel import AnyReader

import teleop_core as tc
from teleop_console.recorded import RecordedLink
from teleop_console.recorded_arms import configuration_of, recorded_arms
from teleop_core.bags.memory import MemoryBag
from teleop_core.graph.topics import MASTER_MEASURED_CP, SLAVE_MEASURED_CP, Kind, Topic

POSES = ("slave/measured_cp", "slave/setpoint_cp", "master/measured_cp")
JOINTS, STATE = "slave/measured_js", "teleop/state"


@pytest.fixture(scope="module")
def session(tmp_path_factory: pytest.TempPathFactory) -> tc.Recording:
    path = tmp_path_factory.mktemp("console") / "session"
    return tc.run("mode_switching", duration=6.0, out=path)


@pytest.fixture(scope="module")
def messages(session: Any) -> dict[str, list[tuple[int, Any]]]:
    """Times of recording [ns] and messages of some topics, as rosbags reads them."""
    found: dict[Any, Any] = {}
    with AnyReader([session.path]) as reader:
        wanted = [one for one in reader.connections if one.topic.lstrip("/") in (*POSES, JOINTS, STATE)]
        for connection, log_ns, data in reader.messages(wanted):
            name = connection.topic.lstrip("/")
            message = reader.deserialize(data, connection.msgtype)
            found.setdefault(name, []).append((log_ns, message))
    return found


@pytest.fixture
def link(session: tc.Recording) -> RecordedLink:
    return RecordedLink(session.bag)


def last(messages: list[tuple[int, object]], time_ns: int) -> Any:
    """Last message that was recorded by a time."""
    return messages[bisect.bisect_right([log for log, _ in messages], time_ns) - 1][1]


@pytest.mark.parametrize("time", [0.0, 0.7774, 2.5, 4.1239, 6.0, 1e9])
def test_a_view_has_what_others_read_as_the_last_sample_by_that_time(
    link: RecordedLink, session: Any, messages: dict[str, list[tuple[int, Any]]], time: float
) -> None:
    link.seek(time)
    seen = link.view().arms[""]
    time_ns = session.bag.start_ns + round(min(time, link.duration) * 1e9)
    for name in POSES:
        pose = last(messages[name], time_ns).pose
        p, q = pose.position, pose.orientation
        assert seen.streams[name].tolist() == [p.x, p.y, p.z, q.w, q.x, q.y, q.z]
    joints = last(messages[JOINTS], time_ns)
    told = [*joints.position, *joints.velocity, *joints.effort]
    assert seen.streams[JOINTS].tolist() == told
    state = {pair.key: pair.value for pair in last(messages[STATE], time_ns).status[0].values}
    assert {name: float(state[name]) for name in seen.state} == seen.state
    assert seen.operation_text


@settings(max_examples=100, deadline=None)
@given(
    steps=st.lists(
        st.tuples(st.sampled_from(("advance", "seek", "play", "pause", "loop")), st.floats(-2.0, 9.0)), max_size=30
    )
)
def test_time_stays_within_the_recording_whatever_is_done(
    small_link: RecordedLink, steps: list[tuple[str, float]]
) -> None:
    link = small_link
    for name, value in steps:
        if name == "loop":
            link.loop = value > 3.0
        elif name in {"play", "pause"}:
            getattr(link, name)()
        else:
            getattr(link, name)(value)
        assert 0.0 <= link.time <= link.duration


@pytest.fixture(scope="module")
def small() -> Any:
    """A short session in memory."""
    return tc.run("coarse_box", duration=0.4).bag


@pytest.fixture(scope="module")
def small_link(small: MemoryBag) -> RecordedLink:
    return RecordedLink(small)


def test_time_passes_at_its_speed_and_stops_at_the_end(link: RecordedLink) -> None:
    link.advance(1.0)
    assert link.time == 0.0, "it is held until somebody plays it"
    link.play()
    link.speed = 0.5
    link.advance(1.0)
    assert link.time == pytest.approx(0.5)
    link.advance(1e3)
    assert link.time == link.duration
    assert not link.is_playing
    link.play()
    assert link.time == 0.0, "from the begin again"


def test_a_loop_begins_again_at_its_end(link: RecordedLink) -> None:
    link.loop = True
    link.play()
    link.advance(link.duration + 0.1)
    assert link.is_playing
    assert link.time < 1.0


@pytest.mark.parametrize("speed", [0.0, -1.0, 101.0, float("nan")])
def test_impossible_speeds_and_no_time_are_refused(link: RecordedLink, speed: float) -> None:
    with pytest.raises(tc.ParameterError, match="speed"):
        link.speed = speed
    with pytest.raises(tc.ParameterError, match="time"):
        link.seek(float("nan"))


def test_a_recording_cannot_be_commanded(link: RecordedLink) -> None:
    before = link.view()
    assert link.command("enable") == (False, "a recording accepts no commands")
    assert "accepts no commands" in link.change("motion_scaling", "mode", "fine")
    link.press(is_pressed=True)
    link.hold("", np.zeros(7))
    link.let_go("")
    link.press_button("", "mode")
    with pytest.raises(tc.TeleopError, match="accepts no commands"):
        link.save("again")
    after = link.view()
    assert before.arms[""].state == after.arms[""].state
    assert not link.is_live


def test_parameters_are_those_that_it_was_made_with(session: tc.Recording, link: RecordedLink) -> None:
    found = link.parameters()
    assert found["motion_scaling", "axes"].value == ("-z", "-x", "+y")
    assert found["slave_sim", "robot"].value == "rcrt1"
    assert all(info.is_fixed for info in found.values())


def test_of_a_long_recording_one_of_some_samples_is_kept_and_memory_stays_bounded(session: tc.Recording) -> None:
    bag = session.bag
    most = 300_000
    (arm,), thinning = recorded_arms(bag, configuration_of(bag), most)
    track = arm.tracks[SLAVE_MEASURED_CP.name]
    whole = session["slave/measured_cp"]
    assert thinning > 5
    kept = sum(one.values.nbytes + one.log_ns.nbytes + one.stamp_ns.nbytes for one in arm.tracks.values())
    assert kept < 1.2 * most
    np.testing.assert_array_equal(track.values, whole.values[::thinning])


def test_a_path_is_that_of_the_last_seconds(link: RecordedLink, session: tc.Recording) -> None:
    link.seek(3.0)
    times, rows = link.path(MASTER_MEASURED_CP, "", 2.0)
    assert len(times) == len(rows) > 100
    assert times[0] == pytest.approx(1.0, abs=2e-3)
    assert times[-1] == pytest.approx(3.0, abs=2e-3)
    np.testing.assert_array_equal(rows[-1], link.view().arms[""].streams["master/measured_cp"])


def test_what_was_not_recorded_has_no_path(link: RecordedLink) -> None:
    times, rows = link.path(Topic("nobody/measured_cp", Kind.POSE), "", 10.0)
    assert times.shape == (0,)
    assert rows.shape == (0, 7)


def foreign(small: MemoryBag, lacking: tuple[str, ...], metadata: dict[str, str]) -> MemoryBag:
    """The same streams without some, as another system would have recorded them."""
    streams = {topic: s for topic, s in small.streams.items() if topic.name not in lacking}
    return MemoryBag("foreign", streams, {}, metadata)


@pytest.mark.parametrize(
    ("lacking", "metadata", "reason"),
    [
        ((), {}, "does not name its robot"),
        (("slave/measured_js",), {"robot": "rcrt1"}, "lacks slave/measured_js"),
        ((), {"robot": "r2d2"}, "robot cannot be loaded"),
        ((), {"robot": "puma560"}, "lacks joints"),
    ],
)
def test_a_recording_of_another_system_is_refused_with_what_it_lacks(
    small: MemoryBag, lacking: tuple[str, ...], metadata: dict[str, str], reason: str
) -> None:
    with pytest.raises(tc.RecordingError, match=reason):
        RecordedLink(foreign(small, lacking, metadata))


def test_a_robot_that_is_named_by_the_recording_alone_is_enough(small: MemoryBag) -> None:
    link = RecordedLink(foreign(small, ("slave/servo_jp", "master/measured_cf"), {"robot": "rcrt1"}))
    seen = link.view().arms[""]
    assert "slave/measured_cp" in seen.streams
    assert "master/measured_cf" not in seen.streams
    assert seen.state == {}


def test_each_arm_of_two_is_seen_as_it_was(small: MemoryBag) -> None:
    later = {topic.of_arm("right"): replace(s, values=s.values[::-1]) for topic, s in small.streams.items()}
    metadata = {"arms": "left right", "robot": "rcrt1", "right/robot": "rcrt1"}
    link = RecordedLink(MemoryBag("two", small.streams | later, {}, metadata))
    assert [arm.name for arm in link.arms] == ["", "right"]
    link.seek(link.duration)
    seen = link.view().arms
    joints = next(s for topic, s in small.streams.items() if topic.name == "slave/measured_js")
    np.testing.assert_array_equal(seen[""].streams["slave/measured_js"], joints.values[-1])
    np.testing.assert_array_equal(seen["right"].streams["slave/measured_js"], joints.values[0])
