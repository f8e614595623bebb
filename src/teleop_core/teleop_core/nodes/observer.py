"""Observer: reads the ``diagnostics`` of all nodes of a graph."""

import math
from dataclasses import dataclass, field
from typing import Any

from teleop_core.bags.messages import read_reports
from teleop_core.graph.topics import DIAGNOSTICS
from teleop_core.middleware.platform import Platform
from teleop_core.middleware.ros import ROS
from teleop_core.nodes.guest import Guest
from teleop_core.nodes.operation import StopButton
from teleop_core.nodes.streams import Subscription

WARNING = 1


@dataclass(frozen=True)
class Status:
    """Last report of one node: level 0 is fine, 1 a warning."""

    level: int
    message: str
    values: dict[str, str] = field(default_factory=dict)
    arrival: float = 0.0

    def number(self, name: str) -> float:
        """Value as a number, 0 if it is not reported or no finite number."""
        try:
            number = float(self.values.get(name, "0"))
        except ValueError:
            return 0.0
        return number if math.isfinite(number) else 0.0


class ReportReader(Guest):
    """Node that reads the reports of a session.

    Args:
        domain: ROS domain.
        name: Name of its node.
        button: Stop button to use, which outlives the observer; None makes a new button.
        platform: Platform of the session.
        options: Further options of the node, as in rclpy.

    Attributes:
        statuses: Newest report of each node.
        malformed: Number of messages that were not valid reports.
        has_heartbeat: Whether an arm expects regular messages from its stop buttons.
    """

    def __init__(
        self,
        domain: int,
        name: str = "teleop_live",
        button: StopButton | None = None,
        platform: Platform = ROS,
        **options: Any,
    ) -> None:
        super().__init__(name, domain, platform, **options)
        self.statuses: dict[str, Status] = {}
        self.malformed, self.has_heartbeat = 0, False
        self._reports = Subscription(self, DIAGNOSTICS, f"/{DIAGNOSTICS.name}", 100)
        self._button = button or StopButton(self)

    def close(self) -> None:
        """Destroy the node."""
        self._reports.close()
        super().close()

    def listen(self, timeout: float) -> None:
        """Wait for a report, at most ``timeout`` [s], then read all received reports."""
        self._reports.wait(timeout)
        self.take()

    def take(self) -> bool:
        """Read all received reports; return whether there were any."""
        if self.has_heartbeat:
            self._button.beat()
        is_new = False
        while (taken := self._reports.take()) is not None:
            try:
                reports = read_reports(taken.data)
            except ValueError:  # bytes from an unknown sender that are not a report
                self.malformed += 1
                continue
            for one in reports:
                self.statuses[one.name] = Status(
                    one.level, one.message, one.values, 1e-9 * self.platform.monotonic_ns()
                )
                is_new = True
        return is_new

    def press(self, *, is_pressed: bool = True) -> None:
        """Press the emergency stop of all arms, or release this button; may be called from any thread."""
        self._button.say(is_pressed=is_pressed)

    def senders(self, topic: str) -> int:
        """Number of discovered publishers of a topic."""
        return int(self.ros.count_publishers(f"/{topic}"))

    def is_active(self, name: str) -> bool:
        """Whether a node has reported that it is at work."""
        status = self.statuses.get(name)
        return status is not None and status.values.get("state") == "active"
