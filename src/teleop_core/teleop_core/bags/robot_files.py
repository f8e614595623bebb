"""Files of robots inside recordings: what is replayed and scored is the arm that was recorded.

A robot that comes from a file (a URDF, a table of links) is recorded with the text of that file,
under ``robot_file`` beside ``robot``. Where the file is gone or says something else by now, the
recorded text is written to a temporary folder and takes its place.
"""

import hashlib
import tempfile
from collections.abc import Mapping
from functools import cache
from pathlib import Path

from teleop_core.base.texts import printable

_ENDINGS = (".urdf", ".yaml", ".yml")
_ROBOT, _FILE = "robot", "robot_file"


def robot_texts(name: str, prefix: str = "") -> dict[str, str]:
    """What a recording stores of a robot beside its name: the text of its file, if it has one.

    Args:
        name: The robot's name or path.
        prefix: What stands before the names of its arm.
    """
    text = _text(Path(name).expanduser()) if name.endswith(_ENDINGS) else None
    return {} if text is None else {f"{prefix}{_FILE}": text}


def recorded_robots(metadata: Mapping[str, str]) -> dict[str, str]:
    """Path of each recorded file of a robot, by the path under which it was recorded.

    Args:
        metadata: Names and texts of a recording.

    Returns:
        The same path where the file still says what it said; else that of a copy of what was
        recorded, which is there until the program ends.
    """
    found: dict[str, str] = {}
    for key, text in metadata.items():
        name = metadata.get(key.removesuffix("_file"), "")
        if key.endswith(_FILE) and name:
            is_same = _text(Path(name).expanduser()) == text
            found[name] = name if is_same else str(_copy(Path(name).name, text))
    return found


def _text(path: Path) -> str | None:
    """Text of a file as recordings give it back; None for what cannot be read as text."""
    try:
        return printable(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError):
        return None


@cache
def _folder() -> tempfile.TemporaryDirectory[str]:
    return tempfile.TemporaryDirectory(prefix="teleop_robots_")


def _copy(name: str, text: str) -> Path:
    path = Path(_folder().name) / hashlib.sha256(text.encode()).hexdigest()[:16] / name
    path.parent.mkdir(exist_ok=True)
    path.write_text(text, encoding="utf-8")
    return path
