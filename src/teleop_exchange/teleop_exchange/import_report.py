"""Import report: the imported motion, the changes made to it, and warnings."""

import math
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from teleop_core.kernels import Array, dot, length
from teleop_exchange.imported_motion import Counts, Motion
from teleop_exchange.times import Stamps, spread_ms

if TYPE_CHECKING:
    from teleop_core.session.recording import Recording

LARGE = 1.0
"""Extent of a motion [m] above which the report asks whether the unit is right."""
FAST = 5.0
"""Speed of a hand [m/s] above which the report asks whether the unit is right."""
TURNING = 15.0
"""Speed of turning [rad/s] above which the report asks whether the orientation is right; a wrist reaches some 10."""
SLOW_HZ = 20.0
SPEED_HZ = 30.0
"""Rate at which speeds are computed [Hz]; it is low so that the noise of fast devices does not count."""
_SHOWN = 5


@dataclass(frozen=True)
class ImportReport:
    """Result of an import.

    Attributes:
        file: Name of the file, without its folder.
        out: Path of the new recording; None if it is only in memory.
        counts: Counts of used, changed and left-out rows.
        losses: The counts as texts.
        start_ns: First stamp [ns].
        duration: Time from the first to the last sample [s].
        rate: Samples per second [Hz]: one over the median period.
        period_ms: Median, 5th and 95th percentile of the periods [ms].
        range: Extent on x, y, z in the master's axes [m].
        rotation: Largest rotation from the first orientation [rad].
        speed: Median and 95th percentile of the speed [m/s], computed at 30 Hz or at the rate if it is lower.
        fastest: Largest speed between two samples [m/s].
        turning: Median and 95th percentile of the speed of turning [rad/s], computed at the same rate.
        gaps: Begin and length [s] of each gap, the longest first.
        given: Import options that were given, as arguments of ``teleop import``; empty if there were none.
        told: Texts about what was used, guessed and changed.
        warnings: Texts about possible errors.
        arm: Name of the hand; empty if there is only one hand.
        others: Reports of the other hands of the file.
    """

    file: str
    out: Path | None
    counts: Counts
    losses: tuple[str, ...]
    start_ns: int
    duration: float
    rate: float
    period_ms: tuple[float, float, float]
    range: tuple[float, float, float]
    rotation: float
    speed: tuple[float, float]
    fastest: float
    gaps: tuple[tuple[float, float], ...]
    told: tuple[str, ...]
    warnings: tuple[str, ...]
    arm: str = ""
    turning: tuple[float, float] = (0.0, 0.0)
    given: str = ""
    others: "tuple[ImportReport, ...]" = ()

    @property
    def recording(self) -> "Recording":
        """Open the new recording.

        Raises:
            RecordingError: The recording no longer exists.
        """
        from teleop_core.session.recording import open_recording

        return open_recording(self.out or "")

    def lines(self) -> list[str]:
        """The report in a few lines."""
        middle, low, high = self.period_ms
        x, y, z = (f"{1e3 * value:.1f}" for value in self.range)
        median, fast = (f"{1e3 * value:.0f}" for value in self.speed)
        turns = " ".join(f"{math.degrees(value):.0f}" for value in self.turning).replace(" ", ", 95 % ")
        out = [f"arm       {self.arm}"] * bool(self.arm) + [f"given     {self.given}"] * bool(self.given)
        out += [f"taken     {text}" for text in self.told] + [
            f"samples   {self._samples()}",
            f"time      {self.duration:.3f} s at {self.rate:.4g} Hz; 90 % of the periods are "
            f"{low:.3g} to {high:.3g} ms, median {middle:.4g} ms",
            f"range     x {x}, y {y}, z {z} mm; rotation {math.degrees(self.rotation):.1f}°",
            f"speed     median {median}, 95 % {fast} mm/s; turning median {turns} °/s",
            f"gaps      {self._gaps()}",
        ]
        return out + [f"warning   {text}" for text in self.warnings]

    def _samples(self) -> str:
        return ", ".join([f"{self.counts.samples} of {self.counts.rows} rows", *self.losses])

    def _gaps(self) -> str:
        if not self.gaps:
            return "none"
        shown = ", ".join(f"{length:.3g} s at {at:.3f} s" for at, length in self.gaps[:_SHOWN])
        more = f", … ({len(self.gaps)} in all)" if len(self.gaps) > _SHOWN else ""
        return f"{len(self.gaps)}: {shown}{more}" if not more else shown + more

    def __str__(self) -> str:
        return "\n".join(line for one in (self, *self.others) for line in one.lines())


def summary(file: str, out: Path | None, motion: Motion, arm: str = "", given: str = "") -> ImportReport:
    """Make the report of an imported motion; ``given`` are its options as arguments of ``teleop import``."""
    period = spread_ms(motion.stamp_ns)
    places, turns = motion.poses[:, :3], motion.poses[:, 3:]
    rate = 1e3 / period[0] if period[0] > 0.0 else 0.0
    extent = places.max(axis=0) - places.min(axis=0)
    steps = speeds(motion.stamp_ns, places)
    every = max(1, round(rate / SPEED_HZ))
    median, high = np.percentile(speeds(motion.stamp_ns[::every], places[::every]), (50, 95))
    turning = turning_speeds(motion.stamp_ns[::every], turns[::every])
    slow, swift = np.percentile(turning, (50, 95))
    cosine = np.clip(np.abs(dot(turns, turns[0])), 0.0, 1.0).min()
    return ImportReport(
        file=file, out=out, counts=motion.counts, losses=tuple(motion.losses()),
        start_ns=int(motion.stamp_ns[0]),
        duration=float(motion.stamp_ns[-1] - motion.stamp_ns[0]) * 1e-9,
        rate=rate, period_ms=period,
        range=(float(extent[0]), float(extent[1]), float(extent[2])),
        rotation=2.0 * math.acos(cosine), speed=(float(median), float(high)),
        fastest=float(steps.max()), gaps=motion.gaps, told=tuple(motion.told),
        warnings=tuple(_warnings(motion, steps, float(extent.max()), rate, float(swift))), arm=arm,
        turning=(float(slow), float(swift)), given=given,
    )  # fmt: skip


def speeds(stamps: Stamps, places: Array) -> Array:
    """Speeds [m/s] between rows; a single zero if there is only one row."""
    if len(stamps) < 2:
        return np.zeros(1)
    return np.asarray(length(np.diff(places, axis=0)) / (np.diff(stamps) * 1e-9))


def turning_speeds(stamps: Stamps, turns: Array) -> Array:
    """Speeds of turning [rad/s] between unit quaternions (N, 4); a single zero if there is only one row."""
    if len(stamps) < 2:
        return np.zeros(1)
    cosine = np.clip(np.abs(dot(turns[1:], turns[:-1])), 0.0, 1.0)
    return np.asarray(2.0 * np.arccos(cosine) / (np.diff(stamps) * 1e-9))


def _warnings(motion: Motion, steps: Array, largest: float, rate: float, turning: float) -> list[str]:
    out, c = [motion.doubt] * bool(motion.doubt), motion.counts
    if turning > TURNING:
        out.append(
            f"the hand turns at {turning:.3g} rad/s in 5 % of the time, a hand at less than {TURNING:g}: are the "
            "columns and the unit of its orientation right? (--quaternion, --euler, --angles)"
        )
    if largest > LARGE:
        out.append(f"the hand moves {largest:,.4g} m: is the unit mm? (--unit mm, or --scale)")
    elif largest < 1e-3:
        out.append(f"the hand moves {1e6 * largest:.3g} µm at most: is the unit right? (--unit)")
    if fast := int((steps > FAST).sum()):
        at = float(motion.stamp_ns[steps.argmax()] - motion.stamp_ns[0]) * 1e-9
        out.append(
            f"{fast} steps faster than {FAST:g} m/s, up to {steps.max():.3g} m/s at "
            f"{at:.3f} s: a wrong unit, or the tracking jumps"
        )
    if rate < SLOW_HZ:
        out.append(
            f"{rate:.3g} Hz is slow for a hand (below {SLOW_HZ:g} Hz): is the unit of the time right? (--time-unit)"
        )
    if c.missing > 0.1 * c.rows:
        out.append(f"{100.0 * c.missing / c.rows:.3g} % of the rows lack numbers")
    if c.doubled > 0.1 * c.rows:
        out.append(f"{100.0 * c.doubled / c.rows:.3g} % of the times are doubled: are they too coarse? (else --rate)")
    changes = motion.presses()
    pressed = motion.stamp_ns[:0] if changes is None else changes[0]
    if len(pressed) > 1 and (pressed[-1] < motion.stamp_ns[0] or pressed[0] > motion.stamp_ns[-1]):
        out.append("the buttons are outside of the time of the poses, so that none of their changes has an effect")
    if motion.strange:
        out.append(f"{motion.strange} rows have an orientation that is none; they are left out")
    return out
