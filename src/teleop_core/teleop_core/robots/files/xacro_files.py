"""Xacro: a macro file of an arm, expanded to its URDF by the package ``xacro`` in a process apart.

Expanding evaluates the expressions of the file and of all that it includes: a xacro is a program (docs/security.md).
An expression may compute without end or fill the memory, and it would hold the interpreter of every other thread. So a
process with limits of time and memory expands it (:mod:`teleop_core.robots.files.xacro_process`).
"""

import json
import subprocess
import sys
from collections.abc import Mapping
from importlib import import_module
from pathlib import Path

from teleop_core.base import ParameterError, TeleopError, UnknownNameError, damage_told

EXPANDED = ".expanded.urdf"
"""Suffix of the expanded URDF that a recording stores for a xacro. Arguments for such a file are allowed and
ignored."""
PATIENCE = 20.0
"""Time in which a xacro must be expanded [s]; the largest published ones take less than a second."""
_PROCESS = "teleop_core.robots.files.xacro_process"


def xml_of(path: Path, arguments: Mapping[str, str]) -> bytes:
    """XML of a URDF, expanded if the name of the file ends in ``.xacro``.

    Args:
        path: The file.
        arguments: Texts for the ``<xacro:arg>`` of the file, by their names.

    Raises:
        RecordingError: The file cannot be read.
        ParameterError: The file cannot be expanded, or not within :data:`PATIENCE` and the memory of its process, or
            arguments are given for a file that is not a xacro.
        UnknownNameError: Neither the file nor a file that it includes declares such an argument.
        TeleopError: The package ``xacro`` is not installed.
    """
    with damage_told(path):
        data = path.read_bytes()
    if path.suffix.lower() != ".xacro":
        if arguments and not path.name.endswith(EXPANDED):
            needed = f"left out: {path} is no .xacro"
            raise ParameterError("arguments of xacro", list(arguments), needed)
        return data
    return _expanded(path.resolve(), dict(arguments))


def _expanded(path: Path, arguments: dict[str, str]) -> bytes:
    try:
        import_module("xacro")
    except ImportError as error:
        raise TeleopError(f"{path} needs xacro: pip install 'teleop_core[urdf]'") from error
    words = [sys.executable, "-P", "-m", _PROCESS, str(path), json.dumps(arguments)]
    try:
        done = subprocess.run(words, capture_output=True, check=False, timeout=PATIENCE)
    except subprocess.TimeoutExpired as error:
        raise ParameterError("xacro", str(path), f"one that is expanded within {PATIENCE:g} s") from error
    try:
        told = json.loads(done.stdout)
    except ValueError:
        raise ParameterError("xacro", str(path), "one that is expanded within the memory of a process") from None
    if "xml" in told:
        return str(told["xml"]).encode()
    raise _error(**told)


def _error(
    text: str = "", name: str = "", value: str = "", requirement: str = "", alternatives: list[str] | None = None
) -> TeleopError:
    """The error that the process reported."""
    if alternatives is not None:
        return UnknownNameError(name, value, alternatives)
    return ParameterError(name, value, requirement) if name else TeleopError(text)
