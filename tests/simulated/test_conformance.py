"""Conformance: what is wrong with a CRTK arm of somebody else is found from outside."""

from functools import cache

import pytest

from foreign_arm import ForeignArm
from simulated.conftest import SimulatedPeer
from teleop_drill.conformance import Finding, RowResult, exit_code
from teleop_drill.nodes.conformance import examine
from teleop_drill.nodes.conformance_arm import ArmClient


@cache
def findings_of(fault: str, *, may_move: bool = True) -> dict[str, Finding]:
    """What is found of an arm with a fault, by topic."""
    peer = SimulatedPeer()
    peer.foreign("foreign", lambda platform: ForeignArm(platform, (fault,)).serve())
    with ArmClient("PSM", platform=peer.platform) as arm:
        assert arm.is_there(20.0)
        return {found.row.name: found for found in examine(arm, may_move=may_move)}


def test_an_arm_without_fault_passes_and_is_only_moved_by_what_it_takes() -> None:
    found = findings_of("honest")
    verdicts = {name: one.verdict for name, one in found.items()}
    sound = (
        "operating_state",
        "state_command",
        "measured_js",
        "measured_cp",
        "setpoint_js",
        "setpoint_cp",
        "move_jp",
        "servo_jp",
    )
    assert {name: verdicts[name] for name in sound} == dict.fromkeys(sound, RowResult.OK), found
    assert {verdict for name, verdict in verdicts.items() if name not in sound} == {RowResult.ABSENT}


def test_a_signal_ends_a_test_where_it_waits() -> None:
    with ArmClient("PSM", platform=SimulatedPeer().platform) as arm:
        arm.interrupt.ask()
        with pytest.raises(KeyboardInterrupt):
            arm.is_there(60.0)


PLACES = ("measured_js", "servo_jp", "move_jp")


@pytest.mark.parametrize(
    ("fault", "topics", "note", "may_move"),
    [
        ("stamp", ("measured_js",), "stamp is 0", False),
        ("nan", ("measured_js",), "not finite", False),
        ("length", ("measured_js",), "different lengths", False),
        ("unit", ("measured_cp",), "length 0.5", False),
        ("type", ("measured_cp",), "must be geometry_msgs/msg/PoseStamped", False),
        ("qos", ("measured_js",), "best effort", False),
        ("no state", ("operating_state",), "", False),
        ("future", ("measured_js",), "s in the future", False),
        ("owners", ("measured_js",), "2 publishers: the arm must have one owner", False),
        ("ignores", ("state_command",), "pause: ENABLED in place of PAUSED", True),
        ("ignores", ("move_jp", "servo_jp"), "no joint", True),
        ("jumps", ("state_command",), "on resume, without a command", True),
        ("frozen tip", ("measured_cp",), "the setpoint moved by 0.003, but measured_cp by 0", True),
        ("moves paused", ("state_command",), "while PAUSED", True),
        ("any word", ("state_command",), "no command changed the state", True),
        ("never busy", ("move_jp",), "never became true", True),
        ("frozen", PLACES, "measured_js by 0", True),
        ("scaled", PLACES, "measured_js by 0.00", True),
        ("late", PLACES, "setpoint", True),
        ("speeds", ("measured_js",), "the integral of its speeds differs", True),
        ("swapped", PLACES, "the setpoint moved by 0.01, but measured_js", True),
        ("bulge", ("measured_js",), "leaves the way of its setpoint", True),
        ("detour", ("move_jp",), "left the range between begin and goal", True),
        ("turning", ("measured_cp",), "the setpoint turned by 0 rad, but measured_cp by 0.09", True),
    ],
)
def test_faults_are_found_by_looking_or_else_by_moving_the_arm(
    fault: str, topics: tuple[str, ...], note: str, may_move: bool
) -> None:
    found = findings_of(fault, may_move=may_move)
    for topic in topics:
        assert found[topic].verdict is RowResult.FAILED, (topic, found[topic])
        assert note in found[topic].note, found[topic]


@pytest.mark.parametrize(
    ("fault", "may_move", "code"),
    [("honest", True, 0), ("frozen", True, 1), ("no state", True, 1), ("disabled", True, 3), ("honest", False, 3)],
)
def test_rows_that_were_not_tried_are_no_pass(fault: str, may_move: bool, code: int) -> None:
    assert exit_code(findings_of(fault, may_move=may_move).values()) == code


def test_nothing_is_commanded_when_only_looking() -> None:
    found = findings_of("", may_move=False)
    assert found["move_jp"].verdict is RowResult.SKIPPED
    assert found["state_command"].note == "read only"
