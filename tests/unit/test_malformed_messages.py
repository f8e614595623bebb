"""Malformed messages: bytes of anybody are read, or refused with a reason; nothing ends by them."""

import warnings
from pathlib import Path

import numpy as np
import pytest

import teleop_core as tc
from teleop_core.bags import ros_types
from teleop_core.bags.messages import Refusal, layout, read_any, read_numbers, report
from teleop_core.bags.reader import Bag
from teleop_core.bags.writer import BagWriter
from teleop_core.base import RecordingError
from teleop_core.graph import topics

JOINTS = ("a", "b")
GARBAGE = b"\0\1\0\0" + bytes(range(200, 256))
SESSION_NAMES = (*(t.name for t in topics.STREAMS), topics.TELEOP_STATE.name)


def sound(topic: tc.Topic) -> bytes:
    if topic.kind is topics.Kind.REPORT:
        return report(5, "x", 0, "fine", dict.fromkeys(topic.columns, "1"))
    count = topic.width(len(JOINTS))
    return layout(topic, JOINTS).encode_one(7, np.arange(count, dtype=float))


def test_what_is_no_message_is_refused_as_such() -> None:
    assert read_any(topics.Kind.POSE, b"\0\1\0\0abc") is Refusal.MALFORMED
    assert read_any(topics.Kind.POSE, sound(topics.SLAVE_MEASURED_CP)[:-1]) is Refusal.MALFORMED
    assert read_numbers(GARBAGE, ("gain",)) is Refusal.MALFORMED
    assert read_numbers(report(0, "x", 0, "", {"gain": "abc"}), ("gain",)) is Refusal.WRONG_NAMES


def test_a_message_that_is_padded_as_rclpy_does_is_one() -> None:
    """A JointState of empty lists of doubles: rclpy adds four bytes for one at its end, eight for two."""
    types = ros_types.typestore().types
    header = types["std_msgs/msg/Header"](types["builtin_interfaces/msg/Time"](1, 2), "base")
    none = np.zeros(0)
    message = types["sensor_msgs/msg/JointState"](header, ["a"], np.ones(1), none, none)
    data = ros_types.serialise(message)
    for padding in (0, 4, 8, 11):
        found = ros_types.deserialise(data + bytes(padding), "sensor_msgs/msg/JointState")
        assert (found.header.stamp.nanosec, len(found.effort)) == (2, 0)
    with pytest.raises(ValueError, match="is no valid sensor_msgs"):
        ros_types.deserialise(data + bytes(12), "sensor_msgs/msg/JointState")


def recorded(path: Path, *, bad: tuple[int, ...] = (), good: int = 3) -> Bag:
    """Recording of one pose topic in which messages number ``bad`` are no poses."""
    topic = topics.SLAVE_MEASURED_CP
    form = layout(topic, ())
    with BagWriter(path, [topic], {}) as writer:
        for i in range(good + len(bad)):
            data = GARBAGE if i in bad else form.encode_one(i, np.arange(7.0) + i)
            writer.write(topic, i, data)
    return Bag(path)


@pytest.mark.parametrize("bad", [(0,), (2,), (1, 3), (0, 4)])
def test_a_recording_is_read_without_its_malformed_messages(tmp_path: Path, bad: tuple[int, ...]) -> None:
    bag = recorded(tmp_path / "bag", bad=bad)
    with pytest.warns(UserWarning, match=f"{len(bad)} of {3 + len(bad)} messages are left out"):
        series = bag.read("slave/measured_cp")
    kept = [i for i in range(3 + len(bad)) if i not in bad]
    assert series.stamp_ns.tolist() == series.log_ns.tolist() == kept
    np.testing.assert_array_equal(series.values[:, 0], kept)


def test_a_recording_of_malformed_messages_alone_is_refused(tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match=r"no readable messages.*3 of 3 messages"):
        recorded(tmp_path / "bag", bad=(0, 1, 2), good=0).read("slave/measured_cp")


def test_a_sound_recording_is_read_without_a_word(tmp_path: Path) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert len(recorded(tmp_path / "bag").read("slave/measured_cp")) == 3


@pytest.fixture(scope="module")
def session() -> tc.Recording:
    return tc.run("coarse_box", duration=1.0)


def copy_of(session: tc.Recording, path: Path, *, bad: tuple[str, ...] = ()) -> tc.Recording:
    """The session on disk, with a malformed message amid those of the topics named ``bad``."""
    by_name = {topic.name: topic for topic in topics.ALL}
    given = set()
    with BagWriter(path, topics.ALL, {}, metadata=session.metadata) as writer:
        for name, _, log_ns, data in session.bag.raw():
            writer.write(by_name[name], log_ns, data)
            if name in bad and name not in given:
                given.add(name)
                writer.write(by_name[name], log_ns, GARBAGE)
                if by_name[name].kind is topics.Kind.REPORT:
                    wrong = report(log_ns, name, 0, "", dict.fromkeys(by_name[name].columns, "abc"))
                    writer.write(by_name[name], log_ns, wrong)
    return tc.open_recording(path)


def test_a_malformed_message_on_every_topic_leaves_the_scores_as_they_were(
    session: tc.Recording, tmp_path: Path
) -> None:
    whole = copy_of(session, tmp_path / "whole").score()
    with pytest.warns(UserWarning, match="left out"):
        score = copy_of(session, tmp_path / "bad", bad=SESSION_NAMES).score()
    assert score.position_error_mm.rms == pytest.approx(whole.position_error_mm.rms, rel=1e-12)
    assert score.value("motion.hand.sparc") == whole.value("motion.hand.sparc")
