"""Recording parameters: which topics are recorded, at what rate and how compressed."""

import re
from collections.abc import Iterable
from dataclasses import dataclass

from teleop_core.bags import compression
from teleop_core.base import NoParameters, ParameterError, UnknownNameError, Within, fixed
from teleop_core.graph import Stage
from teleop_core.graph.topics import BY_NAME, Kind, Quality, Stamp, Topic

_TYPE = re.compile(r"\w+/msg/\w+")
_PICTURES = {
    "/compressed": "sensor_msgs/msg/CompressedImage",
    "/image_raw": "sensor_msgs/msg/Image",
    "/camera_info": "sensor_msgs/msg/CameraInfo",
}
"""Message types by the ends of names that ROS's camera drivers use."""


@dataclass(frozen=True, kw_only=True)
class RecordingParameters:
    """Parameters of :class:`~teleop_core.bags.writer.BagWriter`."""

    compression: str = fixed("zstd", doc="compression of the bag", choices=compression.NAMES)
    compression_level: int = fixed(
        1, Within(1, 16), "compression level; a higher level gives smaller files and is slower"
    )
    topics: tuple[str, ...] = fixed((), doc="topics to record; empty for all")
    every: int = fixed(1, Within(1, 1_000_000), "n: only every n-th sample of each stream is recorded")
    every_of: tuple[str, ...] = fixed(
        (), doc="topics with another n than `every`, as topic=n, e.g. slave/measured_js=10"
    )
    tf_rate: float = fixed(
        50.0,
        Within(0.0, 1000.0, "1/s"),
        "messages of /tf per second; the robot's model is recorded too; 0: neither is recorded",
    )

    also: tuple[str, ...] = fixed(
        (),
        doc="topics of other nodes that a live session records too, as NAME=TYPE, e.g. imu/data=sensor_msgs/msg/Imu; "
        "pictures need no type: camera/front/image_raw/compressed",
    )

    def __post_init__(self) -> None:
        """Refuse unknown names and entries that are not topic=n."""
        if self.compression not in compression.NAMES:
            raise UnknownNameError("compression", self.compression, compression.NAMES)
        if self.every < 1:
            raise ParameterError("every", self.every, "at least 1")
        for entry in self.every_of:
            number = entry.partition("=")[2]
            if not (number.isascii() and number.isdigit() and int(number) > 0):
                raise ParameterError("every_of", entry, "topic=n with a whole number n >= 1")
        _ = self.others

    @property
    def others(self) -> tuple[Topic, ...]:
        """Topics of other nodes that are recorded too.

        Raises:
            ParameterError: An entry of ``also`` is no NAME=TYPE, or a message of this type is unknown.
        """
        found = []
        for entry in self.also:
            name, _, given = entry.strip("/").partition("=")
            kind = given or next((kind for end, kind in _PICTURES.items() if name.endswith(end)), "")
            if not name or not _TYPE.fullmatch(kind):
                raise ParameterError("also", entry, "NAME=PACKAGE/msg/TYPE; pictures need no type")
            found.append(Topic(name, Kind.REPORT, Stamp("of the sender"), message=kind))
        return tuple(found)

    def every_nth(self, topics: Iterable[Topic]) -> dict[str, int]:
        """Decimation of each topic: n if every n-th sample is recorded; 0 if the topic is not recorded.

        Raises:
            UnknownNameError: ``topics`` or ``every_of`` of the parameters names an unknown topic.
        """
        exceptions = dict(entry.split("=") for entry in self.every_of)
        declared = list(topics)
        known = {topic.name for topic in declared} | set(BY_NAME)
        for name in (*self.topics, *exceptions):
            if name not in known:
                raise UnknownNameError("recorded topic", name, sorted(known))
        out = {}
        for topic in declared:
            number = 1 if topic.kind is Kind.REPORT else self.every
            is_wanted = not self.topics or topic.name in self.topics
            out[topic.name] = int(exceptions.get(topic.name, number)) * is_wanted
        return out


MARKS = Topic("recorder/marks", Kind.REPORT, Stamp("time of the mark"), quality=Quality.REPORT)
"""Marks that a user set during a live recording; each mark is one text."""
RECORDER = Stage("recorder", RecordingParameters, reads=(), writes=(), node="teleop_core.nodes.recorder:RecorderNode")
"""The recorder; it reads every topic of its graph, of all arms."""
FRAMES = Stage("frames", NoParameters, reads=(), writes=(), node="teleop_core.nodes.frames:FramesNode")
"""Publishes what other tools draw of a running session, of all arms."""
