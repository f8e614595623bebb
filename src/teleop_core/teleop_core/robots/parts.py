"""Robots as parts: which objects count as a robot, and how they become a :class:`Robot`."""

import inspect
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import Protocol, TypeAlias, TypeVar, cast, runtime_checkable

import numpy as np

from teleop_core.base import ParameterError, PartError, Registry, TeleopError, UnknownNameError
from teleop_core.base.ranges import MOST_OF_ARM, check
from teleop_core.robots.robot import Robot

_BUILT_IN = {"rcrt1": "arms.rcrt1:make"} | {
    name: f"arms.textbook:{name}" for name in ("puma560", "scara", "planar_3r", "five_axis", "pointer")
}
_OF_MACHINES = ("four_bar", "mma", "parallelogram", "rps3", "scara_stewart", "stewart", "three_finger_hand")
_TABLE_ENDINGS = (".yaml", ".yml")
_URDF_ENDINGS = (".urdf", ".xacro")
SCENE_ENDING = ".xml"
"""Ending of the name of a scene, a MuJoCo model; the distribution ``teleop_scene`` reads it."""
DESCRIPTION = "_description"
"""Suffix of names of the package ``robot_descriptions``."""
ARGUMENT = "xacro."
"""Prefix of xacro arguments in a robot's geometry."""
# Largest number of characters kept of an error message of a user's kernel; such a message may be pages long.
_MOST_CHARACTERS = 200


@runtime_checkable
class RobotSource(Protocol):
    """An object that describes a robot, such as :class:`teleop_core.robots.arms.dh.DhTable`."""

    def robot(self) -> Robot:
        """The robot."""
        ...


class SceneReader(Protocol):
    """Reader of scenes."""

    name: str

    def file(self, name: str) -> Path:
        """File that the name of a scene means."""
        ...

    def load(self, file: Path, *, tip: str = "", base: str = "", task: str = "", drive: str = "model") -> Robot:
        """Robot whose tip is a site or body of a scene."""
        ...

    def files(self, file: Path) -> dict[str, Path]:
        """All files of a scene, the first one included, by their paths from its folder."""
        ...


RobotPart: TypeAlias = Robot | RobotSource | Callable[..., Robot]
"""A robot, an object that describes a robot, or a function ``make(**geometry)`` that returns a robot; all its arguments
have defaults."""
Part = TypeVar("Part", bound=RobotPart)


def built(name: str, part: RobotPart, geometry: Mapping[str, float | str]) -> Robot:
    """Robot of a part.

    Raises:
        UnknownNameError: The part's function does not accept one of the symbols.
        ParameterError: A ready robot is given a geometry, or a length is not possible.
        PartError: The part does not make a robot.
    """
    for symbol, value in geometry.items():
        if isinstance(value, float):
            check(symbol, value, "rad or m", MOST_OF_ARM)
    if isinstance(part, Robot | RobotSource):
        if geometry:
            raise ParameterError("geometry", dict(geometry), f"empty: {name!r} has no symbols")
        robot: object = part if isinstance(part, Robot) else part.robot()
    else:
        _refuse_unknown(part, geometry)
        robot = part(**geometry)
    if not isinstance(robot, Robot):
        raise PartError("robot", name, f"made as a Robot, not as a {type(robot).__name__}")
    return robot


def from_file(path: str, geometry: Mapping[str, float | str]) -> Robot | None:
    """Robot of a URDF, a description or a Denavit-Hartenberg table; None if ``path`` is none of these."""
    found = file_of(path)
    if found is None:
        return None
    file, arguments = found
    if is_scene(path):
        return built(path, partial(SCENES.find("scene").load, file), geometry)
    if file.suffix.lower() in _TABLE_ENDINGS:
        from teleop_core.robots.arms.dh import load_table

        return built(path, load_table(file), geometry)
    from teleop_core.robots.files.from_urdf import load_urdf

    options = {name: v for name, v in geometry.items() if not name.startswith(ARGUMENT)}
    return built(path, partial(load_urdf, file, arguments | arguments_of(geometry)), options)


def file_of(name: str) -> tuple[Path, dict[str, str]] | None:
    """File that a robot's name means, and the arguments for its xacro; None if the name means no file.

    Raises:
        TeleopError: As in :func:`~teleop_core.robots.files.descriptions.description_file`.
    """
    if name.endswith(DESCRIPTION) and name not in ROBOTS.names():
        from teleop_core.robots.files.descriptions import description_file

        return description_file(name)
    if is_scene(name):
        return SCENES.find("scene").file(name), {}
    is_file = name.lower().endswith((*_URDF_ENDINGS, *_TABLE_ENDINGS))
    return (Path(name).expanduser(), {}) if is_file else None


def is_scene(name: str) -> bool:
    """Whether a robot's name means a scene."""
    return name.lower().endswith(SCENE_ENDING)


def is_urdf(name: str) -> bool:
    """Whether a robot's name means a URDF, a xacro or a description."""
    is_description = name.endswith(DESCRIPTION) and name not in ROBOTS.names()
    return name.lower().endswith(_URDF_ENDINGS) or is_description


def arguments_of(geometry: Mapping[str, float | str]) -> dict[str, str]:
    """Arguments of a xacro in a robot's geometry, by their names without the prefix."""
    given = {n: str(v) for n, v in geometry.items() if n.startswith(ARGUMENT)}
    return {name.removeprefix(ARGUMENT): value for name, value in given.items()}


def _refuse_unknown(make: Callable[..., Robot], geometry: Mapping[str, float | str]) -> None:
    parameters = inspect.signature(make).parameters.values()
    if any(parameter.kind is parameter.VAR_KEYWORD for parameter in parameters):
        return
    known = [p.name for p in parameters if p.kind in {p.KEYWORD_ONLY, p.POSITIONAL_OR_KEYWORD}]
    for symbol in geometry:
        if symbol not in known:
            raise UnknownNameError("geometry", symbol, known)


def _checked(name: str, part: object) -> RobotPart:
    if isinstance(part, Robot) or (isinstance(part, RobotSource) and not isinstance(part, type)):
        return part
    if not callable(part):
        text = "a Robot, a DhTable or a function make(**geometry) -> Robot"
        raise PartError("robot", name, f"{text}, not a {type(part).__name__}")
    try:
        inspect.signature(part).bind()
    except TypeError as error:
        raise PartError("robot", name, f"a function whose parameters all have defaults ({error})") from error
    except ValueError:  # a built-in function of Python has no signature
        pass
    return part


def _try(part: RobotPart) -> None:
    """Run every kernel once at home, so that errors are reported before anything else runs.

    Chains of a table are not tried, because their kernels are our own.
    """
    name = part_name(part)
    robot = built(name, part, {})
    if robot.kernels.ik.__module__.startswith("teleop_core."):
        return
    try:
        tip = robot.fk(robot.home)
        robot.jacobian(robot.home)
        robot.ik(tip, robot.home)
        robot.ik_all(tip)
        _try_dynamics(robot)
    except TeleopError:
        raise
    except Exception as error:  # one line names the kernel for any exception that a user's kernel raises
        reason = " ".join(str(error).split())[:_MOST_CHARACTERS]
        raise PartError("robot", name, f"one whose kernels run at home; {type(error).__name__}: {reason}") from error


def _reader(name: str, part: object) -> SceneReader:
    if not all(callable(getattr(part, each, None)) for each in ("file", "load", "files")):
        raise PartError("reader of scenes", name, "one with file, load and files")
    return cast("SceneReader", part)


SCENES: Registry[SceneReader] = Registry(
    "reader of scenes", "scene_readers", {}, _reader, elsewhere={"scene": "teleop_scene"}
)
"""Reader of scenes, which the distribution ``teleop_scene`` contains."""


def _try_dynamics(robot: Robot) -> None:
    if robot.dynamics is not None:
        q, row, out = robot.home.copy(), robot.dynamics.parameters.copy(), np.zeros(robot.n)
        robot.dynamics.gravity(q, row, out)
        robot.dynamics.acceleration(q, np.zeros(robot.n), np.zeros(robot.n), row, out)


def part_name(part: RobotPart) -> str:
    """Name of a part: its own name, or that of its function."""
    return str(getattr(part, "name", None) or getattr(part, "__name__", type(part).__name__))


ROBOTS: Registry[RobotPart] = Registry(
    "robot",
    "robots",
    {name: f"teleop_core.robots.{place}" for name, place in _BUILT_IN.items()},
    _checked,
    _try,
    others=("FILE.urdf", "FILE.xacro", "FILE.yaml", "SCENE.xml"),
    elsewhere=dict.fromkeys(_OF_MACHINES, "teleop_machines"),
)
"""All robots by name; see :data:`RobotPart` for what can be added."""
