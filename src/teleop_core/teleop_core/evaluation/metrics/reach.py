"""Reach: share of the time in which the slave could follow the hand, and why it could not follow otherwise."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from teleop_core.evaluation import MISSING, Context, Integers, Moments, Spread, TableRow, Window, error_rows, row
from teleop_core.evaluation.metric import SPREAD_MEANING, Metric, figure, keys_of
from teleop_core.evaluation.stamps import StampTallies
from teleop_core.graph.signals import DT
from teleop_core.graph.topics import SLAVE_REACH, SLAVE_SERVO_CP, Limit
from teleop_core.kernels.geometry import Array

GROUP = "slave follows the hand"
COMPARABLE = 0.99
"""Smallest share of followed time at which values are compared with published values."""
_RESIDUAL = SLAVE_REACH.columns.index("position_residual")
_LIMIT = SLAVE_REACH.columns.index("limit")
_ALIGNING = len(Limit)  # one more cause besides the limits: the slave is being aligned
_SILENT_S = 0.5  # a longer time without a command counts as alignment [s]


@dataclass(frozen=True)
class ReachScore:
    """How well the slave followed after it began to follow; values are None if slave/reach was not recorded."""

    followed_share: float | None = figure(
        "1",
        "share of the time, since the slave first followed, in which it could follow its commands. A "
        "command whose limit in slave/reach is 0 counts as followed until the next command; so does "
        "time with the clutch pressed",
    )
    longest_s: float | None = figure("s", "longest stretch in which the slave could not follow")
    joint_share: float | None = figure("1", "share of the time in which a joint limit kept the slave from following")
    workspace_share: float | None = figure("1", "share of the time in which the command was outside the workspace")
    singularity_share: float | None = figure(
        "1", "share of the time in which the slave was too slow near a singularity"
    )
    speed_share: float | None = figure(
        "1", "share of the time in which the slave was too slow because of its joints' speed limits"
    )
    aligning_share: float | None = figure(
        "1", "share of the time in which master or slave sent nothing, or both were aligned again"
    )
    residual_mm: Spread = figure(
        "mm", f"position error of the inverse kinematics' solution for each command: {SPREAD_MEANING}"
    )
    residual_deg: Spread = figure(
        "deg", f"orientation error of the inverse kinematics' solution for each command: {SPREAD_MEANING}"
    )
    master_hz: float | None = figure("Hz", "commands per second, from the median difference of their stamps")
    interpolation: str | None = figure("1", "interpolation between two commands; null if it was not recorded")
    interpolation_ms: float | None = figure("ms", "delay that the interpolation adds; 0 with a command at every tick")


class ReachMetric(Metric):
    """Shares of time and residuals, from slave/reach."""

    name = "reach"
    keys = keys_of("reach", ReachScore)
    topics = (SLAVE_REACH,)

    def __init__(self, context: Context) -> None:
        self._distance, self._angle = Moments(), Moments()
        self._stamps = context.shared(StampTallies)
        self._interpolation = context.origin.interpolation
        self._time = np.zeros(len(Limit) + 1)  # time at each limit, then time of alignment [s]
        self._longest_s = self._open_s = 0.0
        self._last: tuple[int, int] | None = None  # stamp [ns] of the last command, and its limit

    def add(self, window: Window) -> None:
        """Process one window."""
        found, states = window.samples(SLAVE_REACH), window.states(SLAVE_REACH)
        follows = states.column("is_following") > 0.0
        left = found.values[follows, _RESIDUAL : _RESIDUAL + 2]
        self._distance.add(left[:, 0] * 1e3)
        self._angle.add(np.degrees(left[:, 1]))
        if self._last is None:  # time before the slave first followed does not count
            first = int(np.argmax(follows)) if follows.any() else len(follows)
            found, follows = found.only(np.arange(len(follows)) >= first), follows[first:]
        self._add_times(found.stamp_ns, np.where(follows, found.values[:, _LIMIT], _ALIGNING))

    def _add_times(self, stamp_ns: Integers, limits: Array) -> None:
        """Add commands. Each command counts until the next one; a long time without a command counts as alignment."""
        kinds = limits.astype(np.int64)
        if self._last is not None:
            stamp_ns = np.concatenate(([self._last[0]], stamp_ns))
            kinds = np.concatenate(([self._last[1]], kinds))
        if not len(stamp_ns):
            return
        self._last = int(stamp_ns[-1]), int(kinds[-1])
        spans = np.maximum(np.diff(stamp_ns), 0) * 1e-9
        kinds = np.where(spans > _SILENT_S, _ALIGNING, kinds[:-1])
        self._time += np.bincount(kinds, weights=spans, minlength=len(self._time))
        self._add_stretches(spans, kinds != Limit.NONE)

    def _add_stretches(self, spans: Array, is_off: NDArray[np.bool_]) -> None:
        """Add times [s] in which the slave was limited or not, to find the longest limited stretch.

        A stretch may have begun before these times.
        """
        if not len(spans):
            return
        stretch = np.cumsum(np.diff(is_off, prepend=True) != 0)
        sums = np.bincount(stretch, weights=np.where(is_off, spans, 0.0))
        sums[0] += self._open_s  # the earlier stretch continues until the first change
        self._longest_s = max(self._longest_s, float(sums.max()))
        self._open_s = float(sums[-1]) if is_off[-1] else 0.0

    def values(self) -> ReachScore:
        """Score of everything so far."""
        total = float(self._time.sum())
        shares = self._time / total if total > 0.0 else [None] * len(self._time)
        tally = self._stamps.of.get(SLAVE_SERVO_CP.name)
        period_us = tally.period_us if tally is not None else None
        return ReachScore(
            followed_share=_number(shares[Limit.NONE]),
            longest_s=self._longest_s if total > 0.0 else None,
            joint_share=_number(shares[Limit.JOINT]),
            workspace_share=_number(shares[Limit.WORKSPACE]),
            singularity_share=_number(shares[Limit.SINGULARITY]),
            speed_share=_number(shares[Limit.SPEED]),
            aligning_share=_number(shares[_ALIGNING]),
            residual_mm=self._distance.spread(),
            residual_deg=self._angle.spread(),
            master_hz=None if not period_us else 1e6 / period_us,
            interpolation=self._interpolation,
            interpolation_ms=self._delay_ms(period_us),
        )

    def _delay_ms(self, period_us: int | None) -> float | None:
        if self._interpolation is None or not period_us:
            return None
        is_slow = self._interpolation != "none" and period_us > 1.5e6 * DT
        return period_us * 1e-3 if is_slow else 0.0

    def rows(self) -> list[TableRow]:
        """Rows of tables; shares are in percent."""
        score = self.values()
        return [
            TableRow(GROUP, "followed, time", "%", _percent(score.followed_share)),
            row(GROUP, "longest not followed", "s", score.longest_s),
            TableRow(GROUP, "at a joint's end", "%", _percent(score.joint_share)),
            TableRow(GROUP, "beyond the workspace", "%", _percent(score.workspace_share)),
            TableRow(GROUP, "near a singularity", "%", _percent(score.singularity_share)),
            TableRow(GROUP, "joints too slow", "%", _percent(score.speed_share)),
            TableRow(GROUP, "aligned anew", "%", _percent(score.aligning_share)),
            *error_rows(GROUP, "left by IK", "mm", score.residual_mm),
            row(GROUP, "left by IK, max", "deg", score.residual_deg.max),
            row(GROUP, "commands", "Hz", score.master_hz),
            TableRow(GROUP, "interpolation", "", _way(score)),
        ]


def _way(score: ReachScore) -> str:
    """Interpolation of the slave between commands, and its delay, as text."""
    if score.interpolation is None:
        return MISSING
    name = score.interpolation.replace("_", " ")
    return f"{name}, {score.interpolation_ms:.3g} ms" if score.interpolation_ms else name


def _percent(share: float | None) -> str:
    """Text in percent, rounded down, so that "100" means the whole time."""
    return MISSING if share is None else f"{math.floor(1000.0 * share + 1e-9) / 10.0:.1f}"


def _number(share: float | None) -> float | None:
    return None if share is None else float(share)
