"""Agenda: timers and deferred work of one node, served by the executor's thread.

rclpy registers each timer and guard condition with the middleware and passes all of them to every wait. Here they are
plain Python objects: the executor asks for the next due time and waits no longer than that.
"""

import time
from collections import deque
from collections.abc import Callable

NEVER_NS = 2**63 - 1
"""Due time of an agenda without timers [ns]."""
_TOGETHER_NS = 1_000_000_000
Work = Callable[[], object]


class Timer:
    """See :class:`~teleop_core.middleware.platform.Timer`.

    A late call does not delay later calls, and missed calls are not made up. Calls of timers with a period below a
    second are at multiples of the period, so that all timers of one period wake the executor together.

    Args:
        period: Time between two calls [s].
        callback: Function to call.
        agenda: Agenda of the timer.
    """

    def __init__(self, period: float, callback: Work, agenda: "Agenda") -> None:
        self._period_ns, self.callback, self._agenda = max(1, round(period * 1e9)), callback, agenda
        self._is_canceled = False
        self.due_ns = self._next_ns()

    def _next_ns(self) -> int:
        due_ns = time.monotonic_ns() + self._period_ns
        return due_ns if self._period_ns >= _TOGETHER_NS else due_ns - due_ns % self._period_ns

    def cancel(self) -> None:
        """Pause the timer."""
        self._is_canceled = True

    def reset(self) -> None:
        """Continue the timer; the next call is one period from now."""
        self.due_ns, self._is_canceled = self._next_ns(), False
        self._agenda.wake()

    def is_canceled(self) -> bool:
        """Whether the timer is paused."""
        return self._is_canceled

    def advance(self, now_ns: int) -> None:
        """Set the next due time after a call at ``now_ns`` [ns]."""
        self.due_ns += self._period_ns * (1 + max(0, now_ns - self.due_ns) // self._period_ns)


class Agenda:
    """Timers and deferred work of a node.

    Attributes:
        wake: Lets the executor return from its wait; does nothing before the node has an executor.
    """

    def __init__(self) -> None:
        self.wake: Work = _nothing
        self._timers: tuple[Timer, ...] = ()
        self._work: deque[Work] = deque()

    def timer(self, period: float, callback: Work) -> Timer:
        """Add a timer; the period is in [s]."""
        made = Timer(period, callback, self)
        self._timers = (*self._timers, made)
        self.wake()
        return made

    def drop(self, timer: Timer) -> None:
        """Remove a timer."""
        timer.cancel()
        self._timers = tuple(one for one in self._timers if one is not timer)

    def defer(self, work: Callable[..., object], *arguments: object) -> None:
        """Let the executor call ``work`` soon. May be called from any thread."""
        self._work.append(lambda: work(*arguments))
        self.wake()

    def next_ns(self) -> int:
        """Monotonic time at which something is due [ns]; 0 for now."""
        if self._work:
            return 0
        return min((one.due_ns for one in self._timers if not one.is_canceled()), default=NEVER_NS)

    def serve(self, now_ns: int) -> bool:
        """Do one thing that is due at ``now_ns`` [ns]; return whether there was one."""
        if self._work:
            self._work.popleft()()
            return True
        due = [one for one in self._timers if one.due_ns <= now_ns and not one.is_canceled()]
        if not due:
            return False
        first = min(due, key=lambda one: one.due_ns)
        first.advance(now_ns)
        first.callback()
        return True


class GuardCondition:
    """See :class:`~teleop_core.middleware.platform.GuardCondition`.

    Args:
        agenda: Agenda of the node.
        callback: Function to call.
    """

    def __init__(self, agenda: Agenda, callback: Work) -> None:
        self._agenda, self._callback, self._is_triggered = agenda, callback, False

    def trigger(self) -> None:
        """Let the executor call the function soon, once for all triggers until then; may be called from any thread."""
        if not self._is_triggered:
            self._is_triggered = True
            self._agenda.defer(self._call)

    def cancel(self) -> None:
        """Call the function no more."""
        self._callback = _nothing

    def _call(self) -> None:
        self._is_triggered = False
        self._callback()


def _nothing() -> None:
    """Do nothing: the node has no executor yet."""
