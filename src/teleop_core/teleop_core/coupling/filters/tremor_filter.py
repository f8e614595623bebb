"""Tremor filter: a stage between the master and the mapping, which removes tremor from the hand's motion.

The slave follows the filtered stylus. The operator sees and feels the unfiltered stylus, and ``master/measured_cp``
contains it. Forces on the hand are computed from the unfiltered stylus too, because a delayed force returns more energy
than it took.
"""

import math
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np

from teleop_core.base import Choice, Within, choice, fill, parameter
from teleop_core.coupling.filters import LONGEST_NS, MEMORY, TREMOR_FILTERS
from teleop_core.coupling.mapping import plausibility
from teleop_core.graph import DT, Row, RunningStage, Stage, assign, topics
from teleop_core.kernels import Array, Fields, Vector3, inner, kernel, record

_FADE = 0.2
"""Time constant with which the step at a change of parameters decays [s]."""


@dataclass(frozen=True, kw_only=True)
class TremorFilterParameters:
    """Parameters of :class:`RunningTremorFilter`."""

    kind: Choice = choice(TREMOR_FILTERS, "wflc", doc="filter that removes the hand's tremor")
    longest_pause: float = parameter(
        0.3, Within(0.002, 5.0, "s"), "after a longer pause of the master the filter restarts at the next reading"
    )
    plausible: plausibility.HandLimits = field(default_factory=plausibility.HandLimits)


class FilterRecord(TremorFilterParameters, Fields):
    """Parameter record of the tremor filter."""

    pause_ns: int


class FilterState(plausibility.PlausibilityState):
    """State record of the tremor filter."""

    origin: Vector3  # reading at which the filter began [m]
    value: Vector3  # last reading, relative to ``origin`` [m]
    told: Vector3  # last filtered position [m]
    shift: Vector3  # remaining step of the output at a change of parameters
    begun: int
    is_retuned: int
    is_other: int


class FilterPart(NamedTuple):
    """The filter of the kind, its numbers, and its memory for each coordinate (3, 32)."""

    filter: Any
    numbers: Array
    memory: Array


@inner
def _begin(s: FilterState, memory: Array, pose: Array, filtered: Array) -> None:
    """Restart at a reading: the reading passes unchanged, and earlier readings are forgotten."""
    s.begun += 1
    s.is_retuned = s.is_other = 0
    for i in range(3):
        s.origin[i], s.value[i], s.shift[i], filtered[i] = pose[i], 0.0, 0.0, pose[i]
        for k in range(memory.shape[1]):
            memory[i, k] = 0.0


@inner
def _filter(s: FilterState, part: FilterPart, i: int, value: float, elapsed_ns: int) -> float:
    """Filtered value of a coordinate; a long period is split, with linear interpolation of the values."""
    pieces = 1 + (elapsed_ns - 1) // LONGEST_NS
    period = 1e-9 * elapsed_ns / pieces
    memory, before = part.memory[i], s.value[i]
    for k in range(1, pieces):
        part.filter(part.numbers, memory, before + (value - before) * (k / pieces), period)
    s.value[i] = value
    return part.filter(part.numbers, memory, value, period)


@inner
def _is_finite(values: Array) -> bool:
    total = 0.0
    for i in range(values.shape[0]):
        total += abs(values[i])
    return math.isfinite(total)


@inner
def _fade(s: FilterState, period: float, filtered: Array) -> None:
    """Fade from the output of the old parameters to that of the new ones."""
    for i in range(3):
        if s.is_retuned > 0:
            s.shift[i] = s.told[i] - filtered[i]
        filtered[i] += s.shift[i]
        s.shift[i] *= _FADE / (_FADE + period)
    s.is_retuned = 0


@inner
def _follow(s: FilterState, part: FilterPart, pose: Array, elapsed_ns: int, filtered: Array) -> None:
    """Write the filtered position of a sample that is not the first."""
    if s.is_other > 0:
        _begin(s, part.memory, pose, filtered)
        s.is_retuned = 1
    else:
        for i in range(3):
            filtered[i] = s.origin[i] + _filter(s, part, i, pose[i] - s.origin[i], elapsed_ns)
    _fade(s, 1e-9 * elapsed_ns, filtered)


@kernel
def tremor_filter_step(p: FilterRecord, s: FilterState, part: FilterPart, row: Row, dt: float) -> None:
    """One master sample: write master_filtered_cp and master_filtered_out.

    The position is filtered coordinate by coordinate, over the time between stamps; the orientation passes unchanged.
    A reading that is not finite, or has the stamp of the last one, changes nothing. The filter restarts at the first
    reading, after a pause, when stamps go back, and at an implausible reading. An implausible reading passes
    unchanged, so that ``motion_scaling`` judges the same jump. The filter does not ring after it.

    Args:
        p: Parameter record.
        s: State record; written.
        part: :class:`FilterPart`; its memory is written.
        row: Signals.
        dt: Tick [s].
    """
    pose, filtered = row.master_measured_cp, row.master_filtered_cp
    elapsed_ns = row.master_measured_cp_ns - s.raw_ns
    if not _is_finite(pose) or (elapsed_ns == 0 and s.begun > 0):
        return
    goes_on = s.begun > 0 and 0 < elapsed_ns <= p.pause_ns
    goes_on = plausibility.is_plausible(p.plausible, p.pause_ns, s, pose, row.master_measured_cp_ns) and goes_on
    for i in range(3, 7):
        filtered[i] = pose[i]
    if goes_on:
        _follow(s, part, pose, elapsed_ns, filtered)
    if not (goes_on and _is_finite(filtered)):  # a user's filter may diverge
        _begin(s, part.memory, pose, filtered)
    for i in range(3):
        s.told[i] = filtered[i]
        row.master_filtered_out[i] = pose[i] - filtered[i]


class RunningTremorFilter(RunningStage):
    """Stage that removes tremor from the master's position."""

    def __init__(self, parameters: TremorFilterParameters, dt: float = DT) -> None:
        super().__init__(TREMOR_FILTER, 0, dt)
        self.parameters, self.state = record(FilterRecord), record(FilterState)
        self.kernel = tremor_filter_step
        self._part = FilterPart(None, np.empty(0), np.zeros((3, MEMORY)))
        self._begin = self.signals.copy()
        self.retune(parameters)
        self.reset()

    def reset(self) -> None:
        """Forget all readings: the next reading counts as the first one."""
        assign(self.state, 0)
        assign(self.signals, self._begin)
        self._part.memory[:] = 0.0
        self._told = 0

    def retune(self, parameters: TremorFilterParameters) -> None:
        """Take new parameters from the next sample on; the output does not jump, because the difference fades."""
        fill(self.parameters, parameters)
        self.parameters.pause_ns = round(parameters.longest_pause * 1e9)
        kind = TREMOR_FILTERS.find(parameters.kind.kind)
        numbers, step = kind.numbers(parameters.kind.parameters), kind.filter_pointer
        if step is self._part.filter and len(numbers) == len(self._part.numbers):
            self.state["is_retuned"] |= not np.array_equal(numbers, self._part.numbers)
            self._part.numbers[:] = numbers  # in place, so that the composed tick stays valid
            return
        self._part = FilterPart(step, numbers, self._part.memory)
        self.arguments = (self.parameters, self.state, self._part)
        self._bound = None
        self.state["is_retuned"] = self.state["is_other"] = 1

    def concerns(self) -> list[str]:
        """Text about implausible readings."""
        count, told = int(self.state["implausible"]), self._told
        self._told = count
        if count <= told:
            return []
        return [f"restarted at {count - told} samples of the master that are implausible for a hand"]


TREMOR_FILTER = Stage(
    "tremor_filter",
    TremorFilterParameters,
    reads=(topics.MASTER_MEASURED_CP,),
    writes=(topics.MASTER_FILTERED_CP, topics.MASTER_FILTERED_OUT),
    trigger=topics.MASTER_MEASURED_CP,
    replaces=topics.MASTER_MEASURED_CP,
    spares=("operator",),
    make=RunningTremorFilter,
)
