"""Node ``motion_scaling``: the slave's pose and the hand's force for every pose of the master."""

import sys
from typing import Any

from teleop_core import topics
from teleop_core.mapping.motion_scaling import MotionScaling, MotionScalingParameters
from teleop_core.nodes.answering import AnsweringNode
from teleop_core.nodes.process import run
from teleop_core.session.graph import STAGE
from teleop_core.session.runner import state_report


class MotionScalingNode(AnsweringNode):
    """One step per ``master/measured_cp``, whose stamp goes on with what is made of it."""

    def __init__(self, **options: Any) -> None:
        super().__init__(STAGE["motion_scaling"], **options)

    def setup(self, parameters: MotionScalingParameters) -> None:
        """Make the scaling and open its topics."""
        self.stage = MotionScaling(parameters)
        self.open_streams()
        self.listen(topics.MASTER_MEASURED_CP, topics.SLAVE_SETPOINT_CP)
        self._buttons = self.input(topics.MASTER_BUTTONS)
        self._state = self.open_publisher(topics.TELEOP_STATE)
        state_report(0, self.stage.signals["teleop_state"])  # loads the message types, 60 ms

    def start(self) -> None:
        """Start from the slave's setpoint, whatever was latched before."""
        self.stage.reset()
        self._reported = b""

    def answer(self, stamp_ns: int) -> None:
        """Take the buttons, answer, and report the state where it changed."""
        self._buttons.newest()
        super().answer(stamp_ns)
        row = self.stage.signals["teleop_state"]
        if row.tobytes() != self._reported:
            self._reported = row.tobytes()
            self._state.publish(state_report(stamp_ns, row))


def main() -> int:
    """Entry point of ``ros2 run teleop_core motion_scaling``."""
    return run(MotionScalingNode)


if __name__ == "__main__":
    sys.exit(main())
