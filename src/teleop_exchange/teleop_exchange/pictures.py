"""Pictures: finds the cameras of a recording, and decodes their messages to frames of a video.

A camera is a topic of ``sensor_msgs/Image`` or ``CompressedImage`` (JPEG, PNG, WebP). Depth pictures are no video of
eight bits, so they are left out.
"""

from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from typing import Any

import av
import numpy as np
from numpy.typing import NDArray

from teleop_core.base.errors import RecordingError, UnknownNameError
from teleop_exchange.bag_messages import plain
from teleop_exchange.ros_bags import RosBag
from teleop_exchange.times import SECOND_NS, Stamps

IMAGE, COMPRESSED = "sensor_msgs/msg/Image", "sensor_msgs/msg/CompressedImage"
_RAW = {
    "rgb8": "rgb24", "8UC3": "bgr24", "bgr8": "bgr24", "rgba8": "rgba", "bgra8": "bgra", "8UC4": "bgra",
    "mono8": "gray", "8UC1": "gray", "nv12": "nv12", "nv21": "nv21",
    "yuv422": "uyvy422", "uyvy": "uyvy422", "yuv422_yuy2": "yuyv422", "yuyv": "yuyv422",
    "bayer_rggb8": "bayer_rggb8", "bayer_bggr8": "bayer_bggr8",
    "bayer_gbrg8": "bayer_gbrg8", "bayer_grbg8": "bayer_grbg8",
}  # fmt: skip
"""Formats of FFmpeg for the encodings of ROS."""
_PACKED = ((b"\xff\xd8", "mjpeg"), (b"\x89PNG", "png"), (b"RIFF", "webp"))
"""First bytes of compressed pictures, and the decoder of FFmpeg."""
_ENDS = {"mjpeg": b"\xff\xd9", "png": b"IEND", "webp": b""}
_COMMON = {"image", "image_raw", "image_rect", "image_color", "image_rect_color", "compressed", "color", "rgb"}
_LATE_NS = 10 * SECOND_NS  # stamps farther from the times of recording are of another clock


FULL, LIMITED = 2, 1
"""Ranges of brightness in FFmpeg: 0 to 255 of JPEG, 16 to 235 of videos."""


class NoPictureError(ValueError):
    """A message that holds no picture of eight bits that can be decoded."""


@dataclass(frozen=True, eq=False)
class Camera:
    """Pictures of a topic.

    Attributes:
        name: Name in a data set, such as ``front`` for ``camera/front/image_raw/compressed``.
        topic: Name of the topic.
        stamp_ns: Times of capture (m,) [ns] in the order of the file; -1 for messages without a usable picture.
        notes: What a user should know of these pictures.
    """

    name: str
    topic: str
    stamp_ns: Stamps
    notes: tuple[str, ...] = ()

    def newest(self, times: Stamps) -> Stamps:
        """Number in the file of the newest picture at each time [ns]; -1 before the first one."""
        usable = np.flatnonzero(self.stamp_ns >= 0)
        order = usable[np.argsort(self.stamp_ns[usable], kind="stable")]
        at = np.searchsorted(self.stamp_ns[order], times, side="right") - 1
        return np.append(order, -1)[at]  # -1 takes the last entry

    @property
    def rate(self) -> float:
        """Pictures per second, by the median period; 0 for a single picture."""
        periods = np.diff(np.unique(self.stamp_ns[self.stamp_ns >= 0]))
        return SECOND_NS / float(np.median(periods)) if len(periods) else 0.0


def cameras_of(bag: RosBag, topics: Iterable[str] | None) -> list[Camera]:
    """Cameras of a recording, in the order of their names.

    Args:
        bag: The opened recording.
        topics: Topics of pictures; None for all of them.

    Raises:
        UnknownNameError: There is no such topic of pictures.
    """
    known = [name for name, kind in bag.types.items() if kind in {IMAGE, COMPRESSED}]
    if topics is not None:
        wanted = [plain(name) for name in topics]
        if unknown := [name for name in wanted if name not in known]:
            raise UnknownNameError("--cameras", unknown[0], sorted(known) or ["none"])
        known = [name for name in known if name in wanted]
    found: dict[str, Camera] = {}
    # A camera driver often sends a picture raw and compressed. The raw one has no losses, and it is decoded faster.
    for topic in sorted(known, key=lambda name: (bag.types[name] != IMAGE, name)):
        name = _name(topic, found)
        if name not in found and (camera := _camera(bag, name, topic)) is not None:
            found[name] = camera
    return [found[name] for name in sorted(found)]


def _name(topic: str, taken: Iterable[str]) -> str:
    """Name of a camera: its topic without the parts that every camera has."""
    parts = topic.split("/")
    while len(parts) > 1 and parts[-1] in _COMMON:
        parts.pop()
    if len(parts) > 1 and parts[0] in {"camera", "cameras"}:
        del parts[0]
    return "_".join(parts)


def _camera(bag: RosBag, name: str, topic: str) -> Camera | None:
    """Camera of a topic; None if it has no usable picture, as a depth camera."""
    stamps, logs, refused = list[int](), list[int](), Counter[str]()
    for log, data in bag.raw(topic):
        logs.append(log)
        try:
            message = _message(bag, topic, data)
            _check(message)
            stamps.append(message.header.stamp.sec * SECOND_NS + message.header.stamp.nanosec)
        except NoPictureError as error:
            refused[str(error)] += 1
            stamps.append(-1)
    stamp_ns, log_ns = np.array(stamps, np.int64), np.array(logs, np.int64)
    usable = stamp_ns >= 0
    if not usable.any():
        return None
    notes = [f"{count} messages left out: {reason}" for reason, count in refused.items()]
    if abs(np.median((log_ns - stamp_ns)[usable])) > _LATE_NS:
        notes.append("stamps are of another clock, so the times of recording are taken")
        stamp_ns = np.where(usable, log_ns, -1)
    return Camera(name, topic, stamp_ns, tuple(notes))


def _message(bag: RosBag, topic: str, data: bytes) -> Any:
    read = bag.typestore.deserialize_cdr if bag.is_ros2 else bag.typestore.deserialize_ros1
    try:
        return read(data, bag.types[topic])
    except Exception as error:  # rosbags has no error of its own for bytes that are no message
        raise NoPictureError("no message of its type") from error


def _check(message: Any) -> None:
    """Raise an error if a message can be seen to hold no picture, without decoding it.

    Raises:
        NoPictureError: The error's text is the reason.
    """
    if hasattr(message, "encoding"):
        if message.encoding not in _RAW:
            raise NoPictureError(f"encoding {message.encoding!r} is no colour of eight bits")
        if not 0 < message.height * message.step <= len(message.data):
            raise NoPictureError("fewer bytes than height times step")
        return
    decoder = _decoder_of(message)
    if _ENDS[decoder] not in bytes(message.data[-64:]):
        raise NoPictureError("cut off")


def _decoder_of(message: Any) -> str:
    head = bytes(message.data[:4])
    for begin, decoder in _PACKED:
        if head.startswith(begin):
            return decoder
    raise NoPictureError(f"format {message.format!r} is neither JPEG, PNG nor WebP")


@dataclass
class Decoder:
    """Decodes messages of a camera to frames of a video.

    Args:
        bag: The opened recording.
        camera: The camera.
    """

    bag: RosBag
    camera: Camera
    _contexts: dict[str, Any] = field(default_factory=dict)

    def frames(self, numbers: Stamps) -> Iterator[tuple[int, "av.VideoFrame"]]:
        """Yield a frame for each wanted picture, with the number of the picture that is really shown.

        A picture that cannot be decoded is replaced by the one before it.

        Args:
            numbers: Numbers of pictures in the file (n,), in the order of their stamps; a number may repeat.

        Raises:
            RecordingError: The first picture cannot be decoded.
        """
        wanted, waiting = set(numbers.tolist()), dict[int, bytes]()
        at, shown, frame = 0, -1, None
        for number, (_, data) in enumerate(self.bag.raw(self.camera.topic)):
            if number in wanted:
                waiting[number] = data
            while at < len(numbers) and (next_one := int(numbers[at])) in waiting:
                if at == 0 or next_one != numbers[at - 1]:
                    decoded = self._decoded(waiting[next_one])
                    shown, frame = (next_one, decoded) if decoded is not None else (shown, frame)
                if frame is None:
                    raise RecordingError(self.camera.topic, "its first picture cannot be decoded")
                yield shown, frame
                at += 1
                if at == len(numbers) or numbers[at] != next_one:
                    del waiting[next_one]

    def _decoded(self, data: bytes) -> "av.VideoFrame | None":
        message = _message(self.bag, self.camera.topic, data)
        if hasattr(message, "encoding"):
            return _raw_frame(message)
        name = _decoder_of(message)
        if name not in self._contexts:
            self._contexts[name] = av.CodecContext.create(name, "r")
            self._contexts[name].thread_count = 1  # several threads would hold pictures back
        packet = av.Packet(bytes(message.data))
        packet.is_keyframe = True  # the decoder of PNG would add the picture to the last one
        try:
            found = self._contexts[name].decode(packet)
        except (av.FFmpegError, ValueError):
            return None
        return found[-1] if found else None


def _raw_frame(message: Any) -> "av.VideoFrame":
    """Frame with the pixels of an ``Image``, whose rows may be padded."""
    height, step = int(message.height), int(message.step)
    frame = av.VideoFrame(int(message.width), height, _RAW[message.encoding])
    rows = np.frombuffer(memoryview(message.data), np.uint8)
    rows = rows[: len(rows) // step * step].reshape(-1, step)
    if frame.format.name == "gray":
        frame.color_range = FULL
    begin = 0
    for plane in frame.planes:
        own = np.frombuffer(plane, np.uint8).reshape(-1, plane.line_size)  # type: ignore[call-overload]
        part = rows[begin : begin + plane.height]
        width = min(step, plane.line_size)
        own[: len(part), :width] = part[:, :width]
        begin += plane.height
    return frame.reformat(format="rgb24") if "bayer" in frame.format.name else frame  # yuv of bayer is too bright


def pixels(frame: "av.VideoFrame") -> NDArray[np.uint8]:
    """Colours (height, width, 3) of a frame."""
    return np.asarray(frame.to_ndarray(format="rgb24"), np.uint8)
