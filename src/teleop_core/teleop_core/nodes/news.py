"""News: lines for the log, said once, where something that matters has changed."""

import re
import time
from collections.abc import Iterable
from typing import Any

from rclpy.node import Node

from teleop_core.graph.stage import Stage
from teleop_core.nodes.streams import Input

_CALM_NS = 1_000_000_000  # the same trouble is logged again after this [ns]
_COMMANDS = ("servo_", "move_", "interpolate_")


def introduction(stage: Stage, inputs: Iterable[Input], outputs: Iterable[str], robot: str) -> str:
    """What a node does, in one line.

    Args:
        stage: What it is in the graph.
        inputs: What it reads.
        outputs: Names of the topics that it writes.
        robot: Name of its robot; empty without one.
    """
    read = ", ".join(f"/{entry.topic.name}" for entry in inputs) or "nothing"
    written = ", ".join(f"/{name}" for name in outputs) or "nothing"
    pace = f"answers each {stage.trigger.name}" if stage.trigger else "1000 steps a second"
    start = f"robot {robot}, " if robot else ""
    return f"{start}{pace}; reads {read}; writes {written}"


class Commanders:
    """Who sends the commands that a node reads, as the middleware knows it.

    Args:
        node: The node.
        stage: What it is in the graph: its trigger is a command too.
    """

    def __init__(self, node: Node, stage: Stage) -> None:
        self._node = node
        self._trigger = stage.trigger.name if stage.trigger else ""
        self._known: dict[str, list[str]] = {}

    def news(self, inputs: Iterable[Input]) -> list[str]:
        """One line for each command topic whose senders are others than at the last call."""
        found = []
        for entry in inputs:
            if entry.subscription is None or not self._is_command(entry.topic.name):
                continue
            name = f"/{entry.topic.name}"
            senders = sorted(map(full_name, self._node.get_publishers_info_by_topic(name)))
            before, self._known[name] = self._known.get(name, []), senders
            if senders != before:
                found.append(f"{name} comes from {' and '.join(senders) or 'nobody any more'}")
        return found

    def _is_command(self, name: str) -> bool:
        return name.rpartition("/")[2].startswith(_COMMANDS) or (
            self._trigger != "" and name.endswith(self._trigger)
        )


def full_name(info: Any) -> str:
    """Node of an endpoint, with its namespace."""
    return f"{info.node_namespace.rstrip('/')}/{info.node_name}"


class Trouble:
    """Log of why a bridge holds: each reason once, without regard to its numbers, and its end.

    Args:
        node: The node.
        well: What is logged when nothing is wrong any more.
    """

    def __init__(self, node: Node, well: str) -> None:
        self._node, self._well = node, well
        self._told, self._told_ns = "", 0

    def tell(self, concerns: list[str]) -> None:
        """Log what is wrong now, unless that is known; returns at once."""
        text = "; ".join(concerns)
        words = re.sub(r"[\d.]+", "", text)
        now_ns, executor = time.monotonic_ns(), self._node.executor
        if words == self._told or now_ns - self._told_ns < _CALM_NS or executor is None:
            return
        self._told, self._told_ns = words, now_ns
        executor.create_task(self._log, text)  # a line takes milliseconds, which no loop has

    def _log(self, text: str) -> None:
        log = self._node.get_logger()
        log.error(text) if text else log.info(self._well)
