"""News: log lines about relevant changes, each logged once."""

import re
from collections.abc import Iterable

from teleop_core.graph.stage import Stage
from teleop_core.middleware.platform import Owner
from teleop_core.nodes.streams import Input

_CALM_NS = 1_000_000_000  # shortest time between two log lines about trouble [ns]
_COMMANDS = ("servo_", "move_", "interpolate_")


def introduction(stage: Stage, inputs: Iterable[Input], outputs: Iterable[str], robot: str) -> str:
    """One line about the task of a node.

    Args:
        stage: Stage of the node in the graph.
        inputs: Inputs that the node reads.
        outputs: Names of the topics that the node writes.
        robot: Name of the node's robot; empty without a robot.
    """
    read = ", ".join(f"/{entry.topic.name}" for entry in inputs) or "nothing"
    written = ", ".join(f"/{name}" for name in outputs) or "nothing"
    pace = f"answers each {stage.trigger.name}" if stage.trigger else "1000 steps a second"
    start = f"robot {robot}, " if robot else ""
    return f"{start}{pace}; reads {read}; writes {written}"


class Commanders:
    """Senders of the commands that a node reads, as known to the middleware.

    Args:
        owner: The node.
        stage: Stage of the node in the graph; its trigger counts as a command.
    """

    def __init__(self, owner: Owner, stage: Stage) -> None:
        self._owner = owner
        self._trigger = stage.trigger.name if stage.trigger else ""
        self._known: dict[str, list[str]] = {}

    def news(self, inputs: Iterable[Input]) -> list[str]:
        """One line for each command topic whose senders have changed since the last call."""
        found = []
        for entry in inputs:
            if entry.subscription is None or not self._is_command(entry.topic.name):
                continue
            name = f"/{entry.topic.name}"
            senders = sorted(end.node for end in self._owner.ros.publishers(name))
            before, self._known[name] = self._known.get(name, []), senders
            if senders != before:
                found.append(f"{name} now comes from {' and '.join(senders) or 'no node'}")
        return found

    def _is_command(self, name: str) -> bool:
        return name.rpartition("/")[2].startswith(_COMMANDS) or (self._trigger != "" and name.endswith(self._trigger))


class Trouble:
    """Log of the reasons why a bridge passes on no motion.

    Each reason is logged once, even if numbers in it change. When all reasons are gone, this is logged too.

    Args:
        owner: The node.
        well: Text that is logged when nothing is wrong any more.
    """

    def __init__(self, owner: Owner, well: str) -> None:
        self._owner, self._well = owner, well
        self._told, self._told_ns = "", 0

    def tell(self, concerns: list[str]) -> None:
        """Log current problems that are not logged yet; returns at once."""
        text = "; ".join(concerns)
        words = re.sub(r"[\d.]+", "", text)
        now_ns = self._owner.platform.monotonic_ns()
        if words == self._told or now_ns - self._told_ns < _CALM_NS:
            return
        self._told, self._told_ns = words, now_ns
        self._owner.ros.defer(self._log, text)  # a log line takes milliseconds, too long for a loop

    def _log(self, text: str) -> None:
        log = self._owner.ros.get_logger()
        log.error(text) if text else log.info(self._well)
