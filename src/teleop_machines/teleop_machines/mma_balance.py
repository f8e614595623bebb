"""Balance of the MMA's shoulder: the published spring at joint 2, and the load that it does not balance.

The design balances only the *difference* of the gravity torque between two poses, 0.16 N·m. The spring is slack in the
first pose, where the gravity torque is 1.03 N·m. In the worst pose the spring gives 0.18 of 1.19 N·m, so the operator
has to apply 1.01 N·m. :func:`shoulder_load` returns this residual.

Source:
    Singh 2014, chapter 5, misprints corrected; torques about joint 2, positive downwards.
"""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from teleop_core.base.errors import ParameterError
from teleop_core.kernels.geometry import Array

STANDARD_GRAVITY = 9.8  # [m/s²], the value of the source
# Table 5.1 [kg]; the printed total, 310.36 g, is not the sum of its rows.
MASSES = {
    "L2": 0.03773, "L3": 0.02587, "L3a": 0.00746, "L3b": 0.02587, "L4": 0.02557, "L5": 0.01693,
    "L6": 0.01209, "L7": 0.15259, "packing": 0.00325,
}  # fmt: skip
# Horizontal distance of the common mass centre from joint 2 [m].
ARM_AT_45_DEGREES = 0.34360  # with link 2 at 45°
ARM_LEVEL = 0.39594  # with link 2 level


@dataclass(frozen=True, kw_only=True)
class ShoulderSpring:
    """Compression spring between points on links 1 and 2, both at the distance ``anchor`` from joint 2."""

    anchor: float = 0.028
    """[m]"""
    free_length: float = 0.05173
    """[m]"""
    rate: float = 754.57
    """Spring rate [N/m], with the safety factor 1.15."""

    def __post_init__(self) -> None:
        for name in ("anchor", "free_length", "rate"):
            _positive(name, getattr(self, name))

    def length(self, opening: float | Array) -> Array:
        """Distance between the anchors [m] if the angle between links 1 and 2 is ``opening`` [rad]."""
        return 2.0 * self.anchor * np.sin(0.5 * np.asarray(opening))

    def lever(self, opening: float | Array) -> Array:
        """Distance of the spring's line from joint 2 [m]."""
        return self.anchor * np.cos(0.5 * np.asarray(opening))

    def torque(self, opening: float | Array) -> Array:
        """Torque that lifts link 2 [N·m]; zero when the spring is slack."""
        deflection = np.maximum(self.free_length - self.length(opening), 0.0)
        return self.rate * deflection * self.lever(opening)


class Coil(NamedTuple):
    """Dimensions of a helical spring (table 5.2)."""

    turns: int
    slenderness: float
    """Free length, divided by mean diameter."""
    solid_length: float
    """[m]"""
    spring_index: float
    """Mean diameter, divided by wire diameter."""
    pitch: float
    """[m]"""


class ShoulderLoad(NamedTuple):
    """Torques about joint 2 [N·m], each of the shape of θ2."""

    gravity: Array
    spring: Array
    residual: Array
    """Gravity torque that the spring does not balance; positive pulls link 2 down."""


def gravity_torque(mass: float, arm: float | Array) -> Array:
    """Torque [N·m] of a mass [kg] at a horizontal distance [m]."""
    return mass * STANDARD_GRAVITY * np.asarray(arm)


def matching_rate(torque_difference: float, deflection: float, lever: float) -> float:
    """Rate [N/m] of a spring, slack in the first pose, that gives a torque difference [N·m].

    Args:
        torque_difference: Second minus first gravity torque [N·m].
        deflection: Deflection of the spring in the second pose [m], > 0.
        lever: Lever arm of the spring in the second pose [m], > 0.

    Returns:
        Rate without safety factor [N/m].

    Raises:
        ParameterError: A length is not positive.

    Source:
        Singh 2014, eq. 5.33.
    """
    return torque_difference / (_positive("deflection", deflection) * _positive("lever", lever))


def coil(
    *,
    free_length: float = 0.05173,
    diameter: float = 0.014,
    wire: float = 0.0015,
    rate: float = 754.57,
    shear_modulus: float = 42.5e9,
) -> Coil:
    """Helical spring of a given rate.

    The source prints 13 turns and no material. 13 turns need a shear modulus of 40.9 to 44.2 GPa, as phosphor bronze
    has; steel would need 24 turns.

    Args:
        free_length: [m], > 0.
        diameter: Mean diameter of the coil [m], > 0.
        wire: Diameter of the wire [m], > 0.
        rate: [N/m], > 0.
        shear_modulus: [Pa], > 0.

    Raises:
        ParameterError: A value is not positive, or the spring would have fewer than two turns.

    Source:
        Singh 2014, table 5.2: N = G d⁴ / (8 D³ k).
    """
    given = {
        "free_length": free_length,
        "diameter": diameter,
        "wire": wire,
        "rate": rate,
        "shear_modulus": shear_modulus,
    }
    for name, value in given.items():
        _positive(name, value)
    turns = round(shear_modulus * wire**4 / (8.0 * diameter**3 * rate))
    if turns < 2:
        raise ParameterError("rate", rate, "small enough for two turns")
    return Coil(turns, free_length / diameter, turns * wire, diameter / wire, free_length / (turns - 1))


def shoulder_load(theta2: float | Array, spring: ShoulderSpring | None = None) -> ShoulderLoad:
    """Torques of gravity and spring at joint 2, and their difference, for θ2 [rad] (-90° upright, 0 level).

    The source gives the lever arm of the mass centre in two poses. Between these poses the links after the shoulder
    keep their orientation of home. So the lever arm is a constant plus a cosine, fitted to the two values. The angle
    between links 1 and 2 is 90° - θ2.

    Args:
        theta2: θ2 [rad], any shape.
        spring: Spring at joint 2; None for the published spring.

    Returns:
        :class:`ShoulderLoad`.
    """
    angle = np.asarray(theta2, dtype=np.float64)
    swing = (ARM_LEVEL - ARM_AT_45_DEGREES) / (1.0 - math.sqrt(0.5))
    arm = ARM_LEVEL - swing * (1.0 - np.cos(angle))
    gravity = gravity_torque(sum(MASSES.values()), arm)
    lifting = (spring or ShoulderSpring()).torque(0.5 * math.pi - angle)
    return ShoulderLoad(gravity, lifting, gravity - lifting)


def _positive(name: str, value: float) -> float:
    if not (math.isfinite(value) and value > 0.0):
        raise ParameterError(name, value, "finite and > 0")
    return value
