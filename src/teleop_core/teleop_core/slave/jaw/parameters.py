"""Parameters of the simulated jaw: its drive, the objects that it can grip, and pegs."""

import math
from dataclasses import dataclass, field

from teleop_core.base import ParameterError, Within, fixed, parameter
from teleop_core.graph import topics

PEGS = 12
"""Largest number of pegs on a board."""


@dataclass(frozen=True, kw_only=True)
class GripObjectParameters:
    """Objects that the jaw can grip, with equal thickness in all directions; they stand on a flat table."""

    place: tuple[float, ...] = fixed(
        (),
        Within(-10.0, 10.0, "m"),
        "start position of the middle of the object, half its size above the table; several objects: "
        "one position after the other, with the same z; empty: no object",
    )
    size: float = parameter(0.02, Within(1e-3, 0.2, "m"), "edge length of the object")
    mass: float = parameter(0.05, Within(1e-4, 10.0, "kg"), "mass of the object")
    stiffness: float = parameter(
        4000.0, Within(10.0, 1e6, "N/m"), "stiffness of the object and both pads together", source="assumed"
    )
    damping: float = parameter(
        20.0, Within(0.0, 1e4, "N·s/m"), "damping of the object and both pads together", source="assumed"
    )
    friction: float = parameter(
        0.5, Within(0.0, 5.0), "coefficient of dry friction between each pad and the object", source="assumed"
    )

    def __post_init__(self) -> None:
        n, rest = divmod(len(self.place), 3)
        if rest or n > topics.JAW_OBJECTS or len(set(self.place[2::3])) > 1:
            needed = f"x, y, z of up to {topics.JAW_OBJECTS} objects, with one z, or empty"
            raise ParameterError("jaw_sim.object.place", self.place, needed)


@dataclass(frozen=True, kw_only=True)
class PegParameters:
    """Upright pegs of the table, onto which objects can be put."""

    place: tuple[float, ...] = fixed(
        (), Within(-10.0, 10.0, "m"), "x, y of the axis of each peg, one peg after the other; empty: no pegs"
    )
    height: float = parameter(
        0.015, Within(1e-3, 0.5, "m"), "height by which an object must be lifted to come off a peg", source="assumed"
    )
    clearance: float = parameter(
        0.0015,
        Within(0.0, 0.1, "m"),
        "distance by which an object can move from the peg's axis before the peg touches it",
        source="assumed",
    )

    def __post_init__(self) -> None:
        x, y = self.place[::2], self.place[1::2]
        if len(x) != len(y) or len(x) > PEGS:
            raise ParameterError("jaw_sim.pegs.place", self.place, f"x, y of up to {PEGS} pegs")
        ways = [math.hypot(x[i] - x[k], y[i] - y[k]) for i in range(len(x)) for k in range(i)]
        if min(ways, default=math.inf) <= 2.0 * self.clearance:
            needed = f"pegs more than 2 clearances ({2.0 * self.clearance:g} m) apart"
            raise ParameterError("jaw_sim.pegs.place", self.place, needed)


@dataclass(frozen=True, kw_only=True)
class JawSimParameters:
    """Parameters of :class:`~teleop_core.slave.jaw.jaw_sim.JawSim`."""

    upper: float = fixed(
        0.8,
        Within(0.05, 3.0, "rad"),
        "angle between the fingers at the drive's open stop, which is also the start",
        source="assumed",
    )
    effort_limit: float = parameter(
        0.15, Within(0.0, 100.0, "N·m"), "effort limit of the jaw's drive", source="assumed"
    )
    inertia: float = parameter(1e-4, Within(1e-7, 1.0, "kg·m²"), "inertia of drive and fingers", source="assumed")
    viscous: float = parameter(1e-3, Within(0.0, 10.0, "N·m·s/rad"), "viscous friction of the drive", source="assumed")
    bandwidth: float = parameter(
        100.0,
        Within(1.0, 200.0, "rad/s"),
        "bandwidth of the jaw's control law, which is critically damped",
        source="assumed",
    )
    finger_length: float = parameter(
        0.04, Within(1e-3, 0.5, "m"), "distance from the pivot of a finger to its pad", source="assumed"
    )
    origin: tuple[float, ...] = fixed(
        (0.0, 0.0, 0.0),
        Within(-10.0, 10.0, "m"),
        "origin of the board in the base of the first arm; positions of objects and pegs are relative to it",
        length=3,
    )
    second_base: tuple[float, ...] = fixed(
        (0.0, 0.0, 0.0),
        Within(-10.0, 10.0, "m"),
        "position of the second arm's base in the base of the first arm; their axes are parallel",
        length=3,
    )
    object: GripObjectParameters = field(default_factory=GripObjectParameters)
    pegs: PegParameters = field(default_factory=PegParameters)
