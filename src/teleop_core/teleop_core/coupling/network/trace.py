"""Trace: packets have the delays of a measured network, read from a file."""

import csv
import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from teleop_core.base import ParameterError, parameter
from teleop_core.base.ranges import LATEST_S, LONGEST_DELAY
from teleop_core.coupling.network import LOST, Network
from teleop_core.kernels import Array, kernel

_NAME = "trace.file"
_SLOW = 20.0  # largest interval of rows [s]; with a longer one the network would hardly change during a session


@dataclass(frozen=True, kw_only=True)
class DelayTraceParameters:
    """A recording of delays."""

    file: str = parameter(
        "",
        doc="CSV file with the columns time and delay [s], one row per ping; an empty delay is a "
        "lost packet. At its end the file starts again",
    )


def read_trace(path: str) -> Array:
    """Numbers of a trace: times [s] from 0, each followed by its delay [s] or :data:`LOST`.

    Raises:
        ParameterError: The file cannot be read; times are negative or not in order; a delay is negative; or times or
            delays seem to be in milliseconds. The text names the line.
    """
    try:
        with Path(path).expanduser().open(newline="", encoding="utf-8") as file:
            lines = list(csv.reader(file))
    except (OSError, UnicodeDecodeError) as error:
        reason = error.strerror if isinstance(error, OSError) else "the file is no text"
        raise ParameterError(_NAME, path, f"a file that can be read ({reason})") from error
    rows: list[float] = []
    for number, line in enumerate(lines, start=1):
        if not any(cell.strip() for cell in line) or (number == 1 and line[0].strip() == "time"):
            continue
        rows += _row(path, number, line, rows[-2] if rows else -1.0)
    if len(rows) < 4:
        raise ParameterError(_NAME, path, "a file with two rows of time and delay at least")
    times = np.array(rows, dtype=np.float64)
    times[::2] -= times[0]
    if (step := float(np.median(np.diff(times[::2])))) > _SLOW:
        needed = f"a file with a row at least every {_SLOW:g} s, not every {step:g} s: are its times in ms?"
        raise ParameterError(_NAME, path, needed)
    return times


def _row(path: str, number: int, line: list[str], before: float) -> tuple[float, float]:
    try:
        time = float(line[0])
        delay = float(line[1]) if len(line) > 1 and line[1].strip() else LOST
    except ValueError:
        time = math.nan
        delay = 0.0
    if not (math.isfinite(time) and math.isfinite(delay)):
        raise ParameterError(_NAME, path, f"a file with two a file with two numbers, time and delay, in line {number}")
    if time > LATEST_S:
        needed = f"a file with times of at most {LATEST_S:g} s; line {number} has {time:.15g} s: are they in ms?"
        raise ParameterError(_NAME, path, needed)
    if time < 0.0 or time <= before:
        needed = f"a file with times that are not negative and grow; line {number} has {time:g} s"
        raise ParameterError(_NAME, path, f"{needed}, the row before {before:g} s" if before >= 0 else needed)
    if not 0.0 <= delay <= LONGEST_DELAY and delay != LOST:
        needed = f"a file with delays from 0 to {LONGEST_DELAY:g} s; line {number} has {delay:g} s"
        raise ParameterError(_NAME, path, needed + ": are the delays in ms?" * (delay > 0.0))
    return time, delay


def trace_numbers(parameters: DelayTraceParameters) -> Array:
    """Numbers of the file; without a file, the numbers of a network without delay."""
    return read_trace(parameters.file) if parameters.file else np.array([0.0, 0.0, 1.0, 0.0])


@kernel
def trace_draw(numbers: Array, memory: Array, chances: Array, now: float) -> float:
    """Delay of the last row before now [s]; the file is repeated, after an interval equal to its first interval.

    ``memory`` contains the row in the file, and the total length of the earlier passes through it [s].
    """
    rows = numbers.shape[0] // 2
    whole = numbers[2 * rows - 2] + numbers[2]
    if now - memory[1] >= whole:
        memory[1] += whole * math.floor((now - memory[1]) / whole)
        memory[0] = 0.0
    at = int(memory[0])
    while at + 1 < rows and numbers[2 * at + 2] <= now - memory[1]:
        at += 1
    memory[0] = float(at)
    return numbers[2 * at + 1]


TRACE = Network("trace", DelayTraceParameters, trace_draw, trace_numbers)
