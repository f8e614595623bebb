"""Random faults in virtual time: no joint ever steps farther than its drive can, nothing is NaN."""

from typing import Any

import numpy as np
import pytest

from led_slave import LedSlave
from present import present
from teleop_core.graph.operation import State
from teleop_core.kernels.geometry import Array
from teleop_core.slave.commands import CommandStatus
from teleop_core.slave.operation import OperationParameters
from teleop_core.slave.operation.faults import Fault
from teleop_core.slave.operation.states import COMMANDS
from teleop_core.slave.pair import ArmParameters, SimulatedArm
from teleop_core.slave.plants import PLANTS

TICK_NS = 1_000_000
SEQUENCES = 30_000
"""Random sequences in all; each is a command, a fault or bad commands, with what follows."""
ROBOTS = ("rcrt1", "puma560", "scara_stewart")
LIMIT = 1.0 + 1e-9


class Chaos(LedSlave):
    """A slave that is sent anything, at any time."""

    def __init__(self, robot: str, seed: int) -> None:
        self.rng = np.random.default_rng(seed)
        standstill = ("hold", "brake")[seed % 2]
        operation = OperationParameters(longest_outage=0.15, standstill=standstill, heartbeat=0.0)
        super().__init__(SimulatedArm(ArmParameters(robot=robot, starts_at_home=True, operation=operation)))
        self.now_ns = 10**9
        drives = present(self.slave.robot.drives)
        self.reach = drives.speed_limit * 1e-3
        self.goal = self.slave.robot.home.copy()
        self.last = self.setpoint
        self.worst = 0.0
        self.states: set[Any]
        self.states = set()

    def tick(self, command: Array | None = None, stamp_ns: int | None = None) -> CommandStatus:
        """One tick; keeps the largest step over the drive's limit."""
        status = super().tick(command, stamp_ns)
        now = self.setpoint
        self.worst = max(self.worst, float(np.max(np.abs(now - self.last) / self.reach)))
        self.last = now
        self.states.add(int(self.row["slave_operation"][0]))
        return status

    def stream(self, ticks: int) -> None:
        """A stream of sound commands that wander about."""
        robot = self.slave.robot
        speed = self.rng.uniform(-1.0, 1.0, robot.n)
        self.goal = self.last.copy()
        for _ in range(ticks):
            self.goal = np.clip(self.goal + speed * self.reach, robot.lower, robot.upper)
            self.tick(self.goal)

    def strike(self) -> None:
        """One random fault."""
        rng, n = self.rng, self.slave.robot.n
        kind = rng.integers(9)
        if kind == 0:
            self.slave.server.request(str(rng.choice(COMMANDS)))
        elif kind == 1:
            self.tick(self.goal + rng.normal(size=n) * 10.0 ** rng.uniform(-6, 12))
        elif kind == 2:
            self.tick(rng.choice([np.nan, np.inf, -np.inf, 1e308], size=n))
        elif kind == 3:
            self.tick(self.goal, int(self.now_ns + rng.integers(-(10**12), 10**12)))
        elif kind == 4:
            for _ in range(int(rng.integers(1, 4))):
                self.tick()
        elif kind == 5:
            fault = Fault(int(rng.integers(1, len(Fault))))
            self.slave.server.fail(fault, float(rng.uniform(0, 10)), 1.0)
        elif kind == 6:
            self.slave.server.press(is_pressed=bool(rng.integers(2)), heard_ns=self.now_ns)
        elif kind == 7:
            self.now_ns += int(rng.integers(0, 2 * 10**8))  # the loop stood still
        else:
            self.slave.simulated.arm.dq[:] += rng.normal(size=n) * self.reach * 100.0  # a blow

    def recover(self) -> None:
        """Do what a person does to go on."""
        self.slave.server.press(is_pressed=False, heard_ns=self.now_ns)
        for word in ("reset", "enable", "resume", "home"):
            if word != "home" or not self.row["slave_operation"][1]:
                self.slave.server.request(word)
            self.tick()


@pytest.mark.slow
@pytest.mark.parametrize("robot", ROBOTS)
def test_no_joint_steps_farther_than_its_drive_can_whatever_happens(robot: str) -> None:
    count = SEQUENCES // len(ROBOTS)
    chaos = Chaos(robot, seed=ROBOTS.index(robot))
    for k in range(count):
        chaos.strike()
        chaos.stream(2)
        if k % 20 == 0:
            chaos.recover()
            chaos.stream(10)
    assert chaos.worst <= LIMIT
    assert chaos.states == {int(state) for state in State}
    for name in ("slave_setpoint_js", "slave_measured_js", "slave_measured_cp"):
        assert np.isfinite(chaos.row[name]).all()


@pytest.mark.slow
@pytest.mark.parametrize("plant", [name for name in PLANTS if name not in PLANTS.elsewhere])
def test_after_any_faults_the_arm_can_be_made_to_follow_again(plant: Any) -> None:
    for seed in range(8):
        chaos = Chaos("rcrt1", seed)
        for _ in range(30):
            chaos.strike()
            chaos.stream(2)
        for _ in range(4000):
            chaos.tick()
        chaos.recover()
        for _ in range(6000):
            chaos.tick()
        before = chaos.last.copy()
        chaos.stream(100)
        assert not np.array_equal(chaos.last, before), seed
