"""World: the push of a contact, and its energy."""

import numpy as np
import pytest
from numpy.typing import NDArray

import palpation
import teleop_core as tc
from free_tool import after_a_tick
from present import present
from teleop_core.graph.topics import SLAVE_TRUE_CF
from teleop_core.robots import load_robot
from teleop_core.slave.world.contents import MATERIALS

BLOCK = [0.241, -0.236, -0.087]
"""Middle of the block that the scenario ``palpation`` presses, whose top is at -0.072."""


def pressed(*texts: str, ticks: int = 20_000, seconds: float = 12.0) -> NDArray[np.void]:
    """Signals of the scenario ``palpation`` from ``seconds`` on."""
    return palpation.pressed(*texts, ticks=ticks)[round(1e3 * seconds) :]


def test_the_push_is_stiffness_times_depth_where_the_tip_is_truly() -> None:
    rows = pressed("reflection.architecture=unilateral", "world.damping=0", "world.material=own")
    depth = BLOCK[2] + 0.015 - rows["slave_true_cp"][:, 2]
    push = rows["slave_measured_cf"]
    assert depth.max() > 5e-3
    np.testing.assert_allclose(push[:, 2], np.maximum(1000.0 * depth, 0.0), atol=1e-9)
    assert np.all(np.hypot(push[:, 0], push[:, 1]) <= 0.3 * push[:, 2] + 1e-9)
    assert not push[:, 3:].any()


@pytest.mark.parametrize("name", ["rcrt1", "puma560", "planar_3r", "rps3", "stewart"])
def test_every_arm_is_accelerated_by_the_transposed_jacobian_of_the_push(name: str) -> None:
    robot = load_robot(name)
    J = robot.jacobian(robot.start)[:3]
    way = J @ J.T @ np.array([0.3, 0.5, -0.8])  # one that the arm can go
    way /= np.linalg.norm(way)
    pressed = robot.start + 1e-3 * np.linalg.pinv(J) @ way
    ball = robot.fk(robot.start)[:3, 3] + 0.0052 * way  # its surface is 0.2 mm ahead of the start
    texts = [
        "world=sphere",
        f"world.place={ball.tolist()}",
        "world.sphere.radius=0.005",
        "world.material=own",
        "world.stiffness=500.0",
    ]
    free, _ = after_a_tick(robot, [], pressed)
    pushed, felt = after_a_tick(robot, texts, pressed)
    force = felt[:3]
    assert force @ way == pytest.approx(-0.4, rel=0.05)
    found = [np.zeros(robot.n), np.zeros(robot.n)]
    effort = robot.jacobian(pressed)[:3].T @ force
    for net, ddq in zip((np.zeros(robot.n), effort), found, strict=True):
        model = present(robot.dynamics)
        model.acceleration(pressed.copy(), np.zeros(robot.n), net, model.parameters.copy(), ddq)
    wanted = 1e-3 * (found[1] - found[0])
    np.testing.assert_allclose(pushed - free, wanted, atol=0.07 * np.abs(wanted).max())


def test_the_plant_that_is_the_machine_feels_the_push_behind_its_gears() -> None:
    robot = load_robot("rcrt1")
    center = (robot.fk(robot.start)[:3, 3] - [0.0, 0.0, 0.0155]).tolist()
    down = robot.start + 1e-3 * np.linalg.pinv(robot.jacobian(robot.start)[:3])[:, 2] * -2.0
    texts = ["world=box", f"world.place={center}"]
    (free, _), (pushed, force) = (after_a_tick(robot, more, down, "hardware") for more in ([], texts))
    assert force[2] > 0.05
    assert np.abs(pushed - free).max() > 1e-9


def test_a_surface_that_is_left_fast_does_not_pull() -> None:
    sticky = ("world.material=own", "world.damping=100.0", "reflection.architecture=unilateral")
    rows = pressed(*sticky)
    push, tip = rows["slave_measured_cf"], rows["slave_true_cp"]
    is_leaving = (tip[1:, 2] - tip[:-1, 2] > 1.2e-5) & (tip[1:, 2] < BLOCK[2] + 0.0145)
    assert is_leaving.sum() > 20
    assert not push[1:][is_leaving].any()
    assert push[:, 2].min() == 0.0


@pytest.mark.parametrize("material", ["tissue", "rubber", "steel"])
def test_a_contact_gives_back_no_more_than_it_took(material: str) -> None:
    """Of the work of the push on the tip, from a moment without touch on."""
    top = -0.0801 + 4.0 / MATERIALS[material].stiffness  # pressed with some 4 N
    place = f"world.place={[*BLOCK[:2], top - 0.015]}"
    rows = pressed(f"world.material={material}", place, "reflection.architecture=unilateral", seconds=10.0)
    force, tip = rows["slave_measured_cf"][:, :3], rows["slave_true_cp"][:, :3]
    assert not force[0].any()
    assert 2.0 < force[:, 2].max() < 8.0
    ways = np.diff(tip, axis=0)
    power = np.einsum("ij,ij->i", 0.5 * (force[1:] + force[:-1]), ways)
    given = np.cumsum(power)  # of the block to the tip
    assert given.min() < -1e-5
    assert given.max() <= 1e-3 * np.abs(power).sum()


def test_dry_friction_holds_a_tip_that_is_dragged_less_than_it_carries() -> None:
    texts = (
        "world.material=own",
        "world.stiffness=1000.0",
        "reflection.architecture=unilateral",
        "operator.kind=circle",
        "operator.size=[0.004,0.0,0.004]",
        "operator.center=[0.0,-0.04,0.04]",
    )
    slips = {}
    for friction in (0.0, 2.0):
        rows = pressed(f"world.friction_coefficient={friction}", *texts)
        force = rows["slave_measured_cf"]
        across = np.hypot(force[:, 0], force[:, 1])
        slips[friction] = np.median(across / force[:, 2])
    assert slips[0.0] == 0.0
    assert 0.05 < slips[2.0] < 2.0


def test_the_hand_feels_the_push_along_its_own_axes_and_no_more_than_asked() -> None:
    rows = pressed(
        "world.stiffness=2000.0",
        "world.material=own",
        "reflection.max_force=1.0",
        "position_force.force_gain=0.5",
        "reach_force.is_on=false",
    )
    push, force = rows["slave_measured_cf"][:-1], rows["master_servo_cf"][1:]
    asked = 0.5 * np.column_stack((-push[:, 1], push[:, 2], -push[:, 0]))
    length = np.linalg.norm(asked, axis=1, keepdims=True)
    assert length.max() > 1.0
    np.testing.assert_allclose(force[:, :3], asked / np.maximum(length, 1.0), atol=1e-12)


def test_with_a_tank_no_touch_gives_back_more_than_it_took_and_pressing_feels_the_same() -> None:
    """By the account that the device keeps of its true motion."""
    scores = {}
    for passivity in ("none", "tank"):
        texts = {"reflection.passivity": passivity, "haptic_master.device.gimbal_noise": 0.0}
        scores[passivity] = tc.run("palpation", duration=16.0, settings=texts).score()
    returned = {name: score.value("contact.returned_max") for name, score in scores.items()}
    assert present(returned["none"]) > 1.5
    assert present(returned["tank"]) <= 1.02
    largest = {name: score.value("force_n.max") for name, score in scores.items()}
    assert largest["tank"] == pytest.approx(largest["none"], rel=0.05)


def test_an_object_that_is_seen_from_another_base_is_the_same_object() -> None:
    base, place = [0.03, -0.02, 0.01], [0.03 + BLOCK[0], -0.02 + BLOCK[1], 0.01 + BLOCK[2]]
    own = pressed(ticks=13_000)
    moved = pressed(f"world.place={place}", f"world.base={base}", ticks=13_000)
    assert own["slave_true_cf"][:, 2].max() > 0.3
    np.testing.assert_allclose(moved["slave_true_cf"], own["slave_true_cf"], atol=1e-6)


def test_two_arms_touch_one_object_each_from_its_own_base() -> None:
    rows = pressed("teleop.arms=[right, left]", f"left/world.base={[0.0, 0.0, 0.004]}", ticks=13_000)
    low, high = (rows[SLAVE_TRUE_CF.of_arm(arm).field][:, 2].max() for arm in ("", "left"))
    assert 0.0 < high < low  # the base of the left one is 4 mm higher, so its tip is less deep
