"""Tremor filter: the remaining tremor, and delay and gain of the intended motion."""

from dataclasses import dataclass

import numpy as np

from teleop_core.evaluation import Context, Integers, Metric, TableRow, Window, keys_of, motion_measures, row
from teleop_core.evaluation.metric import figure
from teleop_core.evaluation.metrics.motion import approach_end_ns
from teleop_core.evaluation.motion_samples import MotionSamples
from teleop_core.graph.topics import HAND_TREMOR, MASTER_FILTERED_CP, MASTER_MEASURED_CP
from teleop_core.kernels.geometry import Array

GROUP = "tremor filter"
MEANT = 2.0
"""Motion below this frequency counts as intended motion [Hz]."""


@dataclass(frozen=True)
class TremorFilterScore:
    """Score of a tremor filter.

    Values are None without a filter, or if the recording's rate is too low or the recording is too short.
    """

    before_um: float | None = figure(
        "um", "RMS motion of the stylus from 8 to 12 Hz over three axes; null for sample rates below 60 Hz"
    )
    after_um: float | None = figure("um", "RMS motion of the filtered stylus from 8 to 12 Hz over three axes")
    left_share: float | None = figure("1", "tremor after the filter divided by the tremor before it")
    delay_ms: float | None = figure(
        "ms",
        "delay of the filter for motion below 2 Hz: phase slope of the cross-spectrum of both "
        "velocities, weighted by its magnitude; negative if the output leads",
    )
    gain: float | None = figure(
        "1", "gain of the filter for motion below 2 Hz: in-phase part of the output, divided by the input"
    )
    intention_before_um: float | None = figure(
        "um",
        "RMS distance of the stylus from the intended position, which is its tremor; null if no "
        "hand/tremor was recorded",
    )
    intention_after_um: float | None = figure(
        "um",
        "RMS distance of the filtered stylus from the intended position, including the errors by "
        "the filter's delay and gain",
    )


def passage(before: Array, after: Array) -> tuple[float, float] | None:
    """Delay [s] and gain from a first motion to a second motion, for frequencies below :data:`MEANT`.

    Segments of :data:`SPECTRUM_SAMPLES`, half overlapping and Hann-windowed, give the cross-spectrum S of both
    velocities, summed over the axes. The delay is the one whose phase ``-2πf delay`` fits best: ``-Σ|S| 2πf arg S /
    Σ|S| (2πf)²``. The gain is ``|Σ S exp(2πjf delay)|`` over the power of the first motion.

    Args:
        before: Velocities of the first motion (N, 3) at :data:`RATE`.
        after: Velocities of the second motion (N, 3).

    Returns:
        Delay and gain; None if there is no motion, or less than a second of it.
    """
    size = min(motion_measures.SPECTRUM_SAMPLES, len(before))
    if size < max(motion_measures.SHORTEST, motion_measures.RATE):
        return None
    window = 0.5 - 0.5 * np.cos(2.0 * np.pi * np.arange(size) / size)
    frequency = np.fft.rfftfreq(size, 1.0 / motion_measures.RATE)
    is_meant = (frequency > 0.0) & (frequency <= MEANT)
    cross, power = np.zeros(int(is_meant.sum()), np.complex128), 0.0
    for begin in range(0, len(before) - size + 1, size - size // 2):
        first, second = (
            np.fft.rfft(
                (motion[begin : begin + size] - motion[begin : begin + size].mean(axis=0)) * window[:, None], axis=0
            )[is_meant]
            for motion in (before, after)
        )
        cross += (np.conj(first) * second).sum(axis=1)
        power += float((np.abs(first) ** 2).sum())
    if not power > 0.0:
        return None
    rate, weight = 2.0 * np.pi * frequency[is_meant], np.abs(cross)
    if not weight.any():
        return None
    delay = -float((weight * rate * np.angle(cross)).sum() / (weight * rate * rate).sum())
    gain = float(np.abs((cross * np.exp(1j * rate * delay)).sum()) / power)
    return delay, gain


class TremorFilterMetric(Metric):
    """Tremor before and after a filter, and delay and gain of the intended motion, after the approach."""

    name = "tremor_filter"
    keys = keys_of("tremor_filter", TremorFilterScore)
    topics = (MASTER_MEASURED_CP, MASTER_FILTERED_CP, HAND_TREMOR)

    def __init__(self, context: Context) -> None:
        begin_ns = approach_end_ns(context) if context.span is None else context.span.first_ns
        self._start_ns = context.bag.start_ns
        self._begin_s = (begin_ns - self._start_ns) * 1e-9
        self._before, self._after = MotionSamples(), MotionSamples()
        # Sums of the squared distances from the intended motion, before and after the filter [m²].
        self._off = np.zeros(2)
        self._count = 0  # number of samples in these sums

    def add(self, window: Window) -> None:
        """Process one window: device samples that have a filtered sample with the same stamp."""
        answers = window.samples(MASTER_FILTERED_CP)
        readings = window.around(MASTER_MEASURED_CP)
        if not (len(answers) and len(readings)):
            return
        stamps, first, second = np.intersect1d(readings.stamp_ns, answers.stamp_ns, return_indices=True)
        times = np.asarray((stamps - self._start_ns) * 1e-9, np.float64)
        self._before.add(times, readings.values[first, :7])
        self._after.add(times, answers.values[second, :7])
        self._add_intention(stamps, readings.values[first, :3], answers.values[second, :3], window)

    def _add_intention(self, stamps: Integers, before: Array, after: Array, window: Window) -> None:
        """Add the distances of both motions (N, 3) from the motion without tremor, after the approach."""
        tremors = window.around(HAND_TREMOR)
        common, own, other = np.intersect1d(stamps, tremors.stamp_ns, return_indices=True)
        counts = (common - self._start_ns) * 1e-9 >= self._begin_s
        own, tremor = own[counts], tremors.values[other[counts], :3]
        if tremor.any():
            off = (tremor, after[own] - before[own] + tremor)
            self._off += [float((part * part).sum()) for part in off]
            self._count += len(own)

    def values(self) -> TremorFilterScore:
        """Score of everything so far."""
        spans = [(self._begin_s, np.inf)]
        squares = (samples.tremor.between(spans)[0] for samples in (self._before, self._after))
        before, after = (None if s is None else 1e6 * float(np.sqrt(s)) for s in squares)
        left = None if before is None or after is None or before == 0.0 else after / before
        found = self._passage()
        delay, gain = (None, None) if found is None else (1e3 * found[0], found[1])
        off = [None, None]
        if self._count:
            off = (1e6 * np.sqrt(self._off / self._count)).tolist()
        return TremorFilterScore(before, after, left, delay, gain, *off)

    def _passage(self) -> tuple[float, float] | None:
        """Delay and gain over the longest stretch without a gap."""
        (times, before), (others, after) = self._before.rows(), self._after.rows()
        times, common, other = np.intersect1d(times, others, return_indices=True)
        counts = times >= self._begin_s
        times, before, after = times[counts], before[common][counts], after[other][counts]
        parts = motion_measures.stretches(times, 1.5 / motion_measures.RATE)
        if not parts:
            return None
        longest = max(parts, key=lambda part: part.stop - part.start)
        return passage(*(motion_measures.velocities(motion[longest, :3]) for motion in (before, after)))

    def rows(self) -> list[TableRow]:
        """Tremor before and after, delay and gain; empty without a filter."""
        score = self.values()
        if score.after_um is None and score.delay_ms is None:
            return []
        left = None if score.left_share is None else 100.0 * score.left_share
        gain = None if score.gain is None else 100.0 * score.gain
        return [
            row(GROUP, "tremor before", "µm", score.before_um),
            row(GROUP, "tremor after", "µm", score.after_um),
            row(GROUP, "tremor left", "%", left),
            row(GROUP, "delay below 2 Hz", "ms", score.delay_ms),
            row(GROUP, "gain below 2 Hz", "%", gain),
            row(GROUP, "stylus against intention, RMS", "µm", score.intention_before_um),
            row(GROUP, "filtered against intention, RMS", "µm", score.intention_after_um),
        ]
