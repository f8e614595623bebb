"""Misses: errors at a task, by their kind."""

from teleop_core.evaluation.attempts import Attempts, AttemptsMetric
from teleop_core.evaluation.metric import figure


class MissesMetric(AttemptsMetric):
    """Counts of errors, in the order of :class:`~teleop_core.hand.tasks.Miss`."""

    name, below = "misses", "task"
    beside = figure("1", "number of errors: the attempt ended beside the goal", "errors: beside")
    late = figure("1", "number of errors: the attempt took too long", "errors: late")
    forced = figure("1", "number of errors: the tip pressed too hard", "errors: forced")
    dropped = figure("1", "number of errors: the carried object came to rest beside its goal", "errors: dropped")
    wrong = figure(
        "1", "number of errors: the carried object came to rest on the goal of another object", "errors: wrong"
    )

    def judge(self, tried: Attempts) -> None:
        """Count the errors of each kind."""
        for kind, one in enumerate(self.declared, start=1):
            setattr(self, one.name, int((tried.column("miss") == kind).sum()))
