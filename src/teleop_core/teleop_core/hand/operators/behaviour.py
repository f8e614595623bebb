"""Behaviour of the hand: which operator moves it, and the parameters that smooth operators share."""

from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np

from teleop_core.base import Choice, ParameterError, Within, choice, fixed, parameter
from teleop_core.hand.operators import OPERATORS
from teleop_core.kernels import Array

PRESS_TIME = 0.1
"""Time for which the operator presses the fixture or the mode button [s]."""


@dataclass(frozen=True, kw_only=True)
class PressParameters:
    """Times at which the operator uses the buttons [s]; each press of fixture or mode lasts 0.1 s."""

    clutch: tuple[float, ...] = fixed(
        (), Within(0.0, None, "s"), "times of press, release, press, release, … of the clutch button"
    )
    fixture: tuple[float, ...] = fixed(
        (), Within(0.0, None, "s"), "times of presses of the fixture button; each press switches the fixture on or off"
    )
    mode: tuple[float, ...] = fixed(
        (), Within(0.0, None, "s"), "times of presses of the mode button; each press changes between coarse and fine"
    )

    jaw: tuple[float, ...] = fixed(
        (), Within(0.0, None, "s"), "times at which the hand closes, opens, closes, opens, … the jaw"
    )

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
    """Range of the stylus, as the operator knows it.

    In a session the default is the range of the haptic master.
    """

    workspace: tuple[float, ...] = fixed(
        (0.16, 0.12, 0.07),
        Within(0.01, 1.0, "m"),
        "width, height and depth of the space in which the tip can move; the same as haptic_master's",
        length=3,
    )
    start: tuple[float, ...] = fixed(
        (0.0, 0.0, -0.03),
        Within(-0.5, 0.5, "m"),
        "position of the inkwell relative to the middle of the workspace; the same as haptic_master's",
        length=3,
    )

    @property
    def corners(self) -> tuple[Array, Array]:
        """Low and high corner (3,) [m] of the range of the stylus, relative to the inkwell, which is inside."""
        middle, half = -np.array(self.start), 0.5 * np.array(self.workspace)
        return np.minimum(middle - half, 0.0), np.maximum(middle + half, 0.0)


@dataclass(frozen=True, kw_only=True)
class OperatorParameters:
    """Which operator moves the hand; motions are relative to the start of the stylus, in the master's base."""

    kind: Choice = choice(
        OPERATORS, "random", fixed=True, doc="kind of operator: a simulated motion, a recording or a person's device"
    )
    seed: int = fixed(1, Within(0), "seed of everything random in the session")
    patience: float = fixed(
        10.0,
        Within(0.0, 3600.0, "s"),
        "longest wait for teleop/state to report that the slave follows; then the operator begins anyway",
    )
    center: tuple[float, ...] = fixed(
        (0.0, 0.0, 0.0), Within(-0.3, 0.3, "m"), "centre of the motion, first point of a line", length=3
    )
    approach_time: float = fixed(
        4.0, Within(0.1, 60.0, "s"), "duration of the smooth move from the start to the centre"
    )
    size: tuple[float, ...] = fixed(
        (0.03, 0.03, 0.03),
        Within(0.0, 0.3, "m"),
        "random: width of the region; circle: diameters along x, y, z; line: vector from end to end",
        length=3,
    )
    period: float = fixed(
        8.0,
        Within(0.1, 600.0, "s"),
        "duration of one round; random: period of the slowest part of the motion; points: duration of each leg",
    )
    tilt: tuple[float, ...] = fixed(
        (0.0, 0.0, 0.0), Within(-1.5, 1.5, "rad"), "turn of the stylus at the centre, as a rotation vector", length=3
    )
    rotation: float = fixed(0.2, Within(0.0, 1.5, "rad"), "largest random turn of the stylus about each axis")
    points: tuple[float, ...] = fixed(
        (), Within(-0.3, 0.3, "m"), "points: x, y, z of each stop relative to the centre, one stop after the other"
    )
    bag: str = fixed("", doc="bag: recording whose master/measured_cp the hand follows")
    longest_gap: float = fixed(
        0.1,
        Within(0.0, 60.0, "s"),
        "bag, file: at a longer gap between two samples (and of more than 5 periods) the hand stays in place",
    )

    tremor_amplitude: float = parameter(
        0.1e-3,
        Within(0.0, 5e-3, "m"),
        "amplitude of the hand's intended tremor on each axis",
        source="assumed: within the 50 to 200 µm of microsurgery; friction swallows it at rest",
    )
    tremor_frequency: float = parameter(
        10.0,
        Within(8.0, 12.0, "Hz"),
        "middle of the tremor's band, which is ±2 Hz",
        source="published: physiological tremor has 8 to 12 Hz (Elble and Koller 1990)",
    )
    buttons: PressParameters = field(default_factory=PressParameters)
    device: RoomParameters = field(default_factory=RoomParameters)

    def __post_init__(self) -> None:
        if self.kind.kind == "points" and (not self.points or len(self.points) % 3):
            raise ParameterError("operator.points", self.points, "x, y, z of at least one point")
        if self.kind.kind == "bag" and not self.bag:
            raise ParameterError("operator.bag", self.bag, "a recording, for operator.kind bag")


def insist_on_virtual(stage: str, group: object) -> None:
    """Raise an error if the stage is an operator that cannot move the hand in virtual time.

    Args:
        stage: Name of the stage.
        group: Parameters of the stage.

    Raises:
        ParameterError: The operator needs a person at a device; the message names operators that work.
    """
    if not isinstance(group, OperatorParameters) or _is_virtual(group.kind.kind):
        return
    others = ", ".join(filter(_is_virtual, OPERATORS.names()))
    text = f"one of {others} in virtual time; {group.kind.kind} works only with teleop live"
    raise ParameterError(f"{stage}.kind", group.kind.kind, text)


def _is_virtual(name: str) -> bool:
    """Whether an operator can move the hand faster than real time."""
    operator = OPERATORS.find(name)
    return operator.opens is None and operator.is_here
