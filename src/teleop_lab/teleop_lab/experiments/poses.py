"""Poses: forward kinematics of the six targets of the precision test, and of home."""

import math
from typing import NamedTuple

import numpy as np

from teleop_core.evaluation.figure import MEASURED, PUBLISHED, SURROUNDING, Figure, in_space, scene
from teleop_core.kernels.geometry import Array
from teleop_core.robots import Robot, load_robot
from teleop_lab.experiments.bench import Bench
from teleop_lab.experiments.comparison import Comparison, Findings, absolute
from teleop_lab.experiments.experiment import Experiment

_D = math.pi / 180.0
_WRIST = 80.214 * _D


class Target(NamedTuple):
    """A target of the precision test, eqs. 7.3.1-7.3.13.

    Attributes:
        joints: Joint values that give the printed matrix [rad, m].
        place_mm: Position as printed [mm].
        turn: Rotation as printed; rows of the matrix with the columns n, o and a.
        note: Description of a misprint.
    """

    joints: tuple[float, ...]
    place_mm: tuple[float, float, float]
    turn: tuple[tuple[float, float, float], ...]
    note: str = ""


_FAR = (45.0 * _D,) * 3
TARGETS = {
    1: Target((45 * _D, 68.715 * _D, 0.350, *[_WRIST] * 3), (210.932, 261.747, 123.561),
              ((-0.497, 0.686, -0.532), (-0.220, 0.493, 0.842), (0.840, 0.535, -0.094))),
    2: Target((45 * _D, 90 * _D, 0.375, *[_WRIST] * 3), (244.205, 295.019, -6.197),
              ((-0.257, 0.783, -0.567), (0.020, 0.590, 0.807), (0.966, 0.196, -0.167))),
    3: Target((-30 * _D, 110 * _D, 0.400, *_FAR), (350.581, -181.046, -163.141),
              ((0.063, 0.733, 0.677), (0.949, -0.254, 0.186), (0.309, 0.631, -0.712))),
    4: Target((-30 * _D, 130 * _D, 0.350, *_FAR), (248.503, -122.112, -255.965),
              ((0.177, 0.880, 0.441), (0.884, -0.340, 0.323), (0.434, 0.332, -0.838))),
    5: Target((-45 * _D, 143.715 * _D, 0.375, *[_WRIST] * 3), (181.432, -130.617, -311.018),
              ((0.619, 0.422, 0.662), (-0.342, -0.614, 0.711), (0.707, -0.667, -0.236))),
    6: Target((30 * _D, 130 * _D, 0.400, *_FAR), (263.174, 173.306, -288.104),
              ((-0.677, 0.734, -0.059), (0.595, 0.593, 0.543), (0.434, 0.332, -0.838)),
              "z misprinted as -388.104"),
}  # fmt: skip
# The source prints three decimals; some numbers are cut, not rounded.
_PLACE, _TURN = absolute(1.05e-3), absolute(1.05e-3)


def _rows_of(number: int, target: Target, robot: Robot) -> list[Comparison]:
    pose = robot.fk(np.array(target.joints))
    group = f"point {number}, eq. 7.3.{number}"
    rows = [
        Comparison(quantity=name, unit="mm", published=printed, predicted=1e3 * found, within=_PLACE,
            group=group, note=target.note if name == "z" else "")
        for name, printed, found in zip("xyz", target.place_mm, pose[:3, 3], strict=True)
    ]  # fmt: skip
    rows += [
        Comparison(
            quantity=f"{column}{name}", published=target.turn[i][j], predicted=pose[i, j], within=_TURN, group=group
        )
        for j, column in enumerate("noa")
        for i, name in enumerate("xyz")
    ]
    return rows


def _measure(_: Bench) -> Findings:
    robot = load_robot("rcrt1")
    rows = [row for number, target in TARGETS.items() for row in _rows_of(number, target, robot)]
    home = 1e3 * robot.fk(robot.home)[:3, 3]
    group = "home, table 6.1 against the joints of table 6.2"
    rows += [
        Comparison(quantity=name, unit="mm", published=printed, predicted=found, within=_PLACE, group=group, note=note)
        for name, printed, found, note in zip(
            "xyz",
            (416.901, 0.0, -194.414),
            home,
            ("printed with a wrong sign", "", "both tables differ by 3.4 and 12.5 mm"),
            strict=True,
        )
    ]
    return Findings(tuple(rows), (_figure(robot),), _NOTES)


_NOTES = (
    "Joint values are those that give the matrices; some are printed differently elsewhere. "
    "Table 6.1 is the pose of 460 mm at 115°, which its own joint table does not give.",
)


def _figure(robot: Robot) -> Figure:
    found = np.array([robot.fk(np.array(target.joints))[:3, 3] for target in TARGETS.values()])
    printed: Array = np.array([target.place_mm for target in TARGETS.values()])
    traces = []
    for place in 1e3 * found:
        arm = np.vstack((np.zeros(3), place))
        traces.append({**in_space(arm, "from the shoulder", SURROUNDING, 2), "showlegend": False})
    traces += [
        in_space(1e3 * found, "forward kinematics", MEASURED, 1, "markers", size=7, opacity=0.5),
        in_space(printed, "published", PUBLISHED, 1, "markers", size=3, symbol="diamond"),
    ]
    sentence = "The six targets of the precision test, as printed and by forward kinematics."
    return Figure("Targets in space", sentence, traces, scene("mm"), 460)


POSES = Experiment(
    "poses",
    "forward kinematics of the six targets of the precision test, and of home",
    "Vongbunyong 2008, eqs. 7.3.1-7.3.13, tables 6.1 and 6.2",
    _measure,
)
