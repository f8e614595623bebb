"""Tick scores: how many control ticks the slave executed, and how many came late or not at all."""

from dataclasses import dataclass

from teleop_core.bags.reader import Bag
from teleop_core.topics import DIAGNOSTICS

SLAVE_NODE = "slave_sim"


@dataclass(frozen=True)
class Ticks:
    """Control ticks of the slave.

    Attributes:
        executed: Ticks executed.
        late: Ticks begun late; None if nobody counted them (virtual time, foreign slaves).
        missed: Ticks that were due and never executed.
    """

    executed: int
    late: int | None
    missed: int


def read_counts(bag: Bag) -> dict[str, dict[str, int]]:
    """Counts that the nodes reported last, per node and name; empty without diagnostics."""
    counts: dict[str, dict[str, int]] = {}
    info = bag.topics.get(DIAGNOSTICS.name)
    for report in bag.reports(DIAGNOSTICS) if info is not None and info.count else ():
        found = {key: int(text) for key, text in report.values.items() if _is_whole(text)}
        counts.setdefault(report.name.strip("/"), {}).update(found)
    return counts


def _is_whole(text: str) -> bool:
    return text.isascii() and text.removeprefix("-").isdigit()


def tick_score(counts: dict[str, dict[str, int]], samples: int, gaps: int) -> Ticks:
    """Ticks from the slave's own report if there is one, else from the samples it published.

    Args:
        counts: As from :func:`read_counts`.
        samples: Recorded samples of slave/measured_cp.
        gaps: Samples missing between them.
    """
    own = counts.get(SLAVE_NODE, {})
    return Ticks(own.get("ticks", samples), own.get("late"), own.get("missed", gaps))
