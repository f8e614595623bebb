"""Strain: a loop with real-time priority that asks too much of its processor gives way to other programs.

A loop of SCHED_FIFO that cannot keep up would make up its ticks without end, and no other program would run on its
processor. It gives way if, over :data:`WINDOW_NS`, it uses more than 70 % of a processor or more than half of its
wake-ups are late; and at once if it misses more than :data:`BEHIND` ticks in a wake-up and still more in the next one,
because then it falls further behind by making up ticks. It then runs without priority, and a late wake-up makes one
tick, the newest, and skips the others. It takes its priority again when it uses less than half of a processor.
"""

from collections.abc import Callable

from teleop_core.middleware.platform import Platform

WINDOW_NS = 2_000_000_000
"""Time over which a loop is judged [ns]."""
MOST_USED, MOST_LATE = 0.7, 0.5
"""Share of a processor, and share of late ticks, beyond which a loop gives way."""
BEHIND = 20
"""Number of missed ticks beyond which the next wake-up must miss fewer."""
ROOM = 0.5
"""Share of a processor below which a loop takes its priority again."""


class Strain:
    """Whether a loop has given way.

    Args:
        platform: Platform of the loop.
        take_priority: Gives the loop its priority again; called in the loop.
        say: Called with a text at each change.

    Attributes:
        is_over: Whether the loop has given way.
        times: How often the loop has given way.
    """

    def __init__(self, platform: Platform, take_priority: Callable[[], object], say: Callable[[str], None]) -> None:
        self._platform, self._take_priority, self._say = platform, take_priority, say
        self.is_over, self.times = False, 0
        self._used, self._missed = 0.0, 0
        self.start()

    def start(self) -> None:
        """Begin a new time of judgement; called in the loop."""
        self._begin_ns, self._used_ns = self._platform.monotonic_ns(), self._platform.thread_time_ns()
        self._turns = self._late = 0

    def note(self, now_ns: int, missed: int, *, is_late: bool) -> None:
        """Count a wake-up of the loop; give way or take the priority again.

        Args:
            now_ns: Monotonic time [ns].
            missed: Number of ticks that the loop has missed since the last wake-up.
            is_late: Whether the loop woke late.
        """
        self._turns += 1
        self._late += is_late
        falls_behind = BEHIND < self._missed < missed and not self.is_over
        self._missed, elapsed_ns = missed, now_ns - self._begin_ns
        if elapsed_ns < WINDOW_NS and not falls_behind:
            return
        self._used = (self._platform.thread_time_ns() - self._used_ns) / max(elapsed_ns, 1)
        late = self._late / self._turns
        if not self.is_over and (falls_behind or self._used > MOST_USED or late > MOST_LATE):
            self.is_over, self.times = True, self.times + 1
            self._platform.give_way()
            self._say(f"{self.concern()}; {100.0 * late:.0f} % of its ticks were late")
        elif self.is_over and self._used < ROOM and late <= MOST_LATE:
            self.is_over = False
            self._take_priority()
            self._say(f"the loop has its priority again: it uses {100.0 * self._used:.0f} % of a processor")
        self.start()

    def concern(self) -> str:
        """Text for users about a loop that has given way."""
        used = f"it uses {100.0 * self._used:.0f} % of a processor"
        return f"the loop cannot keep up ({used}): it runs without priority and skips late ticks"
