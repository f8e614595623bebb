"""Conformance: tests a CRTK arm from outside: first the topics, then the reactions to commands.

The test is an ordinary CRTK client: its QoS is reliable and keep-last, and its stamps are the time of the machine. The
arm needs no software of this project.
"""

from collections.abc import Callable, Iterable

from teleop_core.robots.robot import Robot
from teleop_drill.conformance.crtk_topics import CRTK_TOPICS, CrtkTopic, Finding, Group, RowResult
from teleop_drill.nodes.conformance_arm import ArmClient
from teleop_drill.nodes.conformance_queries import look
from teleop_drill.nodes.conformance_trials import TRIALS, TURN, Outcome, Trials
from teleop_drill.nodes.conformance_watch import Watch

Report = Callable[[str], None]
NEVER_TRIED = {
    "servo_jf": "effort commands are not safe to test from outside",
    "servo_cf": "force commands are not safe to test from outside",
    "free": "an arm without control may fall",
    "move_cr": "CRTK does not define the frame",
    "servo_cr": "CRTK does not define the frame",
}


def examine(
    arm: ArmClient, *, may_move: bool, report: Report = lambda _: None, robot: Robot | None = None
) -> list[Finding]:
    """Test all rows of the table and return the findings.

    Args:
        arm: The arm.
        may_move: Whether the test commands states and small motions of a few millimetres or hundredths of a radian;
            each motion is reversed.
        report: Called with a text for each step.
        robot: Expected robot; its forward kinematics are compared with the measured tip.
    """
    findings: dict[str, Finding] = {}
    for row in CRTK_TOPICS:
        report(f"looking at {row.name}")
        findings[row.name] = look(arm, row)
    _insist_on_one(findings)
    if may_move:
        _try(arm, findings, report, robot)
    else:
        _skip(findings, "read only")
    return [findings[row.name] for row in CRTK_TOPICS]


def left_behind(arm: ArmClient, *, may_move: bool) -> str:
    """Text about the state in which an interrupted test has left an arm."""
    if not may_move:
        return "nothing was commanded"
    state = arm.newest("operating_state", 0.5)
    told = "in an unknown state" if state is None else state.state
    cure = "; resume it" if told == "PAUSED" else ""
    return f"the arm is {told} and may be off by {TURN} rad or {1e3 * TURN:.0f} mm{cure}"


def _insist_on_one(findings: dict[str, Finding]) -> None:
    """Raise an error if the arm publishes no measured position."""
    pair = [findings[name] for name in ("measured_js", "measured_cp")]
    if all(found.verdict is RowResult.ABSENT for found in pair):
        row = pair[0].row
        findings[row.name] = Finding(
            row, RowResult.FAILED, "no publisher", "neither measured_js nor measured_cp exists"
        )


def _commands(findings: dict[str, Finding]) -> Iterable[tuple[str, CrtkTopic]]:
    """Commands whose topics passed the test."""
    for name, found in list(findings.items()):
        if found.row.group is not Group.QUERY and found.verdict is RowResult.OK:
            yield name, found.row


def _skip(findings: dict[str, Finding], why: str) -> None:
    for name, row in _commands(findings):
        if row.name != "operating_state":
            findings[name] = Finding(row, RowResult.SKIPPED, findings[name].found, why)


def _try(arm: ArmClient, findings: dict[str, Finding], report: Report, robot: Robot | None) -> None:
    trials = Trials(arm)
    refusal = trials.unfit()
    if refusal:
        _skip(findings, refusal)
        return
    for name, row in _commands(findings):
        if name == "operating_state":
            continue
        if name in NEVER_TRIED:
            verdict, note = RowResult.SKIPPED, NEVER_TRIED[name]
        elif arm.others(name):
            verdict, note = (RowResult.SKIPPED, f"{arm.others(name)} others command it: stop them first")
        else:
            report(f"trying {name}")
            verdict, note = _watched(trials, name, findings, robot)
            trials.go_back()
        findings[name] = Finding(row, verdict, findings[name].found, note)


def _watched(trials: Trials, name: str, findings: dict[str, Finding], robot: Robot | None) -> Outcome:
    """Test a command; the measurements of the arm during the motion must agree with the command.

    A command that moved only the setpoint did not move the arm. From outside it is unknown whether the command or the
    measurement is wrong, so both rows fail.
    """
    watch = Watch(trials.arm, robot)
    verdict, note = TRIALS[name](trials)
    lies = watch.lies()
    for topic, lie in lies.items():
        told = findings[topic]
        if told.verdict is not RowResult.FAILED:
            findings[topic] = Finding(told.row, RowResult.FAILED, told.found, f"{name}: {lie}")
    missed = [lie for lie in lies.values() if "setpoint" in lie]
    return (RowResult.FAILED, missed[0]) if verdict is RowResult.OK and missed else (verdict, note)
