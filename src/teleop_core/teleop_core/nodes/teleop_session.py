"""Session: all nodes of the graph in one process, with one loop that goes through the stages.

The nodes are the same as in processes of their own: names, topics, parameters, lifecycle. Inside,
a value goes from stage to stage as soon as it is there, within the same tick; every message is
published as well, so that others can listen. While a stage is not active, its readers listen to
the topic instead: a real device, or a node elsewhere, takes its place.
"""

import sys
import time

from teleop_core.nodes.base import CoreNode
from teleop_core.nodes.haptic_master import HapticMasterNode
from teleop_core.nodes.inverse_kinematics import InverseKinematicsNode
from teleop_core.nodes.loop import Loop
from teleop_core.nodes.motion_scaling import MotionScalingNode
from teleop_core.nodes.process import run
from teleop_core.nodes.rate import Schedule
from teleop_core.nodes.recorder import RecorderNode
from teleop_core.nodes.slave_sim import SlaveSimNode
from teleop_core.nodes.streams import Output


class TeleopSession:
    """The five nodes and the loop that works for the first four.

    The real-time options and the catch-up of that loop are those of ``slave_sim``.
    """

    def __init__(self) -> None:
        self._recorder = RecorderNode()
        self._master, self._scaling = HapticMasterNode(), MotionScalingNode()
        self._ik, self._slave = InverseKinematicsNode(), SlaveSimNode()
        self._stages = (self._master, self._scaling, self._ik, self._slave)
        for node in self._stages:
            node.has_own_loop = False
        self._schedule = Schedule(time.monotonic_ns, time.sleep, self._slave.options.max_catch_up)
        self._at_work: tuple[bool, ...] = ()
        self._pending: list[tuple[Output, int]] = []
        Loop("session", self._turn, self._slave.fail, self._slave.prepare)

    @property
    def nodes(self) -> tuple[CoreNode, ...]:
        """The nodes, recorder first and master last: nothing that is sent is missed."""
        return (self._recorder, self._slave, self._ik, self._scaling, self._master)

    def _turn(self) -> None:
        """All ticks that are due, each through all stages."""
        at_work = tuple(node.is_at_work for node in self.nodes)
        if at_work != self._at_work:
            self._link()
            self._at_work = at_work
        if not any(at_work):
            time.sleep(0.01)
            self._schedule.start()
            return
        for tick_ns in self._schedule.due():
            self._tick(tick_ns)

    def _tick(self, tick_ns: int) -> None:
        """One tick [ns, monotonic]; a gate keeps a node from being closed while it works."""
        master, scaling, ik, slave = self._stages
        with master.gate:
            if master.is_at_work:
                master.work(tick_ns)
        with scaling.gate:
            if scaling.is_at_work:
                scaling.work()
        with ik.gate:
            if ik.is_at_work:
                ik.work()
        with slave.gate:
            if slave.is_at_work:
                slave.work((tick_ns,))
        # What travels furthest goes first: the slave's command before the master's sample.
        while self._pending:
            output, stamp_ns = self._pending.pop()
            output.publish(stamp_ns)

    def _link(self) -> None:
        """Lead every stage's output to its readers in here, as far as both are at work."""
        active = [node for node in self._stages if node.is_at_work]
        for node in (self._master, self._slave):  # what is late for one is for the other
            node.schedule = self._schedule
        outputs = {topic: out for node in active for topic, out in node.outputs.items()}
        inputs = [entry for node in active for entry in node.inputs.values()]
        for topic, out in outputs.items():
            out.inputs = [entry for entry in inputs if entry.topic == topic]
            channel = self._recorder.channels.get(topic)
            out.tap, out.pending = channel.give if channel else None, self._pending
        for entry in inputs:
            entry.join(entry.topic in outputs)
        for topic, channel in self._recorder.channels.items():
            channel.join(topic in outputs)


def main() -> int:
    """Entry point of ``ros2 run teleop_core teleop_session``."""
    return run(TeleopSession)


if __name__ == "__main__":
    sys.exit(main())
