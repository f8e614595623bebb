"""Report: results of random schedules, and counts of the combinations of fault and state."""

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from teleop_drill.simulation import sometimes
from teleop_drill.simulation.laws import LAWS
from teleop_drill.simulation.planned import Schedule
from teleop_drill.simulation.schedules import KINDS
from teleop_drill.simulation.seeds import Found

_JOIN = " / "


@dataclass
class Coverage:
    """Counts of the schedules that were run so far.

    Attributes:
        sessions: Number of schedules that were run.
        seconds: Simulated time [s].
        met: Number of times that each fault happened in each state of the arm.
        looks: Number of checks of each law.
        under: Number of checks of each law by present fault and state of the arm.
        sometimes: Number of times that each event of :mod:`sometimes` was met.
        broken: Number of schedules that broke each law.
    """

    sessions: int = 0
    seconds: float = 0.0
    met: Counter[tuple[str, str]] = field(default_factory=Counter)
    looks: Counter[str] = field(default_factory=Counter)
    under: Counter[tuple[str, str, str]] = field(default_factory=Counter)
    sometimes: Counter[str] = field(default_factory=Counter)
    broken: Counter[str] = field(default_factory=Counter)

    @classmethod
    def of(cls, plain: Mapping[str, Any]) -> "Coverage":
        """Counts from the values of :meth:`plain`."""
        met, under = ({tuple(k.split(_JOIN)): n for k, n in plain[name].items()} for name in ("met", "under"))
        looks, seen, broken = (Counter(dict(plain[name])) for name in ("looks", "sometimes", "broken"))
        return cls(plain["sessions"], plain["seconds"], Counter(met), looks, Counter(under), seen, broken)

    def add(self, found: Found) -> None:
        """Add the result of a schedule."""
        broken = Counter(one.law for one in found.broken)
        self.merge(Coverage(1, found.seconds, found.met, found.looks, found.under, found.sometimes, broken))

    def merge(self, other: "Coverage") -> None:
        """Add the counts of other schedules."""
        self.sessions += other.sessions
        self.seconds += other.seconds
        for name in ("met", "looks", "under", "sometimes", "broken"):
            getattr(self, name).update(getattr(other, name))

    def table(self) -> list[list[str]]:
        """Table of faults by states of the arm, with the counts of each combination; the first row is the head."""
        return [
            ["fault", *sometimes.STATES],
            *([kind, *(str(self.met[kind, state]) for state in sometimes.STATES)] for kind in sorted(KINDS)),
        ]

    def laws(self) -> list[list[str]]:
        """Table of faults by laws, with the number of checks during each fault; the first row is the head."""
        counts: Counter[tuple[str, str]] = Counter()
        for (kind, _, law), count in self.under.items():
            counts[kind, law] += count
        return [["fault", *LAWS], *([kind, *(str(counts[kind, law]) for law in LAWS)] for kind in sorted(KINDS))]

    def plain(self) -> dict[str, object]:
        """All counts as plain values for JSON; the names of pairs and triples are joined by `` / ``."""
        return {
            "sessions": self.sessions,
            "seconds": self.seconds,
            "looks": dict(self.looks),
            "broken": dict(self.broken),
            "sometimes": {name: self.sometimes[name] for name in sometimes.catalogue(KINDS)},
            "met": {_JOIN.join(key): count for key, count in sorted(self.met.items())},
            "under": {_JOIN.join(key): count for key, count in sorted(self.under.items())},
        }

    def lines(self) -> list[str]:
        """Lines that summarize the result."""
        laws = [f"{law}: {self.looks[law]} looks, {self.broken[law]} broken" for law in self.looks]
        return [f"{self.sessions} sessions of {self.seconds:.0f} s in all", *sorted(laws), *self._sometimes()]

    def never(self) -> list[str]:
        """Events that were never met."""
        return sometimes.never(self.sometimes, KINDS)

    def _sometimes(self) -> list[str]:
        left, total = self.never(), len(sometimes.catalogue(KINDS))
        return [f"{total - len(left)} of {total} events were met; never: {', '.join(left) or 'none'}"]


def told(found: Found, shortest: Found, law: str) -> list[str]:
    """Text about a schedule that broke a law, with the command that reproduces it.

    Args:
        found: Result of the original schedule.
        shortest: Faults that are needed to break the law.
        law: Name of the law.
    """
    (one,) = (broken for broken in shortest.broken if broken.law == law)
    planned = Schedule.of_found(shortest)
    return [
        f"seed {found.seed} breaks `{law}`, {one.at:.3f} s after the arm followed: {one.text}",
        *(f"    {fault.text()}" for fault in shortest.faults),
        f"    again: {planned.command()} --out DIR",
    ]
