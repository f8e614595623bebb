"""Motion figures: all measures of :mod:`motion_measures` for one motion."""

from collections.abc import Sequence
from dataclasses import dataclass, fields
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from teleop_core.evaluation import motion_measures
from teleop_core.evaluation.metric import figure
from teleop_core.evaluation.motion_samples import MotionSamples, TremorWindows
from teleop_core.kernels.geometry import Array

Mask = NDArray[np.bool_]


@dataclass(frozen=True)
class MotionFigures:
    """Values that describe a motion; a value is None if there is too little motion for it."""

    time_s: float = figure("s", "duration without the approach; in_fixture: duration with a fixture on")
    path_mm: float = figure("mm", "length of the tip's path through the samples at 30 Hz")
    speed_median_mm_s: float | None = figure(
        "mm/s", "median speed; like all figures but the tremor it comes from samples at 30 Hz", default=None
    )
    speed_p95_mm_s: float | None = figure("mm/s", "speed that is exceeded for 5 % of the time", default=None)
    acceleration_p95_m_s2: float | None = figure(
        "m/s^2", "acceleration that is exceeded for 5 % of the time", default=None
    )
    idle_share: float | None = figure("1", "share of the time below 5 mm/s", default=None)
    submovements: int = figure("1", "number of speed peaks with a prominence of 10 mm/s or more", default=0)
    peaks_per_s: float | None = figure(
        "1/s", "number of speed peaks per second, with a prominence of 10 mm/s or more", default=None
    )
    reversals: int = figure(
        "1", "number of turning points of x, y and z with 2 mm of motion or more on both sides", default=0
    )
    frequency_50_hz: float | None = figure(
        "Hz", "frequency below which half of the velocity's power lies (Welch, bins of 0.12 Hz)", default=None
    )
    frequency_95_hz: float | None = figure(
        "Hz", "frequency below which 95 % of the velocity's power lies", default=None
    )
    power_1_3: float | None = figure("1", "share of the velocity's power from 1 to 3 Hz", default=None)
    sparc: float | None = figure(
        "1", "spectral arc length of speed, median of windows of 5 s (Balasubramanian 2015)", default=None
    )
    ldlj: float | None = figure(
        "1", "log dimensionless jerk, median of windows of 5 s (Balasubramanian 2015)", default=None
    )
    tremor_um: float | None = figure(
        "um", "RMS motion from 8 to 12 Hz over three axes; null for sample rates below 60 Hz", default=None
    )
    tremor_at_rest_um: float | None = figure(
        "um", "RMS motion from 8 to 12 Hz in the seconds in which the tip stays within 1 mm", default=None
    )
    turn_median_deg_s: float | None = figure(
        "deg/s", "median angular speed; it includes the noise of the device's gimbal", default=None
    )
    turn_p95_deg_s: float | None = figure("deg/s", "angular speed that is exceeded for 5 % of the time", default=None)


NAMES = tuple(field.name for field in fields(MotionFigures))
"""Names of all values, in their order."""


class Kinematics:
    """Velocities of the samples of a motion, from which the values of any part of the motion are computed.

    Attributes:
        times: Times of the samples at 30 Hz, shape (N,), [s].
        position: Positions, shape (N, 3), [m].
        speed: Magnitudes of the velocity, shape (N,), [m/s].
    """

    def __init__(self, samples: MotionSamples) -> None:
        self.times, rows = samples.rows()
        self.position = rows[:, :3]
        self._tremor: TremorWindows = samples.tremor
        count = len(rows)
        self._velocity, self._acceleration = np.zeros((count, 3)), np.zeros((count, 3))
        self._turning = np.zeros(count)
        self._ends = np.flatnonzero(np.diff(self.times) > 1.5 / motion_measures.RATE) + 1
        for part in self._parts(self.everything):
            self._velocity[part] = motion_measures.velocities(self.position[part])
            self._acceleration[part] = motion_measures.velocities(self._velocity[part])
            if part.stop - part.start > 1:
                self._turning[part.start + 1 : part.stop] = motion_measures.turn_rates(rows[part, 3:7])
        self.speed = np.linalg.norm(self._velocity, axis=1)

    @property
    def everything(self) -> Mask:
        """Mask (N,) of all samples."""
        return np.ones(len(self.times), np.bool_)

    def _parts(self, mask: Mask) -> list[slice]:
        edges = np.union1d(np.flatnonzero(np.diff(mask)) + 1, self._ends)
        ends = [0, *edges.tolist(), len(mask)]
        return [slice(a, b) for a, b in pairwise(ends) if b > a and mask[a]]

    def spectrum(self, mask: Mask) -> tuple[Array, Array]:
        """Frequencies [Hz] and power density of the velocity [m²/s] of a part of the motion."""
        return motion_measures.velocity_spectrum(self._velocity[part] for part in self._parts(mask))

    def figures(self, mask: Mask) -> MotionFigures:
        """Values of the part of the motion that a mask (N,) selects."""
        parts, speed = self._parts(mask), self.speed[mask]
        time = len(speed) / motion_measures.RATE
        if not len(speed):
            return MotionFigures(0.0, 0.0)
        windows = [
            slice(part.start + one.start, part.start + one.stop)
            for part in parts
            for one in motion_measures.cut(part.stop - part.start)
        ]
        peaks = sum(len(motion_measures.submovements(self.speed[part])) for part in parts)
        frequency, density = self.spectrum(mask)
        acceleration = np.linalg.norm(self._acceleration[mask], axis=1)
        turning = np.degrees(self._turning[mask])
        tremor, at_rest = self._tremor.between(self._times_of(parts))
        return MotionFigures(
            time_s=time,
            path_mm=1e3 * sum(motion_measures.path_length(self.position[part]) for part in parts),
            speed_median_mm_s=float(np.median(speed) * 1e3),
            speed_p95_mm_s=float(np.quantile(speed, 0.95) * 1e3),
            acceleration_p95_m_s2=float(np.quantile(acceleration, 0.95)),
            idle_share=float(np.mean(speed < motion_measures.IDLE_SPEED)),
            submovements=peaks,
            peaks_per_s=peaks / time,
            reversals=sum(motion_measures.reversals(self.position[part]) for part in parts),
            frequency_50_hz=motion_measures.frequency_holding(0.5, frequency, density),
            frequency_95_hz=motion_measures.frequency_holding(0.95, frequency, density),
            power_1_3=motion_measures.share_between(1.0, 3.0, frequency, density),
            sparc=motion_measures.median(
                [motion_measures.sparc(self.speed[one], motion_measures.RATE) for one in windows]
            ),
            ldlj=motion_measures.median(
                [motion_measures.log_dimensionless_jerk(self._velocity[one], motion_measures.RATE) for one in windows]
            ),
            tremor_um=_micrometres(tremor),
            tremor_at_rest_um=_micrometres(at_rest),
            turn_median_deg_s=float(np.median(turning)),
            turn_p95_deg_s=float(np.quantile(turning, 0.95)),
        )

    def _times_of(self, parts: Sequence[slice]) -> list[tuple[float, float]]:
        return [(float(self.times[part.start]), float(self.times[part.stop - 1])) for part in parts]


def _micrometres(mean_square: float | None) -> float | None:
    return None if mean_square is None else float(np.sqrt(mean_square) * 1e6)
