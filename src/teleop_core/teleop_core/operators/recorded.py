"""Recorded operators: a hand that follows a recording or a table of numbers."""

import csv
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from teleop_core.bags.reader import Bag
from teleop_core.errors import ParameterError, RecordingError
from teleop_core.geometry import Array, rotation_vectors
from teleop_core.operators import Motion, Operator, Setting, sampled_motion
from teleop_core.parameters import parameter
from teleop_core.topics import MASTER_MEASURED_CP

COLUMNS = ("t", "x", "y", "z", "rx", "ry", "rz", "clutch", "fixture", "mode")
"""Columns of a table: time [s], position [m], rotation vector [rad], buttons (1 pressed)."""


@dataclass(frozen=True, kw_only=True)
class FileParameters:
    """A table of what the hand wants."""

    path: str = parameter(
        "", fixed=True,
        doc="CSV file with a head of t, x, y, z and, if wanted, rx, ry, rz, clutch, fixture, mode "
        "[s, m, rad]",
    )  # fmt: skip


def _bag(parameters: object, setting: Setting) -> Motion:
    """Motion of the recorded master since its first sample.

    Raises:
        RecordingError: The recording is missing or lacks master/measured_cp.
    """
    bag = Bag(Path(setting.common.bag))
    bag.require((MASTER_MEASURED_CP,))
    series = bag.read(MASTER_MEASURED_CP)
    at = (series.stamp_ns - series.stamp_ns[0]) * 1e-9
    moves = series.values[:, :3] - series.values[0, :3]
    rows = np.hstack((moves, rotation_vectors(series.values[:, 3:])))

    def motion(times: Array) -> Array:
        return np.stack([np.interp(times, at, column) for column in rows.T], axis=1)

    return motion


def _file(parameters: FileParameters, setting: Setting) -> Motion:
    """Motion of a table relative to its first row.

    Raises:
        RecordingError: The file cannot be read, or its numbers are no motion.
        ParameterError: No file is named.
    """
    if not parameters.path:
        raise ParameterError("operator.file.path", "", "a CSV file, for operator.kind file")
    path = Path(parameters.path)
    times, rows = read_table(path)
    rows[:, :6] -= rows[0, :6]
    return sampled_motion(str(path), times - times[0], rows)


def read_table(path: Path) -> tuple[Array, Array]:
    """Times (N,) [s] and rows (N, 9) of a CSV table as :data:`COLUMNS` names them.

    Raises:
        RecordingError: It cannot be read, lacks t, x, y or z, or holds what is no number.
    """
    try:
        with path.open(newline="", encoding="utf-8") as file:
            table = list(csv.DictReader(file))
    except (OSError, UnicodeDecodeError) as error:
        raise RecordingError(path, f"cannot be read: {error}") from error
    head = [name.strip() for name in (table[0] if table else {})]
    missing = [name for name in COLUMNS[:4] if name not in head]
    if missing:
        have = ", ".join(head) or "nothing"
        raise RecordingError(path, f"lacks the columns {', '.join(missing)}; it has {have}")
    values = np.zeros((len(table), len(COLUMNS)))
    for number, line in enumerate(table):
        named = {str(key).strip(): text for key, text in line.items()}
        for column, name in enumerate(COLUMNS):
            text = named.get(name, "0")
            try:
                values[number, column] = float(text)
            except (TypeError, ValueError) as error:
                reason = f"line {number + 2}: {name} is {text!r}, must be a number"
                raise RecordingError(path, reason) from error
    return values[:, 0], values[:, 1:]


BAG = Operator("bag", _bag)
FILE = Operator("file", _file, FileParameters)
