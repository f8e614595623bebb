"""The rosbag2 side of a recording: topics as MCAP records, and ``metadata.yaml``."""

import errno
import shutil
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from mcap.records import Channel, Schema, Statistics

from teleop_core.bags import ros_types
from teleop_core.base import RecordingError, plain_yaml
from teleop_core.graph.topics import Quality, Topic

VERSION = 9
_FOREVER = {"sec": 9223372036, "nsec": 854775807}
_QUALITIES = {
    Quality.STREAM: ("reliable", "volatile", 1),
    Quality.LATCHED: ("reliable", "transient_local", 1),
    Quality.REPORT: ("reliable", "volatile", 10),
}


def offered_qos(quality: Quality) -> list[dict[str, Any]]:
    """Quality of service of a topic's publisher, in the form of rosbag2 metadata since version 9."""
    reliability, durability, depth = _QUALITIES[quality]
    profile = {
        "history": "keep_last",
        "depth": depth,
        "reliability": reliability,
        "durability": durability,
        "deadline": dict(_FOREVER),
        "lifespan": dict(_FOREVER),
        "liveliness": "automatic",
        "liveliness_lease_duration": dict(_FOREVER),
        "avoid_ros_namespace_conventions": False,
    }
    return [profile]


def records_of(topics: list[Topic]) -> tuple[list[Schema], list[Channel]]:
    """MCAP schemas and channels of topics; a topic's channel number is its index in the list plus one."""
    names = list(dict.fromkeys(topic.ros_type for topic in topics))
    schemas = [
        Schema(number, ros_types.definition(name).encode(), "ros2msg", name)
        for number, name in enumerate(names, start=1)
    ]
    channels = []
    for number, topic in enumerate(topics, start=1):
        entries = {
            "offered_qos_profiles": plain_yaml.written(offered_qos(topic.quality)),
            "topic_type_hash": ros_types.type_hash(topic.ros_type),
        }
        schema = 1 + names.index(topic.ros_type)
        channels.append(Channel(number, "/" + topic.name, "cdr", entries, schema))
    return schemas, channels


def _parsed(qos: str) -> Any:
    """Quality of service from the text of a channel; empty if the text cannot be parsed."""
    try:
        return plain_yaml.parse(qos) or []
    except plain_yaml.UnreadableError:
        return []


def _topic_entry(channel: Channel, type_name: str, count: int) -> dict[str, Any]:
    return {
        "topic_metadata": {
            "name": channel.topic,
            "type": type_name,
            "serialization_format": channel.message_encoding,
            "offered_qos_profiles": _parsed(channel.metadata.get("offered_qos_profiles", "")),
            "type_description_hash": channel.metadata.get("topic_type_hash", ""),
        },
        "message_count": count,
    }


def metadata_text(
    file: Path, schemas: list[Schema], channels: list[Channel], statistics: Statistics, start_ns: int
) -> str:
    """Content of ``metadata.yaml`` of a directory with one finished file.

    Args:
        file: The MCAP file.
        schemas: Message types of the file.
        channels: Topics of the file.
        statistics: Numbers of messages in the file.
        start_ns: Starting time to write if the file has no messages, [ns].
    """
    types = {schema.id: schema.name for schema in schemas}
    begin = statistics.message_start_time if statistics.message_count else start_ns
    end = statistics.message_end_time if statistics.message_count else start_ns
    span = {
        "starting_time": {"nanoseconds_since_epoch": begin},
        "duration": {"nanoseconds": end - begin},
        "message_count": statistics.message_count,
    }
    counts = statistics.channel_message_counts
    information = {
        "version": VERSION,
        "storage_identifier": "mcap",
        **span,
        "topics_with_message_count": [
            _topic_entry(c, types.get(c.schema_id, ""), counts.get(c.id, 0)) for c in channels
        ],
        "compression_format": "",
        "compression_mode": "",
        "relative_file_paths": [file.name],
        "files": [{"path": file.name, **span}],
        "custom_data": None,
        "ros_distro": ros_types.DISTRIBUTION,
    }
    return plain_yaml.written({"rosbag2_bagfile_information": information})


@contextmanager
def new_directory(path: Path) -> Iterator[Path]:
    """Make a recording's directory and yield the path of its file. Remove the directory if the file cannot be written.

    Raises:
        RecordingError: The directory exists already, or the directory or its file cannot be written.
    """
    try:
        path.mkdir(parents=True)
    except FileExistsError as error:
        raise RecordingError(path, "exists already; choose another --out") from error
    except OSError as error:
        raise RecordingError(path, f"cannot be written: {error.strerror}") from error
    try:
        yield path / f"{path.resolve().name}_0.mcap"
    except OSError as error:
        shutil.rmtree(path, ignore_errors=True)
        raise RecordingError(path, f"cannot be written: {error.strerror}") from error


def write_metadata(directory: Path, text: str) -> None:
    """Write ``metadata.yaml`` completely or not at all.

    Raises:
        OSError: The file was not written.
    """
    draft, final = directory / "metadata.yaml.part", directory / "metadata.yaml"
    try:
        if final.exists():  # this recording was moved into the directory of another recording
            raise FileExistsError(errno.EEXIST, f"{final.name} is there already", str(final))
        draft.write_text(text, encoding="utf-8")
        draft.replace(final)
    except OSError:
        with suppress(OSError):
            draft.unlink(missing_ok=True)
        raise
