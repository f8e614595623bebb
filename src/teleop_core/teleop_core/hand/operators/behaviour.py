"""Behaviour of the hand: which operator moves it, and what the smooth ones share."""

from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np

from teleop_core.base import Choice, ParameterError, choice, parameter
from teleop_core.hand.operators import OPERATORS
from teleop_core.kernels import Array

PRESS_TIME = 0.1
"""How long the operator presses the fixture or the mode button [s]."""


@dataclass(frozen=True, kw_only=True)
class ButtonParameters:
    """When the operator uses the buttons [s]; each press of fixture or mode lasts 0.1 s."""

    clutch: tuple[float, ...] = parameter((), unit="s", lower=0.0, fixed=True, doc="press, release, press, release, …")
    fixture: tuple[float, ...] = parameter((), unit="s", lower=0.0, fixed=True, doc="presses: each toggles the box")
    mode: tuple[float, ...] = parameter(
        (), unit="s", lower=0.0, fixed=True, doc="presses: each toggles coarse and fine"
    )

    jaw: tuple[float, ...] = parameter((), unit="s", lower=0.0, fixed=True, doc="jaw: close, open, close, open, …")

    def __post_init__(self) -> None:
        for name, pairs in (("clutch", self.clutch), ("jaw", self.jaw)):
            if len(pairs) % 2 or list(pairs) != sorted(pairs):
                needed = "rising pairs of press, release"
                raise ParameterError(f"operator.buttons.{name}", pairs, needed)
        for name, presses in (("fixture", self.fixture), ("mode", self.mode)):
            if any(b - a < PRESS_TIME + 0.01 for a, b in pairwise(sorted(presses))):
                raise ParameterError(f"operator.buttons.{name}", presses, "at least 0.11 s apart")


@dataclass(frozen=True, kw_only=True)
class RoomParameters:
    """What the operator knows of the device: how far the stylus can go.

    In a session it is that of the haptic master where nothing else is said.
    """

    workspace: tuple[float, ...] = parameter(
        (0.16, 0.12, 0.07),
        unit="m",
        lower=0.01,
        upper=1.0,
        length=3,
        fixed=True,
        doc="width, height, depth within which the tip can move; as haptic_master's",
    )
    start: tuple[float, ...] = parameter(
        (0.0, 0.0, -0.03),
        unit="m",
        lower=-0.5,
        upper=0.5,
        length=3,
        fixed=True,
        doc="place of the inkwell relative to the middle of it; as haptic_master's",
    )

    @property
    def corners(self) -> tuple[Array, Array]:
        """Low and high corner (3,) [m] of where the stylus can go from the inkwell, which is within them."""
        middle, half = -np.array(self.start), 0.5 * np.array(self.workspace)
        return np.minimum(middle - half, 0.0), np.maximum(middle + half, 0.0)


@dataclass(frozen=True, kw_only=True)
class OperatorParameters:
    """Who moves the hand; motions are relative to where the stylus starts, in its base."""

    kind: Choice = choice(OPERATORS, "random", fixed=True, doc="who moves the hand, and how")
    seed: int = parameter(1, lower=0, fixed=True, doc="seed of everything random in the session")
    patience: float = parameter(
        10.0,
        unit="s",
        lower=0.0,
        upper=3600.0,
        fixed=True,
        doc="it begins when teleop/state says that the slave follows, or after this",
    )
    center: tuple[float, ...] = parameter(
        (0.0, 0.0, 0.0),
        unit="m",
        lower=-0.3,
        upper=0.3,
        length=3,
        fixed=True,
        doc="centre of the motion, first point of a line",
    )
    approach_time: float = parameter(
        4.0, unit="s", lower=0.1, upper=60.0, fixed=True, doc="smooth move from start to the centre"
    )
    size: tuple[float, ...] = parameter(
        (0.03, 0.03, 0.03),
        unit="m",
        lower=0.0,
        upper=0.3,
        length=3,
        fixed=True,
        doc="random: width of the region; circle: diameters on x, y, z; line: from end to end",
    )
    period: float = parameter(
        8.0,
        unit="s",
        lower=0.1,
        upper=600.0,
        fixed=True,
        doc="time of one round; random: of the slowest part of the motion; points: per leg",
    )
    tilt: tuple[float, ...] = parameter(
        (0.0, 0.0, 0.0),
        unit="rad",
        lower=-1.5,
        upper=1.5,
        length=3,
        fixed=True,
        doc="turn of the stylus at the centre, as a rotation vector",
    )
    rotation: float = parameter(
        0.2, unit="rad", lower=0.0, upper=1.5, fixed=True, doc="largest random turn of the stylus about each axis"
    )
    points: tuple[float, ...] = parameter(
        (),
        unit="m",
        lower=-0.3,
        upper=0.3,
        fixed=True,
        doc="points: x, y, z of each stop relative to the centre, one after the other",
    )
    bag: str = parameter("", fixed=True, doc="bag: recording whose master/measured_cp is followed")
    longest_gap: float = parameter(
        0.1,
        unit="s",
        lower=0.0,
        upper=60.0,
        fixed=True,
        doc="bag, file: over longer gaps between samples the hand waits, but not below 5 periods",
    )

    tremor_amplitude: float = parameter(
        0.1e-3,
        unit="m",
        lower=0.0,
        upper=5e-3,
        doc="amplitude of the wanted tremor on each axis",
        source="assumed: within the 50 to 200 µm of microsurgery; friction swallows it at rest",
    )
    tremor_frequency: float = parameter(
        10.0,
        unit="Hz",
        lower=8.0,
        upper=12.0,
        doc="middle of the tremor's band, which is ±2 Hz",
        source="published: physiological tremor has 8 to 12 Hz (Elble and Koller 1990)",
    )
    buttons: ButtonParameters = field(default_factory=ButtonParameters)
    device: RoomParameters = field(default_factory=RoomParameters)

    def __post_init__(self) -> None:
        if self.kind.kind == "points" and (not self.points or len(self.points) % 3):
            raise ParameterError("operator.points", self.points, "x, y, z of at least one point")
        if self.kind.kind == "bag" and not self.bag:
            raise ParameterError("operator.bag", self.bag, "a recording, for operator.kind bag")


def insist_on_virtual(stage: str, group: object) -> None:
    """Make sure that a stage's operator, if it is one, can move the hand in virtual time.

    Args:
        stage: Name of the stage.
        group: Its parameters.

    Raises:
        ParameterError: A person must move its device; the text names who works.
    """
    if not isinstance(group, OperatorParameters) or _is_virtual(group.kind.kind):
        return
    others = ", ".join(filter(_is_virtual, OPERATORS.names()))
    text = f"one of {others} in virtual time; {group.kind.kind} is for teleop live"
    raise ParameterError(f"{stage}.kind", group.kind.kind, text)


def _is_virtual(name: str) -> bool:
    """Whether an operator can move the hand faster than time goes."""
    operator = OPERATORS.find(name)
    return operator.opens is None and operator.is_here
