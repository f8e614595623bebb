"""Contents of the world: the object, its position and its material."""

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from teleop_core.base import Choice, ParameterError, Value, Within, choice, fixed, parameter
from teleop_core.kernels.geometry import Array
from teleop_core.slave.world import WORLD_OBJECTS


class Material(NamedTuple):
    """Material of an object.

    Attributes:
        stiffness: Stiffness of its surface [N/m].
        damping: Damping of Hunt and Crossley's law [s/m]: relative increase of the force per speed.
        friction: Dry friction, divided by the normal force.
    """

    stiffness: float
    damping: float
    friction: float


MATERIALS = {
    "tissue": Material(200.0, 2.0, 0.1),
    "silicone": Material(1000.0, 1.5, 0.6),
    "rubber": Material(5000.0, 1.0, 0.8),
    "wood": Material(20000.0, 0.7, 0.4),
    "steel": Material(50000.0, 0.5, 0.2),
}
"""Materials by name. All numbers are assumed: the real contact stiffness also depends on the size of the tip."""
_USUAL: dict[str, Value] = {
    "box.size": (0.06, 0.06, 0.03),
    "cylinder.radius": 0.02,
    "cylinder.direction": (0.0, 0.0, 1.0),
}
"""Parameters of objects whose defaults differ from those of a fixture."""
_FARTHEST = 3.0  # largest distance below the tip at which an object is placed [m]


@dataclass(frozen=True, kw_only=True)
class WorldParameters:
    """Parameters of the object that the tip can touch."""

    kind: Choice = choice(WORLD_OBJECTS, "empty", fixed=True, doc="object that the tip can touch", usual=_USUAL)
    place: tuple[float, ...] = fixed(
        (),
        Within(-10.0, 10.0, "m"),
        "middle of the object in the slave's base; empty: vertically below the tip at the robot's "
        "start, at the distance gap",
    )
    base: tuple[float, ...] = fixed(
        (0.0, 0.0, 0.0),
        Within(-10.0, 10.0, "m"),
        "position of this arm's base in the frame in which place is given, with parallel axes. For a "
        "second arm: its base in the first arm's base, so that both touch the same object",
        length=3,
    )
    gap: float = fixed(
        0.01, Within(0.0, 1.0, "m"), "distance from the tip at the robot's start to the object, if place is empty"
    )
    material: str = parameter(
        "tissue",
        choices=(*MATERIALS, "own"),
        doc="material of the object; own: the parameters stiffness, damping and friction",
        source="assumed: all five materials; the contact force depends on the size of the tip as well",
    )
    stiffness: float = parameter(1000.0, Within(1.0, 1e5, "N/m"), "stiffness of the surface, if the material is own")
    damping: float = parameter(
        1.0,
        Within(0.0, 100.0, "s/m"),
        "damping of the surface, as a share of the force per speed, if the material is own",
        source="assumed: the value; the law is that of Hunt and Crossley 1975",
    )
    friction_coefficient: float = parameter(
        0.3, Within(0.0, 2.0), "friction force divided by the normal force, if the material is own"
    )

    tool_points: int = fixed(
        1,
        Within(1, 16),
        "number of points at which the tool can touch: its tip, and others behind it on the tool's "
        "axis, which is z of the tip",
    )
    tool_length: float = fixed(
        0.02, Within(1e-3, 1.0, "m"), "distance from the tip to the last of several contact points", source="assumed"
    )
    tool_radius: float = fixed(0.0, Within(0.0, 0.1, "m"), "radius of the tool at each of its contact points")

    puncture_force: float = parameter(
        0.0,
        Within(0.0, 100.0, "N"),
        "normal force at which the tip punctures the surface, for any material; 0: the surface cannot be punctured",
    )
    cutting_force: float = parameter(
        0.2,
        Within(0.0, 100.0, "N"),
        "cutting force on a tip that goes deeper than before, behind a punctured surface",
        source="assumed: the value; the law is that of Okamura, Simone and O'Leary 2004",
    )
    shaft_friction: float = parameter(
        20.0,
        Within(0.0, 1e4, "N/m"),
        "dry friction of the needle's shaft, divided by its depth behind the punctured surface",
        source="assumed: the value; the law is that of Okamura, Simone and O'Leary 2004",
    )
    hole_radius: float = parameter(
        0.002,
        Within(1e-4, 0.1, "m"),
        "within this distance of the last hole the tip enters the hole again without a puncture",
        source="assumed",
    )

    @property
    def made_of(self) -> Material:
        """The material: the given numbers, or the named material."""
        if self.material == "own":
            return Material(self.stiffness, self.damping, self.friction_coefficient)
        return MATERIALS[self.material]

    @cached_property
    def shape(self) -> Array:
        """Numbers of the object for its distance function; a mesh file is read, and may be refused."""
        return WORLD_OBJECTS.find(self.kind.kind).numbers(self.kind.parameters)

    def tool(self, T_base_tip: Array) -> Array:
        """Positions (N, 3) [m] of the tool's points in the slave's base, at a tip pose (4, 4)."""
        behind = np.linspace(0.0, self.tool_length, self.tool_points)
        places: Array = T_base_tip[:3, 3] - behind[:, None] * T_base_tip[:3, 2]
        return places

    def distance(self, tool: Array, center: Array) -> float:
        """Distance of the tool's nearest point from the surface of the object [m], positive outside.

        Args:
            tool: Positions of the tool's points (N, 3) [m].
            center: Middle of the object (3,) [m].
        """
        part = WORLD_OBJECTS.find(self.kind.kind)
        found = (part.distance(place - center, self.shape, np.zeros(3)) for place in tool)
        return float(min(found)) - self.tool_radius

    def __post_init__(self) -> None:
        if len(self.place) not in {0, 3}:
            raise ParameterError("world.place", self.place, "x, y, z, or empty")
        if self.puncture_force > 0.0 and getattr(self.kind.parameters, "click_force", 0.0) > 0.0:
            raise ParameterError("world.puncture_force", self.puncture_force, "0 for a button")
        is_needle = self.puncture_force > 0.0 or hasattr(self.kind.parameters, "click_force")
        if is_needle and (self.tool_points > 1 or self.tool_radius > 0.0):
            name = "tool_points" if self.tool_points > 1 else "tool_radius"
            text = "that of a needle (1 point, radius 0) for a button, or with a puncture_force"
            raise ParameterError(f"world.{name}", getattr(self, name), text)

    def center(self, T_base_tip: Array) -> Array:
        """Middle of the object (3,) [m] in the arm's base, for a tip that begins at a pose (4, 4).

        Raises:
            ParameterError: As in :meth:`below`.
        """
        return np.array(self.place) - np.array(self.base) if self.place else self.below(T_base_tip)

    def below(self, T_base_tip: Array) -> Array:
        """Middle (3,) [m] of an object straight below a tip pose (4, 4), with the gap of the parameters to the tip.

        Raises:
            ParameterError: There is no such position.
        """
        tool, tip = self.tool(T_base_tip), T_base_tip[:3, 3]
        down, near, far = np.array([0.0, 0.0, -1.0]), 0.0, _FARTHEST
        if not self.distance(tool, tip) < self.gap <= self.distance(tool, tip + far * down):
            text = f"given for a {self.kind.kind} that cannot lie straight below the tip"
            raise ParameterError("world.place", self.place, text)
        for _ in range(60):  # up to rounding of the position
            way = 0.5 * (near + far)
            is_apart = self.distance(tool, tip + way * down) >= self.gap
            near, far = (near, way) if is_apart else (way, far)
        return tip + far * down
