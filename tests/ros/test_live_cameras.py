"""Cameras that a live session starts: their pictures are recorded, and their death changes nothing else."""

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np
import psutil
import pytest

pytest.importorskip("mujoco", reason="teleop_scene is not installed")
pytest.importorskip("simplejpeg", reason="teleop_scene is not installed")

from live_process import words
from teleop_core.bags.reader import Bag
from teleop_core.base import TeleopError
from teleop_core.graph import topics
from teleop_core.session.configuration import configure
from teleop_scene import models
from teleop_scene.camera import Camera
from teleop_scene.film import topics_of
from teleop_scene.parameters import View

if TYPE_CHECKING:
    from ros.conftest import Peer

SCENE, VIEW = models.OWN / "cubes.xml", View("front", 160, 120)


def _can_draw() -> bool:
    try:
        Camera(SCENE, VIEW).close()
    except TeleopError:
        return False
    return True


pytestmark = [
    pytest.mark.ros,
    pytest.mark.slow,
    pytest.mark.skipif(not _can_draw(), reason="no OpenGL without a screen (EGL) on this machine"),
]


def cameras() -> list[Any]:
    """Processes of cameras that this test has started."""
    return [p for p in psutil.Process().children(recursive=True) if "camera" in words(p)]


def test_a_session_whose_camera_is_killed_goes_on_and_says_so(
    peer: "Peer", session_until: Callable[..., tuple[Bag, str]]
) -> None:
    """SIGKILL after the first pictures; the slave goes on for two seconds, and the recording is whole."""
    texts = [f"robot={SCENE}", "scene.cameras=[front:160x120]", "scene.rate=60", "teleop.duration=600.0"]
    configuration = configure("coarse_box", settings=texts)
    image, _ = topics_of(VIEW)
    killed = list[float]()

    def is_alone_for_two_seconds() -> bool:
        slave = peer.status("slave_sim")
        ticks = slave.number("ticks") if slave else 0.0
        if not killed and peer.has_recorded({image.name: 5}):
            (camera,) = cameras()
            camera.kill()
            killed.append(ticks)
        return bool(killed) and ticks > killed[0] + 3000

    bag, text = session_until(configuration, is_alone_for_two_seconds)
    assert "camera ended with signal SIGKILL" in text
    assert "the session goes on without camera" in text
    assert "beside the session: 1 started, 1 ended early" in text
    assert bag.topics[image.name].count > 5
    assert cameras() == []
    measured = bag.read(topics.SLAVE_MEASURED_JS).stamp_ns
    (last,) = (log for _, _, log, _ in list(bag.raw([image.name]))[-1:])
    assert measured[-1] - last > 1_500_000_000
    assert (np.diff(measured) > 0).all()


def test_the_pictures_of_a_session_end_with_it_and_are_counted(
    peer: "Peer", session_until: Callable[..., tuple[Bag, str]]
) -> None:
    texts = [f"robot={SCENE}", "scene.cameras=[front:160x120]", "scene.rate=60", "teleop.duration=600.0"]
    texts += ["teleop.stages=[network]", "network.back.least_delay=0.2"]
    image, info = topics_of(VIEW)
    enough = {image.name: 10, info.name: 10}
    bag, text = session_until(configure("coarse_box", settings=texts), lambda: peer.has_recorded(enough))
    assert "beside the session: 1 started, 0 ended early" in text
    assert "lost 0" in text
    assert cameras() == []
    assert bag.topics[info.name].count > 10
    late = [log - int.from_bytes(data[4:8], "little") * 10**9 - int.from_bytes(data[8:12], "little")
            for _, _, log, data in bag.raw([image.name])]  # fmt: skip
    assert min(late) >= 200_000_000
