"""Diagnostics: the status that a node reports once a second."""

from collections import Counter
from collections.abc import Mapping

from diagnostic_msgs.msg import DiagnosticArray

from teleop_core.bags.messages import Refusal, report
from teleop_core.graph.topics import DIAGNOSTICS
from teleop_core.middleware.platform import Owner
from teleop_core.nodes.quality import NO_OVERRIDES, profile
from teleop_core.nodes.rate import Recent, TickCounts
from teleop_core.nodes.sender import Sender
from teleop_core.nodes.streams import Input

OK, WARNING = 0, 1
"""Levels of a report."""
_STEP_NS = 50_000_000
"""Largest change of the system clock relative to the monotonic clock in a second that does not count as a step [ns]."""


class Reporter:
    """Sender of a node's ``diagnostics``.

    Args:
        owner: The node; its name, with the namespace, is the name of the status.
    """

    def __init__(self, owner: Owner) -> None:
        self._owner, self._platform = owner, owner.platform
        name, overrides = f"/{DIAGNOSTICS.name}", getattr(owner, "overrides", NO_OVERRIDES)
        self._publisher = owner.ros.create_publisher(
            DiagnosticArray, name, overrides.apply(name, "publisher", profile(DIAGNOSTICS))
        )
        self._last_ns, self._last_ticks, self._elapsed = self._platform.monotonic_ns(), 0, 1.0
        self._last_refused: dict[Input, Counter[Refusal]] = {}
        self._last_received: dict[Input, int] = {}
        self._offset_ns = self._platform.time_ns() - self._platform.monotonic_ns()

    def clock_step(self) -> float:
        """Step of the system's clock since the last call [s]; 0 if it was not stepped."""
        offset_ns = self._platform.time_ns() - self._platform.monotonic_ns()
        step_ns, self._offset_ns = offset_ns - self._offset_ns, offset_ns
        return step_ns * 1e-9 if abs(step_ns) > _STEP_NS else 0.0

    def flush(self) -> None:
        """Wait a moment until the last report has arrived."""
        self._publisher.wait_for_all_acked(0.3)

    def rate(self, ticks: int) -> float:
        """Ticks per second since the last call."""
        now_ns = self._platform.monotonic_ns()
        self._elapsed = max(1e-9 * (now_ns - self._last_ns), 1e-3)
        rate = (ticks - self._last_ticks) / self._elapsed
        self._last_ns, self._last_ticks = now_ns, max(ticks, 0)
        return max(rate, 0.0)

    def input_concerns(self, inputs: list[Input]) -> list[str]:
        """Texts about problems of the received messages since the last call."""
        concerns = []
        for entry in inputs:
            name, publishers = entry.topic.name, entry.publishers()
            if publishers > 1:
                concerns.append(f"{publishers} publishers on {name}, must be one")
            new = entry.refused - self._last_refused.get(entry, Counter())
            self._last_refused[entry] = entry.refused.copy()
            if new:
                reasons = " or ".join(reason.value for reason in new)
                concerns.append(f"refused {new.total()} of {name}: each {reasons}")
            concerns += entry.sender.concerns(name)
            if publishers == 1 and new[Refusal.SECOND_PUBLISHER]:
                entry.sender.release()
        return concerns

    def rates(self, inputs: list[Input]) -> dict[str, str]:
        """Messages per second at each input, over the time between the last two calls of :meth:`rate`."""
        values = {}
        for entry in inputs:
            new = entry.received - self._last_received.get(entry, 0)
            self._last_received[entry] = entry.received
            values[f"rate_hz.{entry.topic.name}"] = f"{new / self._elapsed:.1f}"
        return values

    def send(self, concerns: list[str], text: str, values: Mapping[str, str]) -> None:
        """Publish one status: a warning if there are concerns."""
        name = f"{self._owner.ros.get_namespace()}/{self._owner.ros.get_name()}".strip("/")
        level, message = (WARNING, "; ".join(concerns)) if concerns else (OK, text)
        now_ns = self._platform.time_ns()
        self._publisher.publish(report(now_ns, name, level, message, values, "teleop_core"))


def tick_values(state: str, rate: float, counts: TickCounts, period_ms: float) -> dict[str, str]:
    """Names and texts of the counts of a node's ticks."""
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
    """Names and texts of the counts of received and refused messages."""
    values = {"refused": str(sum(entry.refused.total() for entry in inputs))}
    for entry in inputs:
        values[f"received.{entry.topic.name}"] = str(entry.received)
        for reason, count in entry.refused.items():
            key = f"refused.{entry.topic.name}.{reason.name.lower()}"
            values[key] = str(count)
        values |= sender_values(entry.topic.name, entry.sender)
    return values


def sender_values(name: str, sender: Sender) -> dict[str, str]:
    """Names and texts of losses and ages, found by the numbers and stamps of a topic's messages."""
    _, high, most = sender.ages.summary()
    return {
        f"gaps.{name}": str(sender.gaps),
        f"repeats.{name}": str(sender.repeats),
        f"reordered.{name}": str(sender.reordered),
        f"age_ms.{name}.p99": f"{high * 1e-6:.3f}",
        f"age_ms.{name}.max": f"{most * 1e-6:.3f}",
    }


def recent_values(name: str, numbers_ns: Recent) -> dict[str, str]:
    """Names and texts of median, 99th percentile and maximum of the most recent times, in ms."""
    parts = zip(("median", "p99", "max"), numbers_ns.summary(), strict=True)
    return {f"{name}_ms.{part}": f"{number * 1e-6:.3f}" for part, number in parts}
