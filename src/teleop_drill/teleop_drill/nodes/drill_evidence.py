"""Evidence of a drill: the reports of a session about a fault, the messages of the tap, and the recovery."""

from teleop_core.graph import topics
from teleop_core.graph.operation import State
from teleop_core.slave.operation import Fault
from teleop_drill.drill.exercise import Cure, Exercise
from teleop_drill.drill.judging import Tapped
from teleop_drill.drill.numbers import Scheduling
from teleop_drill.drill.outcome import FaultOutcome
from teleop_drill.nodes.drill_rig import LiveRig

_PATIENCE = 1.0  # waiting time for an arm that resumes by itself [s]
_LONGEST = 60.0  # longest time until an arm follows again [s]
_STRENGTH = (Cure.NOTHING, Cure.RESUME, Cure.RESET, Cure.RESTART)


def note_state(outcome: FaultOutcome, rig: LiveRig, before: dict[str, float]) -> None:
    """Store in the outcome the state that followed, and the node that reported it first."""
    begin_ns = rig.begin_ns
    told: list[tuple[int, str]] = []
    for sent_ns, report in rig.tap.reports(topics.SLAVE_OPERATION):
        if sent_ns >= begin_ns and any(report[name] != before.get(name) for name in ("state", "fault")):
            told.append((sent_ns, "slave/operation"))
            if outcome.told is None and _is_expected(report, outcome.exercise):
                outcome.told = 1e-9 * (sent_ns - begin_ns)
                outcome.fault = Fault(int(report["fault"]))
            if report["fault"] and outcome.fault is Fault.NONE:
                outcome.fault = Fault(int(report["fault"]))
    for sent_ns, report in rig.tap.reports(topics.TELEOP_STATE):
        if sent_ns >= begin_ns and not report["is_following"]:
            told.append((sent_ns, "teleop/state"))
    told += [(ns, f"diagnostics of {n}") for n, ns in rig.warned.items() if ns >= begin_ns]
    if told:
        first_ns, outcome.told_by = min(told)
        outcome.detected = 1e-9 * (first_ns - begin_ns)
    if rig.session.is_running("slave"):
        operation = rig.operation()
        outcome.state, outcome.is_braked = State(int(operation["state"])), bool(operation["is_braked"])


def seen_of(outcome: FaultOutcome, rig: LiveRig, time_ns: tuple[int, int], scheduling: Scheduling) -> Tapped:
    """Return the messages that the tap received during a fault, and the slave's own reports.

    Args:
        outcome: Outcome with the reports.
        rig: The session.
        time_ns: Begin and end of the fault [ns].
        scheduling: Wake-up delays of this machine at the start.
    """
    begin_ns, end_ns = time_ns
    true_cp, measured_cp, setpoints, joints = rig.tap.traces(
        topics.SLAVE_TRUE_CP, topics.SLAVE_MEASURED_CP, topics.SLAVE_SETPOINT_JS, topics.SLAVE_MEASURED_JS
    )
    tip = true_cp if len(true_cp) else measured_cp  # only a simulator publishes the true pose
    told_ns = None if outcome.told is None else begin_ns + round(1e9 * outcome.told)
    warned = [ns for ns in rig.warned.values() if ns >= begin_ns]
    return Tapped(
        begin_ns, end_ns, setpoints, joints, tip, told_ns, min(warned, default=None),
        rig.tap.scheduling(begin_ns).beside(scheduling), max(0.0, 1e-9 * (rig.woken_ns - begin_ns)),
    )  # fmt: skip


def _is_expected(report: dict[str, float], exercise: Exercise) -> bool:
    """Whether a report contains the state that an exercise expects."""
    is_fault = not exercise.faults or Fault(int(report["fault"])) in exercise.faults
    return is_fault and State(int(report["state"])) in exercise.states


def recover(outcome: FaultOutcome, rig: LiveRig) -> None:
    """Wait until the arm follows again, and send more and more of the commands that it may need."""
    begin, used = rig.now(), Cure.NOTHING
    while (elapsed := rig.now() - begin) < _LONGEST:
        if rig.is_following():
            outcome.recovered, outcome.cure = elapsed, used
            break
        if elapsed > _PATIENCE or rig.operation().get("state") != State.ENABLED:
            used = max(used, help_on(rig), key=_STRENGTH.index)
        rig.wait(0.05)
    if rig.session.dead():
        rig.session.start()


def help_on(rig: LiveRig) -> Cure:
    """Send the commands that the arm needs in its state."""
    if rig.session.dead():
        rig.session.start()
        return Cure.RESTART
    operation = rig.operation()
    state = operation.get("state")
    if state == State.PAUSED:
        rig.command("resume")
        return Cure.RESUME
    if state == State.FAULT:
        rig.command("reset")
    if state in {State.FAULT, State.DISABLED}:
        rig.command("enable")
        return Cure.RESET
    if state == State.ENABLED and not operation["is_homed"] and not operation["is_busy"]:
        rig.command("home")
        return Cure.RESET
    return Cure.NOTHING
