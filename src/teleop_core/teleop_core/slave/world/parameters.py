"""Parameters of the world: the object, where it is, and what it is made of."""

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from teleop_core.base.errors import ParameterError
from teleop_core.base.parameters import Choice, choice, parameter
from teleop_core.kernels.geometry import Array
from teleop_core.slave.world import WORLD_OBJECTS


class Material(NamedTuple):
    """What an object is made of.

    Attributes:
        stiffness: Of its surface [N/m].
        damping: Of Hunt and Crossley's law [s/m]: share of the force per speed.
        friction: Dry friction over normal force.
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
"""Materials by name. All numbers are assumed: what a tip meets depends on its own size as well."""
_FARTHEST = 3.0  # below a tip, where an object is looked for [m]


@dataclass(frozen=True, kw_only=True)
class WorldParameters:
    """What the tip can touch."""

    kind: Choice = choice(WORLD_OBJECTS, "empty", fixed=True, doc="what the tip can touch")
    place: tuple[float, ...] = parameter(
        (), unit="m", lower=-10.0, upper=10.0, fixed=True,
        doc="middle of the object in the slave's base; empty: straight below the tip of the "
        "robot's start, gap apart",
    )  # fmt: skip
    gap: float = parameter(
        0.01, unit="m", lower=0.0, upper=1.0, fixed=True,
        doc="between that tip and the object, if no place is given",
    )  # fmt: skip
    material: str = parameter(
        "tissue", choices=(*MATERIALS, "own"),
        doc="what it is made of; own: of the following three numbers",
        source="assumed: all five; what a tip meets depends on its own size as well",
    )  # fmt: skip
    stiffness: float = parameter(
        1000.0, unit="N/m", lower=1.0, upper=1e5, doc="of the surface, if the material is own"
    )
    damping: float = parameter(
        1.0, unit="s/m", lower=0.0, upper=100.0,
        doc="share of the force per speed, if the material is own",
        source="assumed: the number; the law is that of Hunt and Crossley 1975",
    )  # fmt: skip
    friction_coefficient: float = parameter(
        0.3, lower=0.0, upper=2.0, doc="over the normal force, if the material is own"
    )

    puncture_force: float = parameter(
        0.0, unit="N", lower=0.0, upper=100.0,
        doc="push along the normal at which the surface gives way to the tip, of any material; "
        "0: it never does",
    )  # fmt: skip
    cutting_force: float = parameter(
        0.2, unit="N", lower=0.0, upper=100.0,
        doc="push against a tip that goes deeper than before, behind a punctured surface",
        source="assumed: the number; the law is that of Okamura, Simone and O'Leary 2004",
    )  # fmt: skip
    shaft_friction: float = parameter(
        20.0, unit="N/m", lower=0.0, upper=1e4,
        doc="dry friction of the needle's shaft over its depth behind a punctured surface",
        source="assumed: the number; the law is that of Okamura, Simone and O'Leary 2004",
    )  # fmt: skip
    hole_radius: float = parameter(
        0.002, unit="m", lower=1e-4, upper=0.1,
        doc="how near to the last hole the tip enters it again without a puncture",
        source="assumed",
    )  # fmt: skip

    @property
    def made_of(self) -> Material:
        """The material, the own one or that of the name."""
        if self.material == "own":
            return Material(self.stiffness, self.damping, self.friction_coefficient)
        return MATERIALS[self.material]

    @cached_property
    def shape(self) -> Array:
        """Numbers of the object, as its distance takes them; a mesh is read, and may be refused."""
        return WORLD_OBJECTS.find(self.kind.kind).numbers(self.kind.parameters)

    def distance(self, tip: Array, center: Array) -> float:
        """How far a tip (3,) is outside the object with its middle at ``center`` (3,) [m]."""
        part = WORLD_OBJECTS.find(self.kind.kind)
        return float(part.distance(tip - center, self.shape, np.zeros(3)))

    def __post_init__(self) -> None:
        if len(self.place) not in {0, 3}:
            raise ParameterError("world.place", self.place, "x, y, z, or empty")
        if self.puncture_force > 0.0 and getattr(self.kind.parameters, "click_force", 0.0) > 0.0:
            raise ParameterError("world.puncture_force", self.puncture_force, "0 for a button")

    def below(self, tip: Array) -> Array:
        """Middle of the object (3,) [m] that lies straight below a tip (3,) [m], a gap apart.

        Raises:
            ParameterError: There is none.
        """
        down, near, far = np.array([0.0, 0.0, -1.0]), 0.0, _FARTHEST
        if not self.distance(tip, tip) < self.gap <= self.distance(tip, tip + far * down):
            text = f"given for a {self.kind.kind} that cannot lie straight below the tip"
            raise ParameterError("world.place", self.place, text)
        for _ in range(60):  # to a rounding of the place
            way = 0.5 * (near + far)
            is_apart = self.distance(tip, tip + way * down) >= self.gap
            near, far = (near, way) if is_apart else (way, far)
        return tip + far * down
