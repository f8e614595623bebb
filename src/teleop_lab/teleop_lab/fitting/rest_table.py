"""Table: measured joint positions of a machine that rests after moves to targets."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd

from teleop_core.base import TeleopError, damage_told
from teleop_core.kernels.geometry import Array
from teleop_core.robots.robot import Robot

PUBLISHED = Path(__file__).with_name("rcrt1_precision.csv")
"""File with ten runs to each of six points (Vongbunyong 2008, tables 7.1-7.6, misprints corrected)."""


@dataclass(frozen=True, eq=False)
class RestTable:
    """Targets and rest positions of a precision test.

    Attributes:
        name: Origin of the table.
        targets: Joint targets (k, n) [rad or m].
        rests: Rest positions of every run, one array (runs, n) for each target [rad or m].
    """

    name: str
    targets: Array
    rests: tuple[Array, ...]

    @property
    def mean(self) -> Array:
        """Mean over the runs of rest position minus target (k, n) [rad or m]."""
        pairs = zip(self.targets, self.rests, strict=True)
        return np.stack([(rest - target).mean(axis=0) for target, rest in pairs])

    @property
    def spread(self) -> Array:
        """Standard deviation (n,) of the runs about the mean of their target [rad or m]."""
        off = np.concatenate([rest - rest.mean(axis=0) for rest in self.rests])
        free = len(off) - len(self.rests)
        return np.asarray(np.sqrt((off**2).sum(axis=0) / free))


def read_rests(file: Path, robot: Robot) -> RestTable:
    """Read a CSV with one row per run: ``point``, ``target_<joint>``, ``<joint>`` [rad or m].

    Args:
        file: The table.
        robot: Robot of the table's joints.

    Raises:
        TeleopError: The file cannot be read, columns or numbers are missing, or a point has only one run or several
            targets.
    """
    with damage_told(file):
        table = pd.read_csv(file)
    columns = ["point", *(f"target_{name}" for name in robot.joint_names), *robot.joint_names]
    if missing := [name for name in columns if name not in table]:
        text = f"{file}: lacks {', '.join(missing)}; it has {', '.join(map(str, table.columns))}"
        raise TeleopError(text)
    try:
        numbers = table[columns].to_numpy(dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise TeleopError(f"{file}: every value must be a number; {error}") from error
    if not np.isfinite(numbers).all():
        row = int(np.flatnonzero(~np.isfinite(numbers).all(axis=1))[0])
        raise TeleopError(f"{file}: line {row + 2} has an empty or infinite value")
    return _grouped(file, numbers, robot.n)


def _grouped(file: Path, numbers: Array, n: int) -> RestTable:
    targets, rests = [], []
    for point in np.unique(numbers[:, 0]):
        rows = numbers[numbers[:, 0] == point]
        if len(rows) < 2:
            raise TeleopError(f"{file}: point {point:g} has {len(rows)} run; a spread needs two")
        if np.ptp(rows[:, 1 : n + 1], axis=0).any():
            raise TeleopError(
                f"{file}: point {point:g} has several targets; give each target a point number of its own"
            )
        targets.append(rows[0, 1 : n + 1])
        rests.append(rows[:, n + 1 :])
    if not targets:
        raise TeleopError(f"{file}: has no rows")
    return RestTable(file.name, np.array(targets), tuple(rests))
