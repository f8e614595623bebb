"""Rests: rest positions of the slave after repeated moves to joint targets."""

import math
from dataclasses import replace

import numpy as np

from teleop_core.graph import TICK_NS
from teleop_core.kernels import Array, Integers, kernel
from teleop_core.robots import load_robot_set
from teleop_core.robots.hardware import Hardware
from teleop_core.slave.commands import SlaveRow
from teleop_core.slave.pair import ArmParameters, SimulatedArm, arm_step
from teleop_core.slave.trajectory import cubic_move, shortest_move_time

_FINE = 1e-4  # step of smooth encoders, divided by the real encoder step


@kernel
def _drive(calls: Integers, row: SlaveRow, way: Array, begin_ns: int, dt: float) -> None:
    """Command a joint path (N, n), one joint vector per tick; the first tick is the one after ``begin_ns``."""
    for k in range(way.shape[0]):
        row.now_ns = begin_ns + (k + 1) * TICK_NS
        row.slave_servo_jp_ns = row.now_ns
        for i in range(way.shape[1]):
            row.slave_servo_jp[i] = way[k, i]
        arm_step(calls, row, dt)


class Mover:
    """A slave that is moved from target to target by cubics, as in the published precision test.

    Args:
        parameters: Parameters of the slave, which always starts at home.
        faults: Faults of the arm that replace its known faults; None for the known faults.
        speed: Speed of the moves as a share of the speed limits.
        settle: Time at rest after each move [s]. If joints stick, the rest positions do not depend on this time.
        is_smooth: Whether encoders and drives have no steps, because a fit needs derivatives.
    """

    def __init__(
        self,
        parameters: ArmParameters,
        faults: Hardware | None = None,
        speed: float = 0.5,
        settle: float = 1.0,
        *,
        is_smooth: bool = False,
    ) -> None:
        home = load_robot_set(parameters.robot, parameters.geometry).home
        self.slave = SimulatedArm(replace(parameters, start=tuple(home.tolist())))
        simulated = self.slave.simulated
        if faults is not None:
            for name in ("coulomb", "bias", "wander"):
                simulated.parameters[name] = getattr(faults, name)
            if len(faults.dynamics):
                simulated.arm.dynamics[:] = faults.dynamics
        if is_smooth:
            simulated.parameters["encoder_step"] *= _FINE
            simulated.parameters["effort_step"] = 0.0
        self._speed, self._settle, self._now_ns = speed, settle, 0
        self.goal = self.slave.robot.home.copy()
        assert self.slave.robot.drives is not None
        self._limit = self.slave.robot.drives.speed_limit * speed

    def move(self, target: Array) -> Array:
        """Move to a target (n,); returns the joints (n,) that the encoders measure at rest.

        A target outside the joint limits is replaced by the nearest joints within them.
        """
        slave, goal = self.slave, np.asarray(target, dtype=np.float64)
        time = shortest_move_time(self.goal, goal, self._limit)
        count = math.ceil((time + self._settle) / slave.dt)
        way = cubic_move(self.goal, goal, time, slave.dt * np.arange(1.0, count + 1.0))[0]
        way = np.ascontiguousarray(way)
        (calls,) = slave.arguments
        _drive(calls, slave.signals, way, self._now_ns, slave.dt)
        self._now_ns += count * TICK_NS
        self.goal = goal
        return np.array(slave.signals["slave_measured_js"][: len(goal)])

    def true_pose(self) -> Array:
        """True pose of the tip: x, y, z [m] and a quaternion, (7,)."""
        return np.array(self.slave.signals["slave_true_cp"])


def rest_positions(
    parameters: ArmParameters, targets: Array, runs: int, faults: Hardware | None = None, *, is_smooth: bool = False
) -> Array:
    """Rest positions (k, runs, n) [rad or m] after ``runs`` moves from home to each target (k, n).

    The slave goes home after each move, as in Vongbunyong 2008, section 7.3.

    Args:
        parameters: Parameters of the slave.
        targets: Joint targets; values outside the limits are set to the limits.
        runs: Number of moves to each target.
        faults: Faults of the arm that replace its known faults.
        is_smooth: Whether encoders and drives have no steps.
    """
    mover = Mover(parameters, faults, is_smooth=is_smooth)
    robot = mover.slave.robot
    home, inside = mover.goal.copy(), np.clip(targets, robot.lower, robot.upper)
    rests = np.empty((len(targets), runs, len(home)))
    for k, target in enumerate(inside):
        for run in range(runs):
            rests[k, run] = mover.move(target)
            mover.move(home)
    return rests
