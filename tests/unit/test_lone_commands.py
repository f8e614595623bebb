"""Lone commands: a pose or joints sent once are gone to, all the way, at the arm's own limits."""

import numpy as np
import pytest

from present import present
from teleop_core.coupling.mapping.inverse_kinematics import InverseKinematics, InverseKinematicsParameters
from teleop_core.graph.signals import DT, TICK_NS
from teleop_core.kernels.geometry import Array, pose_from_transform
from teleop_core.robots import load_robot
from teleop_core.slave.pair import ArmParameters, SimulatedArm

ARM = load_robot("rcrt1")
MIDDLE = np.array([0.1, 1.7, 0.36, 0.2, 0.5, 0.1])


class Chain:
    """Inverse kinematics and a slave, each with a node's idea of time: messages come when sent."""

    def __init__(self) -> None:
        self.solver = InverseKinematics(InverseKinematicsParameters())
        self.slave = SimulatedArm(ArmParameters(start=tuple(MIDDLE.tolist()), start_speed=1.0))
        self.now_ns = 10**9
        self.run(1)
        while self.slave.server.operation["is_busy"]:
            self.run(100)

    def run(self, ticks: int) -> Array:
        """Setpoints (ticks, n) of the slave."""
        found = np.empty((ticks, 6))
        for i in range(ticks):
            self.now_ns += TICK_NS
            self.slave.signals["now_ns"] = self.now_ns
            self.slave.step()
            found[i] = self.slave.signals["slave_setpoint_js"]
        return found

    def send(self, T: Array) -> None:
        """A message of servo_cp, answered by one of servo_jp."""
        row, slave = self.solver.signals, self.slave.signals
        pose_from_transform(np.ascontiguousarray(T), row["slave_servo_cp"])
        row["slave_servo_cp_ns"] = row["now_ns"] = self.now_ns
        for name in ("slave_setpoint_js", "slave_setpoint_js_ns"):
            row[name] = slave[name]
        self.solver.step()
        slave["slave_servo_jp"] = row["slave_servo_jp"]
        slave["slave_servo_jp_ns"] = self.now_ns

    @property
    def tip(self) -> Array:
        return ARM.fk(self.slave.signals["slave_setpoint_js"])


@pytest.fixture
def chain() -> Chain:
    return Chain()


def moved(T: Array, *way: float) -> Array:
    goal = T.copy()
    goal[:3, 3] += way
    return goal


def test_a_lone_pose_20_mm_away_is_reached_within_the_limits(chain: Chain) -> None:
    goal = moved(chain.tip, 0.02, 0.0, 0.0)
    chain.send(goal)
    path = chain.run(1500)
    np.testing.assert_allclose(chain.tip, goal, atol=1e-6)
    assert (np.abs(np.diff(path, axis=0)) <= present(ARM.drives).speed_limit * DT * (1 + 1e-9)).all()


def test_lone_poses_with_pauses_between_them_are_all_reached(chain: Chain) -> None:
    for way in ((0.02, 0, 0), (0, 0.02, 0), (0, 0, -0.02), (-0.02, -0.02, 0.02)):
        goal = moved(chain.tip, *way)
        chain.send(goal)
        chain.run(1500)
        np.testing.assert_allclose(chain.tip, goal, atol=1e-6)


def test_a_lone_pose_after_a_move_starts_from_where_the_move_ended(chain: Chain) -> None:
    chain.send(moved(chain.tip, 0.02, 0.0, 0.0))
    chain.run(1500)
    chain.slave.server.motion.move(MIDDLE - np.array([0.2, 0.1, 0.05, 0.3, 0.2, 0.2]))
    chain.run(3000)
    goal = moved(chain.tip, 0.0, 0.015, 0.0)
    chain.send(goal)
    chain.run(1500)
    np.testing.assert_allclose(chain.tip, goal, atol=1e-6)


def test_a_lone_pose_far_away_is_gone_to_no_farther_than_the_slave_takes(chain: Chain) -> None:
    goal = moved(chain.tip, 0.0, 0.3, 0.0)
    refused = chain.slave.server.refused
    chain.send(goal)
    chain.run(3000)
    assert chain.slave.server.refused == refused
    way = np.linalg.norm(chain.tip[:3, 3] - goal[:3, 3])
    assert 0.0 < way < 0.3
