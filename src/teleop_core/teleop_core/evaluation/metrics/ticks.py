"""Ticks: how many control ticks the slave executed, and how many came late or not at all."""

from dataclasses import dataclass

from teleop_core.evaluation.context import Context
from teleop_core.evaluation.metric import Key, Metric
from teleop_core.evaluation.metrics.nodes import NodesMetric
from teleop_core.evaluation.rows import MISSING, Row
from teleop_core.evaluation.stamps import StampTallies
from teleop_core.evaluation.windows import Window
from teleop_core.topics import SLAVE_MEASURED_CP

GROUP = "counts"
_FORMER = "slave_sim"  # which counted the ticks before the slave had a server


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


class TicksMetric(Metric):
    """Ticks from the slave's own report if there is one, else from the samples it published."""

    name = "ticks"
    keys = (
        Key("ticks.executed|late|missed", "1",
            "control ticks of the slave; late is null if uncounted"),
    )  # fmt: skip
    topics = (SLAVE_MEASURED_CP,)

    def __init__(self, context: Context) -> None:
        self._nodes, self._stamps = context.shared(NodesMetric), context.shared(StampTallies)
        self._samples = context.expected(SLAVE_MEASURED_CP)
        self._slave = context.origin.writer(SLAVE_MEASURED_CP)

    def add(self, window: Window) -> None:
        """Nothing: stamps and reports are counted by others."""

    def values(self) -> Ticks:
        """Ticks of the whole recording."""
        nodes = self._nodes.values()
        own = nodes.get(self._slave) or nodes.get(_FORMER) or {}
        gaps = self._stamps.of[SLAVE_MEASURED_CP.name].gaps()
        return Ticks(own.get("ticks", self._samples), own.get("late"), own.get("missed", gaps))

    def rows(self) -> list[Row]:
        """All three in one row."""
        ticks = self.values()
        late = MISSING if ticks.late is None else str(ticks.late)
        text = f"{ticks.executed}/{late}/{ticks.missed}"
        return [Row(GROUP, "ticks done/late/missed", "", text)]
