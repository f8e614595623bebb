"""Drill: breaks a running session in all ways that are known, and measures what the arm does."""

from teleop_core.drill.exercise import Cure, Exercise, Master, Motion, Rig
from teleop_core.drill.outcome import Outcome
from teleop_core.drill.processes import PROCESSES
from teleop_core.drill.samples import SAMPLES
from teleop_core.drill.stops import STOPS
from teleop_core.errors import UnknownNameError

__all__ = ["EXERCISES", "SHORT", "Cure", "Exercise", "Master", "Motion", "Outcome", "Rig", "chosen"]

EXERCISES = (*STOPS, *PROCESSES, *SAMPLES)
"""All of them; some once for each way of running."""
SHORT = ("stop_topic", "kill_motion_scaling", "teleport", "second_commander", "kill_bystander")
"""What is enough to see that nothing is badly wrong."""


def chosen(names: tuple[str, ...], *, is_composed: bool) -> tuple[Exercise, ...]:
    """Exercises of a way of running, in the order of the table.

    Args:
        names: Which; none for all.
        is_composed: Whether all nodes share one process.

    Raises:
        UnknownNameError: One is not there in this way of running.
    """
    fitting = [one for one in EXERCISES if is_composed in one.ways]
    for name in names:
        if name not in {one.name for one in fitting}:
            way = "composed" if is_composed else "five processes"
            raise UnknownNameError(f"fault ({way})", name, [one.name for one in fitting])
    return tuple(one for one in fitting if not names or one.name in names)
