"""Motion: how a hand moves, in numbers: speed, spectrum, smoothness, submovements, tremor.

All values except the tremor are computed from positions at :data:`RATE`, so that recordings of any rate can be
compared. Positions are interpolated linearly to 30 Hz; velocities are central differences of the interpolated
positions. Smoothness is computed for windows of :data:`WINDOW`. Gaps divide the motion into stretches
(:func:`stretches`); nothing is computed across a gap.
"""

import itertools
import math
from collections.abc import Iterable, Sequence

import numpy as np

from teleop_core.kernels.geometry import Array

RATE = 30.0
"""Rate of the samples from which values are computed [Hz]."""
WINDOW = 5.0
"""Length of a window of smoothness and tremor [s]."""
IDLE_SPEED = 5e-3
"""A hand that is slower than this rests [m/s]."""
PROMINENCE = 10e-3
"""Smallest height of a speed peak above the valleys beside it that counts as a submovement [m/s]."""
SWING = 2e-3
"""Smallest distance by which a coordinate must move back for its turning point to count as a reversal [m]."""
TREMOR_BAND = (8.0, 12.0)
"""Band of physiological tremor [Hz]."""
SLOWEST_FOR_TREMOR = 60.0
"""Lowest sample rate of a recording for which tremor is computed [Hz]: five samples per period of 12 Hz."""
SPECTRUM_SAMPLES = 256
"""Number of samples in a segment for the velocity's spectrum. A segment lasts 8.5 s; a bin is thus 0.117 Hz wide."""
SHORTEST = 8
"""Smallest number of samples for a spectrum."""
GAP = 0.25
"""Time without a sample that ends a stretch [s]."""


def stretches(times: Array, gap: float = GAP) -> list[slice]:
    """Stretches of samples without a gap.

    Args:
        times: Rising times (N,) [s].
        gap: Longest step within a stretch [s].

    Returns:
        Slices of the samples, in order; empty if there are no samples.
    """
    ends = [0, *(np.flatnonzero(np.diff(times) > gap) + 1).tolist(), len(times)]
    return [slice(a, b) for a, b in itertools.pairwise(ends) if b > a]


def resampled(times: Array, rows: Array, rate: float = RATE) -> Array:
    """Rows at equal intervals from the first time on, shape (M, columns); they are interpolated linearly.

    Args:
        times: Increasing times (N,) [s], at least one.
        rows: Samples (N, columns).
        rate: Samples per second of the result [Hz].
    """
    count = math.floor((times[-1] - times[0]) * rate + 1e-6) + 1
    wanted = times[0] + np.arange(count) / rate
    return np.column_stack([np.interp(wanted, times, column) for column in rows.T])


def velocities(position: Array) -> Array:
    """Velocities (N, 3) [m/s] of positions (N, 3) [m]: central differences, one-sided at both ends."""
    if len(position) < 2:
        return np.zeros_like(position)
    found: Array = np.gradient(position, 1.0 / RATE, axis=0)
    return found


def path_length(position: Array) -> float:
    """Length [m] of the path through positions (N, 3) [m]; sums of :func:`velocities` would cut its corners."""
    return float(np.linalg.norm(np.diff(position, axis=0), axis=1).sum())


def turn_rates(attitude: Array) -> Array:
    """Angular speed (N - 1,) [rad/s] between unit quaternions (N, 4), w first, of any sign."""
    # The chord between two quaternions gives exact small angles; their product does not.
    chord = np.linalg.norm(np.diff(attitude, axis=0), axis=1)
    other = np.linalg.norm(attitude[1:] + attitude[:-1], axis=1)
    found: Array = 4.0 * RATE * np.arcsin(np.minimum(0.5 * np.minimum(chord, other), 1.0))
    return found


def sparc(speed: Array, rate: float, cutoff: float = 10.0, threshold: float = 0.05, padding: int = 4) -> float | None:
    """Spectral arc length of a profile of speed: 0 at best, lower where motion is less smooth.

    This is the arc length of the normalised magnitude spectrum. The spectrum ends at the last frequency that is not
    above ``cutoff`` and at which the magnitude still reaches ``threshold``.

    Args:
        speed: Magnitudes of velocity (N,).
        rate: Samples per second [Hz].
        cutoff: Highest frequency that counts [Hz].
        threshold: Share of the largest magnitude; the spectrum ends where it falls below this share.
        padding: Zeros lengthen the profile by a factor of ``2**padding`` or more.

    Returns:
        The smoothness; None without motion.

    Source:
        Balasubramanian, Melendez-Calderon, Roby-Brami and Burdet 2015 (J. NeuroEng. Rehabil. 12,
        112), definition of SPARC, with the authors' cutoff, threshold and padding.
    """
    if len(speed) < 2 or not speed.any():
        return None
    length = 2 ** (math.ceil(math.log2(len(speed))) + padding)
    magnitude = np.abs(np.fft.rfft(speed, length))
    frequency = np.fft.rfftfreq(length, 1.0 / rate)
    magnitude = magnitude[frequency <= cutoff] / magnitude.max()
    counts = np.flatnonzero(magnitude >= threshold)
    magnitude = magnitude[counts[0] : counts[-1] + 1]
    if len(magnitude) < 2:
        return None
    step = 1.0 / (len(magnitude) - 1)
    return -float(np.hypot(step, np.diff(magnitude)).sum())


def log_dimensionless_jerk(velocity: Array, rate: float) -> float | None:
    """Negative logarithm of dimensionless jerk: lower where motion is less smooth.

    ``-ln(T³ / v_peak² · ∫ |d²v/dt²|² dt)`` over the duration T.

    Args:
        velocity: Velocities (N, 3), or a speed profile (N, 1).
        rate: Samples per second [Hz].

    Returns:
        The smoothness; None without motion or with fewer than three samples.

    Source:
        Balasubramanian et al. 2015, definition of LDLJ (after Hogan and Sternad 2009).
    """
    if len(velocity) < 3:
        return None
    peak = float(np.einsum("ij,ij->i", velocity, velocity).max())
    jerk = np.diff(velocity, 2, axis=0) * rate**2
    total = float(np.einsum("ij,ij->", jerk, jerk)) / rate
    if peak <= 0.0 or total <= 0.0:
        return None
    return -math.log((len(velocity) / rate) ** 3 / peak * total)


def velocity_spectrum(parts: Iterable[Array]) -> tuple[Array, Array]:
    """Power density of velocity, summed over its axes: Welch's mean of overlapping segments.

    Args:
        parts: Velocities (N, 3) [m/s] of each stretch; short stretches are padded with zeros.

    Returns:
        Frequencies (129,) [Hz] and densities (129,) [m²/s]; zeros without motion.

    Source:
        Welch 1967; Hann windows of :data:`SPECTRUM_SAMPLES`, half overlapping, each segment without its mean.
    """
    total, weight = np.zeros(SPECTRUM_SAMPLES // 2 + 1), 0
    for velocity in parts:
        size = min(SPECTRUM_SAMPLES, len(velocity))
        if size < SHORTEST:
            continue
        window = 0.5 - 0.5 * np.cos(2.0 * np.pi * np.arange(size) / size)
        for begin in range(0, len(velocity) - size + 1, size - size // 2):
            segment = velocity[begin : begin + size]
            spectrum = np.fft.rfft((segment - segment.mean(axis=0)) * window[:, None], SPECTRUM_SAMPLES, axis=0)
            total += (np.abs(spectrum) ** 2).sum(axis=1) * (size / np.sum(window**2))
            weight += size
    frequency = np.asarray(np.fft.rfftfreq(SPECTRUM_SAMPLES, 1.0 / RATE), np.float64)
    total[1:-1] *= 2.0  # adds the power at negative frequencies
    return frequency, total / max(weight, 1) / RATE


def frequency_holding(share: float, frequency: Array, density: Array) -> float | None:
    """Lowest frequency [Hz] up to which the spectrum contains a given share of its power.

    None without power.
    """
    power = np.cumsum(density)
    if not power[-1] > 0.0:
        return None
    return float(frequency[np.searchsorted(power, share * power[-1])])


def share_between(low: float, high: float, frequency: Array, density: Array) -> float | None:
    """Share of the power between two frequencies [Hz], both included; None without power."""
    if not density.sum() > 0.0:
        return None
    return float(density[(frequency >= low) & (frequency <= high)].sum() / density.sum())


def turning_points(values: Array, swing: float) -> tuple[list[int], list[int]]:
    """Peaks and valleys of a signal that differ from both sides by at least ``swing``.

    The peaks are the peaks with a topographic prominence of at least ``swing``.

    Args:
        values: Signal (N,).
        swing: Least height of a peak above the valleys beside it, > 0.

    Returns:
        Indices of the peaks and of the valleys, each in order.
    """
    peaks: list[int] = []
    valleys: list[int] = []
    if len(values) < 3:
        return peaks, valleys
    slope = np.sign(np.diff(values))
    # Only the ends and the changes of direction can be extremes.
    at = np.unique(np.append(np.flatnonzero(np.diff(slope) != 0.0) + 1, (0, len(values) - 1)))
    low = high = int(at[0])
    heading = 0
    for index, value in zip(at.tolist(), values[at].tolist(), strict=True):
        high = index if value > values[high] else high
        low = index if value < values[low] else low
        if heading >= 0 and value <= values[high] - swing:
            if heading > 0:
                peaks.append(high)
            heading, low = -1, index
        elif heading <= 0 and value >= values[low] + swing:
            if heading < 0:
                valleys.append(low)
            heading, high = 1, index
    return peaks, valleys


def submovements(speed: Array, prominence: float = PROMINENCE) -> list[int]:
    """Samples at which the speed (N,) [m/s] peaks: each is the middle of a submovement."""
    return turning_points(speed, prominence)[0]


def reversals(position: Array, swing: float = SWING) -> int:
    """Number of turning points of x, y and z (N, 3) [m] at which the hand moves by at least ``swing`` on both sides."""
    return sum(len(turns) for column in position.T for turns in turning_points(column, swing))


def tremor_power(position: Array, rate: float) -> float:
    """Mean square [m²] of the motion in :data:`TREMOR_BAND`, summed over the axes.

    Args:
        position: Positions (N, 3) [m] at equal intervals, a window of a few seconds.
        rate: Samples per second [Hz].

    Returns:
        Power of the Hann-windowed spectrum in the band, after a straight line was removed from the window.
    """
    count = len(position)
    window = 0.5 - 0.5 * np.cos(2.0 * np.pi * np.arange(count) / count)
    line = np.linspace(-1.0, 1.0, count)[:, None]
    straight = position.mean(axis=0) + line * (line * position).sum(axis=0) / (line * line).sum()
    spectrum = np.fft.rfft((position - straight) * window[:, None], axis=0)
    frequency = np.fft.rfftfreq(count, 1.0 / rate)
    in_band = (frequency >= TREMOR_BAND[0]) & (frequency <= TREMOR_BAND[1])
    power = np.abs(spectrum[in_band]) ** 2
    return float(2.0 * power.sum() / (count * np.sum(window**2)))


def cut(count: int, rate: float = RATE, length: float = WINDOW) -> list[slice]:
    """Whole windows of a stretch of ``count`` samples; the stretch itself if it is shorter than a window.

    A stretch shorter than one second has no windows.
    """
    size = round(length * rate)
    if count < size:
        return [slice(0, count)] if count >= rate else []
    return [slice(i * size, (i + 1) * size) for i in range(count // size)]


def median(values: Sequence[float | None]) -> float | None:
    """Median of the known values; None if no value is known."""
    known = [value for value in values if value is not None]
    return float(np.median(known)) if known else None
