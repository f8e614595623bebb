"""Parallel robots: bodies of the Stewart platform and of the 3-RPS, on telescoping legs."""

import math
from dataclasses import dataclass

import numpy as np

from teleop_core.kernels import Array, arctangent, length, product
from teleop_core.robots.bodies.frames import tips
from teleop_core.robots.body import HERE, Bodies, Body, Joint
from teleop_core.robots.robot import Robot
from teleop_core.robots.solids import Solid, along, ball, capsule, rim
from teleop_machines.rps3_loop import COSINES, SINES

_SHARE = 0.95  # length of a tube, divided by the length of the shortest leg
_THINNER = 0.72  # radius of a tube divided by the radius of the tube around it


@dataclass(frozen=True)
class Telescope:
    """Tubes of legs with equal dimensions.

    Args:
        shortest: Length of the shortest leg [m], > 0.
        longest: Length of the longest leg [m]; in a longer leg the tubes do not overlap.
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
        """Number of tubes of a leg, at least two."""
        return max(2, math.ceil(self.longest / self.tube))

    def bodies(self, legs: int, first: int = 0) -> list[Body]:
        """Bodies of all legs, leg by leg; in each leg, the tube at the base comes first.

        Args:
            legs: Number of legs.
            first: Index of the first tube among the free bodies of the robot.
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
    """Rim of a plate through joint points (k, 3) [m], sorted about the z axis, with a ball at each point."""
    turned = points - points.mean(axis=0)
    order = np.argsort(arctangent(turned[:, 1], turned[:, 0]))
    balls = (ball(point, 1.8 * radius, "joint") for point in points)
    return (*rim(points[order], radius, "base" if is_base else "platform"), *balls)


_RADIUS = 0.06  # radius of a leg's outer tube, divided by the platform's size


def stewart_bodies(robot: Robot) -> Bodies:
    """Base, telescopes between the joint points of the layout, platform."""
    points = robot.geometry_row[:36].reshape(2, 6, 3)
    return _platform_on_legs(robot, points[0], points[1])


def rps3_bodies(robot: Robot) -> Bodies:
    """Base, telescopes from hinges to ball joints, platform."""
    circle = np.stack((COSINES, SINES, np.zeros(3)), axis=-1)
    return _platform_on_legs(robot, robot.geometry["b"] * circle, robot.geometry["a"] * circle)


def _platform_on_legs(robot: Robot, base: Array, platform: Array) -> Bodies:
    """Bodies of a platform, which is the tip, on legs whose lengths are the joints.

    Joint points (n, 3) [m] of the base are in base coordinates; those of the platform are in platform coordinates.
    """
    radius = _RADIUS * float(length(platform).max())
    legs = Telescope(float(robot.lower.min()), float(robot.upper.max()), radius)

    def coordinates(q: Array) -> tuple[Array, Array]:
        transforms, poses = tips(robot, q)
        ends = product(platform, transforms[:, :3, :3].swapaxes(1, 2)) + transforms[:, None, :3, 3]
        starts = np.broadcast_to(base, ends.shape)
        return q, np.concatenate((legs.poses(starts, ends), poses[:, None]), axis=1)

    count = robot.n * legs.tubes
    bodies = [Body("base", plate(base, radius, is_base=True), -1), *legs.bodies(robot.n)]
    bodies.append(Body("platform", plate(platform, radius), 0, Joint.FREE, HERE, count))
    bodies.append(Body("tip", (ball(np.zeros(3), 1.5 * radius, "tool"),), 0, Joint.FREE, HERE, count))
    moved = tuple((leg + 1) * legs.tubes for leg in range(robot.n))
    size = float(length(base).max() + robot.upper.max())
    return Bodies(tuple(bodies), robot.n, coordinates, moved, size)
