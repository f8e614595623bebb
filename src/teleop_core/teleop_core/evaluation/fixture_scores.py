"""Fixture scores: how far hand and slave got out of the box, and how hard it pushed back."""

from dataclasses import dataclass

import numpy as np

from teleop_core.evaluation.accumulators import Moments, Spread
from teleop_core.evaluation.state_history import States
from teleop_core.geometry import Array


@dataclass(frozen=True)
class FixtureScore:
    """What happened while the box was on; None where it never was.

    Attributes:
        on_s: Time with the box on, [s].
        outside_share: Share of that time during which the slave's tip was outside, 0 to 1.
        penetration_max_mm: Largest distance of the slave's tip from the box, [mm].
        penetration_rms_mm: Root mean square of it, zero inside, [mm].
        hand_penetration_max_mm: Largest distance of the hand from its box, on the master, [mm].
    """

    on_s: float
    outside_share: float | None
    penetration_max_mm: float | None
    penetration_rms_mm: float | None
    hand_penetration_max_mm: float | None


def penetration(position: Array, center: Array, size: Array) -> Array:
    """Distance (N,) of points outside of boxes to the nearest point of the box; zero inside.

    Args:
        position: Points, shape (N, 3).
        center: Centres of the boxes, shape (N, 3), in the same frame and unit.
        size: Wall to wall, shape (N, 3).
    """
    outside = np.maximum(np.abs(position - center) - 0.5 * size, 0.0)
    depth: Array = np.sqrt(np.einsum("ij,ij->i", outside, outside))
    return depth


class FixtureTally:
    """Accumulator of a :class:`FixtureScore`."""

    def __init__(self) -> None:
        self._slave, self._hand = Moments(), Moments()
        self._outside = 0

    def add_slave(self, tip: Array, states: States) -> None:
        """Take positions (N, 3) [m] of the slave's tip, one per control tick."""
        depth = self._depth(tip, states)
        self._outside += int((depth > 0.0).sum())
        self._slave.add(depth * 1e3)

    def add_command(self, tip: Array, states: States) -> None:
        """Take commanded positions (N, 3) [m]; the hand is as far out, divided by the gain."""
        gain = states.column("gain")[states.column("is_fixture_on") > 0.0]
        with np.errstate(divide="ignore", invalid="ignore"):
            self._hand.add(self._depth(tip, states) * 1e3 / gain)

    @staticmethod
    def _depth(tip: Array, states: States) -> Array:
        is_on = states.column("is_fixture_on") > 0.0
        return penetration(tip[is_on], states.center[is_on], states.size[is_on])

    def score(self, period_s: float | None) -> FixtureScore:
        """Score of everything so far; ``period_s`` [s] is the time between two slave samples."""
        slave: Spread = self._slave.spread()
        count = self._slave.count
        return FixtureScore(
            on_s=count * (period_s or 0.0),
            outside_share=self._outside / count if count else None,
            penetration_max_mm=slave.max,
            penetration_rms_mm=slave.rms,
            hand_penetration_max_mm=self._hand.spread().max,
        )
