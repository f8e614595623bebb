"""Drill: injects every known fault into a running session, and measures the reaction of the arm."""

from teleop_core.base.errors import PartError, UnknownNameError
from teleop_core.base.registry import Registry
from teleop_drill.drill.exercise import AllowedMotion, Cure, Exercise, Master, Rig
from teleop_drill.drill.outcome import FaultOutcome
from teleop_drill.drill.processes import PROCESSES
from teleop_drill.drill.samples import SAMPLES
from teleop_drill.drill.stops import STOPS

__all__ = [
    "EXERCISES",
    "SHORT",
    "AllowedMotion",
    "Cure",
    "Exercise",
    "FaultOutcome",
    "Master",
    "Rig",
    "chosen",
    "register_exercise",
]  # fmt: skip

EXERCISES = (*STOPS, *PROCESSES, *SAMPLES)
"""Built-in exercises. Some have one form for composed sessions and one form for sessions of processes."""
SHORT = ("stop_topic", "kill_motion_scaling", "teleport", "second_commander", "kill_bystander")
"""A short selection that finds gross errors."""


def _checked(name: str, part: object) -> Exercise:
    if not isinstance(part, Exercise):
        raise PartError("exercise", name, f"an Exercise, not a {type(part).__name__}")
    if part.name != name or any(one.name == name for one in EXERCISES):
        raise PartError("exercise", name, "registered under its own name, which no other exercise has")
    return part


FURTHER: Registry[Exercise] = Registry("exercise", "exercises", {}, _checked, package="teleop_drill")
"""Exercises that installed packages or the running program have added."""


def register_exercise(exercise: Exercise, *, replace: bool = False) -> Exercise:
    """Add an exercise under its name until the program ends; see :meth:`Registry.add`."""
    return FURTHER.add(exercise.name, exercise, replace=replace)


def chosen(names: tuple[str, ...], *, is_composed: bool) -> tuple[Exercise, ...]:
    """Exercises for composed sessions or for sessions of processes, in the order of the table.

    Added exercises are last.

    Args:
        names: Names of the exercises; empty for all.
        is_composed: Whether all nodes share one process.

    Raises:
        UnknownNameError: An exercise does not exist for this kind of session.
    """
    further = map(FURTHER.find, FURTHER)
    fitting = [one for one in (*EXERCISES, *further) if is_composed in one.ways]
    for name in names:
        if name not in {one.name for one in fitting}:
            way = "composed" if is_composed else "a process for each node"
            raise UnknownNameError(f"fault ({way})", name, [one.name for one in fitting])
    return tuple(one for one in fitting if not names or one.name in names)
