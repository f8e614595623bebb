"""Exercises with actions of people: stop buttons, silent buttons, wrong parameters."""

import math
from collections.abc import Callable
from functools import partial
from typing import Any

from teleop_core.graph.operation import State
from teleop_core.slave.operation import Fault
from teleop_drill.drill import hand
from teleop_drill.drill.exercise import AllowedMotion, Cure, Exercise, Rig, Time, after, at_once, nothing
from teleop_drill.drill.inside import RACES, STICKS, WORKS

HEARTBEAT = 0.5
"""Silence of the stop button after which it counts as pressed, in exercises with heartbeats [s]."""
_SERVICE = 0.02
"""Time in which a service call must reach the arm's loop, through the executors of both sides [s]."""
_RACE = 0.1
"""Time in which the slave must detect a joint at twice its speed [s]; the drill pushes the joint every 5 ms."""
_STILL = 0.3  # silence that is too short to pause the arm [s]
_BEAT = 0.02  # time between two messages of a stop button [s]
_REFUSED = "refused"
_ROUNDS = 2.0  # time in which the hand on its circle has pulled in every direction [s]


def _press(rig: Rig) -> None:
    rig.mark()
    rig.press(is_pressed=True)


def _press_briefly(rig: Rig) -> None:
    """Send one message with a press, then many with a release; a short queue would lose the press.

    The process of the slave is stopped during this time, so all these messages wait for it.
    """

    def press() -> None:
        rig.press(is_pressed=True)
        for _ in range(30):
            rig.press(is_pressed=False)

    rig.freeze("slave", _STILL, press)


def _release(rig: Rig) -> None:
    for _ in range(5):  # send several messages, because a reader on a bad line may miss one
        rig.press(is_pressed=False)
        rig.wait(0.01)


def _call(rig: Rig) -> None:
    rig.mark()
    rig.command("stop")


def _disable(rig: Rig) -> None:
    rig.mark()
    rig.command("disable")


def _miss_heartbeat(rig: Rig) -> None:
    """Send heartbeats of two buttons, then heartbeats of only one button."""
    for count in range(20):
        for button in (1, 0):
            rig.press(is_pressed=False, button=button)
        rig.wait(_BEAT)
        if count == 1:
            rig.set("slave", "operation.heartbeat", HEARTBEAT)
    rig.press(is_pressed=False)
    rig.mark()
    for _ in range(round(2.0 * HEARTBEAT / _BEAT)):
        rig.press(is_pressed=False, button=1)
        rig.wait(_BEAT)


def _hear_again(rig: Rig) -> None:
    rig.set("slave", "operation.heartbeat", 0.0)
    _release(rig)


def _note_answer(rig: Rig, *, is_taken: bool) -> None:
    rig.note("taken" if is_taken else _REFUSED)


def _press_while_masked(rig: Rig) -> None:
    """Press and request a reset; then release, and request motion without a reset."""
    rig.press(is_pressed=True)
    rig.wait(0.5)  # wait until the arm is at rest; before, enable is refused
    is_taken = rig.command("reset")
    rig.press(is_pressed=False)
    is_taken = rig.command("enable") or rig.command("resume") or is_taken
    _note_answer(rig, is_taken=is_taken)


def _press_two(rig: Rig) -> None:
    """Press one button; a second button then publishes that it is not pressed."""
    rig.press(is_pressed=False, button=1)  # the slave knows the second button before the press
    rig.press(is_pressed=True)
    rig.wait(0.5)
    rig.press(is_pressed=False, button=1)
    rig.wait(0.1)
    _note_answer(rig, is_taken=rig.command("reset"))


def _press_homing(rig: Rig) -> None:
    """Press while the arm moves to its start position."""
    rig.command("home")
    rig.press(is_pressed=True)


def _press_disabled(rig: Rig) -> None:
    """Disable the arm, press and release a button that it knows, and request motion without a reset."""
    rig.press(is_pressed=False)
    rig.command("disable")
    rig.wait(0.5)  # wait until the arm is at rest; before, enable is refused
    rig.press(is_pressed=True)
    rig.press(is_pressed=False)
    rig.wait(_BEAT)
    _note_answer(rig, is_taken=rig.command("enable") or rig.command("resume"))


def _override(rig: Rig) -> None:
    """Press a button, override it by the service ``release``, and request motion without a reset."""
    rig.press(is_pressed=True)
    rig.wait(0.5)
    is_overridden = rig.command("release")
    is_taken = rig.command("enable") or rig.command("resume")
    _note_answer(rig, is_taken=is_taken or not is_overridden)


def _resume_early(rig: Rig) -> None:
    """Pause and resume immediately, so that the arm still brakes when the resume comes."""
    rig.mark()
    _note_answer(rig, is_taken=rig.commands("pause", "resume")[1])


def _hold_fast(fault: Fault, rig: Rig) -> None:
    """Make the joints stick by friction that no drive overcomes, as with a far too heavy payload."""
    others = [one.word for one in _STUCK if one is not fault]
    rig.set("slave", "operation.reported", others)
    if fault is Fault.TIP:
        rig.set("slave", "operation.tip_error", 0.5 * hand.RADIUS)
    rig.mark()
    rig.control(STICKS)


def _run_away(rig: Rig) -> None:
    """Make one joint race as if its drive ignored all commands; only the check of its speed may stop the arm."""
    rig.set("slave", "operation.reported", [one.word for one in _STUCK if one is not Fault.OVERSPEED])
    rig.mark()
    rig.control(RACES)


def _let_go(rig: Rig) -> None:
    rig.control(WORKS)
    rig.set("slave", "operation.reported", [])
    rig.set("slave", "operation.tip_error", 0.0)


_STUCK = (Fault.TRACKING, Fault.TIP, Fault.EFFORT, Fault.OVERSPEED)


def _stopped(name: str, text: str, inject: Callable[[Rig], None], **more: Any) -> Exercise:
    """Exercise in which a stop ends the motion at once, and only a reset ends the fault."""
    values: dict[str, Any] = {"undo": _release, "allowed": at_once, "told": at_once} | more
    return Exercise(
        name=name, text=text, inject=inject, states=(State.FAULT,), faults=(Fault.STOP,), cures=(Cure.RESET,), **values
    )


def _stuck(fault: Fault, told: Time) -> Exercise:
    """Exercise with joints that stick, for one fault; other faults that detect this are set to be only reported.

    After the fault the drives are off. The setpoint moves back to the arm, at most across the whole circle.
    """
    return Exercise(
        name=f"stuck_{fault.word}", text=f"joints held fast; {fault.word} alone may stop them",
        inject=partial(_hold_fast, fault), undo=_let_go, states=(State.FAULT,), faults=(fault,),
        cures=(Cure.RESET,), allowed=lambda n: told(n) + 0.5 * _ROUNDS, told=told, watch=3.0,
        breaks_simulator=True, brakes=True,
    )  # fmt: skip


def _take_bad_gains(rig: Rig) -> None:
    """Set a bandwidth at which no sampled loop at 1 kHz is stable."""
    rig.mark()
    is_taken = rig.set("slave_sim", "controller.pid.bandwidth", [3000.0] * len(rig.setpoint()))
    _note_answer(rig, is_taken=is_taken)


def _take_slack_gains(rig: Rig) -> None:
    """Set a bandwidth so low that the arm follows no motion."""
    rig.mark()
    is_taken = rig.set("slave_sim", "controller.pid.bandwidth", [0.1] * len(rig.setpoint()))
    _note_answer(rig, is_taken=is_taken)


def _take_good_gains(rig: Rig) -> None:
    rig.set("slave_sim", "controller.pid.bandwidth", [])


STOPS = (
    _stopped("stop_topic", "emergency stop by topic", _press, watch=0.2, repeats=20),
    _stopped("stop_brief", "stop pressed and released while the slave stands still", _press_briefly),
    _stopped("stop_service", "emergency stop by service", _call, undo=nothing, allowed=after(_SERVICE),
             told=after(_SERVICE)),
    _stopped("stop_latched", "reset while the stop is pressed; then released, enable and resume without reset",
             _press_while_masked, said=_REFUSED),
    _stopped("stop_two", "stop pressed by one button, released by another, reset", _press_two, said=_REFUSED),
    _stopped("stop_homing", "stop pressed while the arm homes", _press_homing),
    _stopped("stop_disabled", "stop pressed and released while the arm is disabled; then enable without reset",
             _press_disabled, said=_REFUSED),
    _stopped("stop_override", "stop pressed, overridden by release, then enable without reset", _override,
             said=_REFUSED),
    Exercise(
        name="heartbeat", text="one stop button of two falls silent (heartbeat 0.5 s)",
        inject=_miss_heartbeat, undo=_hear_again,
        states=(State.FAULT,), faults=(Fault.HEARTBEAT,), cures=(Cure.RESET,),
        allowed=after(HEARTBEAT), told=after(HEARTBEAT),
    ),
    Exercise(
        name="disable", text="disabled by service", inject=_disable,
        states=(State.DISABLED,), cures=(Cure.RESET,), allowed=after(_SERVICE),
        told=after(_SERVICE),
    ),
    Exercise(
        name="resume_early", text="paused, and resumed before it is at rest",
        inject=_resume_early, states=(State.PAUSED,), cures=(Cure.RESUME,), said=_REFUSED,
        allowed=after(_SERVICE), told=after(_SERVICE),
    ),
    _stuck(Fault.TRACKING, lambda _: _ROUNDS),
    _stuck(Fault.TIP, lambda _: _ROUNDS),
    _stuck(Fault.EFFORT, lambda numbers: numbers.effort_time + 0.25 * _ROUNDS),
    Exercise(
        name="overspeed", text="a joint runs away; overspeed alone may stop it",
        inject=_run_away, undo=_let_go, motion=AllowedMotion.LED, states=(State.FAULT,),
        faults=(Fault.OVERSPEED,), cures=(Cure.RESET,), told=after(_RACE), hand_speed=math.inf,
        breaks_simulator=True, brakes=True,
    ),
    Exercise(
        name="wild_gains", text="gains that are unstable at 1 kHz", inject=_take_bad_gains,
        undo=_take_good_gains, motion=AllowedMotion.GOES_ON, states=(State.ENABLED,), said=_REFUSED,
        cures=(Cure.NOTHING,),
    ),
    Exercise(
        name="slack_gains", text="gains that follow nothing", inject=_take_slack_gains,
        undo=_take_good_gains, motion=AllowedMotion.GOES_ON, watch=2.0, said=_REFUSED,
    ),
)  # fmt: skip
"""Exercises with correct and wrong actions of people."""
