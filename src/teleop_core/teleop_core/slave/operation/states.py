"""States of an arm and the transitions between them, in one table that all run modes use.

The states and commands are those of CRTK (Collaborative Robotics Toolkit, robot operating states), with two more
commands. ``stop`` is the emergency stop, which is accepted in every state. Only ``reset`` ends it.
"""

from enum import IntEnum

import numpy as np

from teleop_core.base import UnknownNameError
from teleop_core.graph import topics
from teleop_core.graph.operation import State
from teleop_core.kernels import Fields, inner


class Event(IntEnum):
    """Events that may change the state: commands, and events that the arm detects itself."""

    ENABLE = 0
    DISABLE = 1
    PAUSE = 2
    RESUME = 3
    HOME = 4
    UNHOME = 5
    RESET = 6
    STOP = 7
    MOVE = 8  # a move to a goal begins
    ARRIVED = 9  # the move has ended
    FAILED = 10  # a fault that latches
    LAPSED = 11  # no commands came for so long that only an explicit command resumes motion


COMMANDS = topics.STATE_COMMANDS
"""Events that people and programs send, by name."""


class Answer(IntEnum):
    """Answer to an event."""

    DONE = 0
    ALREADY = 1  # the event is accepted, but the arm is already in the state
    REFUSED = 2  # the event is refused in this state
    STOPPED = 3  # the emergency stop is still pressed, or must be reset first
    BRAKING = 4  # the arm is not at rest yet


_D, _E, _P, _F = State.DISABLED, State.ENABLED, State.PAUSED, State.FAULT
_NEXT = {
    Event.ENABLE: {_D: _E, _E: _E, _P: _E},
    Event.DISABLE: {_D: _D, _E: _D, _P: _D, _F: _D},
    Event.PAUSE: {_E: _P, _P: _P},
    Event.RESUME: {_E: _E, _P: _E},
    Event.HOME: {_E: _E},
    Event.UNHOME: {_D: _D, _E: _E, _P: _P, _F: _F},
    Event.RESET: {_D: _D, _E: _E, _P: _P, _F: _D},
    Event.STOP: {_D: _F, _E: _F, _P: _F, _F: _F},
    Event.MOVE: {_E: _E},
    Event.ARRIVED: {_E: _E},
    Event.FAILED: {_D: _F, _E: _F, _P: _F, _F: _F},
    Event.LAPSED: {_E: _P},
}
TABLE = np.array([[_NEXT[event].get(state, -1) for event in Event] for state in State], dtype=np.int64)
"""Next state for each state and event; -1 where the event is refused."""

_DONE, _ALREADY, _REFUSED = int(Answer.DONE), int(Answer.ALREADY), int(Answer.REFUSED)
_STOPPED, _BRAKING = int(Answer.STOPPED), int(Answer.BRAKING)
_ENABLED, _PAUSED, _FAULT = int(_E), int(_P), int(_F)
_ENABLE, _DISABLE, _HOME, _UNHOME = (int(Event.ENABLE), int(Event.DISABLE), int(Event.HOME), int(Event.UNHOME))
_RESET, _STOP, _MOVE, _ARRIVED = (int(Event.RESET), int(Event.STOP), int(Event.MOVE), int(Event.ARRIVED))
_RESUME, _LAPSED = int(Event.RESUME), int(Event.LAPSED)


AFTER_RESET = 4
"""Value of ``must_join`` after a reset: only an arm that is not at its setpoint makes the setpoint move."""


class OperatingState(Fields):
    """Fields of a state record that :func:`change` reads and writes."""

    state: int
    is_homed: int
    is_busy: int
    is_homing: int
    must_plan: int  # a move must be planned; during homing it is the move to the start position
    is_stopped: int  # an emergency stop is latched
    is_pressed: int  # the cause of the stop still exists
    is_moving: int  # the arm is not at rest
    must_join: int  # the setpoint goes to the measured position, after a reset or after lost feedback
    must_home: int  # a pause interrupted homing; resume restarts homing
    fault: int
    fault_joint: int
    fault_value: float
    fault_bound: float


@inner
def change(s: OperatingState, event: int) -> int:
    """Take an event: write the state record, return the :class:`Answer`."""
    state, follower = s.state, TABLE[s.state, event]
    if follower < 0:
        return _REFUSED
    if state == _FAULT and event == _RESET and s.is_pressed:
        return _STOPPED
    if state == _FAULT and event == _DISABLE and s.is_stopped:
        return _STOPPED
    if event in (_ENABLE, _RESUME) and state != _ENABLED and s.is_moving:
        return _BRAKING
    if event == _MOVE and not s.is_homed:
        return _REFUSED
    answer = _ALREADY if follower == state else _DONE
    if follower == _FAULT and state != _FAULT:
        s.must_join = 0
    if event != _RESUME and follower != state:
        s.must_home = s.is_homing if follower == _PAUSED else 0
    answer = _take(s, event, answer)
    if follower != _ENABLED:
        s.is_busy = s.is_homing = s.must_plan = 0
    if follower not in (state, _FAULT) and event != _LAPSED:
        s.fault, s.fault_joint, s.fault_value, s.fault_bound = 0, -1, 0.0, 0.0
    s.state = follower
    return answer


@inner
def _take(s: OperatingState, event: int, answer: int) -> int:
    """Apply the effects of an event other than the change of state."""
    if event == _HOME or (event == _RESUME and s.must_home):
        s.is_busy, s.is_homing, s.must_plan, s.is_homed, s.must_home = 1, 1, 1, 0, 0
        return _DONE
    if event == _UNHOME:
        was = s.is_homed or s.is_homing
        s.is_homed = s.is_homing = s.is_busy = s.must_plan = s.must_home = 0
        return _DONE if was else _ALREADY
    if event == _STOP:
        was = s.is_stopped
        s.is_stopped = 1
        return _ALREADY if was else _DONE
    if event == _RESET:
        s.is_stopped, s.must_join = 0, AFTER_RESET
    if event == _MOVE:
        s.is_busy, s.must_plan = 1, 1
        return _DONE
    if event == _ARRIVED:
        if s.is_homing:
            s.is_homed, s.is_homing = 1, 0
        s.is_busy = 0
        return _DONE
    return answer


def command_event(name: str) -> Event:
    """Event of a command's name, such as ``"enable"``.

    Raises:
        UnknownNameError: There is no such command.
    """
    if name not in COMMANDS:
        raise UnknownNameError("state command", name, COMMANDS)
    return Event[name.upper()]


AT_REST_ONLY = "the arm is not at rest yet; try again"
"""Last part of the answer to a command that an arm accepts only at rest."""


STILL_PRESSED = "the emergency stop is still pressed"
"""Part of the answer to a reset while a stop button is pressed or silent."""


def answer_text(event: Event, answer: Answer, state: State) -> str:
    """Answer to an event in words, with advice if the event was refused.

    Args:
        event: The event.
        answer: Result of :func:`change`.
        state: State before the event.
    """
    name = event.name.lower()
    if answer is Answer.DONE:
        return f"{name}: done"
    if answer is Answer.ALREADY:
        return f"{name}: nothing to do, it is {state.name}"
    if answer is Answer.STOPPED:
        if event is Event.RESET:
            return f"{name} refused: {STILL_PRESSED}; release it first"
        return f"{name} refused: an emergency stop is latched; reset first"
    if answer is Answer.BRAKING:
        return f"{name} refused: {AT_REST_ONLY}"
    allowed = [other.name for other in State if TABLE[other, event] >= 0]
    hint = {
        State.FAULT: "; reset first, then enable",
        State.DISABLED: "; enable first",
        State.PAUSED: "; resume first",
    }.get(state, "; home first" if event is Event.MOVE else "")
    return f"{name} refused in {state.name}, allowed in {', '.join(allowed)}{hint}"
