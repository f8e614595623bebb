"""Exercises with what people do: stop buttons, their silence, wrong parameters."""

from teleop_core.drill.exercise import Cure, Exercise, Motion, Rig
from teleop_core.operation import Fault, State

HEARTBEAT = 0.5
"""Silence of the stop button that counts as pressed, while it is drilled [s]."""
_AT_ONCE = 2e-3  # what a stop may take


def _press(rig: Rig) -> None:
    rig.mark()
    rig.press(is_pressed=True)


def _release(rig: Rig) -> None:
    for _ in range(5):  # a reader on a bad line may miss one
        rig.press(is_pressed=False)
        rig.wait(0.01)


def _call(rig: Rig) -> None:
    rig.mark()
    rig.command("stop")


def _disable(rig: Rig) -> None:
    rig.mark()
    rig.command("disable")


def _miss_heartbeat(rig: Rig) -> None:
    for count in range(20):
        rig.press(is_pressed=False)
        rig.wait(0.02)
        if count == 1:
            rig.set("slave_sim", "operation.heartbeat", HEARTBEAT)
    rig.press(is_pressed=False)
    rig.mark()


def _hear_again(rig: Rig) -> None:
    rig.set("slave_sim", "operation.heartbeat", 0.0)
    _release(rig)


def _press_while_masked(rig: Rig) -> None:
    """Press, then claim that it is released and ask for motion, without a reset."""
    rig.mark()
    rig.press(is_pressed=True)
    rig.wait(0.1)
    rig.press(is_pressed=False)
    is_taken = rig.command("enable") or rig.command("resume")
    rig.note("taken" if is_taken else "refused")


def _load_joints(rig: Rig) -> None:
    """Friction that no drive overcomes: as a payload far too heavy, or a hand that holds."""
    rig.mark()
    rig.set("slave_sim", "coulomb", (2.0 * rig.effort_limit()).tolist())


def _unload(rig: Rig) -> None:
    rig.set("slave_sim", "coulomb", [])


def _take_bad_gains(rig: Rig) -> None:
    """A bandwidth at which no sampled loop at 1 kHz is stable."""
    rig.mark()
    is_taken = rig.set("slave_sim", "controller.pid.bandwidth", [3000.0] * len(rig.setpoint()))
    rig.note("taken" if is_taken else "refused")


def _take_slack_gains(rig: Rig) -> None:
    """A bandwidth at which the arm follows nothing."""
    rig.mark()
    is_taken = rig.set("slave_sim", "controller.pid.bandwidth", [0.1] * len(rig.setpoint()))
    rig.note("taken" if is_taken else "refused")


def _take_good_gains(rig: Rig) -> None:
    rig.set("slave_sim", "controller.pid.bandwidth", [])


STOPS = (
    Exercise(
        name="stop_topic", text="emergency stop by topic", inject=_press, undo=_release,
        states=(State.FAULT,), faults=(Fault.STOP,), cures=(Cure.RESET,), allowed=_AT_ONCE,
        watch=0.2, repeats=20,
    ),
    Exercise(
        name="stop_service", text="emergency stop by service", inject=_call,
        states=(State.FAULT,), faults=(Fault.STOP,), cures=(Cure.RESET,), allowed=0.02,
    ),
    Exercise(
        name="stop_latched", text="stop released, enable and resume without reset",
        inject=_press_while_masked, undo=_release,
        states=(State.FAULT,), faults=(Fault.STOP,), cures=(Cure.RESET,), allowed=_AT_ONCE,
    ),
    Exercise(
        name="heartbeat", text="stop button falls silent (heartbeat 0.5 s)",
        inject=_miss_heartbeat, undo=_hear_again,
        states=(State.FAULT,), faults=(Fault.HEARTBEAT,), cures=(Cure.RESET,),
        allowed=HEARTBEAT + 5e-3, watch=2.0 * HEARTBEAT,
    ),
    Exercise(
        name="disable", text="disabled by service", inject=_disable,
        states=(State.DISABLED,), cures=(Cure.RESET,), allowed=0.02,
    ),
    Exercise(
        name="stuck", text="joints held fast: friction over all drives", inject=_load_joints,
        undo=_unload, states=(State.FAULT,), faults=(Fault.TRACKING, Fault.TIP, Fault.EFFORT),
        cures=(Cure.RESET,), allowed=1.5, watch=4.0,
    ),
    Exercise(
        name="wild_gains", text="gains that are unstable at 1 kHz", inject=_take_bad_gains,
        undo=_take_good_gains, motion=Motion.GOES_ON, states=(State.ENABLED,),
        cures=(Cure.NOTHING,),
    ),
    Exercise(
        name="slack_gains", text="gains that follow nothing", inject=_take_slack_gains,
        undo=_take_good_gains, motion=Motion.GOES_ON, states=(State.ENABLED, State.FAULT),
        faults=(Fault.NONE, Fault.TRACKING, Fault.TIP), cures=(Cure.NOTHING, Cure.RESET), watch=2.0,
    ),
)  # fmt: skip
"""What people do, rightly and wrongly."""
