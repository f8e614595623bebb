"""Hand of a drill: moves on a circle at constant speed; its samples can be distorted before they are sent.

Because the speed is constant, the allowed motion in a given time is known exactly.
"""

import itertools
import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from teleop_core.hand.operators.rest import rest_pose
from teleop_core.kernels.geometry import Array

PERIOD = 2e-3
"""Time between two samples [s], as for a device with 500 Hz."""
RADIUS = 0.02
"""Radius of the circle [m]."""
ROUND = 2.0
"""Time of one turn on the circle [s]."""
SPEED = 2.0 * math.pi * RADIUS / ROUND
"""Speed of the stylus [m/s]."""
_EASE = 1.0  # time within which the motion reaches full speed [s]
_SEED = 1  # seed of random losses and scatter


@dataclass(frozen=True, eq=False)
class Sample:
    """Samples that a master sends.

    Attributes:
        stamp_ns: Stamp [ns].
        pose: Position [m] in the master's base and quaternion w, x, y, z, shape (7,).
    """

    stamp_ns: int
    pose: Array


class Distortion(Protocol):
    """Function that returns the samples that replace a sample, in the order of sending."""

    def __call__(self, sample: Sample, /) -> list[Sample]:
        """Return the samples that replace one sample."""


def circle(time: float) -> Array:
    """Pose (7,) of the stylus at a time [s]; at time 0 the stylus rests in the inkwell."""
    eased = 0.5 * time * time / _EASE if time < _EASE else time - 0.5 * _EASE
    angle = 2.0 * math.pi * eased / ROUND
    pose = rest_pose()
    pose[0] += RADIUS * math.sin(angle)
    pose[2] += RADIUS * (1.0 - math.cos(angle))
    return pose


def faithful(sample: Sample) -> list[Sample]:
    """Send the sample unchanged."""
    return [sample]


def silent(_: Sample) -> list[Sample]:
    """Send no sample."""
    return []


def lossy(share: float) -> Distortion:
    """Drop a share of all samples at random."""
    rng = np.random.default_rng(_SEED)
    return lambda sample: [sample] if rng.random() >= share else []


def delayed(samples: int) -> Distortion:
    """Delay each sample by a number of samples, as a slow link does."""
    held: list[Sample] = []

    def send(sample: Sample) -> list[Sample]:
        held.append(sample)
        return [held.pop(0)] if len(held) > samples else []

    return send


def reordered(count: int) -> Distortion:
    """Collect ``count`` samples, then send them in reverse order."""
    held: list[Sample] = []

    def send(sample: Sample) -> list[Sample]:
        held.append(sample)
        if len(held) < count:
            return []
        out = held[::-1]
        held.clear()
        return out

    return send


def replayed(samples: int) -> Distortion:
    """Send each sample, then an unchanged copy of an older sample, which came ``samples`` samples before."""
    past: list[Sample] = []

    def send(sample: Sample) -> list[Sample]:
        past.append(sample)
        return [sample, past.pop(0)] if len(past) > samples else [sample]

    return send


def shaken(amplitude: float, frequency: float) -> Distortion:
    """Add an oscillation across the circle, with an amplitude [m] and a frequency [Hz]; it starts from rest."""
    times = (PERIOD * count for count in itertools.count())

    def change(pose: Array) -> Array:
        pose[1] += amplitude * math.sin(2.0 * math.pi * frequency * next(times))
        return pose

    return moved(change)


def moved(change: Callable[[Array], Array]) -> Distortion:
    """Replace each pose by the result of ``change``."""
    return lambda sample: [Sample(sample.stamp_ns, change(sample.pose.copy()))]


def shifted(way: tuple[float, float, float]) -> Distortion:
    """Shift all positions by a constant distance [m], which causes a jump at the begin."""
    offset = np.array([*way, 0.0, 0.0, 0.0, 0.0])
    return moved(lambda pose: pose + offset)


def turned(angle: float) -> Distortion:
    """Turn all samples by an angle about the stylus's own x axis [rad], which causes a jump at the begin."""
    w, x = math.cos(0.5 * angle), math.sin(0.5 * angle)

    def change(pose: Array) -> Array:
        a, b, c, d = pose[3:7]
        pose[3:7] = a * w - b * x, a * x + b * w, c * w + d * x, d * w - c * x
        return pose

    return moved(change)


def gapped(sent: int, lost: int) -> Distortion:
    """Send ``sent`` samples, lose ``lost``, and so on."""
    count = itertools.count()
    return lambda sample: [sample] if next(count) % (sent + lost) < sent else []


def filled(number: float) -> Distortion:
    """Replace all coordinates of the position by one number, such as NaN."""

    def change(pose: Array) -> Array:
        pose[:3] = number
        return pose

    return moved(change)


def scattered(size: float) -> Distortion:
    """Replace each position by a random one in a cube of this width [m] around the right position."""
    rng = np.random.default_rng(_SEED)

    def change(pose: Array) -> Array:
        pose[:3] += rng.uniform(-0.5 * size, 0.5 * size, 3)
        return pose

    return moved(change)


def stamped(change: Callable[[int], int]) -> Distortion:
    """Replace the stamps [ns] of the samples by the results of ``change``; the poses stay right."""
    return lambda sample: [Sample(change(sample.stamp_ns), sample.pose)]


def frozen_stamps() -> Distortion:
    """Send all samples with the stamp of the first sample, like a driver whose clock stands still."""
    first: list[int] = []

    def change(stamp_ns: int) -> int:
        first.append(stamp_ns)
        return first[0]

    return stamped(change)
