"""Film: adds pictures to the recording of a session with a scene, from the poses that it recorded.

The pictures are those that a camera beside the session would have taken, to the bit: they depend on the poses alone.
The session itself never waits for a picture. A way delays, loses and reorders the pictures as a network would.
"""

import struct
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import simplejpeg
from numpy.typing import NDArray

from teleop_core.bags.kept_files import recorded_files
from teleop_core.bags.ros_types import serialise, typestore
from teleop_core.bags.writer import BagWriter
from teleop_core.base import ParameterError, RecordingError
from teleop_core.graph import TICK_NS, topics
from teleop_core.graph.topics import Kind, Quality, Topic
from teleop_core.kernels import Array
from teleop_core.robots.parts import file_of
from teleop_core.session.recording import Recording, open_recording
from teleop_scene.camera import Camera, Pixels, View

SECOND_NS = 1_000_000_000
QUALITY = 90
"""Quality of JPEG, of 100."""
IMAGE, INFO = "sensor_msgs/msg/CompressedImage", "sensor_msgs/msg/CameraInfo"


@dataclass(frozen=True)
class Way:
    """Way of pictures from a camera to whoever sees them.

    Attributes:
        delay: Delay [s].
        jitter: Standard deviation of a further delay, which is never negative [s].
        loss: Share of lost pictures, 0 to 1.
        seed: Seed of the random numbers.
    """

    delay: float = 0.0
    jitter: float = 0.0
    loss: float = 0.0
    seed: int = 0

    def __post_init__(self) -> None:
        for name, value, most in (("delay", self.delay, 60.0), ("jitter", self.jitter, 60.0), ("loss", self.loss, 1.0)):
            if not 0.0 <= value <= most:
                raise ParameterError(f"--{name}", value, f"0 to {most:g}")

    def arrivals(self, count: int) -> Array:
        """Delay of each picture [s]; infinite for a lost one."""
        rng = np.random.default_rng(self.seed)
        late = self.delay + self.jitter * np.abs(rng.standard_normal(count))
        late[rng.random(count) < self.loss] = np.inf
        return late


def encoded(pixels: Pixels, stamp_ns: int, frame: str) -> bytes:
    """CDR bytes of a ``CompressedImage`` with a picture (height, width, 3), and the time of its capture [ns]."""
    data = simplejpeg.encode_jpeg(np.ascontiguousarray(pixels), QUALITY, colorspace="RGB", colorsubsampling="420")
    name = frame.encode() + b"\0"
    head = struct.pack("<BBBBiII", 0, 1, 0, 0, *divmod(stamp_ns, SECOND_NS), len(name)) + name
    head += b"\0" * (-len(head) % 4) + struct.pack("<I", 5) + b"jpeg\0\0\0\0" + struct.pack("<I", len(data))
    return head + data


def calibration(camera: Camera) -> Callable[[int], bytes]:
    """Maker of the CDR bytes of a camera's ``CameraInfo`` for a stamp [ns]: a pinhole without distortion."""
    types, view = typestore().types, camera.view
    header = types["std_msgs/msg/Header"](types["builtin_interfaces/msg/Time"](0, 0), view.name)
    f, x, y = camera.focal, view.width / 2.0, view.height / 2.0
    K = np.array([f, 0.0, x, 0.0, f, y, 0.0, 0.0, 1.0])
    P = np.array([f, 0.0, x, 0.0, 0.0, f, y, 0.0, 0.0, 0.0, 1.0, 0.0])
    whole = types["sensor_msgs/msg/RegionOfInterest"](0, 0, 0, 0, False)
    info = types[INFO](header, view.height, view.width, "plumb_bob", np.zeros(5), K, np.eye(3).ravel(), P, 0, 0, whole)
    data = serialise(info)
    return lambda stamp_ns: data[:4] + struct.pack("<iI", *divmod(stamp_ns, SECOND_NS)) + data[12:]


def topics_of(view: View) -> tuple[Topic, Topic]:
    """Topics of the pictures and of the calibration of a camera."""
    image = Topic(view.topic, Kind.REPORT, frame_id=view.name, quality=Quality.STREAM, message=IMAGE)
    info = Topic(view.info_topic, Kind.REPORT, frame_id=view.name, quality=Quality.STREAM, message=INFO)
    return image, info


def captures(stamps: NDArray[np.int64], rate: float) -> NDArray[np.int64]:
    """Indices of the samples at which a camera takes a picture: the first one in each period.

    Args:
        stamps: Stamps of the poses (n,) [ns].
        rate: Pictures per second [Hz].
    """
    slots = np.floor(stamps * (rate / SECOND_NS) + 1e-6)
    return np.flatnonzero(np.diff(slots, prepend=-1.0) > 0)


@dataclass(frozen=True)
class FilmReport:
    """Result of a film.

    Attributes:
        out: The new recording.
        taken: Number of pictures of all cameras.
        lost: Number of pictures that the way lost.
        missed: Number of periods without poses, in which no picture could be taken.
    """

    out: Path
    taken: int
    lost: int
    missed: int

    def __str__(self) -> str:
        return f"{self.out}: {self.taken} pictures taken, {self.lost} lost on the way, {self.missed} not made"


def scene_file(recording: Recording) -> Path:
    """File of the scene of a recording, as it was then.

    Raises:
        RecordingError: The session had no scene.
    """
    name = recording.metadata.get("robot", "")
    name = recorded_files(recording.metadata).get(name, name)
    found = file_of(name) if name.lower().endswith(".xml") else None
    if found is None or topics.SCENE_POSES.name not in recording.topics:
        raise RecordingError(recording.bag.path, f"lacks {topics.SCENE_POSES.name}: its robot is no scene")
    return found[0]


def film(
    recording: Recording | Path | str,
    out: Path | str,
    cameras: Sequence[str | View],
    *,
    rate: float = 30.0,
    way: Way | None = None,
    is_marked: bool = False,
) -> FilmReport:
    """Write a copy of a recording that has the pictures of cameras too.

    Args:
        recording: Recording of a session with a scene.
        out: Directory of the new recording.
        cameras: Cameras, as :meth:`View.parse` reads them.
        rate: Pictures per second [Hz] of each camera; not above the rate of ``scene/poses``.
        way: Way of the pictures to the recorder.
        is_marked: Whether pictures carry the number of their tick, for tests.

    Raises:
        RecordingError: The recording has no scene, or cannot be read, or the new one exists.
        ParameterError: A value is not allowed.
        UnknownNameError: The scene has no such camera.
        TeleopError: This machine cannot draw.
    """
    source = recording if isinstance(recording, Recording) else open_recording(recording)
    if not 0.0 < rate <= 1000.0:
        raise ParameterError("--rate", rate, "above 0 Hz, up to 1000 Hz")
    if not cameras:
        raise ParameterError("--cameras", (), "at least one camera of the scene")
    views = [View.parse(one, is_marked=is_marked) if isinstance(one, str) else one for one in cameras]
    file, poses = scene_file(source), source.bag.read(topics.SCENE_POSES)
    taken_way = way or Way()
    made, counts = list[tuple[Topic, int, bytes]](), np.zeros(2, int)
    at = captures(poses.stamp_ns, rate)
    slots = np.floor(poses.stamp_ns[at] * (rate / SECOND_NS) + 1e-6)
    missed = int(slots[-1] - slots[0]) + 1 - len(at)
    for number, view in enumerate(views):
        camera = Camera(file, view)
        image, info = topics_of(view)
        late = replace(taken_way, seed=taken_way.seed + number).arrivals(len(at))
        calibrated = calibration(camera)
        for k, index in enumerate(at):
            counts += (1, not np.isfinite(late[k]))
            if np.isfinite(late[k]):
                stamp = int(poses.stamp_ns[index])
                picture = camera.take(poses.values[index].reshape(-1, 7)[: camera.bodies], stamp // TICK_NS)
                came_ns = int(poses.log_ns[index] + late[k] * SECOND_NS)
                made += [(image, came_ns, encoded(picture, stamp, view.name)), (info, came_ns, calibrated(stamp))]
        camera.close()
    _copy(source, Path(out), sorted(made, key=lambda m: m[1]), [t for view in views for t in topics_of(view)])
    return FilmReport(Path(out), int(counts[0]), int(counts[1]), missed * len(views))


def _copy(source: Recording, out: Path, made: list[tuple[Topic, int, bytes]], further: list[Topic]) -> None:
    bag = source.bag
    known = [Topic(name, Kind.REPORT, message=info.type) for name, info in bag.topics.items()]
    by_name = {topic.name: topic for topic in known}
    with BagWriter(out, (*known, *further), (), metadata=bag.metadata) as writer:
        pictures = iter([*made, None])
        waiting = next(pictures)
        for name, _, log_ns, data in bag.raw():
            while waiting is not None and waiting[1] <= log_ns:
                writer.write(waiting[0], waiting[1], waiting[2])
                waiting = next(pictures)
            writer.write(by_name[name], log_ns, data)
        while waiting is not None:
            writer.write(waiting[0], waiting[1], waiting[2])
            waiting = next(pictures)
