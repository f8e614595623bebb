"""Film: adds pictures to the recording of a session with a scene, from the poses that it recorded.

The pictures are those that a camera beside the session would have taken, to the bit: they depend on the poses alone.
The session itself never waits for a picture. The network of the session delays, loses and reorders the pictures.
"""

import struct
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import simplejpeg
from numpy.typing import NDArray

from teleop_core.bags.kept_files import recorded_files
from teleop_core.bags.ros_types import serialise, typestore
from teleop_core.bags.series import Series
from teleop_core.bags.writer import BagWriter
from teleop_core.base import ParameterError, RecordingError
from teleop_core.coupling.network.link import LONGEST
from teleop_core.coupling.network.network import NETWORK
from teleop_core.coupling.network.pictures import PictureWay
from teleop_core.coupling.network.presets import NetworkParameters
from teleop_core.graph import TICK_NS, topics
from teleop_core.graph.layers import parse_setting
from teleop_core.graph.topics import Kind, Quality, Topic
from teleop_core.robots.parts import file_of
from teleop_core.session.configuration import Configuration
from teleop_core.session.recording import Recording, open_recording
from teleop_core.session.runner import recorded_configuration
from teleop_scene.camera import Camera, Pixels
from teleop_scene.parameters import SceneParameters, View

SECOND_NS = 1_000_000_000
QUALITY = 90
"""Quality of JPEG, of 100."""
_Message = tuple[Topic, int, bytes]
IMAGE, INFO = "sensor_msgs/msg/CompressedImage", "sensor_msgs/msg/CameraInfo"


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


def network_of(configuration: Configuration) -> NetworkParameters | None:
    """Network of the first arm, over which the pictures of a session go; None without one."""
    found = configuration.groups.get(NETWORK.name)
    return found if isinstance(found, NetworkParameters) else None


def film(
    recording: Recording | Path | str,
    out: Path | str,
    cameras: Sequence[str | View] = (),
    *,
    rate: float | None = None,
    texts: Sequence[str] = (),
    is_marked: bool = False,
) -> FilmReport:
    """Write a copy of a recording that has the pictures of cameras too.

    Args:
        recording: Recording of a session with a scene.
        out: Directory of the new recording.
        cameras: Cameras, as :meth:`View.parse` reads them; empty: ``scene.cameras`` of the session.
        rate: Pictures per second [Hz] of each camera, not above the rate of ``scene/poses``; None:
            ``scene.camera_rate`` of the session.
        texts: Parameters ``key=value`` that replace those of the session, such as ``network.back.loss=0.1``.
        is_marked: Whether pictures carry the number of their tick, for tests.

    Raises:
        RecordingError: The recording has no scene, or cannot be read, or the new one exists.
        ParameterError: A value is not allowed.
        UnknownNameError: The scene has no such camera.
        TeleopError: This machine cannot draw.
    """
    source = recording if isinstance(recording, Recording) else open_recording(recording)
    file, poses = scene_file(source), source.bag.read(topics.SCENE_POSES)
    layer, scenario = recorded_configuration(source.bag)
    configuration = Configuration.from_layers([layer, *map(parse_setting, texts)], scenario)
    scene = configuration.of(SceneParameters)
    rate = scene.camera_rate if rate is None else rate
    if not 0.0 < rate <= 1000.0:
        raise ParameterError("--rate", rate, "above 0 Hz, up to 1000 Hz")
    if not (given := tuple(cameras) or scene.cameras):
        raise ParameterError("--cameras", (), "at least one camera of the scene")
    views = [View.parse(one, is_marked=is_marked) if isinstance(one, str) else one for one in given]
    at = captures(poses.stamp_ns, rate)
    slots = np.floor(poses.stamp_ns[at] * (rate / SECOND_NS) + 1e-6)
    missed = int(slots[-1] - slots[0]) + 1 - len(at)
    made, network = list[_Message](), network_of(configuration)
    for number, view in enumerate(views):
        made += _pictures(Camera(file, view), poses, at, PictureWay(network, number))
    _copy(source, Path(out), sorted(made, key=lambda m: m[1]), [t for view in views for t in topics_of(view)])
    taken = len(at) * len(views)
    return FilmReport(Path(out), taken, taken - len(made) // 2, missed * len(views))


def _pictures(camera: Camera, poses: Series, at: NDArray[np.int64], way: PictureWay) -> list[_Message]:
    """Pictures of a camera and their calibrations, as they arrive over the network."""
    (image, info), calibrated, packed, found = (
        topics_of(camera.view),
        calibration(camera),
        list[bytes](),
        list[_Message](),
    )
    ticks = (poses.log_ns[at] - poses.log_ns[at[0]]) // TICK_NS
    pauses = [*np.diff(ticks).tolist(), LONGEST]
    for index, pause in zip(at, pauses, strict=True):
        stamp = int(poses.stamp_ns[index])
        picture = camera.take(poses.values[index].reshape(-1, 7)[: camera.bodies], stamp // TICK_NS)
        packed.append(encoded(picture, stamp, camera.view.name))
        for k, tick in way.pass_time(pause, len(packed[-1])):
            if tick >= 0:
                sent_ns, stamp_ns = int(poses.log_ns[at[k]]), int(poses.stamp_ns[at[k]])
                came_ns = sent_ns + (tick - int(ticks[k])) * TICK_NS
                found += [(image, came_ns, packed[k]), (info, came_ns, calibrated(stamp_ns))]
    camera.close()
    return found


def _copy(source: Recording, out: Path, made: list[_Message], further: list[Topic]) -> None:
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
