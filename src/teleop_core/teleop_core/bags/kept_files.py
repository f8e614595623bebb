"""Kept files: what is replayed, scored and drawn is what was recorded.

A recording holds the text of a robot's file (a URDF, a table of links) under ``robot_file`` beside ``robot``. All other
files stand there by their digests: a mesh or field of heights that is touched under ``mesh_file`` beside ``mesh``; the
mesh of a fixture under ``fixture_mesh_file``; drives of a URDF under ``drives_file``; the meshes that a robot's links
look like under ``robot_meshes``, in a line of digest and name each. Under each digest are the packed bytes, once for
all arms, as long as there is room for them. Where a file is gone or says something else by now, what was recorded is
written to a temporary folder and takes its place.
"""

import base64
import hashlib
import tempfile
import warnings
import zlib
from collections.abc import Iterable, Mapping
from functools import cache
from pathlib import Path

from teleop_core.base import TeleopWarning, printable
from teleop_core.robots import geometry_of
from teleop_core.robots.files import visuals, xacro_files
from teleop_core.robots.parts import DESCRIPTION, arguments_of, file_of

TOUCHED, FIXTURE = "mesh", "fixture_mesh"
_PLACES = range(8)  # of a shape that is made of several: they are called mesh, mesh1, mesh2
_ROBOT, _DRIVES, _FILE, _MESHES = "robot", "drives", "_file", "_meshes"
_PACKED, _DIGEST = "zlib, base64: ", "sha256:"
_LEVEL = 4  # 27 MB of meshes of an arm take 0.4 s; at 6 they take 1.5 s, and 5 % less room
_MOST = 2**25
"""Bytes of files that a recording keeps beside texts, before they are packed."""


class KeptFiles:
    """What a recording stores of the files of its arms; what is added first is kept first."""

    def __init__(self) -> None:
        self._texts: dict[str, str] = {}
        self._room, self._left_out = _MOST, dict[str, Path]()

    def add_mesh(self, name: str, prefix: str = "", kind: str = TOUCHED) -> None:
        """Add a mesh, or a field of heights; one that cannot be read is none.

        Args:
            name: Its path.
            prefix: What stands before the names of its arm.
            kind: :data:`TOUCHED` or :data:`FIXTURE`, with its number behind it beyond the first.
        """
        self._name(f"{prefix}{kind}", name)

    def add_robot(self, name: str, settings: Iterable[str] = (), prefix: str = "") -> None:
        """Add the text of a robot's file, if it has one, its drives and the meshes of its links.

        Args:
            name: The robot's name or path.
            settings: Its geometry; arguments among them have expanded a xacro, of which the URDF is stored.
            prefix: What stands before the names of its arm.
        """
        found = file_of(name)
        if found is None:
            return
        path, text, geometry = found[0], None, geometry_of(settings)
        if path.suffix.lower() == ".xacro":
            arguments = found[1] | arguments_of(geometry)
            text = printable(xacro_files.xml_of(path, arguments).decode())
        else:
            text = _text(path)
        if text is None:
            return
        self._texts[f"{prefix}{_ROBOT}{_FILE}"] = text
        if drives := str(geometry.get(_DRIVES, "")):
            self._name(f"{prefix}{_DRIVES}", drives)
        digests = {mesh: self._add(file) for mesh, file in visuals.meshes_of(text, path).items()}
        if lines := [f"{digest} {mesh}" for mesh, digest in digests.items() if digest]:
            self._texts[f"{prefix}{_ROBOT}{_MESHES}"] = "\n".join(lines)

    def texts(self) -> dict[str, str]:
        """Names and texts for the recording; files that exceed its room give a warning."""
        if self._left_out:
            names = ", ".join(path.name for path in self._left_out.values())
            limit = f"keeps {_MOST / 2**20:g} MiB of files"
            warnings.warn(f"the recording {limit}, and only digests of {names}", TeleopWarning, stacklevel=3)
        return dict(self._texts)

    def _name(self, key: str, name: str) -> None:
        """Keep a file under a path of its own."""
        if digest := self._add(Path(name).expanduser()):
            self._texts |= {key: name, f"{key}{_FILE}": digest}

    def _add(self, path: Path) -> str:
        """Digest of a file, whose packed bytes are kept if there is room; empty if unreadable."""
        data = _bytes(path)
        if data is None:
            return ""
        digest = _digest(data)
        if digest not in self._texts and digest not in self._left_out:
            if len(data) <= self._room:
                packed = base64.b64encode(zlib.compress(data, _LEVEL)).decode()
                self._texts[digest] = _PACKED + packed
                self._room -= len(data)
            else:
                self._left_out[digest] = path
        return digest


def recorded_files(metadata: Mapping[str, str], arm: str = "") -> dict[str, str]:
    """Path of each recorded file of an arm, by the path under which it was recorded.

    A file of which only the digest was kept gives a warning if it is gone or has changed.

    Args:
        metadata: Names and texts of a recording.
        arm: What stands before the names of the arm, without the slash.

    Returns:
        The same path where the file still says what it said; else that of a copy of what was
        recorded, which is there until the program ends.
    """
    prefix, found = f"{arm}/" if arm else "", {}
    meshes = (f"{kind}{place or ''}" for kind in (TOUCHED, FIXTURE) for place in _PLACES)
    for kind in (*meshes, _DRIVES):
        name, digest = (metadata.get(f"{prefix}{kind}{end}", "") for end in ("", _FILE))
        if not (name and digest):
            continue
        path = Path(name).expanduser()
        if _digest_now(path) == digest:
            found[name] = name
        elif (data := _unpacked(metadata, digest, _MOST)) is not None:
            found[name] = str(_written(_place(digest) / path.name, data))
        else:
            _tell(name, path)
    name, text = (metadata.get(f"{prefix}{_ROBOT}{end}", "") for end in ("", _FILE))
    if name and text:
        lines = metadata.get(f"{prefix}{_ROBOT}{_MESHES}", "").split("\n")
        parts = [line.partition(" ") for line in lines]
        digests = {mesh: digest for digest, _, mesh in parts if mesh}
        found[name] = _robot_now(name, text, digests, metadata)
    return found


def recorded_geometry(settings: Iterable[str], files: Mapping[str, str]) -> tuple[str, ...]:
    """Geometry of a robot as texts, with the drives in it that were recorded.

    Args:
        settings: Its geometry.
        files: Those of its arm, as of :func:`recorded_files`.
    """
    found = []
    for text in settings:
        symbol, _, value = (part.strip() for part in text.partition("="))
        is_kept = symbol == _DRIVES and value in files
        found.append(f"{_DRIVES}={files[value]}" if is_kept else text)
    return tuple(found)


def _robot_now(name: str, text: str, digests: Mapping[str, str], metadata: Mapping[str, str]) -> str:
    """Path of a robot's file, with the meshes of its links as they were recorded."""
    path = Path(name).expanduser()
    files = visuals.meshes_of(text, path)
    same = {mesh for mesh, digest in digests.items() if _digest_now(files.get(mesh)) == digest}
    if _text(path) == text and len(same) == len(digests):
        return name
    is_made = path.name.lower().endswith((".xacro", DESCRIPTION))
    copy = _place(f"{text}{digests}") / (path.name + xacro_files.EXPANDED * is_made)
    room = _MOST
    for mesh, digest in digests.items():
        data = _unpacked(metadata, digest, room)
        room -= len(data or b"")
        if data is None and mesh in same:
            data = _bytes(files[mesh])
        if data is None:
            _tell(mesh, files.get(mesh))
        else:
            _written(visuals.kept_mesh(mesh, copy), data)
    return str(_written(copy, text.encode()))


def _tell(name: str, path: Path | None) -> None:
    change = "another by now" if _digest_now(path) else "gone"
    warnings.warn(f"{name}: this file is {change}; the recording has no copy of it", TeleopWarning, stacklevel=4)


def _text(path: Path) -> str | None:
    """Text of a file as recordings give it back; None for what cannot be read as text."""
    try:
        return printable(path.read_text(encoding="utf-8")) if path.is_file() else None
    except (OSError, UnicodeDecodeError):
        return None


def _bytes(path: Path) -> bytes | None:
    """Bytes of a file; None for what cannot be read, or is no file, as a pipe."""
    try:
        return path.read_bytes() if path.is_file() else None
    except OSError:
        return None


def _digest(data: bytes) -> str:
    return _DIGEST + hashlib.sha256(data).hexdigest()


def _digest_now(path: Path | None) -> str:
    """Digest of a file; empty for what cannot be read."""
    data = None if path is None else _bytes(path)
    return "" if data is None else _digest(data)


def _unpacked(metadata: Mapping[str, str], digest: str, most: int) -> bytes | None:
    """Bytes that a recording keeps under a digest; None if missing, damaged or larger than ``most``."""
    try:
        packed = base64.b64decode(metadata.get(digest, "").removeprefix(_PACKED))
        data = zlib.decompressobj().decompress(packed, max(1, most))
    except (ValueError, zlib.error):
        return None
    return data if _digest(data) == digest else None


@cache
def _folder() -> tempfile.TemporaryDirectory[str]:
    return tempfile.TemporaryDirectory(prefix="teleop_files_")


def _place(text: str) -> Path:
    """Folder of the copies of a recorded file."""
    return Path(_folder().name) / hashlib.sha256(text.encode()).hexdigest()[:16]


def _written(path: Path, data: bytes) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    if not path.is_file():
        path.write_bytes(data)
    return path
