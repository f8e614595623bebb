"""Robot descriptions: files of the package ``robot_descriptions``, if the user has downloaded them.

A module of that package clones a repository with git when it is imported. Here the module is imported with the clone
replaced by a search in the package's cache, so nothing is downloaded.
"""

import os
import runpy
from pathlib import Path

from teleop_core.base.errors import ParameterError, TeleopError, UnknownNameError

_CACHE = "ROBOT_DESCRIPTIONS_CACHE"


def description_file(name: str) -> tuple[Path, dict[str, str]]:
    """File of a description, and the arguments that it passes to a xacro.

    Args:
        name: Name of a module of ``robot_descriptions``, such as ``ur5e_description``.

    Raises:
        UnknownNameError: The package has no module of this name that describes a URDF.
        ParameterError: The description is not in the cache; the message contains the command to download it.
        TeleopError: The package is not installed, or cannot be used without git.
    """
    try:
        from robot_descriptions import DESCRIPTIONS, _cache
    except ImportError as error:
        text = f"{name} needs robot_descriptions: pip install 'teleop_core[urdf]' ({error})"
        raise TeleopError(text) from error
    known = sorted(other for other, about in DESCRIPTIONS.items() if about.has_urdf)
    if name not in known:
        raise UnknownNameError("robot", name, known)
    fetch = f"in the cache; `robot_descriptions pull {name}` fetches it"

    def look_up(repository: str, commit: str | None = None) -> str:
        place = _cache.REPOSITORIES[repository].cache_path
        below = place if commit is None else f"{place}-{commit}/{place}"
        folder = Path(os.environ.get(_CACHE, "~/.cache/robot_descriptions")).expanduser() / below
        if not folder.is_dir():
            raise ParameterError("robot", name, fetch)
        return str(folder)

    theirs = _cache.clone_to_cache
    _cache.clone_to_cache = look_up
    try:
        found = runpy.run_module(f"robot_descriptions.{name}")
    finally:
        _cache.clone_to_cache = theirs
    path = Path(found.get("URDF_PATH") or found["XACRO_PATH"])
    if not path.is_file():
        raise ParameterError("robot", name, fetch)
    return path, {} if "URDF_PATH" in found else dict(found.get("XACRO_ARGS", {}))
