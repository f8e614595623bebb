"""Configurations of choices: what a choice's settings mean, and which files may be read for it."""

import os
from collections.abc import Sequence
from functools import lru_cache

from teleop_console.folders import is_own
from teleop_core.base.errors import ParameterError, TeleopError
from teleop_core.graph.layers import SESSION, Layer, config_folder, list_scenarios, load_file, parse_setting
from teleop_core.robots import load_robot_set
from teleop_core.robots.parts import DESCRIPTION, SCENE_ENDING
from teleop_core.session.configuration import Configuration
from teleop_core.session.length import as_long_as_followed


def is_robot_file(robot: str) -> bool:
    """Whether a robot's word means a file, or a description of an installed package, which has a file too."""
    return robot.lower().endswith((".urdf", ".xacro", ".yaml", ".yml", SCENE_ENDING, DESCRIPTION))


def made(scenario: str, said: Sequence[str], followed: str, *, opens: bool) -> Configuration:
    """Configuration of a scenario and settings.

    Args:
        scenario: Name of the scenario; empty for none.
        said: Settings ``key=value``.
        followed: File that an operator follows; empty for none.
        opens: Whether any file may be read. If not, the session is as long as a followed recording only if
            :func:`~teleop_console.folders.is_own` allows to read the recording.

    Raises:
        TeleopError: The settings contradict each other, or a file cannot be read.
    """
    layers = [_base(), *([_scenario(scenario)] if scenario else [])]
    given = [_setting(text) for text in said]
    found = Configuration.from_layers([*layers, *given], scenario)
    return as_long_as_followed(found, given) if not followed or opens or is_own(followed) else found


def robot_refusal(robot: str, geometry: tuple[str, ...], *, opens: bool) -> str:
    """Reason why a robot cannot be loaded; empty if it can. The configuration does not check this.

    Args:
        robot: Name of the robot, or its file.
        geometry: Its geometry.
        opens: Whether any file may be read. If not, a file that :func:`~teleop_console.folders.is_own` excludes is not
            checked.
    """
    if not is_robot_file(robot):
        return _refusal(robot, geometry, 0)
    if not opens and not is_own(robot):
        return ""
    changed = os.stat(robot).st_mtime_ns if is_own(robot) else None
    return _refusal.__wrapped__(robot, geometry, 0) if changed is None else _refusal(robot, geometry, changed)


@lru_cache(64)
def _refusal(robot: str, geometry: tuple[str, ...], changed: int) -> str:
    del changed  # time of the file, so that a changed file is checked anew
    try:
        load_robot_set(robot, geometry)
    except TeleopError as error:
        return str(error)
    return ""


_setting = lru_cache(1024)(parse_setting)


@lru_cache(1)
def _base() -> Layer:
    return load_file(config_folder() / "teleop.yaml")


@lru_cache(64)
def _scenario(name: str) -> Layer:
    scenarios = list_scenarios()
    if name not in scenarios:
        raise ParameterError("scenario", name, f"one of {', '.join(scenarios)}")
    return load_file(config_folder() / f"{name}.yaml")


def stages_of(scenario: str) -> tuple[str, ...]:
    """Additional stages that a scenario sets."""
    layers = [_base(), *([_scenario(scenario)] if scenario else [])]
    found: object = ()
    for layer in layers:
        found = layer.get(SESSION, {}).get("stages", found)
    return tuple(found) if isinstance(found, list | tuple) else ()
