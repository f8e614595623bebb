"""Notes on a robot of a URDF: one line for each property that its author may not have intended."""

from teleop_core.kinematics import DIRECTIONS
from teleop_core.robots.freedom import lever
from teleop_core.robots.rank import directions_of
from teleop_core.robots.robot import Robot


def notes_on_robot(robot: Robot, file: str, has_task: bool) -> list[str]:
    """Notes on ambiguous content of the file, and on directions in which the tip cannot move.

    Args:
        robot: The robot as loaded from the file.
        file: Path of the file, for the text.
        has_task: Whether the user chose the controlled directions.
    """
    notes = [f"{file}: {note}" for note in robot.notes]
    return [*notes, *filter(None, [rank_note(robot, file, has_task)])]


def rank_note(robot: Robot, file: str, has_task: bool) -> str:
    """Note on directions that an arm does not control because it cannot move in all six at once; else empty.

    Args:
        robot: The robot as loaded from the file.
        file: Path of the file, for the text.
        has_task: Whether the user chose the controlled directions. Then there is a note only if the user chose too
            many.
    """
    rank, best = directions_of(robot, lever(robot))
    pairs = list(zip(DIRECTIONS, robot.task_mask, strict=True))
    held, free = ([name for name, is_held in pairs if is_held == kind] for kind in (True, False))
    if rank == len(DIRECTIONS) or (has_task and len(held) <= rank):
        return ""
    does = f"it controls {' '.join(held)}, and not {' '.join(free)}"
    if len(held) > rank:
        does = f'it is asked for {" ".join(held)}; "task={" ".join(best)}" it can follow'
    return (
        f"{file}: the tip moves in only {rank} of 6 directions at once, so it cannot reach every "
        f'pose: {does}. geometry=[..., "task=x y z"] chooses the controlled directions, and teleop '
        "reach prints how far a hand can go with them"
    )


def assumed_note(robot: Robot, file: str) -> str:
    """Note on the drive limits that a URDF does not state for at least one joint; empty if it states all.

    Args:
        robot: The robot as loaded from the file.
        file: Path of the file, for the text.
    """
    words = {"effort_limit": "effort", "speed_limit": "velocity"}
    drives = robot.drives
    missing = [] if drives is None else [name for name in words if name in drives.assumed]
    if drives is None or not missing:
        return ""
    entries = {words[name]: drives.entries()[name] for name in missing}
    found = [f"{word} {', '.join(f'{v:g}' for v in row)}" for word, row in entries.items()]
    return (
        f"{file} does not give every joint its limits of {' and '.join(entries)}; the rest is "
        f"assumed. All joints, in SI units: {'; '.join(found)}"
    )
