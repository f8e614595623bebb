"""Task: number of an operator's attempts at a task's goals, number of failures, and times of the attempts."""

from teleop_core.evaluation.attempts import Attempts, AttemptsMetric
from teleop_core.evaluation.metric import figure
from teleop_core.hand.tasks import Miss


class TaskMetric(AttemptsMetric):
    """Counts and times of the attempts in ``task/state``."""

    name = "task"
    attempts = figure("1", "number of attempts at a goal", "attempts")
    successes = figure("1", "number of attempts that ended within the goal's width", "successes")
    error_share = figure("1", "share of the attempts that ended outside of the goal", "errors")
    time_s = figure(
        "s",
        "mean time of an attempt since its goal was set; of four or more attempts the first does not "
        "count, because it includes the approach",
        "time of an attempt, mean",
    )
    forced_share = figure("1", "share of the attempts that ended because the tip pressed too hard: share of damage")

    def judge(self, tried: Attempts) -> None:
        """Set counts, shares and the mean time."""
        self.attempts, self.successes = tried.count, tried.successes
        if tried.count:
            self.error_share, self.time_s = 1.0 - self.successes / tried.count, float(tried.settled("time").mean())
            self.forced_share = float((tried.column("miss") == Miss.FORCE).mean())
