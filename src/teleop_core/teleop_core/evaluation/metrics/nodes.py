"""Nodes: the counts that the nodes of a live session reported."""

from teleop_core.bags.reader import Bag
from teleop_core.evaluation.context import Context
from teleop_core.evaluation.metric import Key, Metric
from teleop_core.evaluation.rows import Row
from teleop_core.evaluation.windows import Window
from teleop_core.topics import DIAGNOSTICS

Counts = dict[str, dict[str, int]]


class NodesMetric(Metric):
    """Counts that each node reported last; none in virtual time, where no node reports."""

    name = "nodes"
    keys = (
        Key("nodes.<node>.<name>", "1", "counts that the nodes reported last on diagnostics"),
    )  # fmt: skip

    def __init__(self, context: Context) -> None:
        self._counts = _read_counts(context.bag)

    def add(self, window: Window) -> None:
        """Nothing: reports are no streams."""

    def values(self) -> Counts:
        """Counts per node and name."""
        return self._counts

    def rows(self) -> list[Row]:
        """None: they are for JSON."""
        return []


def _read_counts(bag: Bag) -> Counts:
    """Counts per node and name; empty without diagnostics."""
    counts: Counts = {}
    info = bag.topics.get(DIAGNOSTICS.name)
    for report in bag.reports(DIAGNOSTICS) if info is not None and info.count else ():
        found = {key: int(text) for key, text in report.values.items() if _is_whole(text)}
        counts.setdefault(report.name.strip("/"), {}).update(found)
    return counts


def _is_whole(text: str) -> bool:
    return text.isascii() and text.removeprefix("-").isdigit()
