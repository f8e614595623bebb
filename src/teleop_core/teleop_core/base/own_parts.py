"""Own parts: Python files that register parts, for commands and for the processes that commands start.

An installed package registers its parts by entry points. A single file is named once, by ``teleop --parts FILE.py`` or
in the environment variable ``TELEOP_PARTS``, and is loaded in every process of the session.
"""

import os
import sys
from collections.abc import Iterable
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from traceback import extract_tb
from typing import Any

from teleop_core.base.errors import PartError, TeleopError
from teleop_core.base.registry import ADDED, Registry

VARIABLE = "TELEOP_PARTS"
_texts: dict[str, tuple[str, bytes]] = {}  # path and content of the file that was run, by module
_made: dict[str, list[tuple[Registry[Any], str]]] = {}  # parts that the file of a module registered, by module


def load_own_parts(files: Iterable[Path] = ()) -> None:
    """Run the given files and the files of the environment, each once, and pass them on to child processes.

    A file that has changed since it was run is run again; the parts that it registered before are removed.

    Raises:
        PartError: A file is missing or raises an exception; the error text names the file and the exception.
    """
    wanted = list(dict.fromkeys(path.resolve() for path in (*named_files(), *files)))
    for path in wanted:
        _load(path)
    if wanted:
        os.environ[VARIABLE] = os.pathsep.join(map(str, wanted))


def named_files() -> list[Path]:
    """Files that the environment names."""
    return [Path(text) for text in os.environ.get(VARIABLE, "").split(os.pathsep) if text]


def own_files() -> list[Path]:
    """Files that the environment names and that are loaded, and files of modules in the same folders."""
    folders = {path.parent for path in named_files()}
    modules = (getattr(module, "__file__", None) for module in tuple(sys.modules.values()))
    beside = {Path(file) for file in modules if file and Path(file).parent in folders}
    return sorted(beside.union(named_files()))


def forget_own_parts() -> None:
    """Unregister the parts of all loaded files, and remove the files' paths from the environment variable."""
    for name in tuple(_texts):
        _forget(name)
    os.environ.pop(VARIABLE, None)


def _forget(name: str) -> None:
    del _texts[name], sys.modules[name]
    for registry, part in _made.pop(name, ()):
        if registry.is_added(part):
            registry.remove(part)


def _load(path: Path) -> None:
    name = f"teleop_own_parts_{path.stem}"
    spec = spec_from_file_location(name, path)
    if not path.is_file() or spec is None or spec.loader is None:
        raise PartError("file of parts", str(path), "a Python file that exists")
    text = (str(path), path.read_bytes())
    if _texts.get(name) == text:
        return
    if name in _texts and _texts[name][0] == str(path):
        _forget(name)
    module = module_from_spec(spec)
    sys.modules[name], _texts[name], count = module, text, len(ADDED)
    if str(path.parent) not in sys.path:  # like any script, the file can then import modules in its folder
        sys.path.append(str(path.parent))
    try:
        exec(compile(text[1], path, "exec"), module.__dict__)  # a cached compilation may be from an earlier version
    except Exception as error:  # any exception of a user's file becomes a one-line error that names the file
        _made.setdefault(name, []).extend(ADDED[count:])
        _forget(name)
        if isinstance(error, TeleopError):
            raise
        reason = " ".join(str(error).split())
        line = next((f.lineno for f in reversed(extract_tb(error.__traceback__)) if f.filename == str(path)), None)
        place = f" (line {line})" if line else ""
        said = f"a file that can be loaded; it raises {type(error).__name__}: {reason}{place}"
        raise PartError("file of parts", str(path), said) from error
    _made.setdefault(name, []).extend(ADDED[count:])
