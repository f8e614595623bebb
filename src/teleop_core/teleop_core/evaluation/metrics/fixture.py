"""Fixture: how far hand and slave got out of the virtual fixture while it was on."""

from dataclasses import dataclass

import numpy as np

from teleop_core.bags.reader import Series
from teleop_core.evaluation.accumulators import Moments
from teleop_core.evaluation.context import Context
from teleop_core.evaluation.fixture_depth import fixture_depth
from teleop_core.evaluation.metric import Key, Metric
from teleop_core.evaluation.published import BOX_OVERSHOOT_MM
from teleop_core.evaluation.rows import MISSING, Row, row
from teleop_core.evaluation.stamps import StampTallies
from teleop_core.evaluation.state_history import States
from teleop_core.evaluation.windows import Window
from teleop_core.geometry import Array
from teleop_core.topics import SLAVE_MEASURED_CP, SLAVE_SERVO_CP

GROUP = "virtual fixture"


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


class FixtureMetric(Metric):
    """Penetration of the slave's tip, and of the hand, which is that of the command by the gain."""

    name = "fixture"
    keys = (
        Key("fixture.on_s", "s", "time with the box on"),
        Key("fixture.outside_share", "1", "share of that time with the slave's tip outside"),
        Key("fixture.penetration_max_mm", "mm", "largest distance of the slave's tip from the box"),
        Key("fixture.penetration_rms_mm", "mm", "root mean square of it, zero inside"),
        Key("fixture.hand_penetration_max_mm", "mm", "largest distance of the hand from its box"),
    )
    topics = (SLAVE_MEASURED_CP, SLAVE_SERVO_CP)

    def __init__(self, context: Context) -> None:
        self._slave, self._hand, self._outside = Moments(), Moments(), 0
        self._stamps = context.shared(StampTallies)

    def add(self, window: Window) -> None:
        """Take one window."""
        depth, _ = _depth(window.samples(SLAVE_MEASURED_CP), window.states(SLAVE_MEASURED_CP))
        self._outside += int((depth > 0.0).sum())
        self._slave.add(depth * 1e3)
        depth, held = _depth(window.samples(SLAVE_SERVO_CP), window.states(SLAVE_SERVO_CP))
        with np.errstate(divide="ignore", invalid="ignore"):
            self._hand.add(depth * 1e3 / held.column("gain"))

    def values(self) -> FixtureScore:
        """Score of everything so far."""
        slave, count = self._slave.spread(), self._slave.count
        period_us = self._stamps.of[SLAVE_MEASURED_CP.name].period_us
        period_s = 0.0 if period_us is None else period_us * 1e-6
        return FixtureScore(
            on_s=count * period_s,
            outside_share=self._outside / count if count else None,
            penetration_max_mm=slave.max,
            penetration_rms_mm=slave.rms,
            hand_penetration_max_mm=self._hand.spread().max,
        )

    def rows(self) -> list[Row]:
        """All of it, the slave beside the overshoot that was published."""
        box = self.values()
        share = None if box.outside_share is None else 100.0 * box.outside_share
        return [
            Row(GROUP, "box on for", "s", f"{box.on_s:.1f}"),
            row(GROUP, "slave outside, max", "mm", box.penetration_max_mm, BOX_OVERSHOOT_MM),
            row(GROUP, "slave outside, RMS", "mm", box.penetration_rms_mm),
            Row(GROUP, "slave outside, time", "%", MISSING if share is None else f"{share:.1f}"),
            row(GROUP, "hand outside, max", "mm", box.hand_penetration_max_mm),
        ]


def _depth(poses: Series, states: States) -> tuple[Array, States]:
    """Distance (N,) [m] from the fixture at the N samples with the fixture on, and their states."""
    is_on = states.is_fixture_on
    held = states.only(is_on)
    return fixture_depth(poses.values[is_on, :3], held), held
