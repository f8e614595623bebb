"""Measured: readings of an instrument that measures the tip pose by pose, and a reader of tables of them."""

import re
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from teleop_core.base import ParameterError, ShapeError, TeleopError, damage_told
from teleop_core.kernels.geometry import Array, checked_array
from teleop_core.robots.robot import Robot
from teleop_exchange.names import without_unit

if TYPE_CHECKING:
    import pandas as pd

_LENGTHS = {"": 1.0, "m": 1.0, "cm": 1e-2, "mm": 1e-3, "in": 0.0254}
_ANGLES = {"": 1.0, "rad": 1.0, "deg": np.pi / 180.0}
# If joints exceed their limits by more than this share of the range, their values probably have another unit.
_BEYOND = 0.5


class CalibrationError(TeleopError):
    """The measurements are not sufficient for the request; the message contains the reason and a remedy."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Measured:
    """Readings of an instrument at poses of an arm; the arrays are read-only copies.

    Args:
        joints: Encoder readings, (N, n) [rad, m].
        points: Position of the tip (N, 3) [m], NaN for an axis that was not read; None for distances.
        distances: Distance (N,) [m] of the tip from its position at ``origins``; None for points.
        origins: Joint vectors (N, n) at the start of each distance; None for points.
        labels: Name of the group of each distance, such as the axis along which the tip moved; empty for no groups.

    Raises:
        ShapeError: The shapes of the arrays do not match.
        ParameterError: Points and distances are both missing, or joints are not finite.
    """

    joints: Array
    points: Array | None = None
    distances: Array | None = None
    origins: Array | None = None
    labels: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        joints = np.array(self.joints, dtype=np.float64)
        if joints.ndim != 2:
            raise ShapeError("joints", "(N, n)", joints.shape)
        checked_array("joints", joints, joints.shape[1:])
        if (self.points is None) == (self.distances is None):
            raise ParameterError("measured", "both or none", "either points or distances")
        count = len(joints)
        for name, shape in (
            ("joints", joints.shape),
            ("points", (count, 3)),
            ("distances", (count,)),
            ("origins", joints.shape),
        ):
            value = getattr(self, name)
            if value is None:
                continue
            array = np.array(value, dtype=np.float64)
            if array.shape != shape:
                raise ShapeError(name, shape, array.shape)
            array.setflags(write=False)
            object.__setattr__(self, name, array)
        if self.distances is not None and self.origins is None:
            raise ParameterError("origins", None, "joint vectors from which distances count")
        if self.labels and len(self.labels) != count:
            raise ShapeError("labels", (count,), (len(self.labels),))

    def __len__(self) -> int:
        return len(self.joints)

    @property
    def readings(self) -> int:
        """Number of values that were read; a pose has at most three."""
        if self.points is not None:
            return int(np.isfinite(self.points).sum())
        return len(self)

    def part(self, rows: Array) -> "Measured":
        """Return the readings of some poses, selected by a mask or by indices."""
        at = np.arange(len(self))[rows]
        return Measured(
            joints=self.joints[at],
            points=None if self.points is None else self.points[at],
            distances=None if self.distances is None else self.distances[at],
            origins=None if self.origins is None else self.origins[at],
            labels=tuple(self.labels[i] for i in at) if self.labels else (),
        )


def read_measured(path: Path, robot: Robot) -> Measured:
    """Read measured poses from a CSV file with a column for each joint, and x, y, z of the tip.

    Joint columns are named like the robot's joints, or q1 ... qn. Values are in metres and radians, unless the name of
    the column contains another unit, such as ``x [mm]`` or ``theta1_deg``. Cells of x, y, z may be empty. Other columns
    are ignored.

    Raises:
        RecordingError: The file cannot be read, or is not a text table.
        CalibrationError: Columns are missing, cells are not numbers, or joints are far beyond their limits. The usual
            cause of the last case is a wrong unit.
    """
    import pandas as pd

    with damage_told(path, "is no table of text with a head ({})"):
        frame = pd.read_csv(path, sep=None, engine="python", comment="#", skipinitialspace=True)
    found = {_letters_of(name): name for name in map(str, frame.columns)}
    joints, slides = np.empty((len(frame), robot.n)), _slides(robot)
    for i, name in enumerate(robot.joint_names):
        column = found.get(_letters_of(name), found.get(f"q{i + 1}"))
        if column is None:
            raise _missing(path, f"joint {name} (or q{i + 1})", frame.columns)
        joints[:, i] = _numbers(path, frame, column, _LENGTHS if name in slides else _ANGLES)
    points = np.empty((len(frame), 3))
    for i, axis in enumerate("xyz"):
        if axis not in found:
            raise _missing(path, axis, frame.columns)
        points[:, i] = _numbers(path, frame, found[axis], _LENGTHS, may_miss=True)
    _check_joints(path, joints, robot)
    return Measured(joints=joints, points=points)


def _letters_of(name: str) -> str:
    return re.sub(r"[^0-9a-z]+", "", without_unit(name)[0].lower())


def _slides(robot: Robot) -> tuple[str, ...]:
    from teleop_lab.calibration.model import ChainModel

    kinds = ChainModel.of(robot).chain.kinds
    return tuple(n for n, kind in zip(robot.joint_names, kinds, strict=True) if abs(kind) > 1.5)


def _missing(path: Path, what: str, columns: Iterable[str]) -> CalibrationError:
    names = ", ".join(map(str, columns))
    return CalibrationError(f"{path}: has no column for {what}; its columns are {names}")


def _numbers(
    path: Path, frame: "pd.DataFrame", column: str, units: dict[str, float], *, may_miss: bool = False
) -> Array:
    """Values of a column in SI units; NaN for empty cells if they are allowed."""
    import pandas as pd

    cells = frame[column]
    unit = without_unit(column)[1]
    if unit not in units:
        known = ", ".join(sorted(filter(None, units)))
        raise CalibrationError(f"{path}: column {column!r} is in {unit!r}, must be in {known}")
    values = pd.to_numeric(cells, errors="coerce").to_numpy(dtype=np.float64)
    bad = ~np.isfinite(values) & (~cells.isna().to_numpy() if may_miss else True)
    if bad.any():
        row = int(np.argmax(bad))
        cell = f"'{cells.iloc[row]}'"
        raise CalibrationError(f"{path}: row {row + 1} of {column!r} is {cell}, must be a number")
    return np.asarray(values * units[unit], dtype=np.float64)


def _check_joints(path: Path, joints: Array, robot: Robot) -> None:
    margin = _BEYOND * (robot.upper - robot.lower)
    is_bad = (joints < robot.lower - margin) | (joints > robot.upper + margin)
    if not is_bad.any():
        return
    row, i = map(int, np.argwhere(is_bad)[0])
    name, low, high = robot.joint_names[i], robot.lower[i], robot.upper[i]
    raise CalibrationError(
        f"{path}: row {row + 1}: {name} is {joints[row, i]:g}, far from its limits {low:.4g} to "
        f"{high:.4g}; give its unit in the header, such as '{name}_deg' or '{name} [mm]'"
    )
