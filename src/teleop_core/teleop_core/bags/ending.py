"""Ending of a recording: writes index and metadata. A failure to write them never deletes recorded messages."""

from contextlib import suppress
from pathlib import Path

from teleop_core.bags import rosbag2
from teleop_core.bags.layouts import SECOND_NS
from teleop_core.bags.mcap_file import McapFile
from teleop_core.base.errors import RecordingError


def end(path: Path, file: McapFile, start_ns: int, stopped: OSError | None, given: int = 0) -> Exception | None:
    """Finish a recording's file and directory, even if they were moved during the recording.

    Args:
        path: Path at which the directory was made.
        file: The file in the directory; it contains whole chunks only.
        start_ns: Log time at which the session started, [ns].
        stopped: Error that prevented the writing of a chunk; None if all chunks were written.
        given: Number of messages that callers passed to the writer, after decimation.

    Returns:
        Error to raise in the caller of the writer; None if the recording is complete and at ``path``.
    """
    with suppress(OSError):  # a disk that failed is reported below
        file.go_on_after_truncation()
    found = file.statistics()
    if file.truncated:
        what = f"{found.message_count} messages"
    elif stopped is None:
        what = f"all {found.message_count} messages"
    else:
        seconds = max(0, found.message_end_time - start_ns) / SECOND_NS
        what = f"the first {seconds:.1f} s ({found.message_count} of {given} messages)"
    said = f"cannot be written any more ({stopped.strerror}); " if stopped else ""
    if file.truncated:
        said += f"was truncated by another program during the recording, {file.truncated} messages are lost; "
    try:
        home = _finished(path, file, start_ns)
    except OSError as error:
        kept = file.place
        if kept is None:
            reason = (
                f"was removed during the recording and cannot be created again ({error.strerror}); all "
                "its messages are lost"
            )
            return RecordingError(path, said + reason)
        reason = f"cannot be finished ({error.strerror}), but contains {what}; "
        return RecordingError(kept.parent, f"{said}{reason}`teleop recover {kept}` completes it")
    if home == path:
        return RecordingError(path, f"{said}was removed during the recording and is created again with {what}")
    if home is not None:
        return RecordingError(path, f"{said}was moved or removed during the recording; {what} are in {home}")
    return RecordingError(path, f"{said}{what} are safe") if said else None


def _finished(path: Path, file: McapFile, start_ns: int) -> Path | None:
    """Write index and metadata. Return their directory if the recording was moved or removed, else None.

    Raises:
        OSError: Index or metadata could not be written; all chunks are kept.
    """
    file.finish()
    place = file.place
    is_moved = place != file.path
    if place is None:
        place = _made_again(path, file)
    text = rosbag2.metadata_text(place, file.schemas, file.channels, file.statistics(), start_ns)
    rosbag2.write_metadata(place.parent, text)
    return place.parent if is_moved else None


def _made_again(path: Path, file: McapFile) -> Path:
    """Path of a new copy of a file that was removed while it was still open for writing.

    Raises:
        OSError: The copy can be written neither at the old path nor beside it.
    """
    try:
        return _copy(file, path)
    except OSError:
        return _copy(file, path.with_name(f"{path.name}_rescued"))


def _copy(file: McapFile, home: Path) -> Path:
    home.mkdir(parents=True, exist_ok=True)
    file.copy_to(home / file.path.name)
    return home / file.path.name
