"""Reach: for how much of the time the slave could do what the hand asked for, and why not."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from teleop_core.evaluation.accumulators import Moments, Spread
from teleop_core.evaluation.context import Context
from teleop_core.evaluation.metric import SPREAD_MEANING, Key, Metric
from teleop_core.evaluation.rows import MISSING, Row, row
from teleop_core.evaluation.stamps import StampTallies
from teleop_core.evaluation.state_history import StateHistory
from teleop_core.evaluation.windows import Window
from teleop_core.geometry import Array
from teleop_core.signals import DT, STATE
from teleop_core.topics import SLAVE_REACH, SLAVE_SERVO_CP, Limit

GROUP = "slave follows the hand"
COMPARABLE = 0.99
"""Least share of the time followed with which published figures are compared."""
_RESIDUAL = SLAVE_REACH.columns.index("position_residual")
_CAUSES = (Limit.JOINT, Limit.WORKSPACE, Limit.SINGULARITY, Limit.SPEED)


@dataclass(frozen=True)
class ReachScore:
    """How far the slave followed, since it first did; None without what says so.

    Attributes:
        followed_share: Share of the time in which nothing held the slave back, 0 to 1.
        longest_s: Longest stretch of time in which it did not follow, [s].
        joint_share: Share of the time against the end of a joint.
        workspace_share: Share beyond all joint vectors.
        singularity_share: Share in which it lagged near a singularity.
        speed_share: Share in which it lagged because joints were too slow.
        aligning_share: Share in which master or slave were silent and it was aligned anew.
        residual_mm: Distance that inverse kinematics left to the command, [mm].
        residual_deg: Angle that it left, [deg].
        master_hz: Commands per second: the median of their stamps' steps.
        interpolation: How the slave goes from command to command; None if it is not told.
        interpolation_ms: By what that is late: a period of the commands, if it is longer than a
            control tick, [ms].
    """

    followed_share: float | None
    longest_s: float | None
    joint_share: float | None
    workspace_share: float | None
    singularity_share: float | None
    speed_share: float | None
    aligning_share: float | None
    residual_mm: Spread
    residual_deg: Spread
    master_hz: float | None
    interpolation: str | None
    interpolation_ms: float | None


class ReachMetric(Metric):
    """Shares of time by teleop/state, residuals by slave/reach."""

    name = "reach"
    keys = (
        Key("reach.followed_share", "1",
            "share of the time since the slave first followed in which no limit held it back and "
            "it was not aligned anew; clutched time counts as followed"),
        Key("reach.longest_s", "s", "longest stretch in which it did not follow"),
        Key("reach.joint_share|workspace_share|singularity_share|speed_share|aligning_share", "1",
            "share of that time against the end of a joint, beyond the workspace, too slow near a "
            "singularity, too slow, and while master or slave were silent"),
        Key("reach.residual_mm.rms|sd|max", "mm",
            f"what inverse kinematics left of each command: {SPREAD_MEANING}"),
        Key("reach.residual_deg.rms|sd|max", "deg", f"the same for angles: {SPREAD_MEANING}"),
        Key("reach.master_hz", "Hz", "commands per second, by the median step of their stamps"),
        Key("reach.interpolation", "1", "how the slave goes from command to command"),
        Key("reach.interpolation_ms", "ms", "by what that is late; 0 where there is a command "
            "every tick"),
    )  # fmt: skip
    topics = (SLAVE_REACH,)

    def __init__(self, context: Context) -> None:
        bag, span = context.bag, context.span
        self._history = context.history
        self._begin_ns = bag.start_ns if span is None else span.first_ns
        self._end_ns = bag.end_ns if span is None else span.last_ns
        self._distance, self._angle = Moments(), Moments()
        self._stamps, self._interpolation = (
            context.shared(StampTallies),
            context.origin.interpolation,
        )

    def add(self, window: Window) -> None:
        """Take one window."""
        follows = window.states(SLAVE_REACH).column("is_following") > 0.0
        left = window.samples(SLAVE_REACH).values[follows, _RESIDUAL : _RESIDUAL + 2]
        self._distance.add(left[:, 0] * 1e3)
        self._angle.add(np.degrees(left[:, 1]))

    def values(self) -> ReachScore:
        """Score of everything so far."""
        shares, longest_s = _shares(self._history, self._begin_ns, self._end_ns)
        tally = self._stamps.of.get(SLAVE_SERVO_CP.name)
        period_us = tally.period_us if tally is not None else None
        return ReachScore(
            followed_share=shares.get(Limit.NONE),
            longest_s=longest_s,
            joint_share=shares.get(Limit.JOINT),
            workspace_share=shares.get(Limit.WORKSPACE),
            singularity_share=shares.get(Limit.SINGULARITY),
            speed_share=shares.get(Limit.SPEED),
            aligning_share=shares.get("aligning"),
            residual_mm=self._distance.spread(),
            residual_deg=self._angle.spread(),
            master_hz=None if not period_us else 1e6 / period_us,
            interpolation=self._interpolation,
            interpolation_ms=self._delay_ms(period_us),
        )

    def _delay_ms(self, period_us: int | None) -> float | None:
        if self._interpolation is None or not period_us:
            return None
        is_slow = self._interpolation != "off" and period_us > 1.5e6 * DT
        return period_us * 1e-3 if is_slow else 0.0

    def rows(self) -> list[Row]:
        """Shares in percent, the longest stretch, residuals, and whether figures compare."""
        score = self.values()
        return [
            Row(GROUP, "followed, time", "%", _percent(score.followed_share)),
            row(GROUP, "longest not followed", "s", score.longest_s),
            Row(GROUP, "at a joint's end", "%", _percent(score.joint_share)),
            Row(GROUP, "beyond the workspace", "%", _percent(score.workspace_share)),
            Row(GROUP, "near a singularity", "%", _percent(score.singularity_share)),
            Row(GROUP, "joints too slow", "%", _percent(score.speed_share)),
            Row(GROUP, "aligned anew", "%", _percent(score.aligning_share)),
            row(GROUP, "left by IK, RMS", "mm", score.residual_mm.rms),
            row(GROUP, "left by IK, max", "mm", score.residual_mm.max),
            row(GROUP, "left by IK, max", "deg", score.residual_deg.max),
            row(GROUP, "commands", "Hz", score.master_hz),
            Row(GROUP, "interpolation", "", _way(score)),
        ]


def _way(score: ReachScore) -> str:
    """How the slave goes from command to command, with the delay of it."""
    if score.interpolation is None:
        return MISSING
    name = score.interpolation.replace("_", " ")
    return f"{name}, {score.interpolation_ms:.3g} ms" if score.interpolation_ms else name


def _percent(share: float | None) -> str:
    return MISSING if share is None else f"{100.0 * share:.1f}"


def _shares(
    history: StateHistory, begin_ns: int, end_ns: int
) -> tuple[dict[Limit | str, float], float | None]:
    """Share of the time in each cause, none among them, and the longest stretch [s] off."""
    follows = history.rows[:, STATE["is_following"]] > 0.0
    limits = history.rows[:, STATE["limit"]]
    if not follows.any() or np.isnan(limits).any():
        return {}, None
    first = int(np.argmax(follows))
    stamps = np.clip(np.append(history.stamp_ns[first:], end_ns), begin_ns, end_ns)
    spans = np.diff(stamps) * 1e-9
    total = float(spans.sum())
    if total <= 0.0:
        return {}, None
    follows, limits = follows[first:], limits[first:]
    found: dict[Limit | str, float] = {
        cause: float(spans[follows & (limits == cause)].sum()) / total
        for cause in (Limit.NONE, *_CAUSES)
    }
    found["aligning"] = float(spans[~follows].sum()) / total
    return found, _longest(spans, ~follows | (limits > 0.0))


def _longest(spans: Array, is_off: NDArray[np.bool_]) -> float:
    """Longest sum of neighbouring spans that are off; 0 if none is."""
    stretch = np.cumsum(np.diff(is_off, prepend=~is_off[:1]) != 0)
    sums = np.bincount(stretch, weights=np.where(is_off, spans, 0.0))
    return float(sums.max())
