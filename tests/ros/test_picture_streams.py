"""Pictures that the console's page shows: the newest of each camera, with the time since its capture."""

import time
from typing import Any

import pytest

from teleop_core.graph.topics import Kind, Stamp, Topic
from teleop_core.nodes.guest import Guest
from teleop_core.nodes.quality import profile
from teleop_core.nodes.streams import message_type

pytest.importorskip("mujoco", reason="teleop_scene is not installed")
simplejpeg = pytest.importorskip("simplejpeg", reason="teleop_scene is not installed")

import numpy as np  # noqa: E402

from live_process import wait_until  # noqa: E402
from teleop_console.picture_streams import TYPE, Picture, PictureStreams  # noqa: E402
from teleop_scene.film import encoded  # noqa: E402

pytestmark = pytest.mark.ros
TOPIC = Topic("camera/front/image_raw/compressed", Kind.REPORT, Stamp("of the sender"), message=TYPE)


def test_the_newest_picture_of_a_camera_comes_with_the_time_since_its_capture(peer: Any) -> None:
    with Guest("camera", int(peer.domain)) as camera, Guest("page", int(peer.domain)) as page:
        publisher = camera.ros.create_publisher(message_type(TYPE), f"/{TOPIC.name}", profile(TOPIC))
        streams, sent = PictureStreams(page), 0

        def shown() -> Picture | None:
            nonlocal sent
            sent += 1
            stamp_ns = time.time_ns() - 300_000_000
            publisher.send(encoded(np.full((32, 48, 3), 150, np.uint8), stamp_ns, "front"))
            return streams.take().get("front")

        picture = wait_until(shown, "a picture")
        assert picture.age >= 0.3
        assert abs(int(simplejpeg.decode_jpeg(picture.data)[0, 0, 0]) - 150) < 3
        again = streams.take()["front"]
        assert again.age == pytest.approx(1e-9 * (time.time_ns() - again.stamp_ns), abs=0.1)
