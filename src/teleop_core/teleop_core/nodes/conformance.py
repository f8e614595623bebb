"""Conformance: looks at a CRTK arm from outside, its topics first, then what it does when told.

It is a stock client: reliable, keep last, stamped with the time of the machine. Nothing of ours is
needed at the other end.
"""

from collections.abc import Callable, Iterable

from teleop_core.conformance.rows import ROWS, Finding, Group, Row, Verdict
from teleop_core.nodes.conformance_arm import Arm
from teleop_core.nodes.conformance_queries import look
from teleop_core.nodes.conformance_trials import TRIALS, Trials

Report = Callable[[str], None]
NEVER_TRIED = {
    "servo_jf": "efforts are not safe to try from outside",
    "servo_cf": "forces are not safe to try from outside",
    "free": "an arm that is let go may fall",
    "move_cr": "CRTK does not say in which frame",
    "servo_cr": "CRTK does not say in which frame",
}


def examine(arm: Arm, *, may_move: bool, report: Report = lambda _: None) -> list[Finding]:
    """Findings of all rows.

    Args:
        arm: The arm.
        may_move: Whether states are commanded and small motions made: a few millimetres and
            hundredths of a radian, each back again.
        report: Told what is done now.
    """
    findings: dict[str, Finding] = {}
    for row in ROWS:
        report(f"looking at {row.name}")
        findings[row.name] = look(arm, row)
    _insist_on_one(findings)
    if may_move:
        _try(arm, findings, report)
    else:
        _skip(findings, "read only")
    return [findings[row.name] for row in ROWS]


def _insist_on_one(findings: dict[str, Finding]) -> None:
    """An arm without any measured position is none."""
    pair = [findings[name] for name in ("measured_js", "measured_cp")]
    if all(found.verdict is Verdict.ABSENT for found in pair):
        row = pair[0].row
        findings[row.name] = Finding(
            row, Verdict.FAILED, "no publisher", "neither measured_js nor measured_cp is there"
        )


def _commands(findings: dict[str, Finding]) -> Iterable[tuple[str, Row]]:
    """Commands that are there, soundly."""
    for name, found in list(findings.items()):
        if found.row.group is not Group.QUERY and found.verdict is Verdict.OK:
            yield name, found.row


def _skip(findings: dict[str, Finding], why: str) -> None:
    for name, row in _commands(findings):
        if row.name != "operating_state":
            findings[name] = Finding(row, Verdict.SKIPPED, findings[name].found, why)


def _try(arm: Arm, findings: dict[str, Finding], report: Report) -> None:
    trials = Trials(arm)
    refusal = trials.unfit()
    if refusal:
        _skip(findings, refusal)
        return
    for name, row in _commands(findings):
        if name == "operating_state":
            continue
        if name in NEVER_TRIED:
            verdict, note = Verdict.SKIPPED, NEVER_TRIED[name]
        elif arm.others(name):
            verdict, note = (
                Verdict.SKIPPED,
                f"{arm.others(name)} others command it: stop them first",
            )
        else:
            report(f"trying {name}")
            verdict, note = TRIALS[name](trials)
            trials.go_back()
        findings[name] = Finding(row, verdict, findings[name].found, note)
