"""Operator parameters: which operator moves the hand, and what the smooth ones share."""

from dataclasses import dataclass

from teleop_core.errors import ParameterError
from teleop_core.operators import OPERATORS
from teleop_core.parameters import Choice, choice, parameter


@dataclass(frozen=True, kw_only=True)
class OperatorParameters:
    """What the hand wants to do, relative to where the stylus starts, in the master's base."""

    kind: Choice = choice(OPERATORS, "random", fixed=True, doc="who moves the hand, and how")
    center: tuple[float, ...] = parameter(
        (0.0, 0.0, 0.0), unit="m", lower=-0.3, upper=0.3, length=3, fixed=True,
        doc="centre of the motion, first point of a line",
    )  # fmt: skip
    approach_time: float = parameter(
        4.0, unit="s", lower=0.1, upper=60.0, fixed=True, doc="smooth move from start to the centre"
    )
    size: tuple[float, ...] = parameter(
        (0.03, 0.03, 0.03), unit="m", lower=0.0, upper=0.3, length=3, fixed=True,
        doc="random: width of the region; circle: diameters on x, y, z; line: from end to end",
    )  # fmt: skip
    period: float = parameter(
        8.0, unit="s", lower=0.1, upper=600.0, fixed=True,
        doc="time of one round; random: of the slowest part of the motion; points: per leg",
    )  # fmt: skip
    tilt: tuple[float, ...] = parameter(
        (0.0, 0.0, 0.0), unit="rad", lower=-1.5, upper=1.5, length=3, fixed=True,
        doc="turn of the stylus at the centre, as a rotation vector",
    )  # fmt: skip
    rotation: float = parameter(
        0.2, unit="rad", lower=0.0, upper=1.5, fixed=True,
        doc="largest random turn of the stylus about each axis",
    )  # fmt: skip
    points: tuple[float, ...] = parameter(
        (), unit="m", lower=-0.3, upper=0.3, fixed=True,
        doc="points: x, y, z of each stop relative to the centre, one after the other",
    )  # fmt: skip
    bag: str = parameter("", fixed=True, doc="bag: recording whose master/measured_cp is followed")
    longest_gap: float = parameter(
        0.1, unit="s", lower=0.0, upper=60.0, fixed=True,
        doc="bag, file: over longer gaps between samples the hand waits, but not below 5 periods",
    )  # fmt: skip

    def __post_init__(self) -> None:
        if self.kind.kind == "points" and (not self.points or len(self.points) % 3):
            raise ParameterError("operator.points", self.points, "x, y, z of at least one point")
        if self.kind.kind == "bag" and not self.bag:
            raise ParameterError("operator.bag", self.bag, "a recording, for operator.kind bag")
