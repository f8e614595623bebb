"""Bodies of a scene on the page: they are drawn where the session says that they are."""

from importlib.util import find_spec
from typing import Any

import numpy as np
import pytest

import teleop_core as tc
from page_client import TOKEN
from teleop_console.recorded import RecordedLink
from teleop_console.scene import Scene
from teleop_console.server import ConsoleServer
from teleop_console.surrounding_nodes import PATH
from teleop_core.kernels.geometry import Array, rotations_from_quaternions
from teleop_scene.arm import SceneRobot
from teleop_scene.models import model_of, moving_bodies

ALOHA = "gym_aloha/assets/bimanual_viperx_transfer_cube.xml"
STILL = 1e-4  # what is less is not sent


@pytest.fixture(scope="module")
def server() -> Any:
    with ConsoleServer(port=0, token=TOKEN) as opened:
        yield opened.viser


def on_page(server: Any, path: str) -> Array:
    """Place (3,) of a node in the axes of the page, one level below the world of the scene."""
    root, node = (server.scene.get_handle_by_name(name) for name in (PATH, path))
    return np.asarray(root.position + rotations_from_quaternions(root.wxyz[None])[0] @ node.position)


def drawn(server: Any, recording: tc.Recording, time: float) -> Scene:
    server.scene.reset()
    link = RecordedLink(recording.bag)
    scene = Scene(server, link.arms)
    link.seek(time)
    scene.draw(link.view())
    return scene


def test_the_bodies_of_a_scene_are_drawn_where_they_were(server: Any) -> None:
    recording = tc.run("coarse_box", duration=6.0, robot="cubes.xml")
    scene = drawn(server, recording, 6.0)
    robot = tc.load_robot("cubes.xml")
    assert isinstance(robot, SceneRobot)
    model = model_of(robot.file)
    hand = moving_bodies(model).index(model.body("hand").id)
    joints = recording.bag.read("slave/measured_js").values[-1, : robot.n]
    T = robot.fk(joints)
    np.testing.assert_allclose(on_page(server, f"{PATH}/body{hand}"), T[:3, 3] - 0.15 * T[:3, 0], atol=1e-3)
    red = moving_bodies(model).index(model.body("red").id)
    place = on_page(server, f"{PATH}/body{red}") + robot.world_base[:3, 3]
    np.testing.assert_allclose(place, [0.33, -0.06, 0.015], atol=1e-3)
    assert not any(mesh.visible for mesh in scene.arms[""].drawn._meshes)


@pytest.mark.skipif(find_spec("gym_aloha") is None, reason="no gym_aloha")
def test_two_arms_stand_in_one_scene_where_their_tips_are_measured(server: Any) -> None:
    tips = {arm: [f"tip=vx300s_{arm}/gripper_link"] for arm in ("left", "right")}
    settings = {"robot": ALOHA} | {f"{arm}/geometry": tip for arm, tip in tips.items()}
    recording = tc.run("coarse_box", duration=0.5, arms=["left", "right"], settings=settings)
    scene = drawn(server, recording, 0.5)
    robot = tc.load_robot(ALOHA, tip="vx300s_right/gripper_link")
    model = model_of(robot.file)  # type: ignore[attr-defined]
    gripper = moving_bodies(model).index(model.body("vx300s_right/gripper_link").id)
    nodes = scene.arms["right"]
    tip = (
        nodes._root.position
        + rotations_from_quaternions(nodes._root.wxyz[None])[0] @ nodes.drawn.frames["tip"].position
    )
    np.testing.assert_allclose(on_page(server, f"{PATH}/body{gripper}"), tip, atol=2e-3)
