"""Device joints: which joint of a jointed device is which of a robot, from moving each alone."""

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from teleop_core.base.errors import ParameterError
from teleop_core.kernels.geometry import Array
from teleop_core.kernels.portable import length
from teleop_core.robots.robot import Robot

Positions = Mapping[str, float]
"""Positions [rad or m] by the device's names of its joints."""
_LEAST = 0.05  # of a joint's range that it must be moved by
_MOST = 1.5  # of that range; what goes farther is told in another unit
_ALONE = 0.4  # largest move of any other joint, of that of the joint
_HELD = 0.025
"""How well a person holds a joint, of its range up to a turn, assumed: less is no offset."""
_ON_AXIS = 0.03
"""A tip that is nearer to the joint's axis turns and does not travel [m]."""
_BESIDE = 0.5  # least part of a direction that is told beside the largest
_WAYS = (("forward", "back"), ("to the left", "to the right"), ("up", "down"))
"""Ways along and against x, y and z of the base of a robot, as ROS has them (REP 103)."""


@dataclass(frozen=True)
class JointParameters:
    """What ``master_bridge`` needs to know of a device's joints.

    Attributes:
        handle_joints: ``ours=theirs`` for each joint that the device calls otherwise.
        handle_signs: 1.0 or -1.0 for each of our joints: ours = sign * theirs + offset.
        handle_offsets: Of each of our joints [rad or m].
    """

    handle_joints: tuple[str, ...]
    handle_signs: tuple[float, ...]
    handle_offsets: tuple[float, ...]


class DeviceJoints:
    """Finder of a device's joints, which are moved one after the other, first from home.

    Args:
        robot: The device as a robot, whose joints are looked for in their order.
        rest: Where the device's joints are while it is held as the robot at home.
    """

    def __init__(self, robot: Robot, rest: Positions) -> None:
        self._robot, self._rest = robot, dict(rest)
        self._theirs: list[str] = []
        self._signs: list[float] = []

    @property
    def joint(self) -> str:
        """Our joint that is to be moved next; empty once all were."""
        return "".join(self._robot.joint_names[len(self._theirs) : len(self._theirs) + 1])

    def way(self, now: Positions) -> str:
        """Which way that joint is to be moved, in words: the one in which its position rises.

        Args:
            now: Where the device's joints are.

        Raises:
            ParameterError: It is not told of a joint that was found.
        """
        column = self._robot.jacobian(self._posture(now))[:, len(self._theirs)]
        if length(column[3:]) > 0.0 and length(column[:3]) < _ON_AXIS:
            return f"it turns clockwise as you look {_words(column[3:])}"
        return f"its tip goes {_words(column[:3])}"

    def take(self, begin: Positions, end: Positions) -> str:
        """The device's name of the joint, from its move.

        Args:
            begin: Where the device's joints were before.
            end: Where they are.

        Raises:
            ParameterError: It was moved too little or not alone, was moved for another one of ours,
                or goes farther than it can, as where degrees are told; nothing is taken then.
        """
        room = self._room(len(self._theirs))
        moves = {n: end[n] - begin[n] for n in begin if n in end and n in self._rest}
        name, *others = sorted(moves, key=lambda name: -abs(moves[name])) or [""]
        move, beside = moves.get(name, 0.0), max((abs(moves[n]) for n in others), default=0.0)
        where = f"move of {self.joint}"
        if not abs(move) >= _LEAST * room:
            raise ParameterError(where, move, f"at least {_LEAST * room:.2g} rad or m")
        if abs(move) > _MOST * room:
            raise ParameterError(where, move, f"within {room:.3g}: does the driver say degrees?")
        if beside > _ALONE * abs(move):
            raise ParameterError(where, {n: moves[n] for n in (name, others[0])}, "one joint alone")
        if name in self._theirs:
            ours = self._robot.joint_names[self._theirs.index(name)]
            raise ParameterError(where, name, f"another joint than that of {ours}")
        self._theirs.append(name)
        self._signs.append(1.0 if move > 0.0 else -1.0)
        return name

    def place(self, now: Positions) -> Array:
        """Where the tip is (3,) [m] in the base of the robot; joints to be found are at home.

        Args and errors as of :meth:`way`.
        """
        found: Array = self._robot.fk(self._posture(now))[:3, 3]
        return found

    def parameters(self) -> JointParameters:
        """What was found of all joints of the robot."""
        renamed, offsets = [], []
        for k, name in enumerate(self._theirs):
            ours, room = self._robot.joint_names[k], self._room(k)
            offset = float(self._robot.home[k]) - self._signs[k] * self._rest[name]
            is_held = abs(offset) < _HELD * min(room, 2.0 * math.pi)
            offsets.append(0.0 if is_held else round(offset, 4))
            renamed += [f"{ours}={name}"] * (ours != name)
        return JointParameters(tuple(renamed), tuple(self._signs), tuple(offsets))

    def _room(self, joint: int) -> float:
        """Range of one of our joints [rad or m]."""
        return float(self._robot.upper[joint] - self._robot.lower[joint])

    def _posture(self, now: Positions) -> Array:
        p, q = self.parameters(), self._robot.home.copy()
        for k, (name, sign) in enumerate(zip(self._theirs, p.handle_signs, strict=True)):
            if name not in now:
                raise ParameterError("joints of the device", sorted(now), f"with {name}")
            q[k] = sign * now[name] + p.handle_offsets[k]
        return q


def _words(direction: Array) -> str:
    """Direction (3,) in words, of which the largest part comes first."""
    size = np.abs(direction)
    told = [k for k in np.argsort(-size, kind="stable") if size[k] >= _BESIDE * size.max()]
    return " and ".join(_WAYS[k][int(direction[k] < 0.0)] for k in told)
