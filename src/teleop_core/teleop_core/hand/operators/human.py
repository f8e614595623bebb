"""Human: a hand that reaches from target to target, sees its error, corrects, and rests.

A reach begins with a first submovement that falls short of its target, with noise that grows with speed. Each
correction begins a reaction time after the eye could see the error. Each submovement is a minimum-jerk movement;
overlapping ones add up. Between reaches the hand dwells, or goes on immediately. Tremor never stops. The sources of
the numbers are in ``docs/human_operator.md``.
"""

import math
from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from teleop_core.base import ParameterError, Within, fixed
from teleop_core.hand.operators import Motion, Operator, Setting
from teleop_core.hand.operators.behaviour import OperatorParameters
from teleop_core.hand.operators.shapes import minimum_jerk
from teleop_core.kernels import Array, dot, length

_TRIES = 50  # number of targets drawn before any target in the region is accepted
_LINES = 16  # number of sines of the tremor, per axis
_TREMOR_BAND = (8.0, 12.0)
_PEAK = 10.0  # middle of the tremor's spectral peak, which is known to lie within the band [Hz]
_HALF_WIDTH = 1.5  # half width of that peak [Hz]; assumed
_CUT = (4.0, 20.0)  # lower and upper cut-off frequency [Hz]


@dataclass(frozen=True, kw_only=True)
class HumanParameters:
    """Numbers of reaches, errors, corrections, rests and tremor of the hand."""

    reach: float = fixed(
        0.0105,
        Within(1e-3, 0.3, "m"),
        "median distance from target to target, within the region of operator.size",
        source="assumed: the distances between targets depend on the task",
    )
    reach_spread: float = fixed(
        0.72,
        Within(0.0, 2.0),
        "standard deviation of the logarithm of the distance from target to target",
        source="assumed: together with reach, fits the figures of people",
    )
    turn: float = fixed(
        0.3,
        Within(0.0, 2.0),
        "standard deviation of the turn to the next target, divided by operator.rotation",
        source="assumed: fits the figures of people",
    )
    width: float = fixed(
        2.6e-3, Within(1e-4, 0.1, "m"), "width of a target in Fitts's law", source="assumed: fits the figures of people"
    )
    tolerance: float = fixed(
        2.4e-3,
        Within(1e-4, 0.1, "m"),
        "the hand makes no correction if it is nearer to the target than this",
        source="assumed: a little below width",
    )
    movement_time: float = fixed(
        0.055,
        Within(0.05, 2.0, "s"),
        "duration of a submovement whose index of difficulty is 0",
        source="assumed: fits the figures of people; form of Fitts 1954",
    )
    time_per_bit: float = fixed(
        0.195,
        Within(0.0, 2.0, "s"),
        "added duration of a submovement for each bit of its index of difficulty",
        source="assumed: 5 bit/s, as with a mouse (Soukoreff, MacKenzie 2004); 10 bit/s with a pen (Fitts 1954)",
    )
    time_spread: float = fixed(
        0.23,
        Within(0.0, 1.0),
        "standard deviation of the logarithm of a submovement's duration",
        source="assumed: fits the figures of people",
    )
    shortfall: float = fixed(
        0.05,
        Within(0.0, 0.5),
        "share of the distance by which a first submovement aims too short",
        source="assumed: first submovements fall short (Engelbrecht, Berthier and O'Sullivan 2003)",
    )
    noise_along: float = fixed(
        0.05,
        Within(0.0, 0.2, "s"),
        "standard deviation of a submovement's end along its direction, divided by its mean speed",
        source="assumed: ends spread with mean speed (Schmidt et al. 1979; Meyer et al. 1988)",
    )
    noise_across: float = fixed(
        0.018,
        Within(0.0, 0.2, "s"),
        "standard deviation of a submovement's end across its direction, divided by its mean speed",
        source="assumed: smaller than along the direction (Gordon, Ghilardi and Ghez 1994)",
    )
    reaction_time: float = fixed(
        0.22,
        Within(0.05, 1.0, "s"),
        "time from seeing an error, half way through a submovement, to the start of its correction",
        source="published: 0.19 to 0.26 s (Keele and Posner 1968)",
    )
    corrections: int = fixed(
        3, Within(0, 10), "largest number of corrections in one reach", source="assumed: more are hardly ever needed"
    )
    dwell_time: float = fixed(
        0.22,
        Within(0.01, 10.0, "s"),
        "median duration of a rest at a target",
        source="assumed: fits the figures of people",
    )
    dwell_spread: float = fixed(
        0.4,
        Within(0.0, 2.0),
        "standard deviation of the logarithm of the rest's duration",
        source="assumed: fits the figures of people",
    )
    passing: float = fixed(
        0.75,
        Within(0.0, 1.0),
        "share of targets at which the hand does not rest",
        source="assumed: fits the figures of people",
    )
    overlap: float = fixed(
        0.32,
        Within(0.0, 0.5),
        "at a target without rest, the next reach begins before the last submovement ends, by this "
        "share of its duration",
        source="assumed: Flash and Henis 1991 state that submovements overlap",
    )
    tremor: float = fixed(
        63e-6,
        Within(0.0, 5e-3, "m"),
        "RMS tremor of the tip over three axes, from 8 to 12 Hz; the hand trembles at rest too",
        source="fitted: to the tremor of a hand that rests, docs/human_operator.md",
    )

    def __post_init__(self) -> None:
        if self.tolerance > self.reach:
            raise ParameterError("human.tolerance", self.tolerance, f"<= reach ({self.reach} m)")


class Submovement(NamedTuple):
    """A minimum-jerk movement: start time [s], duration [s] and displacement.

    ``step`` (6,) is the displacement [m] and the rotation vector [rad].
    """

    begin: float
    duration: float
    step: Array

    @property
    def end(self) -> float:
        """Time at which the movement ends [s]."""
        return self.begin + self.duration


def submovements(p: HumanParameters, region: OperatorParameters, rng: np.random.Generator) -> Iterator[Submovement]:
    """Yield the submovements of the hand after the approach, endless, in order of time.

    Args:
        p: Parameters of the reaches.
        region: Size of the region and largest rotation.
        rng: Random numbers; the same numbers give the same movements.
    """
    room = np.array([0.5 * side for side in region.size] + [region.rotation] * 3)
    place, time = np.zeros(6), 0.0
    while True:
        target = _next_target(p, room, place, rng)
        for last in _reach(p, target, place, time, rng):
            place = place + last.step
            yield last
        if rng.random() < p.passing:
            time = last.end - p.overlap * last.duration
        else:
            time = last.end + _spread(p.dwell_time, p.dwell_spread, rng)


def _spread(median: float, spread: float, rng: np.random.Generator) -> float:
    """Log-normal random number."""
    return median * math.exp(spread * rng.standard_normal())


def _next_target(p: HumanParameters, room: Array, place: Array, rng: np.random.Generator) -> Array:
    """Target (6,) in the region, at a distance of about ``p.reach`` if the region is large enough."""
    half, largest = room[:3], room[3:]
    turn = np.clip(place[3:] + p.turn * largest * rng.standard_normal(3), -largest, largest)
    for _ in range(_TRIES):
        way = half * rng.standard_normal(3)
        way *= _spread(p.reach, p.reach_spread, rng) / max(float(length(way)), 1e-12)
        if (np.abs(place[:3] + way) <= half).all():
            return np.concatenate((place[:3] + way, turn))
    return np.concatenate((rng.uniform(-half, half), turn))


def _reach(
    p: HumanParameters, target: Array, place: Array, time: float, rng: np.random.Generator
) -> Iterator[Submovement]:
    """First submovement to a target, which may be a rotation alone, and its corrections.

    The duration is that of Fitts (1954) in MacKenzie's (1992) form. The end error is proportional to the speed of the
    submovement (Schmidt et al. 1979; Meyer et al. 1988), as noise proportional to the motor command causes it (Harris
    and Wolpert 1998).
    """
    for number in range(p.corrections + 1):
        way = target - place
        distance = float(length(way[:3]))
        is_first = number == 0
        if distance <= p.tolerance and not is_first:
            return
        bits = math.log2(distance / p.width + 1.0)
        duration = _spread(p.movement_time + p.time_per_bit * bits, p.time_spread, rng)
        aimed = way * (1.0 - p.shortfall * is_first)
        found = Submovement(time, duration, _blurred(p, aimed, duration, rng))
        yield found
        place = place + found.step
        time = min(found.end, time + 0.5 * duration + p.reaction_time)


def _blurred(p: HumanParameters, way: Array, duration: float, rng: np.random.Generator) -> Array:
    """A wanted displacement and rotation (6,) plus the noise of execution; a zero displacement gets no noise."""
    out = way.copy()
    for part in (slice(0, 3), slice(3, 6)):
        size = float(length(way[part]))
        if size > 0.0:
            along = way[part] / size
            noise = rng.standard_normal(3)
            ahead = along * dot(along, noise)
            off = p.noise_along * ahead + p.noise_across * (noise - ahead)
            out[part] += size / duration * off
    return out


class _Walk:
    """Sum of all submovements at any times, in memory that does not grow with their number.

    Finished submovements are added up in the order of their beginning. So the sum is the same, bit for bit, for any
    division of the times into blocks. Times before the end of a finished submovement restart the sum.
    """

    def __init__(self, p: HumanParameters, region: OperatorParameters, seed: int) -> None:
        self._made_of = (p, region, seed)
        self._begin()

    def _begin(self) -> None:
        p, region, seed = self._made_of
        self._plan = submovements(p, region, np.random.default_rng((seed, 1)))
        self._next = next(self._plan)
        self._active: deque[Submovement] = deque()
        self._place, self._over = np.zeros(6), 0.0

    def at(self, times: Array) -> Array:
        """Position [m] and rotation vector [rad] (N, 6) at increasing times (N,) [s] since the approach."""
        if not len(times):
            return np.empty((0, 6))
        if times[0] < self._over:
            self._begin()
        while self._next.begin < times[-1]:
            self._active.append(self._next)
            self._next = next(self._plan)
        while self._active and self._active[0].end <= times[0]:
            self._over = self._active[0].end
            self._place = self._place + self._active.popleft().step
        rows = np.tile(self._place, (len(times), 1))
        for movement in self._active:
            share = minimum_jerk((times - movement.begin) / movement.duration)
            rows += share[:, None] * movement.step
        return rows


def tremor(size: float, rng: np.random.Generator) -> Motion:
    """Tremor of the tip: a function from times (N,) [s] to offsets (N, 3) [m]; equal times give equal offsets.

    The tremor is a sum of sines of random frequencies and phases, which is close to noise and never repeats. Most
    frequencies are near 10 Hz and fewer farther away, so that the spectrum is that of a resonance.

    Args:
        size: Root mean square of the length of the offset within 8 to 12 Hz [m].
        rng: Random numbers.

    Source:
        Rice 1944, section 2.8: noise as a sum of sines. Band: Elble and Koller 1990.
    """
    first, last = (math.atan((edge - _PEAK) / _HALF_WIDTH) for edge in _CUT)
    low, high = (math.atan((edge - _PEAK) / _HALF_WIDTH) for edge in _TREMOR_BAND)
    places = (np.arange(_LINES) + rng.uniform(0.0, 1.0, (3, _LINES))) / _LINES
    angles = first + (last - first) * places
    rates = 2.0 * math.pi * (_PEAK + _HALF_WIDTH * np.sin(angles) / np.cos(angles))
    phases = rng.uniform(0.0, 2.0 * math.pi, (3, _LINES))
    share = (high - low) / (last - first)  # share of the power within the band
    amplitude = size * math.sqrt(2.0 / (3 * _LINES * share))

    def motion(times: Array) -> Array:
        sines = times[:, None, None] * rates
        sines += phases
        np.sin(sines, out=sines)  # in place, because allocating memory would take as long as the sines
        found: Array = amplitude * sines.sum(axis=2)
        return found

    return motion


def _human(p: HumanParameters, setting: Setting) -> Motion:
    """Approach the centre, then reach around it; tremor is in the last three columns."""
    common: OperatorParameters = setting.common
    walk = _Walk(p, common, setting.seed)
    trembling = tremor(p.tremor, np.random.default_rng((setting.seed, 2)))
    center = np.concatenate((common.center, common.tilt))

    def motion(times: Array) -> Array:
        approach = minimum_jerk(times / common.approach_time)[:, None]
        moved = walk.at(np.maximum(times - common.approach_time, 0.0))
        shaking = minimum_jerk(times)[:, None] * trembling(times)
        return np.hstack((approach * center + moved, np.zeros((len(times), 3)), shaking))

    return motion


HUMAN = Operator("human", _human, HumanParameters, trembles=True, approaches=True)
