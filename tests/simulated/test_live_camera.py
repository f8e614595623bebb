"""Cameras beside a live session: pictures of the poses of their stamps, on time, late or lost as the network says."""

from typing import Any

import numpy as np
import pytest

pytest.importorskip("mujoco", reason="teleop_scene is not installed")
simplejpeg = pytest.importorskip("simplejpeg", reason="teleop_scene is not installed")
from rosbags.typesys import Stores, get_typestore  # noqa: E402

from teleop_core.base import TeleopError, build  # noqa: E402
from teleop_core.coupling.network.presets import NetworkParameters  # noqa: E402
from teleop_core.graph import TICK_NS, topics  # noqa: E402
from teleop_core.nodes.interrupt import Interrupt  # noqa: E402
from teleop_core.nodes.streams import Subscription  # noqa: E402
from teleop_scene import models  # noqa: E402
from teleop_scene.camera import Camera, read_marker  # noqa: E402
from teleop_scene.film import topics_of  # noqa: E402
from teleop_scene.live_camera import run  # noqa: E402
from teleop_scene.parameters import View  # noqa: E402

SCENE = models.OWN / "cubes.xml"
VIEW = View("front", 160, 120, is_marked=True)
POSES = np.tile([0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0], topics.POSES)


def _can_draw() -> bool:
    try:
        Camera(SCENE, VIEW).close()
    except TeleopError:
        return False
    return True


pytestmark = pytest.mark.skipif(not _can_draw(), reason="no OpenGL without a screen (EGL) on this machine")


@pytest.mark.parametrize(("back", "kept"), [({}, 1), ({"least_delay": 0.05}, 1), ({"loss": 1.0}, 0)])
def test_pictures_of_a_live_session_carry_the_stamp_of_their_poses(
    back: dict[str, float], kept: int, peer: Any
) -> None:
    types, interrupt, counts = get_typestore(Stores.ROS2_JAZZY), Interrupt(), list[Any]()
    image, _ = topics_of(VIEW)
    network = build(NetworkParameters, {f"back.{name}": value for name, value in back.items()})

    def work(platform: Any) -> int:
        counts.append(
            run(SCENE, [VIEW], rate=20.0, network=network, platform=platform, interrupt=interrupt, say=lambda _: None)
        )
        return 0

    taker = Subscription(peer, image, f"/{image.name}", 100)
    process = peer.foreign("camera", work)
    peer.publisher(topics.SCENE_POSES)
    begin, found = peer.time_ns() // TICK_NS * TICK_NS, list[tuple[int, Any]]()
    for k in range(1100):
        if k % 10 == 0:
            peer.send(topics.SCENE_POSES, begin + k * TICK_NS, POSES)
        peer.sleep(1e-3)
        while (taken := taker.take()) is not None:
            found.append((peer.time_ns(), types.deserialize_cdr(taken.data, image.ros_type)))
    interrupt.ask()
    peer.wait(lambda: counts, "the end of the camera")
    assert process is not None
    assert 10 <= counts[0].taken <= 23  # poses before the camera has found their sender are not drawn
    assert counts[0].missed == 0
    assert len(found) >= 0.8 * kept * counts[0].taken
    assert counts[0].lost == (0 if kept else counts[0].taken)
    delay_ns = back.get("least_delay", 0.0) * 1e9
    for came_ns, message in found:
        stamp = message.header.stamp.sec * 10**9 + message.header.stamp.nanosec
        assert read_marker(simplejpeg.decode_jpeg(message.data.tobytes())) * TICK_NS == stamp
        assert came_ns - stamp >= delay_ns
        assert came_ns - stamp < delay_ns + 60_000_000
