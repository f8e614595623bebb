"""Asked error: distance between the slave's tip and the pose that the hand asked for."""

import numpy as np
from numpy.typing import NDArray

from teleop_core.evaluation import Context, Integers, Window, latest, same_stamp
from teleop_core.evaluation.metric import SpreadMetric
from teleop_core.evaluation.pairing import NONE
from teleop_core.evaluation.tracking import angles_between
from teleop_core.graph.signals import STATE
from teleop_core.graph.topics import MASTER_MEASURED_CP, SLAVE_MEASURED_CP, SLAVE_SERVO_CP
from teleop_core.kernels.geometry import Array, quaternion_products

ASKED_TOPICS = (MASTER_MEASURED_CP, SLAVE_SERVO_CP, SLAVE_MEASURED_CP)
"""Topics that :class:`Asked` reads."""
_FIRST_NS = -(2**62)


class Asked:
    """Accumulator of the poses that the hand asks for, window by window.

    The asked pose begins as the slave's pose at the moment when the slave was last engaged or the clutch was last
    released. The hand's motion since that moment, scaled by the gain, and the hand's rotation are added.
    """

    def __init__(self, context: Context) -> None:
        context.read(ASKED_TOPICS)
        self._history, self._origin = context.history, context.origin
        self._until_ns = _FIRST_NS
        # State at the last command.
        self._hand = np.zeros(3)  # position of the hand in the slave's axes [m]
        self._command = np.zeros(3)  # commanded position [m]
        self._cut = np.full(3, np.nan)  # motion that limits cut off [m]
        self._alignment = np.full(4, np.nan)  # latched alignment of the tool
        self._pose = np.full(7, np.nan)  # asked pose
        self._stamps, self._asked = np.empty(0, np.int64), np.empty((0, 7))

    def add(self, window: Window) -> None:
        """Process one window."""
        # The last command of the previous window stays valid until the first command of this window.
        before_ns, before = self._until_ns, self._pose
        stamps, asked = self._poses(window)
        self._stamps = np.concatenate(([before_ns], stamps))
        self._asked = np.concatenate((before[None], asked))

    def at(self, stamp_ns: Integers) -> Array:
        """Asked poses (N, 7) at stamps (N,) [ns] of this window; NaN where no pose is asked for."""
        at = latest(stamp_ns, self._stamps)
        found: Array = np.where((at == NONE)[:, None], np.nan, self._asked[at])
        return found

    def _poses(self, window: Window) -> tuple[Integers, Array]:
        """Stamps (N,) and asked poses (N, 7) of a window's commands; NaN where no pose is asked for."""
        hand, command = window.around(MASTER_MEASURED_CP), window.samples(SLAVE_SERVO_CP)
        is_new = command.stamp_ns > self._until_ns
        stamps, commands = command.stamp_ns[is_new], command.values[is_new]
        partner = same_stamp(stamps, hand.stamp_ns)
        stamps, commands = stamps[partner != NONE], commands[partner != NONE]
        if not len(stamps):
            return stamps, np.empty((0, 7))
        hands = hand.values[partner[partner != NONE]]
        rows = self._history.at(stamps).rows
        is_held = (rows[:, STATE["is_following"]] == 0.0) | (rows[:, STATE["is_clutched"]] > 0.0)
        # A sequence begins with the sample after a sample at which the slave is held. This first sample only latches
        # the alignment.
        was_held = np.concatenate(([np.isnan(self._cut).any()], is_held[:-1]))
        asked = np.empty((len(stamps), 7))
        places = hands[:, :3] @ self._origin.axes.T
        cut = self._cuts(rows[:, STATE["gain"], None], places, commands[:, :3], is_held | was_held)
        asked[:, :3] = commands[:, :3] - cut
        asked[:, 3:] = self._turned(hands[:, 3:], commands[:, 3:], is_held | was_held)
        asked[is_held] = np.nan
        self._until_ns, self._pose = int(stamps[-1]), asked[-1]
        self._hand, self._command = places[-1], commands[-1, :3]
        self._cut = np.where(is_held[-1], np.nan, cut[-1])
        return stamps, asked

    def _cuts(self, gain: Array, hands: Array, commands: Array, begins: NDArray[np.bool_]) -> Array:
        """For each command, the total motion that limits cut off since the slave was last engaged, (N, 3) [m]."""
        moved = np.diff(hands, axis=0, prepend=self._hand[None])
        cut = np.diff(commands, axis=0, prepend=self._command[None]) - gain * moved
        cut[begins] = 0.0
        total = np.cumsum(cut, axis=0)
        last = _last(begins)
        before = np.where((last >= 0)[:, None], total[last], -np.nan_to_num(self._cut))
        found: Array = total - before
        return found

    def _turned(self, stylus: Array, commands: Array, begins: NDArray[np.bool_]) -> Array:
        """Asked orientations (N, 4): from the moment at which it was engaged, the tool rotates like the hand."""
        if self._origin.tool is None:
            return np.full((len(stylus), 4), np.nan)
        slave_master, stylus_tool, is_aligned = self._origin.tool
        tools = quaternion_products(quaternion_products(slave_master, stylus), stylus_tool)
        inverse = tools * (1.0, -1.0, -1.0, -1.0)
        latched = quaternion_products(commands, inverse) if is_aligned else quaternion_products(inverse, commands)
        last = _last(begins)
        alignment = np.where((last >= 0)[:, None], latched[last], self._alignment)
        self._alignment = alignment[-1]
        return quaternion_products(alignment, tools) if is_aligned else quaternion_products(tools, alignment)


def _last(begins: NDArray[np.bool_]) -> Integers:
    """For each sample (N,), index of the latest sample that begins a sequence; -1 before the first such sample."""
    found: Integers = np.maximum.accumulate(np.where(begins, np.arange(len(begins)), -1))
    return found


_GROUP = "against what was asked for"
_MEANING = (
    "slave/measured_cp to the pose that follows from the hand's motion since the slave last "
    "began to follow or the clutch was released"
)


class _AskedMetric(SpreadMetric):
    """Spread of an error relative to the asked pose."""

    group, topics = _GROUP, ASKED_TOPICS

    def __init__(self, context: Context) -> None:
        super().__init__(context)
        self._asked = context.shared(Asked)


class AskedErrorMetric(_AskedMetric):
    """Spread of the distance between tip and asked position, [mm].

    Motion that limits cut off stays in this error until the next clutch stroke. The error also includes the lag of
    filters and interpolation.
    """

    name, meaning = "asked_error_mm", _MEANING

    def errors(self, window: Window) -> Array:
        """Distances (N,) [mm]."""
        measured = window.samples(SLAVE_MEASURED_CP)
        off = measured.values[:, :3] - self._asked.at(measured.stamp_ns)[:, :3]
        return np.asarray(np.linalg.norm(off, axis=1) * 1e3)


class AskedTurnMetric(_AskedMetric):
    """Spread of the angle between the tool and its asked orientation, [deg].

    None if ``rotation_gain`` is not 1, because no orientation of the tool is then asked for.
    """

    name, label, unit = "asked_error_deg", "rotation", "deg"
    meaning = f"angle from {_MEANING}"

    def errors(self, window: Window) -> Array:
        """Angles (N,) [deg]."""
        measured = window.samples(SLAVE_MEASURED_CP)
        asked = self._asked.at(measured.stamp_ns)[:, 3:]
        return np.degrees(angles_between(measured.values[:, 3:], asked))
