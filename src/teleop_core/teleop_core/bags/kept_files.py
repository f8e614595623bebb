"""Kept files: copies of robot and mesh files in a recording. Replay, scores and drawings use these copies.

The metadata contain the text of a robot's file (a URDF, a table of links) under ``robot_file``, beside ``robot``. They
contain the digests of all other files:

- ``mesh_file``, beside ``mesh``: a touched mesh or height field;
- ``fixture_mesh_file``: the mesh of a fixture;
- ``drives_file``: the drives of a URDF;
- ``robot_meshes``: the visual meshes of a robot's links, one line of digest and name for each mesh;
- ``scene_files``: all files of the scene of a robot, one line of digest and path for each file, the scene first.

The entry that has a digest as its name contains the packed bytes of the file. The entry is stored once for all arms,
up to a total size of all files. If a file is missing or has changed since the recording, its recorded bytes are
written to a temporary folder, and that copy is used instead.
"""

import base64
import hashlib
import tempfile
import warnings
import zlib
from collections.abc import Iterable, Mapping
from contextlib import suppress
from functools import cache
from pathlib import Path

from teleop_core.base import TeleopError, TeleopWarning, printable
from teleop_core.robots import geometry_of
from teleop_core.robots.files import visuals, xacro_files
from teleop_core.robots.parts import DESCRIPTION, SCENES, arguments_of, file_of, is_scene

TOUCHED, FIXTURE = "mesh", "fixture_mesh"
_PLACES = range(8)  # parts of a combined shape: their meshes are called mesh, mesh1, mesh2
_ROBOT, _DRIVES, _FILE, _MESHES, _SCENE = "robot", "drives", "_file", "_meshes", "scene_files"
_PACKED, _DIGEST = "zlib, base64: ", "sha256:"
_LEVEL = 4  # 27 MB of an arm's meshes take 0.4 s; level 6 takes 1.5 s for 5 % less size
_MOST = 2**25
"""Largest total size of the kept files before packing, robot texts not counted [bytes]."""


class KeptFiles:
    """Files of the arms that a recording stores.

    Files that are added first are stored first, until the limit is reached.
    """

    def __init__(self) -> None:
        self._texts: dict[str, str] = {}
        self._room, self._left_out = _MOST, dict[str, Path]()

    def add_mesh(self, name: str, prefix: str = "", kind: str = TOUCHED) -> None:
        """Add a mesh or a height field; a file that cannot be read is ignored.

        Args:
            name: Path of the file.
            prefix: Prefix of the names of the arm.
            kind: :data:`TOUCHED` or :data:`FIXTURE`; for the second and further meshes of a kind, with the number
                appended.
        """
        self._name(f"{prefix}{kind}", name)

    def add_robot(self, name: str, settings: Iterable[str] = (), prefix: str = "") -> None:
        """Add the text of a robot's file, if it has one, its drives and the meshes of its links.

        Args:
            name: The robot's name or path.
            settings: Geometry of the robot. A xacro file is expanded with the arguments in this geometry, and the
                resulting URDF is stored.
            prefix: Prefix of the names of the arm.
        """
        found = file_of(name)
        if found is None:
            return
        if is_scene(name):
            files = SCENES.find("scene").files(found[0])
            self._texts[f"{prefix}{_SCENE}"] = "\n".join(f"{self._add(file)} {at}" for at, file in files.items())
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
        """Names and texts for the recording. Warns of files that were left out because the size limit was reached."""
        if self._left_out:
            names = ", ".join(path.name for path in self._left_out.values())
            limit = f"keeps {_MOST / 2**20:g} MiB of files"
            warnings.warn(f"the recording {limit}; of {names} it keeps only digests", TeleopWarning, stacklevel=3)
        return dict(self._texts)

    def _name(self, key: str, name: str) -> None:
        """Store a file, and its path in the metadata entry ``key``."""
        if digest := self._add(Path(name).expanduser()):
            self._texts |= {key: name, f"{key}{_FILE}": digest}

    def _add(self, path: Path) -> str:
        """Digest of a file; empty if unreadable. Stores the file's packed bytes unless they would exceed the limit."""
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
    """Current path of each recorded file of an arm, by the path in the recording.

    A warning is given if a file is missing or has changed and only its digest was stored.

    Args:
        metadata: Names and texts of a recording.
        arm: Prefix of the arm's names, without the slash.

    Returns:
        The same path if the file has not changed; else the path of a temporary copy of the recorded file, which exists
        until the program ends.
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
    if name and (scene := metadata.get(f"{prefix}{_SCENE}", "")):
        found[name] = _scene_now(name, scene, metadata)
    if name and text:
        lines = metadata.get(f"{prefix}{_ROBOT}{_MESHES}", "").split("\n")
        parts = [line.partition(" ") for line in lines]
        digests = {mesh: digest for digest, _, mesh in parts if mesh}
        found[name] = _robot_now(name, text, digests, metadata)
    return found


def recorded_geometry(settings: Iterable[str], files: Mapping[str, str]) -> tuple[str, ...]:
    """Geometry of a robot as texts, with the path of the recorded drives in it.

    Args:
        settings: Geometry of the robot.
        files: Files of the arm, from :func:`recorded_files`.
    """
    found = []
    for text in settings:
        symbol, _, value = (part.strip() for part in text.partition("="))
        is_kept = symbol == _DRIVES and value in files
        found.append(f"{_DRIVES}={files[value]}" if is_kept else text)
    return tuple(found)


def _robot_now(name: str, text: str, digests: Mapping[str, str], metadata: Mapping[str, str]) -> str:
    """Path of a robot's file whose text and link meshes are as recorded; a temporary copy if they have changed."""
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


def _scene_now(name: str, lines: str, metadata: Mapping[str, str]) -> str:
    """Name of a scene whose files are as recorded; the path of a temporary copy if a file has changed or is gone."""
    recorded = {at: digest for digest, _, at in (line.partition(" ") for line in lines.split("\n"))}
    first = next(iter(recorded))
    with suppress(TeleopError):  # a scene that cannot be read, or no package that reads scenes
        now = SCENES.find("scene").files(SCENES.find("scene").file(name))
        if {at: _digest_now(file) for at, file in now.items()} == recorded:
            return name
    folder, room = _place(lines), _MOST
    for at, digest in recorded.items():
        data = _unpacked(metadata, digest, room)
        room -= len(data or b"")
        if data is None:
            _tell(at, None)
        elif (path := (folder / at).resolve()).is_relative_to(folder.resolve()):
            _written(path, data)
    return str(folder / first)


def _tell(name: str, path: Path | None) -> None:
    change = "another by now" if _digest_now(path) else "gone"
    warnings.warn(f"{name}: this file is {change}; the recording has no copy of it", TeleopWarning, stacklevel=4)


def _text(path: Path) -> str | None:
    """Printable text of a file, as read back from a recording; None if the file cannot be read as text."""
    try:
        return printable(path.read_text(encoding="utf-8")) if path.is_file() else None
    except (OSError, UnicodeDecodeError):
        return None


def _bytes(path: Path) -> bytes | None:
    """Bytes of a file; None if the path cannot be read or is not a regular file but, for example, a pipe."""
    try:
        return path.read_bytes() if path.is_file() else None
    except OSError:
        return None


def _digest(data: bytes) -> str:
    return _DIGEST + hashlib.sha256(data).hexdigest()


def _digest_now(path: Path | None) -> str:
    """Digest of a file; empty if the file cannot be read."""
    data = None if path is None else _bytes(path)
    return "" if data is None else _digest(data)


def _unpacked(metadata: Mapping[str, str], digest: str, most: int) -> bytes | None:
    """Bytes that a recording stores under a digest; None if missing, damaged or larger than ``most``."""
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
