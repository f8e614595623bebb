"""Node ``inverse_kinematics``: joint references for every pose the slave shall reach."""

import sys
import time
from typing import Any

from teleop_core.bags import topics
from teleop_core.nodes.base import CoreNode
from teleop_core.nodes.process import run
from teleop_core.nodes.streams import Waiter
from teleop_core.robots.inverse_kinematics import InverseKinematics, InverseKinematicsParameters
from teleop_core.session.graph import STAGE


class InverseKinematicsNode(CoreNode):
    """One solution per ``slave/servo_cp``, under the same stamp."""

    def __init__(self, **options: Any) -> None:
        super().__init__(STAGE["inverse_kinematics"], **options)

    def setup(self, parameters: InverseKinematicsParameters) -> None:
        """Make the solver of the robot and open its topics."""
        self.stage = InverseKinematics(parameters)
        self.open_streams(self.stage.robot.joint_names)
        self._signals = self.stage.signals
        self._servo_cp = self.input(topics.SLAVE_SERVO_CP)
        self._setpoint = self.input(topics.SLAVE_SETPOINT_JS)
        self._servo_jp = self.output(topics.SLAVE_SERVO_JP)
        assert self._servo_cp.subscription is not None
        self._waiter = Waiter(self.context, self._servo_cp.subscription)

    def start(self) -> None:
        """Start from the slave's joints, wherever they are."""
        self._signals["setpoint_stamp_ns"] = 0

    def turn(self) -> None:
        """Answer the next pose."""
        self._waiter.wait(0.1)
        self.work()

    def work(self) -> None:
        """Answer the poses that have come, one by one."""
        if self._setpoint.newest():
            self._signals["setpoint_stamp_ns"] = self._setpoint.stamp_ns
        while self._servo_cp.take():
            # Without knowing where the slave is, any solution could be another branch.
            if self._setpoint.stamp_ns is not None:
                self._answer()

    def _answer(self) -> None:
        stamp_ns = self._servo_cp.stamp_ns
        assert stamp_ns is not None
        self._signals["stamp_ns"] = stamp_ns
        with self.lock:
            self.stage.step()
        self._servo_jp.send(stamp_ns)
        self.counts.ticks += 1
        self.delay.put(time.time_ns() - stamp_ns)

    def concerns(self) -> list[str]:
        """Topics that are missing or silent, poses that are out of reach."""
        timeout = self.parameters.feedback_timeout
        inputs = (self._servo_cp, self._setpoint)
        return [f"no {entry.topic.name}" for entry in inputs if entry.age() > timeout]


def main() -> int:
    """Entry point of ``ros2 run teleop_core inverse_kinematics``."""
    return run(InverseKinematicsNode)


if __name__ == "__main__":
    sys.exit(main())
