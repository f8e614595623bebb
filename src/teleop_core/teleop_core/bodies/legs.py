"""Legs of changing length: telescopes of rigid tubes between two points."""

import math
from dataclasses import dataclass

import numpy as np

from teleop_core.bodies.body import Body, Joint
from teleop_core.bodies.solids import Solid, along, ball, capsule, rim
from teleop_core.geometry import Array
from teleop_core.portable import arctangent, length

_SHARE = 0.95  # of the shortest leg: length of a tube
_THINNER = 0.72  # radius of a tube over that of the one around it


@dataclass(frozen=True)
class Telescope:
    """Tubes of legs that are all alike.

    Args:
        shortest: Length of the shortest leg [m], > 0.
        longest: Length of the longest leg [m]; beyond it the tubes come apart.
        radius: Radius of the outer tube [m].
    """

    shortest: float
    longest: float
    radius: float

    @property
    def tube(self) -> float:
        """Length of a tube [m]."""
        return _SHARE * self.shortest

    @property
    def tubes(self) -> int:
        """Number of tubes of a leg, two at least."""
        return max(2, math.ceil(self.longest / self.tube))

    def bodies(self, legs: int, first: int = 0) -> list[Body]:
        """Bodies of all legs, those of the first leg first, the tube at the base first.

        Args:
            legs: Number of legs.
            first: Index of the first among the free bodies of the robot.
        """
        end, found = np.array([0.0, 0.0, self.tube]), []
        for leg in range(legs):
            for tube in range(self.tubes):
                solid = capsule(np.zeros(3), end, self.radius * math.pow(_THINNER, tube), "leg")
                place, name = first + leg * self.tubes + tube, f"leg{leg + 1}_tube{tube + 1}"
                found.append(Body(name, (solid,), 0, Joint.FREE, coordinate=place))
        return found

    def poses(self, starts: Array, ends: Array) -> Array:
        """Poses (N, k · tubes, 7) of legs from points (N, k, 3) to points (N, k, 3) [m]."""
        ways = ends - starts
        lengths = length(ways)[..., None]
        units = np.divide(ways, lengths, out=np.zeros_like(ways), where=lengths > 0.0)
        shares = np.linspace(0.0, 1.0, self.tubes)[:, None]
        out = np.empty((*lengths.shape[:2], self.tubes, 7))
        out[..., :3] = starts[..., None, :] + (units * (lengths - self.tube))[..., None, :] * shares
        out[..., 3:] = along(ways.reshape(-1, 3)).reshape(*lengths.shape[:2], 1, 4)
        return out.reshape(len(out), out.shape[1] * self.tubes, 7)


def plate(points: Array, radius: float, is_base: bool = False) -> tuple[Solid, ...]:
    """Rim of a plate through joint points (k, 3) [m] about its z axis, with a ball at each."""
    turned = points - points.mean(axis=0)
    order = np.argsort(arctangent(turned[:, 1], turned[:, 0]))
    balls = (ball(point, 1.8 * radius, "joint") for point in points)
    return (*rim(points[order], radius, "base" if is_base else "platform"), *balls)
