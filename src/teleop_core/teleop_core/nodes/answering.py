"""Answering node: one step of its stage for every message of its trigger, under the same stamp."""

import time
from typing import Any

from teleop_core.bags.reports import read_reports
from teleop_core.nodes.base import CoreNode
from teleop_core.nodes.streams import Waiter
from teleop_core.session.runner import state_report
from teleop_core.topics import Kind, Topic


class AnsweringNode(CoreNode):
    """Node that answers each message of one topic on all its outputs.

    Nothing is answered before the topics that the stage needs have come: without knowing where the
    slave is, any answer could move it.
    """

    def setup(self, parameters: Any) -> None:
        """Make the stage, open its topics, and listen to the one it answers."""
        super().setup(parameters)
        assert self.description.trigger is not None
        self._trigger: Topic = self.description.trigger
        self._question = self.input(self._trigger)
        self._needed = [self.input(topic) for topic in self.description.needs]
        self._waiter: Waiter | None = None
        self._report = next((t for t in self.description.writes if t.kind is Kind.REPORT), None)
        if self._report is not None:
            self._reporter_of_state = self.open_publisher(self._report)
            row = self.stage.signals[self._report.field]
            read_reports(state_report(0, row))  # loads the message types, 60 ms

    def start(self) -> None:
        """Start from where the slave is, whatever was before."""
        self.stage.reset()
        for port in self.description.reads:
            self.stage.signals[f"{port.field}_ns"] = 0
        self._reported = ""

    def turn(self) -> None:
        """Answer the next message."""
        if self._waiter is None:
            assert self._question.subscription is not None
            self._waiter = Waiter(self.context, self._question.subscription)
        # What is held back on a slow link comes without a message to wait for.
        self._waiter.wait(1e-3 if self._question.delay else 0.1)
        self.work()

    def tick(self, tick_ns: int) -> None:
        """Answer what has come within a session."""
        self.work()

    def work(self) -> None:
        """Answer the messages that have come, one by one."""
        self.read_ports(self._trigger)
        while self._question.take():
            stamp_ns = self._question.stamp_ns
            if stamp_ns is not None and all(n.stamp_ns is not None for n in self._needed):
                self.answer(stamp_ns)

    def answer(self, stamp_ns: int) -> None:
        """Make one step of the stage, send what came of it, and report the state if it changed."""
        self.read_ports(self._trigger)
        signals = self.stage.signals
        signals[f"{self._trigger.field}_ns"] = signals["now_ns"] = stamp_ns
        with self.lock:
            self.stage.step()
        self.send_all(stamp_ns)
        self.counts.ticks += 1
        self.delay.put(time.time_ns() - stamp_ns)
        if self._report is not None:
            self._send_report(self._report, stamp_ns)

    def _send_report(self, topic: Topic, stamp_ns: int) -> None:
        row = self.stage.signals[topic.field]
        described: dict[str, str] = getattr(self.stage, "described", dict)()
        seen = f"{row.tobytes()!r}{described}"
        if seen != self._reported:
            self._reported = seen
            self._reporter_of_state.publish(state_report(stamp_ns, row, described))

    def concerns(self) -> list[str]:
        """Topics that are missing or silent."""
        timeout = getattr(self.parameters, "feedback_timeout", 0.1)
        inputs = (self._question, *self._needed)
        return [f"no {entry.topic.name}" for entry in inputs if entry.age() > timeout]
