"""Loop: the thread of a node that does its work, beside the executor that serves its parameters."""

import sys
import traceback
from collections.abc import Callable

from teleop_core.base.errors import TeleopError
from teleop_core.middleware.world import World

_END_PATIENCE = 8.0  # the last turn may compile a kernel, or wait for a slow disk


class Loop:
    """Thread that takes one turn after another until it is stopped.

    Args:
        world: Where it is.
        name: Name of the thread.
        turn: One turn; blocks for a tenth of a second at most.
        fail: Told in words, and whether it was expected, why a turn could not be finished; the
            loop has ended then.
        prepare: Called once in the thread before the first turn, may take long; None if the turns
            do it themselves.
        patience: Time without any progress after which it counts as hung, less the time for which
            it waited for a processor [s]; 0: it never does.

    Attributes:
        name: Name of the thread.
        turns: Number of turns taken.
        patience: As given.
        is_running: Whether it goes on; False once it is to stop.
        is_ready: Whether it is prepared.
        is_hung: Whether a watchdog has found it so.
    """

    def __init__(
        self,
        world: World,
        name: str,
        turn: Callable[[], None],
        fail: Callable[[str, bool], None],
        prepare: Callable[[], None] | None = None,
        patience: float = 0.0,
    ) -> None:
        self.name, self.turns, self.patience = name, 0, patience
        self.is_ready = self.is_hung = False
        self._turn, self._fail, self._prepare = turn, fail, prepare
        self.is_running, self._world = True, world
        self._thread = world.thread(name, self._run)

    def start(self) -> None:
        """Begin with the turns."""
        self._thread.start()

    def stop(self) -> bool:
        """End after the present turn; returns whether it did. A loop that hangs is left behind."""
        self.is_running = False
        if self._world.thread_ident() == self._thread.ident:
            return True
        self._thread.join(0.0 if self.is_hung else _END_PATIENCE)
        return not self._thread.is_alive()

    @property
    def is_alive(self) -> bool:
        """Whether it takes turns still."""
        return self._thread.is_alive()

    @property
    def thread(self) -> int:
        """Number by which the system knows its thread; 0 before it has begun."""
        return self._thread.native_id or 0

    def place(self) -> str:
        """Where its thread is now: the innermost calls, the last one last."""
        frame = sys._current_frames().get(self._thread.ident or 0)
        if frame is None:
            return "  it has ended"
        return "".join(traceback.format_stack(frame)[-6:]).rstrip()

    def _run(self) -> None:
        turn = self._turn
        try:
            if self._prepare is not None:
                self._prepare()
                self.is_ready = True
            while self.is_running:
                turn()
                self.turns += 1
        except TeleopError as error:
            self._fail(str(error), True)
        except Exception:  # a thread would die without a word
            self._fail(traceback.format_exc(), False)
