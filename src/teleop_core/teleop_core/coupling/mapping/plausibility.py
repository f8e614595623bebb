"""Plausibility: samples that no hand can have made do not move the slave.

Each sample is compared with the previous one. A sample that is too fast, too sudden or too far away holds the command,
as a pressed clutch does. So does motion during an unusually long gap in the stream. From the next plausible sample on
the slave follows again, relative to the hand's pose at that time. So neither jumps nor random poses move the slave.
"""

import math
from dataclasses import dataclass

from teleop_core.base import Within, parameter
from teleop_core.graph import Row
from teleop_core.kernels import Array, Fields, PoseRow, Vector3, inner


@dataclass(frozen=True, kw_only=True)
class HandLimits:
    """Bounds of the motion that a hand on the master can make."""

    speed: float = parameter(
        3.0,
        Within(0.01, 1000.0, "m/s"),
        "largest plausible speed of the stylus; faster samples are refused",
        source="assumed: crosses the Phantom's workspace in a twentieth of a second",
    )
    acceleration: float = parameter(
        1000.0,
        Within(1.0, 1e6, "m/s²"),
        "largest plausible acceleration of the stylus",
        source="assumed: ten times the acceleration of a fast arm, because one step of the reading in 1 ms is 55 m/s²",
    )
    turn: float = parameter(
        60.0,
        Within(0.1, 1e4, "rad/s"),
        "largest plausible angular speed of the stylus",
        source="assumed: three times the angular speed of a fast wrist",
    )
    reach: float = parameter(
        2.0,
        Within(0.01, 100.0, "m"),
        "largest plausible distance of the stylus from the master's base",
        source="assumed: longer than an arm",
    )


@dataclass(frozen=True, kw_only=True)
class PlausibilityParameters(HandLimits):
    """Bounds of the motion of a hand on the master, and of the time without messages of its buttons."""

    button_silence: float = parameter(
        0.5,
        Within(0.01, 60.0, "s"),
        "if a stream of buttons has no message for this time, the clutch counts as pressed; 0: never",
        off=0.0,
    )


class PlausibilityState(Fields):
    """Fields of a state record with the last readings."""

    raw: PoseRow
    raw_rate: Vector3
    raw_ns: int
    raw_elapsed_ns: int  # time since the previous sample
    implausible: int
    is_doubted: int
    is_lost: int
    in_row: int
    buttons_ns: int


# A shorter time between two samples counts as this time [s], because stamps may be uneven.
_SHORTEST = 1e-3
# In a gap of the samples, a motion cannot be distinguished from a jump. So the hand may move no farther than its speed
# limit allows in this time [s], or in two periods of a slower stream.
_GAP = 20e-3
# Buttons are a stream after this number of messages without a pause. The count is at most twice this number, and a
# pause reduces it by this number. So one pause in which the poses also stopped does not end the stream; a second one
# does.
_STREAM = 20
_STREAM_NS = 100_000_000  # a longer time between two messages is a pause [ns]


@inner
def is_plausible(hand: HandLimits, pause_ns: int, s: PlausibilityState, pose: Array, stamp_ns: int) -> bool:
    """Whether a hand can have moved from the last sample to this one; counts implausible samples.

    Args:
        hand: Bounds of the hand's motion.
        pause_ns: Pause after which any sample is plausible [ns].
        s: State; written.
        pose: Sample (7,).
        stamp_ns: Stamp of the sample [ns].
    """
    elapsed_ns = stamp_ns - s.raw_ns
    period = max(1e-9 * elapsed_ns, _SHORTEST)
    is_first = s.raw_ns == 0 or elapsed_ns > pause_ns
    far, fast, sudden = 0.0, 0.0, 0.0
    for i in range(3):
        rate = 0.0 if is_first else (pose[i] - s.raw[i]) / period
        change = 0.0 if is_first or s.is_doubted else (rate - s.raw_rate[i]) / period
        far += pose[i] * pose[i]
        fast += rate * rate
        sudden += change * change
        s.raw_rate[i] = rate
    turn = 0.0 if is_first else _turn(s.raw[3:7], pose[3:7]) / period
    share = min(1.0, max(_GAP, 2e-9 * s.raw_elapsed_ns) / period)
    is_sound = (
        math.sqrt(far) <= hand.reach
        and math.sqrt(fast) <= hand.speed * share
        and math.sqrt(sudden) <= hand.acceleration
        and turn <= hand.turn * share
    )
    for i in range(7):
        s.raw[i] = pose[i]
    s.raw_ns, s.raw_elapsed_ns = stamp_ns, 0 if is_first else elapsed_ns
    if not is_sound:
        s.implausible += 1
    s.is_doubted = 0 if is_sound else 1
    return is_sound


@inner
def _turn(before: Array, after: Array) -> float:
    """Angle between two orientations [rad]."""
    cosine = 0.0
    for i in range(4):
        cosine += before[i] * after[i]
    return 2.0 * math.acos(min(abs(cosine), 1.0))


@inner
def has_lost_buttons(longest_ns: int, s: PlausibilityState, row: Row) -> bool:
    """Whether a stream of button messages has stopped, so that the state of the clutch is unknown.

    A master that sends buttons only at a change has no such stream. ``longest_ns`` [ns] is the longest silence that is
    allowed; 0: any.
    """
    stamp_ns = row.master_buttons_ns
    if stamp_ns != s.buttons_ns:
        is_next = stamp_ns - s.buttons_ns <= _STREAM_NS
        s.in_row = min(s.in_row + 1, 2 * _STREAM) if is_next else max(s.in_row - _STREAM, 0)
        s.buttons_ns = stamp_ns
    silence_ns = row.master_measured_cp_ns - stamp_ns
    s.is_lost = 1 if s.in_row >= _STREAM and 0 < longest_ns < silence_ns else 0
    return bool(s.is_lost)
