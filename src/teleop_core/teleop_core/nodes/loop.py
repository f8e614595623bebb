"""Loop: the thread of a node that does its work, beside the executor that serves its parameters."""

import threading
import traceback
from collections.abc import Callable

from teleop_core.errors import TeleopError


class Loop:
    """Thread that takes one turn after another until it is stopped.

    Args:
        name: Name of the thread.
        turn: One turn; blocks for a tenth of a second at most.
        fail: Told in words, and whether it was expected, why a turn could not be finished; the
            loop has ended then.
        prepare: Called once in the thread before the first turn.
    """

    def __init__(
        self,
        name: str,
        turn: Callable[[], None],
        fail: Callable[[str, bool], None],
        prepare: Callable[[], None],
    ) -> None:
        self._turn, self._fail, self._prepare = turn, fail, prepare
        self._is_running = True
        self._thread = threading.Thread(target=self._run, name=name, daemon=True)
        self._thread.start()

    def stop(self) -> None:
        """End after the present turn."""
        self._is_running = False
        if threading.current_thread() is not self._thread:
            self._thread.join()

    def _run(self) -> None:
        turn = self._turn
        try:
            self._prepare()
            while self._is_running:
                turn()
        except TeleopError as error:
            self._fail(str(error), True)
        except Exception:  # a thread would die without a word
            self._fail(traceback.format_exc(), False)
