"""Finding the files of a recording: files that its ``metadata.yaml`` lists, in the same directory."""

from collections.abc import Mapping
from pathlib import Path

from teleop_core.base import RecordingError, plain_yaml, shown

METADATA = "metadata.yaml"


def check_new(path: Path | None) -> None:
    """Refuse the path of a new recording if the path already exists; None stands for a path that is chosen later.

    Raises:
        RecordingError: The path exists.
    """
    if path is not None and path.exists():
        raise RecordingError(path, "exists already; choose another --out")


def mcap_files(path: Path) -> list[Path]:
    """MCAP files of a recording, in order.

    Args:
        path: Directory of a recording, or one ``.mcap`` file.

    Raises:
        RecordingError: There are no such files, or ``metadata.yaml`` is missing or malformed.
    """
    if not path.exists():
        raise RecordingError(path, "does not exist; give a recording's directory or .mcap file")
    if path.is_file():
        return [path]
    mcaps, others = sorted(path.glob("*.mcap")), sorted(path.glob("*.db3"))
    index = path / METADATA
    if not mcaps and others:
        raise RecordingError(path, "is stored as sqlite3, must be mcap; convert it with `ros2 bag convert`")
    if not mcaps:
        raise RecordingError(path, "is no recording: it contains no .mcap file")
    if not index.exists():
        reason = f"was not finished (no {METADATA}); `teleop recover {path}` saves its intact messages"
        raise RecordingError(path, reason)
    return _listed(path, index)


def _listed(path: Path, index: Path) -> list[Path]:
    """Files that the index lists. They are searched beside the index; folders in the listed names are ignored."""
    information, mode = _information(index), compression_mode(index)
    if mode != "none":
        reason = f"is compressed by {shown(mode)}; convert it to plain mcap with `ros2 bag convert`"
        raise RecordingError(path, reason)
    names = information.get("relative_file_paths")
    if not isinstance(names, list) or not names or not all(isinstance(n, str) for n in names):
        raise _damaged(index, "relative_file_paths must be a list of names of files")
    plain = [Path(name).name for name in names]
    if twice := [name for name in dict.fromkeys(plain) if plain.count(name) > 1]:
        raise _damaged(index, f"it lists {twice[0]} {plain.count(twice[0])} times")
    missing = [name for name in plain if name in {"", ".."} or not _is_file(path / name)]
    if missing:
        raise RecordingError(path, f"lacks its files {', '.join(missing)}")
    return [path / name for name in plain]


def compression_mode(index: Path) -> str:
    """Compressed part of a recording according to its metadata: ``none``, ``file`` or ``message``.

    Raises:
        RecordingError: The metadata is malformed.
    """
    return str(_information(index).get("compression_mode") or "none").lower()


def _is_file(path: Path) -> bool:
    try:
        return path.is_file()
    except OSError:  # the file name is too long
        return False


def _information(index: Path) -> Mapping[str, object]:
    try:
        content = plain_yaml.read(index)
    except plain_yaml.UnreadableError as error:
        raise _damaged(index, f"it {error}") from error
    except OSError as error:
        raise _damaged(index, f"it cannot be read: {error.strerror}") from error
    found = content.get("rosbag2_bagfile_information") if isinstance(content, Mapping) else None
    if not isinstance(found, Mapping):
        raise _damaged(index, "it must contain rosbag2_bagfile_information with its entries")
    return found


def _damaged(index: Path, reason: str) -> RecordingError:
    return RecordingError(index, f"is damaged: {reason}; give the .mcap file of the recording instead")
