"""Answering node: makes one step of its stage for every message of its trigger, with the trigger's stamp."""

from collections.abc import Sequence
from typing import Any

from teleop_core.graph.signals import DT
from teleop_core.graph.topics import Topic
from teleop_core.nodes.base import CoreNode


class AnsweringNode(CoreNode):
    """Node that answers each message of one topic on all its outputs.

    The node sends no answer until it has received all topics that the stage needs: while the slave's pose is unknown,
    any answer could move the slave.
    """

    def setup(self, parameters: Any) -> None:
        """Make the stage, open its topics, and listen to its trigger."""
        super().setup(parameters)
        assert self.description.trigger is not None
        self._trigger: Topic = self.description.trigger
        self._question = self.input(self._trigger)
        self._needed = [self.input(topic) for topic in self.description.needs]
        self._stamp_fields = (f"{self._trigger.field}_ns", "now_ns")

    def start(self) -> None:
        """Start from the slave's current pose; forget all earlier messages."""
        self.stage.reset()
        self._was_silent, self._told_ns = True, 0
        for port in self.description.reads:
            self.row[f"{port.field}_ns"] = 0

    def due(self) -> Sequence[int]:
        """Wait for a message of the trigger."""
        assert self._question.subscription is not None
        # A delayed message becomes due even if no new message comes. Therefore the wait is short if there is a delay.
        self._question.subscription.wait(DT if self._question.delay else 0.1)
        return (self.platform.monotonic_ns(),)

    def tell(self) -> None:
        """Report the state after the last answer, if it has changed."""
        if self._told_ns:
            self.send_report(self._told_ns)

    def step(self, tick_ns: int) -> None:
        """Answer the received messages one by one."""
        has_come = False
        while self._question.take():
            has_come = True
            self.read_ports(self._trigger)
            stamp_ns = self._question.stamp_ns
            if stamp_ns is not None and all(n.stamp_ns is not None for n in self._needed):
                self.answer(stamp_ns)
                self._told_ns = stamp_ns
        if not has_come:
            self.read_ports(self._trigger)
            self._find_silence()

    def _find_silence(self) -> None:
        """When the trigger stops sending, let the stage make its outputs safe."""
        is_silent = self._question.age() > self._timeout
        if is_silent and not self._was_silent:
            with self.lock:
                self.stage.fall_silent()
            self._told_ns = self.platform.time_ns()
        self._was_silent = is_silent

    def answer(self, stamp_ns: int) -> None:
        """Make one step of the stage, and send its outputs."""
        for name in self._stamp_fields:
            self.row[name] = stamp_ns
        with self.lock:
            self.stage.step()
        self.ports.send(stamp_ns)
        self.counts.ticks += 1
        self.delay.put(self.platform.time_ns() - stamp_ns)

    def concerns(self) -> list[str]:
        """Topics that are missing or silent."""
        inputs = (self._question, *self._needed)
        return [f"no {entry.topic.name}" for entry in inputs if entry.age() > self._timeout]

    @property
    def _timeout(self) -> float:
        """Time after which an input counts as silent [s]."""
        return float(getattr(self.parameters, "feedback_timeout", 0.1))
