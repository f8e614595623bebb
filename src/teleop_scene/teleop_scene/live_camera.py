"""Live cameras: a process that draws a scene while its session runs, and publishes the pictures.

The process reads ``scene/poses`` and nothing waits for it. If drawing takes longer than a period, the periods without a
picture are counted, and the next picture shows the newest poses.
"""

import heapq
import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from time import perf_counter

import numpy as np

from teleop_core.bags.layouts import layout
from teleop_core.bags.messages import read_any
from teleop_core.bags.reports import report
from teleop_core.base import ParameterError
from teleop_core.coupling.network.pictures import PictureWay
from teleop_core.coupling.network.presets import NetworkParameters
from teleop_core.graph import TICK_NS
from teleop_core.graph.topics import DIAGNOSTICS, SCENE_POSES, Topic
from teleop_core.kernels import Array
from teleop_core.middleware.platform import Platform, Publisher
from teleop_core.middleware.ros import ROS
from teleop_core.nodes.discovery import choose_transport
from teleop_core.nodes.guest import Guest
from teleop_core.nodes.interrupt import Interrupt
from teleop_core.nodes.parent import Parent
from teleop_core.nodes.quality import profile
from teleop_core.nodes.streams import Subscription, message_type
from teleop_scene.camera import Camera
from teleop_scene.film import SECOND_NS, calibration, encoded, topics_of
from teleop_scene.parameters import View

NAME = "camera"
_NICE = 5
_WAIT = 0.02  # longest wait for poses [s], in which pictures on their way may become due
_BLOCK = 1024


@dataclass
class Counts:
    """What cameras did: pictures taken, lost on the way, and not made; times of drawing and encoding [ms]."""

    taken: int = 0
    lost: int = 0
    missed: int = 0
    times_ms: list[float] = field(default_factory=list)

    def values(self) -> dict[str, str]:
        """The counts as texts, for a report."""
        median = float(np.median(self.times_ms[-_BLOCK:])) if self.times_ms else 0.0
        found = {"taken": self.taken, "lost": self.lost, "missed": self.missed, "picture_ms": round(median, 3)}
        return {name: str(value) for name, value in found.items()}

    def __str__(self) -> str:
        return ", ".join(f"{name} {value}" for name, value in self.values().items())


class _Sender:
    """Publishes pictures when they arrive over the network."""

    def __init__(self, guest: Guest, views: Sequence[View], network: NetworkParameters | None, counts: Counts) -> None:
        self._guest, self._counts, self._begin_ns = guest, counts, guest.platform.monotonic_ns()
        self._ways = [PictureWay(network, k) for k in range(len(views))]
        self._ticks, self._sent = [0] * len(views), [0] * len(views)
        self._made = [[self._publisher(topic) for topic in topics_of(view)] for view in views]
        self._reports = self._publisher(DIAGNOSTICS)
        self._waiting = dict[tuple[int, int], tuple[bytes, bytes]]()  # by camera and number
        self._due: list[tuple[int, int, int]] = []

    def _publisher(self, topic: Topic) -> Publisher:
        return self._guest.ros.create_publisher(message_type(topic.ros_type), f"/{topic.name}", profile(topic))

    def _now(self) -> int:
        return (self._guest.platform.monotonic_ns() - self._begin_ns) // TICK_NS

    def _pass(self, k: int, size: int = 0) -> None:
        """Send a picture of camera ``k`` if it has a size, and let the time until now pass before it."""
        now = self._now()
        decided = self._ways[k].pass_time(now - self._ticks[k])
        self._ticks[k] = now
        for number, tick in decided + (self._ways[k].pass_time(0, size) if size else []):
            if tick >= 0:
                heapq.heappush(self._due, (tick, k, number))
            else:
                self._counts.lost += 1
                del self._waiting[k, number]

    def send(self, k: int, picture: bytes, calibrated: bytes) -> None:
        """Send a picture of camera ``k`` and its calibration on their way."""
        self._waiting[k, self._sent[k]] = (picture, calibrated)
        self._sent[k] += 1
        self._pass(k, len(picture))

    def deliver(self) -> None:
        """Publish the pictures that are due."""
        for k in range(len(self._ways)):
            self._pass(k)
        while self._due and self._due[0][0] <= self._now():
            _, k, number = heapq.heappop(self._due)
            for publisher, data in zip(self._made[k], self._waiting.pop((k, number)), strict=True):
                publisher.send(data)

    def tell(self) -> None:
        """Publish the counts."""
        self._reports.send(report(self._guest.platform.time_ns(), NAME, 0, "active", self._counts.values()))


class _Cameras:
    """Draws a picture of each camera at the first poses of each period."""

    def __init__(
        self, guest: Guest, cameras: Sequence[Camera], rate: float, network: NetworkParameters | None, counts: Counts
    ) -> None:
        self._cameras, self._rate, self._counts, self._platform = cameras, rate, counts, guest.platform
        self._form, self._slot, self._told = layout(SCENE_POSES, ()), -1, 0
        self._poses = Subscription(guest, SCENE_POSES, f"/{SCENE_POSES.name}")
        self._sender = _Sender(guest, [camera.view for camera in cameras], network, counts)
        self._calibrated = [calibration(camera) for camera in cameras]

    def turn(self) -> None:
        """Deliver what is due, then draw the newest poses if a period has begun."""
        self._sender.deliver()
        if (now := self._platform.monotonic_ns() // SECOND_NS) != self._told:
            self._told = now
            self._sender.tell()
        taken = self._poses.take()
        if taken is None:
            self._poses.wait(_WAIT)
            return
        found = self._form.decode_one(taken.data) or read_any(SCENE_POSES.kind, taken.data)
        if isinstance(found, tuple) and self._is_due(found[0]):
            self._draw(*found)

    def _is_due(self, stamp_ns: int) -> bool:
        slot, before = int(stamp_ns * self._rate / SECOND_NS + 1e-6), self._slot
        if slot <= before:
            return False
        self._counts.missed += (slot - before - 1) * len(self._cameras) if before >= 0 else 0
        self._slot = slot
        return True

    def _draw(self, stamp_ns: int, row: Array) -> None:
        for k, camera in enumerate(self._cameras):
            begin = perf_counter()
            picture = camera.take(row.reshape(-1, 7)[: camera.bodies], stamp_ns // TICK_NS)
            self._sender.send(k, encoded(picture, stamp_ns, camera.view.name), self._calibrated[k](stamp_ns))
            self._counts.taken += 1
            self._counts.times_ms.append(1e3 * (perf_counter() - begin))
            self._sender.deliver()


def run(
    file: Path,
    views: Sequence[View],
    *,
    rate: float = 30.0,
    network: NetworkParameters | None = None,
    platform: Platform = ROS,
    interrupt: Interrupt | None = None,
    say: Callable[[str], object] = print,
) -> Counts:
    """Draw and publish pictures of a running session until an ending signal, or until its process ends.

    Args:
        file: File of the scene.
        views: Cameras.
        rate: Pictures per second [Hz] of each camera; not above the rate of ``scene/poses``.
        network: Network on the way of the pictures; None: they arrive at once.
        platform: Platform of the session.
        interrupt: Object that ends the cameras, in addition to signals of this process.
        say: Called with each line for the user.

    Returns:
        Counts of the pictures.

    Raises:
        ParameterError: There are no cameras, or the rate is not allowed.
        TeleopError: As in :class:`~teleop_scene.camera.Camera`.
    """
    if not views or not 0.0 < rate <= 1000.0:
        raise ParameterError("--rate", rate, "above 0 Hz, up to 1000 Hz, for at least one camera")
    interrupt, counts = interrupt or Interrupt(), Counts()
    parent = Parent.of_environment()
    cameras = [Camera(file, view) for view in views]
    if platform is ROS:
        choose_transport()
        os.nice(_NICE)
    with interrupt.caught(), Guest(NAME, platform=platform) as guest:
        work = _Cameras(guest, cameras, rate, network, counts)
        say(f"{len(cameras)} cameras of {file.name} at {rate:g} Hz: {', '.join(view.topic for view in views)}")
        try:
            while True:
                interrupt.check()
                if parent is not None:
                    parent.tell("at work")
                    if parent.has_gone():  # its session was killed
                        break
                work.turn()
        except KeyboardInterrupt:
            say(str(counts))
        finally:
            for camera in cameras:
                camera.close()
    return counts
