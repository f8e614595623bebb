"""Steps: speeds of the joints and of the tip between setpoints, computed for many setpoints together."""

from typing import NamedTuple

import numpy as np

from teleop_core.bags.layouts import Layout
from teleop_core.graph.signals import DT
from teleop_core.kernels.geometry import Array
from teleop_core.robots import Robot

_BLOCK = 64  # number of setpoints that are judged together


class StepSpeeds(NamedTuple):
    """Largest speeds between some successive setpoints.

    Attributes:
        number: Number of steps.
        joints: Largest speed of each joint, shape (n,) [rad/s or m/s].
        tip: Largest speed of the tip [m/s].
        setpoint: Newest setpoint of the joints, shape (n,) [rad or m].
    """

    number: int
    joints: Array
    tip: float
    setpoint: Array


class StepReader:
    """Collects the setpoints of one process, one in each tick.

    Args:
        form: Layout of the messages.
        robot: The slave.
    """

    def __init__(self, form: Layout, robot: Robot) -> None:
        self._form, self._robot = form, robot
        self._block: list[bytes] = []
        self._last: tuple[Array, Array] | None = None

    def add(self, data: bytes) -> bool:
        """Add a message; returns whether it is time to call :meth:`steps`."""
        self._block.append(data[: self._form.size])
        return len(self._block) >= _BLOCK

    def steps(self) -> StepSpeeds | None:
        """Steps since the last call, also from the setpoint before; None without a setpoint that can be read."""
        if not self._block:
            return None
        rows = np.frombuffer(b"".join(self._block), np.uint8).reshape(len(self._block), -1)
        self._block = []
        if not self._form.matches(rows):
            self._last = None
            return None
        q = self._form.decode(rows)[1][:, : self._robot.n]
        if not np.isfinite(q).all():  # a setpoint that is not a number is infinitely fast
            self._last = None
            return StepSpeeds(len(q), np.full(self._robot.n, np.inf), np.inf, self._robot.home)
        tips = self._robot.fk(q)[:, :3, 3]
        if self._last is not None:
            q, tips = np.vstack((self._last[0], q)), np.vstack((self._last[1], tips))
        self._last = q[-1], tips[-1]
        joints = np.abs(np.diff(q, axis=0)).max(axis=0, initial=0.0) / DT
        tip = np.linalg.norm(np.diff(tips, axis=0), axis=1).max(initial=0.0) / DT
        return StepSpeeds(len(q) - 1, joints, float(tip), q[-1])
