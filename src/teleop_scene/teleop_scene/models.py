"""Models: MuJoCo models from files, found by path or by the name of an installed package."""

import os
import re
from functools import lru_cache
from importlib.util import find_spec
from pathlib import Path

import mujoco

from teleop_core.base import ParameterError, RecordingError

OWN = Path(__file__).parent / "scenes"
"""Folder of the scenes of this package."""
_MOST_WORDS = 40  # of an error of the compiler, whose messages may be pages long


def file_of(name: str) -> Path:
    """File that the name of a scene means.

    Args:
        name: Path of an MJCF file; or such a path that begins with the name of an installed package, which is not
            imported: ``gym_aloha/assets/bimanual_viperx_transfer_cube.xml``; or the name of a scene of this package:
            ``cubes.xml``.
    """
    path = Path(name).expanduser()
    if path.is_absolute() or path.exists():
        return path
    if len(path.parts) == 1:
        own = OWN / path
        return own if own.is_file() else path
    folder = package_folder(path.parts[0])
    return path if folder is None else folder.joinpath(*path.parts[1:])


def package_folder(name: str) -> Path | None:
    """Folder of an installed package, which is not imported; None if there is none of this name."""
    if not name.isidentifier():
        return None
    spec = find_spec(name)
    places = [] if spec is None else list(spec.submodule_search_locations or ())
    return Path(places[0]) if places else None


def model_of(file: Path) -> mujoco.MjModel:
    """Compiled model of a file. All callers get the same object, which they must not change.

    Raises:
        RecordingError: The file cannot be read.
        ParameterError: The file is no model, or a file that it names is missing; the message is the compiler's.
    """
    try:
        own = _state(file.resolve())
    except OSError as error:
        raise RecordingError(file, f"cannot be read: {error.strerror}") from error
    return _compiled(file.resolve(), (own, *(_state(path) for path in _others(*own) if path.is_file())))


def _state(file: Path) -> tuple[Path, int, int]:
    """A file as it is now: another state means that it may have changed."""
    stat = file.stat()
    return file, stat.st_mtime_ns, stat.st_size


@lru_cache(maxsize=32)
def _others(file: Path, _changed_ns: int, _size: int) -> tuple[Path, ...]:
    """Other files that a model names, included files of included files too; none if the file is no XML."""
    try:
        found = {Path(name).resolve() for name in mujoco.mju_getXMLDependencies(str(file))}
    except (ValueError, mujoco.FatalError):
        return ()
    return tuple(sorted(found - {file}))


@lru_cache(maxsize=8)
def _compiled(file: Path, _states: tuple[tuple[Path, int, int], ...]) -> mujoco.MjModel:
    try:
        return mujoco.MjModel.from_xml_path(str(file))
    except (ValueError, mujoco.FatalError) as error:
        words = re.sub(r"\s+", " ", str(error)).split(" ")
        text = " ".join(words[:_MOST_WORDS])
        raise ParameterError("scene", str(file), f"a MuJoCo model; {text}") from error


def files_of(file: Path) -> dict[str, Path]:
    """All files of a model by their paths from the folder that contains all of them; the file itself comes first.

    Raises:
        ParameterError: As in :func:`model_of`.
    """
    model_of(file)
    own = file.resolve()
    paths = [own, *(path for path in _others(*_state(own)) if path.is_file())]
    root = os.path.commonpath([path.parent for path in paths])
    return {str(path.relative_to(root)): path for path in paths}


def moving_bodies(model: mujoco.MjModel) -> list[int]:
    """Bodies with joints, whose poses ``scene/poses`` contains in this order."""
    return [b for b in range(1, model.nbody) if model.body_jntnum[b] > 0]
