"""Asked error: how far the slave's tip is from where the hand would have brought it."""

import numpy as np

from teleop_core.evaluation.accumulators import Integers, Moments, Spread
from teleop_core.evaluation.context import Context
from teleop_core.evaluation.metric import SPREAD_MEANING, Key, Metric
from teleop_core.evaluation.pairing import NONE, latest, same_stamp
from teleop_core.evaluation.rows import Row, row
from teleop_core.evaluation.windows import Window
from teleop_core.geometry import Array
from teleop_core.signals import STATE
from teleop_core.topics import MASTER_MEASURED_CP, SLAVE_MEASURED_CP, SLAVE_SERVO_CP

GROUP = "against what was asked for"
_FIRST_NS = -(2**62)


class AskedErrorMetric(Metric):
    """Spread of the distance between tip and asked place, [mm].

    The hand asks for where the slave was when it was last engaged or the clutch let go, plus all
    that the hand has moved since, by the gain. What limits cut off stays in the error until the
    next clutch stroke, and the lag of filters and interpolation is in it.
    """

    name = "asked_error_mm"
    keys = (
        Key("asked_error_mm.rms|sd|max", "mm",
            "slave/measured_cp to where the hand has asked it to be since it was engaged or the "
            f"clutch let go: {SPREAD_MEANING}"),
    )  # fmt: skip
    topics = (MASTER_MEASURED_CP, SLAVE_SERVO_CP, SLAVE_MEASURED_CP)

    def __init__(self, context: Context) -> None:
        self._error, self._history = Moments(), context.history
        self._axes = context.origin.axes
        self._until_ns = _FIRST_NS
        # Of the last command: the hand [m] in the slave's axes, the command [m], what was cut off.
        self._hand, self._command, self._cut = np.zeros(3), np.zeros(3), np.full(3, np.nan)

    def add(self, window: Window) -> None:
        """Take one window."""
        # The last command of the window before is in force until the first of this one.
        before_ns, before = self._until_ns, self._command - self._cut
        stamps, asked = self._asked(window)
        stamps = np.concatenate(([before_ns], stamps))
        asked = np.concatenate((before[None], asked))
        measured = window.samples(SLAVE_MEASURED_CP)
        at = latest(measured.stamp_ns, stamps)
        places = np.where((at == NONE)[:, None], np.nan, asked[at])
        self._error.add(np.linalg.norm(measured.values[:, :3] - places, axis=1) * 1e3)

    def _asked(self, window: Window) -> tuple[Integers, Array]:
        """Stamps (N,) and asked places (N, 3) [m] of a window's commands; NaN if nothing is."""
        hand, command = window.around(MASTER_MEASURED_CP), window.samples(SLAVE_SERVO_CP)
        is_new = command.stamp_ns > self._until_ns
        stamps, commands = command.stamp_ns[is_new], command.values[is_new, :3]
        partner = same_stamp(stamps, hand.stamp_ns)
        stamps, commands = stamps[partner != NONE], commands[partner != NONE]
        if not len(stamps):
            return stamps, np.empty((0, 3))
        hands = hand.values[partner[partner != NONE], :3] @ self._axes.T
        cut = self._cuts(stamps, hands, commands)
        self._until_ns = int(stamps[-1])
        self._hand, self._command, self._cut = hands[-1], commands[-1], cut[-1]
        return stamps, commands - cut

    def _cuts(self, stamps: Integers, hands: Array,
              commands: Array) -> Array:  # fmt: skip
        """What was cut off each command since the slave was last engaged (N, 3) [m]."""
        rows = self._history.at(stamps).rows
        gain = rows[:, STATE["gain"], None]
        is_held = (rows[:, STATE["is_following"]] == 0.0) | (rows[:, STATE["is_clutched"]] > 0.0)
        moved = np.diff(hands, axis=0, prepend=self._hand[None])
        cut = np.diff(commands, axis=0, prepend=self._command[None]) - gain * moved
        # A stretch begins with the sample after one that is held, which only latches.
        begins = is_held | np.concatenate(([np.isnan(self._cut).any()], is_held[:-1]))
        cut[begins] = 0.0
        total = np.cumsum(cut, axis=0)
        last = np.maximum.accumulate(np.where(begins, np.arange(len(begins)), -1))
        before = np.where((last >= 0)[:, None], total[last], -np.nan_to_num(self._cut))
        found: Array = total - before
        found[is_held] = np.nan
        return found

    def values(self) -> Spread:
        """Spread so far, [mm]."""
        return self._error.spread()

    def rows(self) -> list[Row]:
        """Root mean square and maximum."""
        spread = self.values()
        return [
            row(GROUP, "position, RMS", "mm", spread.rms),
            row(GROUP, "position, max", "mm", spread.max),
        ]
