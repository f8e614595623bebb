"""A camera of LeRobot reads pictures of a live session from their topic, each with its true age."""

from importlib.util import find_spec
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

simplejpeg = pytest.importorskip("simplejpeg", reason="teleop_scene is not installed")
pytest.importorskip("mujoco", reason="teleop_scene is not installed")

import teleop_core as tc  # noqa: E402
from teleop_core.nodes.quality import profile  # noqa: E402
from teleop_core.nodes.streams import message_type  # noqa: E402
from teleop_scene.film import encoded, topics_of  # noqa: E402
from teleop_scene.parameters import View  # noqa: E402

if TYPE_CHECKING:
    from teleop_core_lerobot import LiveCamera

# Imported by the tests that use it: it registers stages, and other files list all stages when they are collected.
pytestmark = pytest.mark.skipif(find_spec("teleop_core_lerobot") is None, reason="no lerobot_robot_teleop_core")
IMAGE, _ = topics_of(View("front"))


def grey(level: int) -> Any:
    return np.full((32, 48, 3), level, np.uint8)


@pytest.fixture
def send(peer: Any) -> Any:
    """Sends a grey picture that was captured so many seconds ago."""
    publisher = peer.ros.create_publisher(message_type(IMAGE.ros_type), f"/{IMAGE.name}", profile(IMAGE))

    def send(level: int, age: float) -> None:
        publisher.send(encoded(grey(level), peer.time_ns() - round(age * 1e9), "front"))
        peer.sleep(0.01)

    return send


@pytest.fixture
def camera(peer: Any) -> Any:
    from teleop_core_lerobot import LiveCamera

    with LiveCamera("front", platform=peer.platform) as made:
        peer.sleep(0.2)
        yield made


def test_picture_comes_with_the_time_since_its_capture(camera: "LiveCamera", send: Any) -> None:
    assert camera.age == float("inf")
    send(200, 0.3)
    assert camera.age == pytest.approx(0.31, abs=0.005)
    assert np.abs(camera.newest().astype(int) - 200).max() <= 2
    with pytest.raises(TimeoutError, match=r"0\.3\d* s old, at most 0.1 s"):
        camera.newest(0.1)


def test_picture_that_was_overtaken_is_left_out(camera: "LiveCamera", send: Any) -> None:
    send(100, 0.02)
    send(200, 0.5)
    assert np.abs(camera.newest().astype(int) - 100).max() <= 2


def test_each_picture_is_new_once_and_the_next_is_waited_for(camera: "LiveCamera", send: Any) -> None:
    send(100, 0.0)
    assert camera.next(0.5).shape == (32, 48, 3)
    with pytest.raises(TimeoutError, match=r"no new picture came on camera/front/image_raw/compressed in 0.2 s"):
        camera.next(0.2)
    send(150, 0.0)
    assert np.abs(camera.next(0.2).astype(int) - 150).max() <= 2


def test_camera_that_does_not_listen_says_so(peer: Any) -> None:
    from teleop_core_lerobot import LiveCamera

    camera = LiveCamera("/any/topic", platform=peer.platform)
    assert camera.topic == "any/topic"
    with pytest.raises(tc.SessionError, match="begin first"):
        camera.newest()
    camera.begin()
    with pytest.raises(tc.SessionError, match="read already"):
        camera.begin()
    with pytest.raises(TimeoutError, match="no picture has come"):
        camera.newest()
    camera.end()
    assert not camera.is_running
