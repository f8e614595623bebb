"""Noise: random numbers of the coming ticks, drawn a block of ticks in advance."""

from typing import Any

import numpy as np

BLOCK = 1000
"""Largest number of ticks for which noise, and the wanted motion of a hand, is computed at once."""


class Noise:
    """Noise of a stage; the stage's kernel counts the used rows in ``next_noise`` of the stage's state.

    Attributes:
        rows: Standard normal numbers, shape (:data:`BLOCK`, 6), a row for each tick.
    """

    def __init__(self) -> None:
        self.rows = np.zeros((BLOCK, 6))

    def begin(self, rng: np.random.Generator) -> None:
        """Use a generator from now on; the state counts the rows from 0 again."""
        self._rng, self._end = rng, 0

    def prepare(self, state: Any, ticks: int) -> None:
        """Draw the numbers that the next ticks need."""
        first = int(state["next_noise"])
        left = self._end - first
        if left >= ticks:
            return
        self.rows[:left] = self.rows[first : self._end]
        self._end = BLOCK
        state["next_noise"] = 0
        self.rows[left:] = self._rng.standard_normal((BLOCK - left, 6))
