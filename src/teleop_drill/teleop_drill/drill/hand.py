"""Hand of a drill: moves in a circle at constant speed; its samples can be distorted before they are sent.

The speed is constant, so that the allowed motion in a given time is known exactly.
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
"""Time from sample to sample [s], as of a device at 500 Hz."""
RADIUS, ROUND = 0.02, 2.0
"""Radius [m] and time of one round [s] of the circle."""
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
    """Function that returns the samples that are sent instead of a sample, in their order."""

    def __call__(self, sample: Sample, /) -> list[Sample]:
        """Take one sample."""


def circle(time: float) -> Array:
    """Pose (7,) of the stylus after a time [s]; it starts at rest in the inkwell."""
    eased = 0.5 * time * time / _EASE if time < _EASE else time - 0.5 * _EASE
    angle = 2.0 * math.pi * eased / ROUND
    pose = rest_pose()
    pose[0] += RADIUS * math.sin(angle)
    pose[2] += RADIUS * (1.0 - math.cos(angle))
    return pose


def faithful(sample: Sample) -> list[Sample]:
    """Send it as it is."""
    return [sample]


def silent(_: Sample) -> list[Sample]:
    """Send nothing."""
    return []


def lossy(share: float) -> Distortion:
    """Lose a share of all samples, at random."""
    rng = np.random.default_rng(_SEED)
    return lambda sample: [sample] if rng.random() >= share else []


def delayed(samples: int) -> Distortion:
    """Send each sample a number of samples later, as a slow link does."""
    held: list[Sample] = []

    def send(sample: Sample) -> list[Sample]:
        held.append(sample)
        return [held.pop(0)] if len(held) > samples else []

    return send


def reordered(count: int) -> Distortion:
    """Send as many samples at a time, the last one first."""
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
    """Send each sample, and after it an unchanged copy of the sample that came a fixed number of samples earlier."""
    past: list[Sample] = []

    def send(sample: Sample) -> list[Sample]:
        past.append(sample)
        return [sample, past.pop(0)] if len(past) > samples else [sample]

    return send


def shaken(amplitude: float, frequency: float) -> Distortion:
    """Swing across the circle by an amplitude [m] at a frequency [Hz], from rest on."""
    times = (PERIOD * count for count in itertools.count())

    def change(pose: Array) -> Array:
        pose[1] += amplitude * math.sin(2.0 * math.pi * frequency * next(times))
        return pose

    return moved(change)


def moved(change: Callable[[Array], Array]) -> Distortion:
    """Send another pose in place of each."""
    return lambda sample: [Sample(sample.stamp_ns, change(sample.pose.copy()))]


def shifted(way: tuple[float, float, float]) -> Distortion:
    """Send all poses from another place, a jump away [m]."""
    offset = np.array([*way, 0.0, 0.0, 0.0, 0.0])
    return moved(lambda pose: pose + offset)


def filled(number: float) -> Distortion:
    """Send the same number, such as NaN, as all coordinates of the place."""

    def change(pose: Array) -> Array:
        pose[:3] = number
        return pose

    return moved(change)


def scattered(size: float) -> Distortion:
    """Send places anywhere in a cube of this width [m] around the right one."""
    rng = np.random.default_rng(_SEED)

    def change(pose: Array) -> Array:
        pose[:3] += rng.uniform(-0.5 * size, 0.5 * size, 3)
        return pose

    return moved(change)


def stamped(change: Callable[[int], int]) -> Distortion:
    """Send the right poses under other stamps [ns]."""
    return lambda sample: [Sample(change(sample.stamp_ns), sample.pose)]


def frozen_stamps() -> Distortion:
    """Send all samples with the stamp of the first, like a driver whose clock stands still."""
    first: list[int] = []

    def change(stamp_ns: int) -> int:
        first.append(stamp_ns)
        return first[0]

    return stamped(change)
