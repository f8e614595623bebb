"""Node ``motion_scaling``: the slave's pose and the hand's force for every pose of the master."""

import sys
import time
from typing import Any

from teleop_core.bags import topics
from teleop_core.mapping.motion_scaling import MotionScaling, MotionScalingParameters
from teleop_core.nodes.base import CoreNode
from teleop_core.nodes.process import run
from teleop_core.nodes.streams import Waiter
from teleop_core.session.graph import STAGE
from teleop_core.session.runner import state_report


class MotionScalingNode(CoreNode):
    """One step per ``master/measured_cp``, whose stamp goes on with what is made of it."""

    def __init__(self, **options: Any) -> None:
        super().__init__(STAGE["motion_scaling"], **options)

    def setup(self, parameters: MotionScalingParameters) -> None:
        """Make the scaling and open its topics."""
        self.stage = MotionScaling(parameters)
        self.open_streams()
        self._signals = self.stage.signals
        self._pose = self.input(topics.MASTER_MEASURED_CP)
        self._buttons = self.input(topics.MASTER_BUTTONS)
        self._setpoint = self.input(topics.SLAVE_SETPOINT_CP)
        self._servo_cp = self.output(topics.SLAVE_SERVO_CP)
        self._servo_cf = self.output(topics.MASTER_SERVO_CF)
        self._state = self.open_publisher(topics.TELEOP_STATE)
        state_report(0, self._signals["teleop_state"])  # loads the message types, 60 ms
        assert self._pose.subscription is not None
        self._waiter = Waiter(self.context, self._pose.subscription)

    def start(self) -> None:
        """Start from the slave's setpoint, whatever was latched before."""
        self.stage.reset()
        self._reported = b""

    def turn(self) -> None:
        """Answer the next sample of the master."""
        self._waiter.wait(0.1)
        self.work()

    def work(self) -> None:
        """Answer the samples that have come, one by one."""
        if self._setpoint.newest():
            self._signals["setpoint_stamp_ns"] = self._setpoint.stamp_ns
        while self._pose.take():
            self._buttons.newest()
            # Without knowing where the slave is, any pose could move it.
            if self._setpoint.stamp_ns is not None:
                self._answer()

    def _answer(self) -> None:
        stamp_ns = self._pose.stamp_ns
        assert stamp_ns is not None
        self._signals["stamp_ns"] = stamp_ns
        with self.lock:
            self.stage.step()
        self._servo_cp.send(stamp_ns)
        self._servo_cf.send(stamp_ns)
        self.counts.ticks += 1
        self.delay.put(time.time_ns() - stamp_ns)
        self._report_state(stamp_ns)

    def _report_state(self, stamp_ns: int) -> None:
        row = self._signals["teleop_state"]
        if row.tobytes() != self._reported:
            self._reported = row.tobytes()
            self._state.publish(state_report(stamp_ns, row))

    def concerns(self) -> list[str]:
        """Topics that are missing or silent."""
        timeout = self.parameters.feedback_timeout
        inputs = (self._pose, self._setpoint)
        return [f"no {entry.topic.name}" for entry in inputs if entry.age() > timeout]


def main() -> int:
    """Entry point of ``ros2 run teleop_core motion_scaling``."""
    return run(MotionScalingNode)


if __name__ == "__main__":
    sys.exit(main())
