"""Answering node: one step of its stage for every message of one topic, under the same stamp."""

import time

from teleop_core.nodes.base import CoreNode
from teleop_core.nodes.streams import Waiter
from teleop_core.topics import Topic


class AnsweringNode(CoreNode):
    """Node that answers each message of one topic on all its output streams.

    Nothing is answered before the slave's first setpoint: without knowing where the slave is, any
    answer could move it.
    """

    def listen(self, question: Topic, setpoint: Topic) -> None:
        """Name the topic to answer and the one that tells where the slave is, both open."""
        self._question, self._setpoint = self.input(question), self.input(setpoint)
        assert self._question.subscription is not None
        self._waiter = Waiter(self.context, self._question.subscription)

    def turn(self) -> None:
        """Answer the next message."""
        self._waiter.wait(0.1)
        self.work()

    def work(self) -> None:
        """Answer the messages that have come, one by one."""
        if self._setpoint.newest():
            self.stage.signals["setpoint_stamp_ns"] = self._setpoint.stamp_ns
        while self._question.take():
            stamp_ns = self._question.stamp_ns
            if self._setpoint.stamp_ns is not None and stamp_ns is not None:
                self.answer(stamp_ns)

    def answer(self, stamp_ns: int) -> None:
        """Make one step of the stage and send what came of it."""
        self.stage.signals["stamp_ns"] = stamp_ns
        with self.lock:
            self.stage.step()
        for output in self.outputs.values():
            output.send(stamp_ns)
        self.counts.ticks += 1
        self.delay.put(time.time_ns() - stamp_ns)

    def concerns(self) -> list[str]:
        """Topics that are missing or silent."""
        timeout = self.parameters.feedback_timeout
        inputs = (self._question, self._setpoint)
        return [f"no {entry.topic.name}" for entry in inputs if entry.age() > timeout]
