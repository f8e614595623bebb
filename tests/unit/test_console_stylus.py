"""Stylus of the console: who holds it, where it is wanted, and how it is let go."""

import asyncio
from collections.abc import Iterator
from typing import Any, Literal

import numpy as np
import pytest
import viser

import teleop_core as tc
from page_client import TOKEN
from present import present
from teleop_console.cameras import FIELD
from teleop_console.hooks import Server
from teleop_console.link import ArmView, ShownArm, View
from teleop_console.scene import Scene
from teleop_console.server import ConsoleServer
from teleop_console.stylus import LINGER, STEP_LENGTH, STEP_TURN, Stylus, stepped
from teleop_core.kernels.geometry import Array, rotations_from_quaternions

POSE = np.array([0.01, -0.06, -0.08, 0.98, -0.2, 0.0, 0.0])
POSE[3:] /= np.linalg.norm(POSE[3:])


@pytest.fixture(scope="module")
def server() -> Iterator[Server]:
    with ConsoleServer(port=0, token=TOKEN) as opened:
        yield opened.viser


class Hand:
    """A stylus, and what it says."""

    def __init__(self, server: Server) -> None:
        server.scene.reset()
        self.said: list[Any]
        self.server, self.drivers, self.said = server, {1, 2}, []
        scene = Scene(server, [ShownArm("", tc.load_robot("rcrt1"))])
        self.stylus = Stylus(
            server,
            scene,
            lambda client: client in self.drivers,
            lambda arm, pose: self.said.append(pose.tolist()),
            lambda arm: self.said.append("let go"),
        )
        self.gizmo: Any = server.scene.get_handle_by_name(f"{scene.masters['']}/grip")
        self.time = 0.0
        self.see(POSE)

    def see(self, pose: Array, dt: float = 1 / 30) -> None:
        """Draw the stylus where it is measured."""
        self.time += dt
        self.stylus.draw(View(time=self.time, arms={"": ArmView({"master/measured_cp": pose})}))

    def drag(self, phase: Literal["start", "update", "end"], client: int = 1, x: Any = None) -> None:
        """What viser does when a browser says that the gizmo was dragged."""
        if x is not None:
            self.gizmo.position = (x, *POSE[1:3])
        event = viser.TransformControlsEvent(None, client, self.gizmo, phase)
        for listen in self.gizmo._impl_aux.update_cb:
            asyncio.run(listen(event))

    def take(self) -> Any:
        said, self.said = self.said, []
        return said


@pytest.fixture
def hand(server: Server) -> Any:
    return Hand(server)


def test_the_gizmo_follows_the_stylus_while_nobody_holds_it(hand: Hand) -> None:
    there = POSE + np.array([0.02, 0, 0, 0, 0, 0, 0])
    hand.see(there)
    np.testing.assert_allclose(present(hand.gizmo).position, there[:3])
    assert hand.take() == []


def test_what_is_dragged_is_told_at_every_drawing_until_it_is_let_go(hand: Any) -> None:
    hand.drag("start")
    hand.drag("update", x=0.03)
    hand.take()
    for _ in range(5):
        hand.see(POSE)
    wanted = [0.03, *POSE[1:]]
    np.testing.assert_allclose(hand.take(), [wanted] * 5)
    np.testing.assert_allclose(present(hand.gizmo).position, wanted[:3])
    hand.drag("end")
    hand.see(POSE)
    assert hand.take() == ["let go"]
    np.testing.assert_allclose(present(hand.gizmo).position, POSE[:3])


def test_who_may_not_drive_moves_nothing(hand: Hand) -> None:
    for phase in ("start", "update", "end"):
        hand.drag(phase, client=3, x=0.05)
    hand.see(POSE)
    assert hand.take() == []
    np.testing.assert_allclose(present(hand.gizmo).position, POSE[:3])


def test_a_second_hand_does_not_take_the_stylus_out_of_the_first(hand: Hand) -> None:
    hand.drag("start", client=1)
    hand.take()
    for phase in ("start", "update", "end"):
        hand.drag(phase, client=2, x=0.09)
    assert hand.take() == []
    assert hand.stylus.held("")
    hand.drag("end", client=1)
    hand.drag("start", client=2)
    assert hand.stylus.held("")


def test_who_loses_control_while_dragging_lets_go_and_the_rest_is_not_heard(hand: Hand) -> None:
    hand.drag("start")
    hand.take()
    hand.drivers.clear()
    hand.see(POSE)
    assert hand.take() == ["let go"]
    hand.drag("update", x=0.04)
    hand.drivers.add(1)
    hand.drag("update", x=0.05)
    hand.drag("end")
    assert hand.take() == []
    hand.drag("start")
    assert hand.stylus.held(""), "a new gesture is heard again"


def test_letting_go_from_elsewhere_ends_the_gesture(hand: Hand) -> None:
    hand.drag("start")
    hand.take()
    hand.stylus.let_go("")
    hand.stylus.let_go("")
    hand.drag("update", x=0.04)
    assert hand.take() == ["let go"]


def test_a_small_step_is_held_for_a_while_and_further_ones_add_up(hand: Any) -> None:
    hand.stylus.nudge("", "x", 1)
    hand.stylus.nudge("", "x", 1)
    hand.take()
    hand.see(POSE, 0.5 * LINGER)
    (told,) = hand.take()
    np.testing.assert_allclose(told[:3], POSE[:3] + np.array([2 * STEP_LENGTH, 0, 0]))
    hand.see(POSE, 0.6 * LINGER)
    assert hand.take() == ["let go"]


@pytest.mark.parametrize("axis", ["rx", "ry", "rz"])
@pytest.mark.parametrize("sign", [1, -1])
def test_a_step_of_turn_is_about_an_axis_of_the_base_and_a_step_back_undoes_it(axis: str, sign: int) -> None:
    turned = stepped(POSE, axis, sign)
    before, after = rotations_from_quaternions(np.stack((POSE[3:], turned[3:])))
    assert np.trace(after @ before.T) == pytest.approx(1.0 + 2.0 * np.cos(STEP_TURN), abs=1e-12)
    unit = np.eye(3)["xyz".index(axis[1])]
    np.testing.assert_allclose((after @ before.T) @ unit, unit, atol=1e-12)
    turn = (after @ before.T) - (after @ before.T).T
    assert sign * turn[[2, 0, 1], [1, 2, 0]] @ unit > 0.0
    np.testing.assert_allclose(stepped(turned, axis, -sign), POSE, atol=1e-12)


def test_nothing_is_stepped_before_the_stylus_is_known_or_while_it_is_dragged(server: Server, hand: Hand) -> None:
    hand.drag("start")
    hand.take()
    hand.stylus.nudge("", "x", 1)
    assert hand.take() == []
    server.scene.reset()
    scene, said = Scene(server, [ShownArm("", tc.load_robot("rcrt1"))]), list[Any]()
    stylus = Stylus(server, scene, lambda _: True, lambda *_: said.append(1), said.append)
    stylus.nudge("", "x", 1)
    assert said == []


def test_unknown_axes_are_refused(hand: Hand) -> None:
    with pytest.raises(tc.ParameterError, match="axis"):
        hand.stylus.nudge("", "w", 1)


def test_a_pose_that_is_none_moves_nothing(hand: Hand) -> None:
    hand.see(np.full(7, np.nan))
    np.testing.assert_allclose(present(hand.gizmo).position, POSE[:3])


@pytest.mark.parametrize("robot", ["rcrt1", "puma560"])
def test_handles_grow_with_the_arm_so_that_a_large_view_shows_them_as_large(server: Server, robot: str) -> None:
    server.scene.reset()
    scene = Scene(server, [ShownArm("", tc.load_robot(robot))])
    Stylus(server, scene, lambda _: True, lambda *_: None, lambda _: None)
    gizmo: Any = server.scene.get_handle_by_name(f"{scene.masters['']}/grip")
    camera = scene.work()
    height = 900 * gizmo.scale / (2.0 * np.tan(0.5 * FIELD) * np.linalg.norm(camera.position - camera.look_at))
    assert 60 < height < 400  # pixels on a screen of 900
