"""Kept files: what is replayed and scored is the arm that was recorded, and what it touched.

A robot that comes from a file (a URDF, a table of links) is recorded with the text of that file,
under ``robot_file`` beside ``robot``; a mesh with its packed bytes, under ``mesh_file`` beside
``mesh``, or with their digest where they are many. Where the file is gone or says something else by
now, what was recorded is written to a temporary folder and takes its place.
"""

import base64
import hashlib
import tempfile
import warnings
import zlib
from collections.abc import Mapping
from functools import cache
from pathlib import Path

from teleop_core.base.texts import printable

_ENDINGS = (".urdf", ".yaml", ".yml")
_ROBOT, _MESH, _FILE = "robot", "mesh", "_file"
_PACKED, _DIGEST = "zlib, base64: ", "sha256: "
_MOST = 2**20
"""Characters of a packed mesh that a recording keeps."""


def robot_texts(name: str, prefix: str = "") -> dict[str, str]:
    """What a recording stores of a robot beside its name: the text of its file, if it has one.

    Args:
        name: The robot's name or path.
        prefix: What stands before the names of its arm.
    """
    text = _text(Path(name).expanduser()) if name.endswith(_ENDINGS) else None
    return {} if text is None else {f"{prefix}{_ROBOT}{_FILE}": text}


def mesh_texts(name: str, prefix: str = "") -> dict[str, str]:
    """What a recording stores of a mesh: its path, and its packed bytes or their digest.

    Args:
        name: Path of the mesh.
        prefix: What stands before the names of its arm.
    """
    packed, digest = _packed(Path(name).expanduser())
    text = packed if len(packed) <= _MOST else digest
    return {f"{prefix}{_MESH}": name, f"{prefix}{_MESH}{_FILE}": text} if text else {}


def recorded_files(metadata: Mapping[str, str]) -> dict[str, str]:
    """Path of each recorded file of a robot or mesh, by the path under which it was recorded.

    A mesh of which only the digest was kept, and that is gone or another by now, is told by a
    warning.

    Args:
        metadata: Names and texts of a recording.

    Returns:
        The same path where the file still says what it said; else that of a copy of what was
        recorded, which is there until the program ends.
    """
    found: dict[str, str] = {}
    for key, text in metadata.items():
        name = metadata.get(key.removesuffix(_FILE), "")
        if not (key.endswith((_ROBOT + _FILE, _MESH + _FILE)) and name):
            continue
        path = Path(name).expanduser()
        now = [_text(path) or ""] * 2 if key.endswith(_ROBOT + _FILE) else _packed(path)
        if text in now:
            found[name] = name
        elif text.startswith(_DIGEST):
            change = "another by now" if now[1] else "gone"
            about = "the recording has no copy, since it was too large"
            warnings.warn(f"{name}: this mesh is {change}; {about}", stacklevel=2)
        else:
            found[name] = str(_copy(path.name, text))
    return found


def _text(path: Path) -> str | None:
    """Text of a file as recordings give it back; None for what cannot be read as text."""
    try:
        return printable(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError):
        return None


def _packed(path: Path) -> tuple[str, str]:
    """Bytes of a file as printable text, and their digest; empty for what cannot be read."""
    try:
        data = path.read_bytes()
    except OSError:
        return "", ""
    text = base64.b64encode(zlib.compress(data)).decode()
    return _PACKED + text, _DIGEST + hashlib.sha256(data).hexdigest()


@cache
def _folder() -> tempfile.TemporaryDirectory[str]:
    return tempfile.TemporaryDirectory(prefix="teleop_files_")


def _copy(name: str, text: str) -> Path:
    path = Path(_folder().name) / hashlib.sha256(text.encode()).hexdigest()[:16] / name
    path.parent.mkdir(exist_ok=True)
    if text.startswith(_PACKED):
        path.write_bytes(zlib.decompress(base64.b64decode(text.removeprefix(_PACKED))))
    else:
        path.write_text(text, encoding="utf-8")
    return path
