"""Noise: random numbers of the coming ticks, drawn a block ahead of them."""

from typing import Any

import numpy as np

BLOCK = 1000
"""Ticks for which noise, and what a hand wants, is drawn at once, at most."""


class Noise:
    """Noise of a stage, whose kernel counts the rows that it took in ``next_noise`` of its state.

    Attributes:
        rows: Standard normal numbers, shape (:data:`BLOCK`, 6), a row for each tick.
    """

    def __init__(self) -> None:
        self.rows = np.zeros((BLOCK, 6))

    def begin(self, rng: np.random.Generator) -> None:
        """Draw from a generator from now on; the state counts from row 0 again."""
        self._rng, self._end = rng, 0

    def prepare(self, state: Any, ticks: int) -> None:
        """Draw what the next ticks take."""
        first = int(state["next_noise"])
        left = self._end - first
        if left >= ticks:
            return
        self.rows[:left] = self.rows[first : self._end]
        self._end = BLOCK
        state["next_noise"] = 0
        self.rows[left:] = self._rng.standard_normal((BLOCK - left, 6))
