"""Task: how many attempts an operator made at a task's goals, how many failed, and how long they took."""

from teleop_core.evaluation.attempts import Attempts, AttemptsMetric
from teleop_core.evaluation.metric import figure


class TaskMetric(AttemptsMetric):
    """Counts and times of the attempts that ``task/state`` tells."""

    name = "task"
    attempts = figure("1", "attempts at a goal", "attempts")
    successes = figure("1", "attempts that ended within the goal's width", "successes")
    error_share = figure("1", "share of the attempts that ended outside of it", "errors")
    time_s = figure(
        "s",
        "mean time of an attempt since its goal was set; of four or more without the first, in which the arm is led in",
        "time of an attempt, mean",
    )

    def judge(self, tried: Attempts) -> None:
        """Count, and take the mean time."""
        self.attempts, self.successes = tried.count, tried.successes
        if tried.count:
            self.error_share, self.time_s = 1.0 - self.successes / tried.count, float(tried.settled("time").mean())
