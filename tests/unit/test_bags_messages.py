"""Messages: by attribute, checked, and as reports."""

from types import SimpleNamespace as Record
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from accepted import why_refused
from teleop_core.bags.messages import Refusal, Report, read_reports, read_values, report, write_values
from teleop_core.base.texts import printable
from teleop_core.graph.topics import POSES, Kind

POSE = np.array([0.1, 0.2, 0.3, 1.0, 0.0, 0.0, 0.0])


def empty_message(kind: Kind) -> Any:
    def vector() -> Record:
        return Record(x=0.0, y=0.0, z=0.0)

    bodies: dict[Kind, dict[str, Any]] = {
        Kind.POSE: {"pose": Record(position=vector(), orientation=vector())},
        Kind.POSES: {"poses": [Record(position=vector(), orientation=vector()) for _ in range(POSES)]},
        Kind.TWIST: {"twist": Record(linear=vector(), angular=vector())},
        Kind.WRENCH: {"wrench": Record(force=vector(), torque=vector())},
    }
    return Record(header=Record(stamp=Record(sec=0, nanosec=0)), **bodies.get(kind, {}))


def joint_state(
    names: str | tuple[str, ...],
    position: tuple[float, ...],
    velocity: tuple[float, ...] = (),
    effort: tuple[object, ...] = (),
) -> Any:
    message = empty_message(Kind.STATE)
    message.name, message.position = list(names), list(position)
    message.velocity, message.effort = list(velocity), list(effort)
    return message


@pytest.mark.parametrize("kind", [kind for kind in Kind if kind is not Kind.REPORT])
def test_reading_gives_back_what_was_written(kind: Any) -> None:
    names = ("jaw",) if kind is Kind.JAW else ("a", "b")
    values = np.arange(1.0, 1.0 + kind.width(2))
    message = write_values(kind, empty_message(kind), 3_000_000_004, values, frame_id="f", joint_names=names)
    assert (message.header.stamp.sec, message.header.stamp.nanosec) == (3, 4)
    assert message.header.frame_id == "f"
    taken = read_values(kind, message, names)
    assert not isinstance(taken, Refusal)
    stamp_ns, read = taken
    assert stamp_ns == 3_000_000_004
    np.testing.assert_array_equal(read, values)


def test_the_quaternion_of_a_message_is_found_by_name_not_by_place() -> None:
    message = write_values(Kind.POSE, empty_message(Kind.POSE), 0, np.arange(7.0))
    turn = message.pose.orientation
    assert (turn.w, turn.x, turn.y, turn.z) == (3.0, 4.0, 5.0, 6.0)


def test_joints_are_put_into_the_order_of_the_robot() -> None:
    message = joint_state(("b", "other", "a"), (1.0, 2.0, 3.0))
    taken = read_values(Kind.JOINTS, message, ("a", "b"))
    assert not isinstance(taken, Refusal)
    _, values = taken
    np.testing.assert_array_equal(values, [3.0, 1.0])


def test_a_missing_joint_is_refused() -> None:
    message = joint_state(("a", "c"), (1.0, 2.0))
    assert read_values(Kind.JOINTS, message, ("a", "b")) is Refusal.WRONG_NAMES


@pytest.mark.parametrize(
    "message",
    [joint_state(("a", "b"), (1.0,)), joint_state(("a", "b"), (1.0, 2.0), (1.0,)), joint_state(("a", "b"), ())],
)
def test_joint_vectors_of_another_length_are_refused(message: Record) -> None:
    assert read_values(Kind.STATE, message, ("a", "b")) is Refusal.WRONG_LENGTH


def test_velocities_and_efforts_that_are_not_sent_are_nan() -> None:
    taken = read_values(Kind.STATE, joint_state("ab", (1.0, 2.0)), ("a", "b"))
    assert not isinstance(taken, Refusal)
    _, values = taken
    np.testing.assert_array_equal(values, [1.0, 2.0, *[np.nan] * 4])


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("column", [0, 3, 6])
def test_numbers_that_are_not_finite_are_refused(bad: float, column: int) -> None:
    values = POSE.copy()
    values[column] = bad
    assert why_refused(Kind.POSE, 5, values, None) is Refusal.NOT_FINITE


def test_opposite_infinities_do_not_cancel() -> None:
    assert why_refused(Kind.JOINTS, 5, np.array([np.inf, -np.inf]), None) is Refusal.NOT_FINITE


@pytest.mark.parametrize(
    ("norm", "reason"), [(1.0009, None), (0.9991, None), (1.0011, Refusal.NOT_UNIT), (0.0, Refusal.NOT_UNIT)]
)
def test_quaternions_off_unit_length_by_more_than_a_thousandth_are_refused(norm: float, reason: Refusal | None) -> None:
    values = POSE.copy()
    values[3:] = norm * np.array([0.5, 0.5, -0.5, 0.5])
    assert why_refused(Kind.POSE, 5, values, None) is reason


@pytest.mark.parametrize("last", [5, 6])
def test_stamps_that_stand_still_or_go_back_are_refused(last: int) -> None:
    assert why_refused(Kind.POSE, 5, POSE, last) is Refusal.NOT_NEWER


# Control codes are shown, not kept: see teleop_core.base.texts.
TEXT = st.text(st.characters(codec="utf-8", exclude_characters="\0")).map(printable)


@settings(deadline=None)
@given(st.integers(0, 2**31 * 10**9 - 1), TEXT, st.integers(0, 3), TEXT, st.dictionaries(TEXT, TEXT))
def test_a_report_says_when_read_what_it_was_given(
    stamp_ns: int, name: str, level: int, message: str, values: dict[str, str]
) -> None:
    data = report(stamp_ns, name, level, message, values)
    assert read_reports(data) == [Report(stamp_ns, name, level, message, values)]


@pytest.mark.parametrize("data", [b"", b"\0\1\0\0\5", report(1, "a", 0, "b", {"c": "d"})[:30]])
def test_bytes_that_are_no_report_are_refused(data: bytes) -> None:
    with pytest.raises(ValueError, match="DiagnosticArray"):
        read_reports(data)
