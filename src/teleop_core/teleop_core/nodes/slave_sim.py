"""Node ``slave_sim``: the simulated slave, exactly one step per elapsed millisecond."""

import sys
import time
from collections.abc import Iterable
from typing import Any

from teleop_core import topics
from teleop_core.nodes.base import CoreNode
from teleop_core.nodes.process import run
from teleop_core.session.graph import STAGE
from teleop_core.slave.slave_sim import CommandStatus, SlaveSim, SlaveSimParameters


class SlaveSimNode(CoreNode):
    """Follows the newest ``slave/servo_jp``; holds its last reference when there is none."""

    def __init__(self, **options: Any) -> None:
        super().__init__(STAGE["slave_sim"], **options)

    def setup(self, parameters: SlaveSimParameters) -> None:
        """Make the slave and open its topics."""
        self.stage = SlaveSim(parameters)
        self.open_streams(self.stage.robot.joint_names)
        self._signals = self.stage.signals
        self._servo_jp = self.input(topics.SLAVE_SERVO_JP)
        self._setpoints = [
            self.output(t) for t in (topics.SLAVE_SETPOINT_JS, topics.SLAVE_SETPOINT_CP)
        ]
        self._measured = [
            self.output(t) for t in (topics.SLAVE_MEASURED_JS, topics.SLAVE_MEASURED_CP)
        ]

    def start(self) -> None:
        """Relate the monotonic time of the loop to the stamps."""
        self._epoch_ns = time.time_ns() - time.monotonic_ns()

    def turn(self) -> None:
        """Take the newest command and all steps that are due."""
        self.work(self.schedule.due())

    def work(self, ticks: Iterable[int]) -> None:
        """Take the newest command and the steps of some ticks [ns, monotonic]."""
        if self._servo_jp.newest():
            self._signals["servo_stamp_ns"] = self._servo_jp.stamp_ns
        before_ns = int(self._signals["setpoint_stamp_ns"])
        for tick_ns in ticks:
            now_ns = tick_ns + self._epoch_ns
            with self.lock:
                self.stage.step(now_ns)
            stamp_ns = int(self._signals["setpoint_stamp_ns"])
            for setpoint in self._setpoints:
                setpoint.send(stamp_ns)
            for measured in self._measured:
                measured.send(now_ns)
        if stamp_ns != before_ns:
            self.delay.put(time.time_ns() - stamp_ns)

    def concerns(self) -> list[str]:
        """A slave that holds still because nothing sound tells it where to go."""
        status = CommandStatus(int(self._signals["command_status"]))
        if self._servo_jp.stamp_ns is None:
            return ["waits for slave/servo_jp and holds"]
        if status is CommandStatus.STALE:
            return [f"no slave/servo_jp for {self._servo_jp.age():.1f} s: holds"]
        return ["slave/servo_jp jumped: holds"] if status is CommandStatus.REFUSED else []

    def values(self) -> dict[str, str]:
        """How many commands were too far away to be followed."""
        return {"refused.slave/servo_jp.jump": str(self.stage.refused)}


def main() -> int:
    """Entry point of ``ros2 run teleop_core slave_sim``."""
    return run(SlaveSimNode)


if __name__ == "__main__":
    sys.exit(main())
