"""Loop: the working thread of a node; the executor serves the node's parameters in another thread."""

import sys
import traceback
from collections.abc import Callable

from teleop_core.base.errors import TeleopError
from teleop_core.middleware.world import World

_END_PATIENCE = 8.0  # longest wait for the last turn [s], which may compile a kernel or wait for a slow disk


class Loop:
    """Thread that makes one turn after another until it is stopped.

    Args:
        world: World of the loop.
        name: Name of the thread.
        turn: Makes one turn; blocks for at most a tenth of a second.
        fail: Called when a turn failed and the loop has ended, with the reason and whether it was expected.
        prepare: Called once in the thread before the first turn, may take long; None if the turns prepare themselves.
        patience: Time without progress after which the loop counts as hung, without the time for which it waited for a
            processor [s]; 0: never.

    Attributes:
        name: Name of the thread.
        turns: Number of finished turns.
        patience: As given.
        is_running: Whether the loop continues; False after it was asked to stop.
        is_ready: Whether the loop is prepared for its turns.
        is_hung: Whether a watchdog found that it hangs.
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
        """Start the thread."""
        self._thread.start()

    def stop(self) -> bool:
        """End after the current turn; returns whether the loop has ended. A loop that hangs is abandoned."""
        self.is_running = False
        if self._world.thread_ident() == self._thread.ident:
            return True
        self._thread.join(0.0 if self.is_hung else _END_PATIENCE)
        return not self._thread.is_alive()

    @property
    def is_alive(self) -> bool:
        """Whether the thread is still running."""
        return self._thread.is_alive()

    @property
    def thread(self) -> int:
        """Number of the loop's thread in the operating system; 0 before the thread has begun."""
        return self._thread.native_id or 0

    def place(self) -> str:
        """Current position of the loop's thread in the code: the innermost calls, the most recent call last."""
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
        except Exception:  # the thread would end without a message
            self._fail(traceback.format_exc(), False)
