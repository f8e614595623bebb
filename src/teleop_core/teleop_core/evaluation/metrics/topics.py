"""Topics: messages of each topic, and how many are missing by their stamps."""

from dataclasses import dataclass

from teleop_core.evaluation.context import Context
from teleop_core.evaluation.metric import Key, Metric
from teleop_core.evaluation.metrics.ticks import GROUP
from teleop_core.evaluation.rows import Row
from teleop_core.evaluation.stamps import StampTallies
from teleop_core.evaluation.windows import Window


@dataclass(frozen=True)
class TopicScore:
    """Messages of a topic, and how many are missing by their stamps (None if not a stream)."""

    count: int
    gaps: int | None


class TopicsMetric(Metric):
    """Counts and gaps of everything that was recorded."""

    name = "topics"
    keys = (
        Key("topics.<name>.count", "1", "messages"),
        Key("topics.<name>.gaps", "1",
            "messages missing by their stamps, lost or passed over by a stage that takes only the "
            "newest; null if not a stream"),
    )  # fmt: skip

    def __init__(self, context: Context) -> None:
        self._infos, self._stamps = context.bag.topics, context.shared(StampTallies)

    def add(self, window: Window) -> None:
        """Nothing: stamps are counted by others too."""

    def values(self) -> dict[str, TopicScore]:
        """Score of each topic, in the order of their names."""
        stamps = self._stamps.of
        return {
            name: TopicScore(info.count, stamps[name].gaps() if name in stamps else None)
            for name, info in sorted(self._infos.items())
        }

    def rows(self) -> list[Row]:
        """Sums over all topics."""
        topics = self.values().values()
        return [
            Row(GROUP, "messages", "", str(sum(topic.count for topic in topics))),
            Row(GROUP, "messages missing", "", str(sum(topic.gaps or 0 for topic in topics))),
        ]
