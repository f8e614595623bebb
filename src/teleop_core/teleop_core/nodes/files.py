"""Parameter files of a process: they are checked, adapted to any namespace, and read for the graph."""

import atexit
import os
import tempfile
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path
from typing import IO, Any

from teleop_core.base.parameters import build
from teleop_core.base.plain_yaml import load, written
from teleop_core.graph.graph import Graph, build_graph
from teleop_core.graph.layers import SESSION, SessionParameters

_FLAG = "--params-file"


def checked_arguments(arguments: list[str]) -> list[str]:
    """Arguments whose parameter files are readable and apply in any namespace.

    A file may name nodes without namespace, like the files of this package. The middleware would silently ignore such
    names for a node in a namespace. Such a file is copied, with names that match in every namespace.

    Raises:
        TeleopError: A file is missing or is not YAML.
    """
    out = list(arguments)
    for index, (flag, file) in enumerate(pairwise(arguments)):
        if flag != _FLAG:
            continue
        content = load(Path(file))
        if isinstance(content, dict) and any(not str(key).startswith("/") for key in content):
            # If a node matches two names, the later name applies. Therefore more specific names come later.
            named = {str(key): value for key, value in content.items()}
            keys = sorted(named, key=lambda key: (key.startswith("/"), key.count("/")))
            out[index + 1] = _copy({_anywhere(key): named[key] for key in keys})
    return out


def _anywhere(key: str) -> str:
    """Key that matches a node in any namespace: ``left/name`` becomes a key that matches /lab/left/name."""
    return key if key.startswith("/") else f"/**/{key}"


def _copy(content: dict[str, Any]) -> str:
    """Write a copy for this process into a file without a name, so that no file remains; return its path."""
    file = tempfile.TemporaryFile("w+", encoding="utf-8")  # noqa: SIM115
    file.write(written(content))
    file.flush()
    _copies.append(file)  # the file exists as long as it is open
    return f"/dev/fd/{file.fileno()}"


_copies: list[IO[str]] = []


def temporary_file(text: str) -> str:
    """Name of a new parameter file, which is removed when this process ends."""
    with tempfile.NamedTemporaryFile("w", suffix=".yaml", delete=False) as file:
        file.write(text)
    atexit.register(_remove, file.name)
    return file.name


def _remove(name: str) -> None:
    if Path(name).exists():
        os.unlink(name)


def _session_values(arguments: list[str]) -> Iterator[dict[str, Any]]:
    for flag, file in pairwise(arguments):
        if flag == _FLAG:
            content = load(Path(file)) or {}
            for key, inner in content.items():
                if str(key).rpartition("/")[2] == SESSION and isinstance(inner, dict):
                    yield inner.get("ros__parameters") or {}


def session_of(arguments: list[str]) -> SessionParameters:
    """Parameters of the graph in the group ``teleop`` of the parameter files.

    Raises:
        TeleopError: A file or a value is wrong.
    """
    given: dict[str, Any] = {}
    for values in _session_values(arguments):
        given |= {name: values[name] for name in ("arms", "stages", "delays") if name in values}
    return build(SessionParameters, given, f"{SESSION}.")


def graph_of(arguments: list[str]) -> Graph:
    """Graph that the group ``teleop`` of the parameter files describes.

    Raises:
        TeleopError: A file or the graph is wrong.
    """
    session = session_of(arguments)
    return build_graph(session.arms, session.stages, session.delays)
