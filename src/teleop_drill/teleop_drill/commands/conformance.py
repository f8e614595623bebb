"""``teleop conformance``: test any CRTK arm, row by row."""

import sys
from collections import Counter

from teleop_core.base.errors import ParameterError, SessionError
from teleop_core.commands.options import Domain, ros_module

_QUESTION = "move {}? one joint by 0.01 rad, its tip by 3 mm, each back again; pause, resume [y/N] "


def conformance(
    namespace: str,
    /,
    *,
    read_only: bool = False,
    yes: bool = False,
    json: bool = False,
    domain: Domain = None,
    robot: str | None = None,
    wait: float = 5.0,
) -> int:
    """Test a CRTK arm, row by row: topics, stamps, states, small motions.

    Tests an arm, ours or any other, against CRTK (Collaborative Robotics Toolkit): which topics there are, their types,
    rates, stamps and numbers, and whether it does what a stock client tells it.

        teleop conformance slave --read-only   # look, touch nothing
        teleop conformance /PSM1               # asks before it moves anything
        teleop conformance slave --yes --json  # for programs

    It pauses and resumes the arm, moves one joint by 0.01 rad (or 10 mm) and the tip by 3 mm, and goes back each time.
    Where it chooses the speed, that is at most 0.02 rad/s and 6 mm/s. Whatever it measures must follow what it was
    told, in time and in place; its speeds must add up to its way. Efforts, forces and free are never tried. Stop
    whoever else commands the arm, and keep a hand at the emergency stop.

    Verdicts: ok; absent, which is allowed; not tried, with the reason; noted, works but look at it; FAILED. The exit
    code is 1 if a row FAILED, else 3 if a row was not tried, as of an arm that is not enabled and homed, else 0.

    Args:
        namespace: Namespace of the arm's topics, such as slave, or /PSM1.
        read_only: Command nothing.
        yes: Move the arm without asking first.
        json: Print JSON in place of the table.
        domain: ROS domain; without it, ROS_DOMAIN_ID.
        robot: Robot model of the arm, one of `teleop robot` or a Denavit-Hartenberg table; its forward kinematics are
            compared with measured_cp.
        wait: Longest time to wait for the arm [s].
    """
    if read_only and yes:
        raise ParameterError("--yes", yes, "left out with --read-only")
    from rich.console import Console

    from teleop_core.robots import load_robot
    from teleop_drill.conformance import RowResult, exit_code, findings_json, findings_table

    ros_module("conformance", "teleop_drill.nodes")
    from teleop_core.nodes.children import environment
    from teleop_core.nodes.interrupt import Interrupt
    from teleop_drill.nodes.conformance import examine, left_behind
    from teleop_drill.nodes.conformance_arm import ArmClient

    model = None if robot is None else load_robot(robot)
    environment()
    with ArmClient(namespace, domain) as arm:
        with arm.interrupt.caught():
            is_there = arm.is_there(wait)
        if not is_there:
            where = f"{arm.namespace}/… within {wait:g} s"
            hint = "is it on this ROS domain? `ros2 topic list`, or another --domain"
            raise SessionError(f"no CRTK topic at {where}; {hint}")
        may_move = not read_only and (yes or _agreed(arm.namespace))
        progress = Console(stderr=True)
        try:
            with arm.interrupt.caught(), progress.status("looking") as status:
                findings = examine(arm, may_move=may_move, report=status.update, robot=model)
        except KeyboardInterrupt:
            arm.interrupt = Interrupt()  # a new one, so that the search for remaining topics can run
            left = left_behind(arm, may_move=may_move)
            print(f"teleop conformance: interrupted; {left}", file=sys.stderr)
            return 130
    if json:
        print(findings_json(arm.namespace, findings))
    else:
        Console().print(findings_table(arm.namespace, findings))
        count = Counter(finding.verdict for finding in findings)
        there, failed = len(findings) - count[RowResult.ABSENT], count[RowResult.FAILED]
        print(f"{there} of {len(findings)} rows are there, {failed} failed, {count[RowResult.SKIPPED]} not tried")
    return exit_code(findings)


def _agreed(namespace: str) -> bool:
    """Whether the user agrees that the arm moves; false without a terminal."""
    if not sys.stdin.isatty():
        raise SessionError("needs an answer: --yes to move the arm, or --read-only")
    return input(_QUESTION.format(namespace)).strip().lower() in {"y", "yes"}
