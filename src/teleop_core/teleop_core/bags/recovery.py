"""Recovery: a readable copy of a recording that was cut off."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from teleop_core.bags import chunks, compression, mcap_file, mcap_source, rosbag2
from teleop_core.base.errors import RecordingError


def recover(path: Path | str, out: Path | str | None = None) -> tuple[Path, int]:
    """Copy all intact messages of a recording into a new recording; the old recording is not changed.

    Args:
        path: Directory or ``.mcap`` file of a recording whose writer was killed.
        out: Directory to make; None appends ``_recovered`` to the name of the old recording.

    Returns:
        The new directory and the number of messages in it.

    Raises:
        RecordingError: There is nothing to recover, or the new directory exists or is not writable.
    """
    path = Path(path)
    source = mcap_source.McapSource(_only_file(path), is_whole=False)
    found = source.contents
    if not found.places:
        raise RecordingError(path, "contains no complete chunk of messages; nothing can be recovered")
    target = Path(out) if out else path.with_name((path.stem if path.is_file() else path.name) + "_recovered")
    with rosbag2.new_directory(target) as file:
        return target, _copy(source, file)


def _only_file(path: Path) -> Path:
    if not path.exists():
        raise RecordingError(path, "does not exist; give a recording's directory or .mcap file")
    files = [path] if path.is_file() else sorted(path.glob("*.mcap"))
    if len(files) != 1:
        reason = f"contains {len(files)} .mcap files; give the one to recover"
        raise RecordingError(path, reason)
    return files[0]


def _copy(source: mcap_source.McapSource, target: Path) -> int:
    found = source.contents
    schemas, channels = list(found.schemas.values()), list(found.channels.values())
    file = mcap_file.McapFile(
        target,
        schemas,
        channels,
        {record.name: record.metadata for record in found.metadata},
        "zstd",
        compression.compressor("zstd", 1),
    )
    try:
        for records in source.records(found.places):
            is_sound = np.isin(records.channel, list(found.channels)) & (records.log_ns >= 0)
            if is_sound.any():
                file.append(_chunk(records, is_sound))
        file.finish()
        statistics = file.statistics()
        text = rosbag2.metadata_text(file.path, schemas, channels, statistics, 0)
        rosbag2.write_metadata(target.parent, text)
    finally:
        file.close()
    return int(statistics.message_count)


def _chunk(records: mcap_source.Records, chosen: NDArray[np.bool_]) -> chunks.Chunk:
    """Chunk of the chosen messages, in the same order, with an index."""
    channels, log_ns = records.channel[chosen], records.log_ns[chosen]
    begins, sizes = records.begin[chosen] - chunks.HEADER.size, records.size[chosen] + chunks.HEADER.size
    pieces = [records.data[b : b + n] for b, n in zip(begins.tolist(), sizes.tolist(), strict=True)]
    entries = np.column_stack((log_ns, np.cumsum(sizes) - sizes)).astype("<u8")
    index = {number: entries[channels == number] for number in np.unique(channels).tolist()}
    return chunks.Chunk(np.concatenate(pieces), int(log_ns.min()), int(log_ns.max()), index)
