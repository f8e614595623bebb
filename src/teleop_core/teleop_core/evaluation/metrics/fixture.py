"""Fixture: how far hand and slave left the virtual fixture while it was on."""

from collections import Counter
from dataclasses import dataclass

import numpy as np

from teleop_core.coupling.fixtures.reported_fixture import ReportedFixture
from teleop_core.evaluation import MISSING, Context, Metric, Moments, TableRow, Window, keys_of, row
from teleop_core.evaluation.metric import figure
from teleop_core.evaluation.published import BOX_OVERSHOOT_MM, Gains
from teleop_core.evaluation.stamps import StampTallies
from teleop_core.evaluation.state_history import States
from teleop_core.graph.topics import SLAVE_MEASURED_CP, SLAVE_SERVO_CP, Topic
from teleop_core.kernels.geometry import Array
from teleop_core.shapes.box import BOX


def fixture_depth(positions: Array, states: States, axes: Array) -> Array:
    """Distance (N,) [m] of points outside of the fixture to the fixture's nearest point; zero inside.

    The distance is NaN for points that are not finite, and for fixtures of unknown shape.

    Args:
        positions: Points in the slave's base, shape (N, 3), [m].
        states: State at the time of each point, with the fixture on.
        axes: Rotation (3, 3) from the master's base to the slave's axes.
    """
    offsets, gain = positions - states.center, states.column("gain")
    depth = np.full(len(positions), np.nan)
    for fixture, count in states.fixture_counts().items():
        if not fixture.fault:
            here = states.is_told(fixture) if count < len(positions) else slice(None)
            depth[here] = fixture.depths(offsets[here], gain[here], axes)
    return depth


GROUP = "virtual fixture"


@dataclass(frozen=True)
class FixtureScore:
    """Score of the time in which a fixture was on; values are None if no fixture was ever on."""

    on_s: float = figure("s", "time with the fixture on")
    outside_share: float | None = figure(
        "1", "share of the time with the fixture on in which the slave's tip was outside"
    )
    penetration_max_mm: float | None = figure("mm", "largest distance of the slave's tip from the fixture")
    penetration_rms_mm: float | None = figure(
        "mm", "RMS distance of the slave's tip from the fixture; 0 for samples inside"
    )
    hand_penetration_max_mm: float | None = figure(
        "mm",
        "largest distance of the slave's command from the fixture, which shows how far the hand "
        "pushed through; 0 if it stayed inside",
    )
    kind: str | None = figure("1", "kinds of fixture that were on; null if none was")
    unscored: str | None = figure(
        "1", "kinds of fixture whose shape is not known here; only on_s is scored for them; null if there is none"
    )


class FixtureMetric(Metric):
    """Penetration of the slave's tip, and of the hand.

    The hand's penetration is the command's penetration divided by the gain.
    """

    name = "fixture"
    keys = keys_of("fixture", FixtureScore)
    topics = (SLAVE_MEASURED_CP, SLAVE_SERVO_CP)

    def __init__(self, context: Context) -> None:
        self._slave, self._hand, self._outside = Moments(), Moments(), 0
        self._axes, self._stamps = context.origin.axes, context.shared(StampTallies)
        self._gains = context.shared(Gains)
        self._on: Counter[ReportedFixture] = Counter()

    def add(self, window: Window) -> None:
        """Process one window."""
        depth, held = self._depth(window, SLAVE_MEASURED_CP)
        self._outside += int((depth > 0.0).sum())
        self._slave.add(depth * 1e3)
        self._on.update(held.fixture_counts())
        depth, held = self._depth(window, SLAVE_SERVO_CP)
        with np.errstate(divide="ignore", invalid="ignore"):
            self._hand.add(depth * 1e3 / held.column("gain"))

    def _depth(self, window: Window, topic: Topic) -> tuple[Array, States]:
        """Distance (N,) [m] from the fixture at the samples with the fixture on, and the states at these samples."""
        states, positions = window.states(topic), window.samples(topic).values[:, :3]
        is_on = states.is_fixture_on
        held = states.only(is_on)
        if held is not states:
            positions = positions[is_on]
        return fixture_depth(positions, held, self._axes), held

    def values(self) -> FixtureScore:
        """Score of everything so far."""
        slave, count = self._slave.spread(), self._slave.count
        period_us = self._stamps.of[SLAVE_MEASURED_CP.name].period_us
        period_s = 0.0 if period_us is None else period_us * 1e-6
        unknown = {fixture.kind: fixture.fault for fixture in self._on if fixture.fault}
        unscored = sum(count for fixture, count in self._on.items() if fixture.fault)
        return FixtureScore(
            on_s=(count + unscored) * period_s,
            outside_share=self._outside / count if count else None,
            penetration_max_mm=slave.max,
            penetration_rms_mm=slave.rms,
            hand_penetration_max_mm=self._hand.spread().max,
            kind=" and ".join(dict.fromkeys(fixture.kind for fixture in self._on)) or None,
            unscored="; ".join(f"{kind}: {fault}" for kind, fault in unknown.items()) or None,
        )

    def rows(self) -> list[TableRow]:
        """Rows of all values; the slave's penetration is shown beside the published overshoot of a box.

        The list is empty if no fixture was ever on.
        """
        score = self.values()
        if not score.on_s:
            return []
        share = None if score.outside_share is None else 100.0 * score.outside_share
        kind = score.kind or BOX.name
        is_comparable = kind == BOX.name and self._gains.published is not None
        published = BOX_OVERSHOOT_MM if is_comparable else None
        rows = [
            TableRow(GROUP, f"{kind} on for", "s", f"{score.on_s:.1f}"),
            row(GROUP, "slave outside, max", "mm", score.penetration_max_mm, published),
            row(GROUP, "slave outside, RMS", "mm", score.penetration_rms_mm),
            TableRow(GROUP, "slave outside, time", "%", MISSING if share is None else f"{share:.1f}"),
            row(GROUP, "hand outside, max", "mm", score.hand_penetration_max_mm),
        ]
        unknown = dict.fromkeys(fixture.kind for fixture in self._on if fixture.fault)
        return rows + [TableRow(GROUP, "shape not known", "", ", ".join(unknown))] * bool(unknown)
