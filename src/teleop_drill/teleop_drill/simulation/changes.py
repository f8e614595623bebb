"""Changes: whether an arm changes its state by commands only, keeps a held stop, and pauses by itself."""

import math
from collections.abc import Callable
from typing import Any

from teleop_core.graph.operation import State
from teleop_core.slave.velocity import MotionSource
from teleop_drill.drill.numbers import Numbers
from teleop_drill.simulation import sometimes
from teleop_drill.simulation.drilled_session import DrilledSession

_ANSWERED = 1.0
"""Longest time until a command is answered [s]."""
_PAUSED = 0.15
"""Longest time until an arm pauses after an outage that is too long [s]; the same time must have passed since."""
_STILL = 0.04
"""Shortest rest of the setpoint before an arm becomes ENABLED [s]; the arm itself rests for somewhat longer."""
_ENABLED, _PAUSED_STATE, _FAULT = int(State.ENABLED), int(State.PAUSED), int(State.FAULT)
_FOLLOWING = int(MotionSource.FOLLOWING)


class StateChanges:
    """Checks the laws ``asked``, ``pause``, and a part of ``stop`` in one session.

    Times are running times of the slave's process [s].

    Args:
        stage: The session.
        numbers: Numbers from the session's parameters.
        count: Function that counts a check of a law.
        tell: Function that takes a broken law and the text about it.
    """

    def __init__(
        self, stage: DrilledSession, numbers: Numbers, count: Callable[[str], None], tell: Callable[[str, str], None]
    ) -> None:
        self._stage, self._longest, self._count, self._tell = stage, numbers.longest_outage, count, tell
        self._asked: dict[str, float] = {}  # when each command was last sent
        self._asks, self._now, self._late = 0, 0.0, 0.0
        self.begin()

    def begin(self) -> None:
        """Begin with another slave."""
        self._due: dict[int, float] = {}  # from when on each held button must keep the arm stopped
        self._state, self._was_homing, self._broke_off, self._moved_at = -1, False, False, -math.inf
        self._silent = self._stood = 0.0
        self._leave_by = math.inf

    def hold(self, button: int, due: float) -> None:
        """Note from which time on a pressed button must keep the arm stopped."""
        self._due[button] = due

    def stand(self, seconds: float) -> None:
        """Note that the slave's process stood still for some time [s]."""
        self._stood += seconds

    def judge(self, slave: Any, now: float, late: float, silence: float) -> None:
        """Check the laws now and then.

        Args:
            slave: Node of the slave.
            now: Time [s].
            late: Delay that lines and processors of the machine may add [s].
            silence: Time since the arm last followed a new command [s].
        """
        self._now, self._late = now, late
        asked, state = self._stage.asked, slave.stage.state
        self._asked.update(dict.fromkeys(asked[self._asks :], now))
        self._asks = len(asked)
        held = self._stage.held if not self._was_asked(sometimes.RELEASE) else set()
        self._due = {button: due for button, due in self._due.items() if button in held}
        self._judge_change(state)
        self._judge_pause(state, silence)

    def _was_asked(self, *names: str) -> bool:
        """Whether one of these commands may have been answered just now; a script sends some that nobody hears."""
        return self._stage.is_scripted or any(
            self._asked.get(name, -math.inf) >= self._now - _ANSWERED - self._late for name in names
        )

    def _judge_change(self, state: Any) -> None:
        before, after = self._state, int(state["state"])
        was_homing, self._was_homing = self._was_homing, bool(state["is_homing"])
        self._state = after
        still = self._now - self._moved_at
        if state["step"].any():
            self._moved_at = self._now
        if before in {-1, after}:
            return
        self._count("asked")
        change = f"{State(before).name} became {State(after).name}"
        if after == _ENABLED and not self._was_asked("enable", "resume"):
            self._tell("asked", f"{change} without a command")
        if after == _ENABLED and still < _STILL:
            self._tell("asked", f"{change} before it was at rest")
        if after == _PAUSED_STATE:
            self._broke_off = was_homing
        is_resumed = (before, after) == (_PAUSED_STATE, _ENABLED) and not self._was_asked("enable", "unhome")
        if is_resumed and self._broke_off and not (self._was_homing or state["is_homed"]):
            self._tell("asked", "resume does not go on with the move home that a pause broke off")
        if before == _FAULT and not self._was_asked("reset", "disable"):
            self._tell("asked", f"{change} without a command")
        if before == _FAULT and any(due + self._late < self._now for due in self._due.values()):
            self._tell("stop", f"{change} while a stop button was held")

    def _judge_pause(self, state: Any, silence: float) -> None:
        """Check that an arm pauses whose commands, or whose own loop, stood still for too long."""
        self._count("pause")
        is_enabled = state["state"] == _ENABLED
        if self._stood > self._longest + _PAUSED and is_enabled:
            self._leave_by = self._now + _PAUSED + self._late
        if not is_enabled or self._was_asked("enable", "resume"):
            self._silent = self._stood = 0.0
            self._leave_by = math.inf
            return
        follows = state["is_stream"] and not state["is_busy"] and state["motion"] == _FOLLOWING
        since = self._silent if follows and silence > self._longest + _PAUSED else self._now
        self._silent, self._stood = since or self._now, 0.0
        if self._now - self._silent > _PAUSED + self._late:
            self._tell("pause", f"is ENABLED after {silence:.1f} s without a command")
        if self._now > self._leave_by:
            self._tell("pause", "is ENABLED after its loop stood still")
