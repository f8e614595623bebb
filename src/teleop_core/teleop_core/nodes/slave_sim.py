"""Node ``slave_sim``: the simulated slave, exactly one step per elapsed millisecond."""

import time
from collections.abc import Iterable

from teleop_core.nodes.ticking import TickingNode
from teleop_core.slave.commands import CommandStatus
from teleop_core.topics import SLAVE_SERVO_JP


class SlaveSimNode(TickingNode):
    """Follows the newest ``slave/servo_jp``; holds its last reference when there is none."""

    def work(self, ticks: Iterable[int]) -> None:
        """Take the newest command and the steps of some ticks [ns, monotonic]."""
        before_ns = int(self.row["slave_setpoint_js_ns"])
        super().work(ticks)
        stamp_ns = int(self.row["slave_setpoint_js_ns"])
        if stamp_ns != before_ns:
            self.delay.put(time.time_ns() - stamp_ns)

    def concerns(self) -> list[str]:
        """A slave that holds still because nothing sound tells it where to go."""
        status = CommandStatus(int(self.row["command_status"]))
        if status is CommandStatus.MOVING:
            return ["moves to where it starts, and follows then"]
        servo_jp = self.input(SLAVE_SERVO_JP)
        if servo_jp.stamp_ns is None:
            return ["waits for slave/servo_jp and holds"]
        if status is CommandStatus.STALE:
            return [f"no slave/servo_jp for {servo_jp.age():.1f} s: holds"]
        return ["slave/servo_jp jumped: holds"] if status is CommandStatus.REFUSED else []

    def values(self) -> dict[str, str]:
        """How many commands were too far away to be followed."""
        return {"refused.slave/servo_jp.jump": str(self.stage.refused)}
