"""Diagnostics: what a node says about itself once a second."""

import time
from collections.abc import Mapping

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rclpy.duration import Duration
from rclpy.node import Node

from teleop_core.nodes.quality import NO_OVERRIDES, profile
from teleop_core.nodes.rate import Recent, TickCounts
from teleop_core.nodes.streams import Input
from teleop_core.topics import DIAGNOSTICS


class Reporter:
    """Sender of a node's ``diagnostics``.

    Args:
        node: The node; its name, with the namespace, is that of the status.
    """

    def __init__(self, node: Node) -> None:
        self._node = node
        name, overrides = f"/{DIAGNOSTICS.name}", getattr(node, "overrides", NO_OVERRIDES)
        self._publisher = node.create_publisher(
            DiagnosticArray, name, overrides.apply(name, "publisher", profile(DIAGNOSTICS))
        )
        self._last_time, self._last_ticks = time.monotonic(), 0
        self._last_refused: dict[str, int] = {}

    def flush(self) -> None:
        """Wait a moment until the last report has arrived."""
        self._publisher.wait_for_all_acked(Duration(nanoseconds=300_000_000))

    def rate(self, ticks: int) -> float:
        """Ticks per second since the last call."""
        now = time.monotonic()
        rate = (ticks - self._last_ticks) / max(now - self._last_time, 1e-3)
        self._last_time, self._last_ticks = now, max(ticks, 0)
        return max(rate, 0.0)

    def input_concerns(self, inputs: list[Input]) -> list[str]:
        """What is wrong with what came in since the last call, in words."""
        concerns = []
        for entry in inputs:
            publishers = entry.publishers()
            if publishers > 1:
                concerns.append(f"{publishers} publishers on {entry.topic.name}, must be one")
            total = entry.refused.total()
            new = total - self._last_refused.get(entry.topic.name, 0)
            self._last_refused[entry.topic.name] = total
            if new > 0:
                reasons = " or ".join(reason.value for reason in entry.refused)
                concerns.append(f"refused {new} of {entry.topic.name}: each {reasons}")
        return concerns

    def send(self, concerns: list[str], text: str, values: Mapping[str, str]) -> None:
        """Publish one status: a warning if there are concerns."""
        name = f"{self._node.get_namespace()}/{self._node.get_name()}".strip("/")
        status = DiagnosticStatus(name=name, hardware_id="teleop_core")
        status.level = DiagnosticStatus.WARN if concerns else DiagnosticStatus.OK
        status.message = "; ".join(concerns) or text
        status.values = [KeyValue(key=key, value=value) for key, value in values.items()]
        message = DiagnosticArray(status=[status])
        message.header.stamp = self._node.get_clock().now().to_msg()
        self._publisher.publish(message)


def tick_values(state: str, rate: float, counts: TickCounts, period_ms: float) -> dict[str, str]:
    """Names and texts of what became of a node's ticks."""
    return {
        "state": state,
        "rate_hz": f"{rate:.1f}",
        "ticks": str(counts.ticks),
        "late": str(counts.late),
        "missed": str(counts.missed),
        "caught_up": str(counts.caught_up),
        "dropped_time_ms": f"{counts.dropped * period_ms:g}",
    }


def input_values(inputs: list[Input]) -> dict[str, str]:
    """Names and texts of what came in and what of it was refused."""
    values = {"refused": str(sum(entry.refused.total() for entry in inputs))}
    for entry in inputs:
        values[f"received.{entry.topic.name}"] = str(entry.received)
        for reason, count in entry.refused.items():
            key = f"refused.{entry.topic.name}.{reason.name.lower()}"
            values[key] = str(count)
    return values


def recent_values(name: str, numbers_ns: Recent) -> dict[str, str]:
    """Names and texts of median, 99th percentile and maximum of the last times, in ms."""
    parts = zip(("median", "p99", "max"), numbers_ns.summary(), strict=True)
    return {f"{name}_ms.{part}": f"{number * 1e-6:.3f}" for part, number in parts}
