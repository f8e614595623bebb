"""Node ``inverse_kinematics``: joint references for every pose the slave shall reach."""

import sys
from typing import Any

from teleop_core import topics
from teleop_core.nodes.answering import AnsweringNode
from teleop_core.nodes.process import run
from teleop_core.robots.inverse_kinematics import InverseKinematics, InverseKinematicsParameters
from teleop_core.session.graph import STAGE


class InverseKinematicsNode(AnsweringNode):
    """One solution per ``slave/servo_cp``, under the same stamp."""

    def __init__(self, **options: Any) -> None:
        super().__init__(STAGE["inverse_kinematics"], **options)

    def setup(self, parameters: InverseKinematicsParameters) -> None:
        """Make the solver of the robot and open its topics."""
        self.stage = InverseKinematics(parameters)
        self.open_streams(self.stage.robot.joint_names)
        self.listen(topics.SLAVE_SERVO_CP, topics.SLAVE_SETPOINT_JS)

    def start(self) -> None:
        """Start from the slave's joints, wherever they are."""
        self.stage.signals["setpoint_stamp_ns"] = 0


def main() -> int:
    """Entry point of ``ros2 run teleop_core inverse_kinematics``."""
    return run(InverseKinematicsNode)


if __name__ == "__main__":
    sys.exit(main())
