"""Points along a tool: forces and torques of a line of contacts, on the arm and by its energy."""

import math
from typing import Any

import numpy as np
import pytest
from numpy.typing import ArrayLike

from free_tool import after_a_tick, drag, fly
from present import present
from teleop_core.base.errors import ParameterError
from teleop_core.kernels.geometry import Array
from teleop_core.robots import load_robot
from teleop_core.session.configuration import configure
from teleop_core.session.virtual import VirtualTime
from teleop_core.shapes import box, hole

STILL = np.zeros((1, 6))


def pushed(begin: ArrayLike, axis: ArrayLike, name: str = "plane", parameters: Any = None, **numbers: Any) -> Array:
    """Wrench (6,) [N, N·m] on a tool that stands still, of points without friction."""
    return drag(begin, axis, STILL, name, parameters, **numbers)[0][0]


@pytest.mark.parametrize("radius", [0.0, 0.003])
@pytest.mark.parametrize("tilt", [0.0, 0.05, 1.2, -0.3])
def test_force_and_torque_are_the_sums_over_all_points(tilt: float, radius: float) -> None:
    """Of springs that push along z, each where its ball is deepest."""
    axis = np.array([math.cos(tilt), 0.0, math.sin(tilt)])
    tip = np.array([0.01, 0.02, -0.002])
    places = tip - np.linspace(0.0, 0.03, 7)[:, None] * axis
    depths = np.maximum(radius - places[:, 2], 0.0)
    forces = 1000.0 * depths[:, None] * (0.0, 0.0, 1.0)
    touched = places - (0.0, 0.0, radius)
    expected = np.concatenate((forces.sum(0), np.cross(touched - tip, forces).sum(0)))
    found = pushed(tip, axis, points=7, tool_length=0.03, tool_radius=radius)
    np.testing.assert_allclose(found, expected, atol=1e-12)


def test_a_line_of_points_as_long_as_nothing_is_one_point_as_stiff_as_all() -> None:
    one, five = (
        drag((0.0, 0.0, 1e-3), (0.6, 0.0, -0.8), np.tile((2e-5, 0, -2e-5, 0, 0, 0), (200, 1)),
             points=count, tool_length=0.0, world_friction=0.3, world_stiffness=1000.0 / count)[0]
        for count in (1, 5)
    )  # fmt: skip
    assert one[-1, 2] > 1.0
    np.testing.assert_allclose(five, one, atol=1e-12)


def test_a_ball_touches_as_a_point_does_a_radius_nearer() -> None:
    ball = pushed((0.0, 0.0, 0.004), (0.0, 0.0, -1.0), points=1, tool_radius=0.005)
    assert ball[2] == pytest.approx(1.0)
    steps = np.tile((1e-5, 0.0, 0.0, 0.0, 0.0, 0.0), (100, 1))
    dragged, *_ = drag((0, 0, 0.004), (0, 0, -1), steps, points=1, tool_radius=0.005, world_friction=0.2)
    assert dragged[-1, 0] == pytest.approx(-0.2)
    assert dragged[-1, 4] == pytest.approx(0.005 * 0.2)  # friction acts below the ball's middle


def test_a_ball_that_rolls_is_not_held_and_one_that_spins_in_place_is() -> None:
    radius, rate = 0.005, 0.01
    roll = np.tile((radius * rate, 0.0, 0.0, 0.0, rate, 0.0), (50, 1))
    spin = roll * (0, 0, 0, 0, 1, 0)
    numbers: dict[str, Any] = {"points": 1, "tool_radius": radius, "world_friction": 0.5}
    rolled, spun = (drag((0.0, 0.0, 0.004), (0.0, 1.0, 0.0), steps, **numbers)[0] for steps in (roll, spin))
    assert np.abs(rolled[:, 0]).max() < 1e-9
    assert spun[-1, 0] == pytest.approx(0.5)


def test_each_point_has_its_own_bristle() -> None:
    """A tool that spins about its middle, flat on a plane: friction turns, and does not push."""
    axis, half = np.array([1.0, 0.0, 0.0]), 0.02  # long beside a bristle's bend of 0.3 mm
    rate, steps = 2e-3, np.zeros((200, 6))
    angles = rate * np.arange(201)
    steps[:, :3] = half * np.diff(np.column_stack((np.cos(angles), np.sin(angles), 0.0 * angles)), axis=0)
    steps[:, 5] = rate
    felt, *_ = drag((half, 0.0, -1e-3), axis, steps, points=4, tool_length=2.0 * half, world_friction=0.3)
    tip = half * np.array([math.cos(angles[-2]), math.sin(angles[-2]), 0.0])
    about_middle = felt[-1, 3:] + np.cross(tip, felt[-1, :3])
    assert np.abs(felt[-1, :2]).max() < 0.01
    distances = np.abs(np.linspace(-half, half, 4))
    assert about_middle[2] == pytest.approx(-0.3 * 1.0 * distances.sum(), rel=1e-3)


@pytest.mark.parametrize("name", ["rcrt1", "puma560"])
def test_an_arm_feels_force_and_torque_through_its_transposed_jacobian(name: str) -> None:
    robot = load_robot(name)
    T, J = robot.fk(robot.start), robot.jacobian(robot.start)
    behind = T[:3, 3] - 0.04 * T[:3, 2]
    side = np.cross(T[:3, 2], (0.3, 0.8, 0.5))
    side /= np.linalg.norm(side)
    # A ball beside the last point: the push has a lever of 40 mm about the tip.
    ball = behind + 0.0146 * side
    texts = ["world=sphere", f"world.place={ball.tolist()}", "world.sphere.radius=0.01",
             "world.tool_points=3", "world.tool_length=0.04", "world.tool_radius=0.005",
             "world.material=own", "world.stiffness=2000.0"]  # fmt: skip
    (free, _), (moved, felt) = (after_a_tick(robot, more) for more in ([], texts))
    np.testing.assert_allclose(felt[:3], -0.8 * side, atol=1e-6)
    arm = -0.04 * T[:3, 2] + 0.005 * side
    np.testing.assert_allclose(felt[3:], np.cross(arm, -0.8 * side), atol=1e-6)
    found = [np.zeros(robot.n), np.zeros(robot.n)]
    for net, ddq in zip((np.zeros(robot.n), J.T @ felt), found, strict=True):
        model = present(robot.dynamics)
        model.acceleration(robot.start.copy(), np.zeros(robot.n), net, model.parameters.copy(), ddq)
    wanted = 1e-3 * (found[1] - found[0])
    np.testing.assert_allclose(moved - free, wanted, atol=0.07 * np.abs(wanted).max())


def wandering(seed: int, ticks: int, size: float = 4e-3, turn: float = 0.1, slower: float = 1.0) -> tuple[Array, Array]:
    """First place (3,) and steps (ticks, 6) of a tool that wanders and turns."""
    rng, times = np.random.default_rng(seed), 1e-3 / slower * np.arange(ticks + 1)
    rates, phases = rng.uniform(0.3, 2.0, (4, 6)), rng.uniform(0.0, 2.0 * np.pi, (4, 6))
    sizes = rng.normal(size=(4, 6)) * ([0.5 * size] * 3 + [0.5 * turn] * 3)
    way = (sizes * np.sin(2.0 * np.pi * times[:, None, None] * rates + phases)).sum(axis=1)
    return way[0, :3], np.diff(way, axis=0)


SOLIDS = {
    "plane": ((0.0, 0.0, 0.0), (0.6, 0.0, -0.8), None, 0.0),
    "box": ((0.0, 0.0, 0.017), (1.0, 0.0, 0.0), box.BoxParameters(size=(0.06, 0.06, 0.03)), 0.003),
    "sphere": ((0.0, 0.0, 0.015), (0.0, 0.6, -0.8), None, 0.003),
    "capsule": ((0.0, 0.0, 0.012), (1.0, 0.0, 0.0), None, 0.003),
    "hole": ((0.0, 0.0, -0.015), (0.0, 0.0, -1.0), hole.HoleParameters(), 0.005),
}
"""Where a tool wanders, its axis, the object's shape, and the tool's radius."""


def gained(name: str, seed: int, ticks: int, points: int, slower: float = 1.0) -> tuple[float, float]:
    """Energy that an object gave a wandering tool beyond what it took, and work turned over [J]."""
    middle, axis, parameters, radius = SOLIDS[name]
    begin, steps = wandering(seed, ticks, slower=slower)
    _, lost, turned = drag(
        begin + middle, axis, steps, name, parameters, points, tool_radius=radius,
        world_friction=(0.0, 0.4)[seed % 2], world_damping=(0.0, 1.0)[seed // 2 % 2],
    )  # fmt: skip
    return -np.minimum(np.diff(lost), 0.0).sum(), turned[-1]


@pytest.mark.parametrize("points", [1, 5])
@pytest.mark.parametrize("name", SOLIDS)
def test_no_contact_makes_energy_in_hundreds_of_random_motions(name: str, points: int) -> None:
    """But what a surface and a Jacobian that stand still for a tick add to the work in it.

    A wall that turns much in a tick, as near the axis of a hole, adds the most.
    """
    most = {"hole": 5e-2}.get(name, 1e-3)
    sums = np.array([gained(name, seed, 250, points) for seed in range(250)])
    assert (sums[:, 1] > 1e-4).sum() > 100
    assert (sums[:, 0] <= most * sums[:, 1] + 1e-9).all()
    assert sums[:, 0].sum() <= 2e-3 * sums[:, 1].sum()


@pytest.mark.parametrize("name", SOLIDS)
def test_what_ticks_add_falls_with_the_way_in_a_tick(name: str) -> None:
    fast, slow = (
        np.sum([gained(name, seed, round(500 * slower), 5, slower) for seed in range(0, 40, 4)], axis=0)
        for slower in (1.0, 4.0)
    )
    assert slow[1] == pytest.approx(fast[1], rel=0.01)
    assert slow[0] < 0.3 * fast[0]


@pytest.mark.parametrize("damping", [0.0, 1.0])
@pytest.mark.parametrize("seed", range(4))
def test_a_rod_that_tumbles_onto_a_plane_never_has_more_energy_than_at_first(seed: int, damping: float) -> None:
    rng = np.random.default_rng(seed)
    axis = rng.normal(size=3)
    flight = fly(
        (0.0, 0.0, 0.06), rng.normal(size=6) * ([0.3] * 3 + [3.0] * 3), 1500,
        axis / np.linalg.norm(axis), points=4, tool_length=0.05, mass=0.2, inertia=1e-4,
        world_damping=damping, world_friction=0.3 * (seed % 2), world_stiffness=2000.0,
    )  # fmt: skip
    speed = flight["speed"]
    energy = 0.1 * (speed[:, :3] ** 2).sum(axis=1) + 0.5e-4 * (speed[:, 3:] ** 2).sum(axis=1)
    energy += 0.2 * 9.81 * flight["place"][:, 2] + flight["stored"]
    assert flight["stored"].max() > 1e-3
    assert energy.max() <= energy[0] * (1.0 + 2e-3)
    if damping or seed % 2:
        assert energy[-1] < 0.9 * energy[0]
    else:
        assert energy[-1] > 0.95 * energy[0]


def test_a_tool_whose_shaft_begins_in_an_object_is_refused_with_its_depth() -> None:
    robot = load_robot("rcrt1")
    T = robot.fk(robot.home)
    texts = ["world=sphere", f"world.place={(T[:3, 3] - 0.03 * T[:3, 2]).tolist()}", "world.sphere.radius=0.008"]
    VirtualTime(configure("free_motion", settings=texts))
    with pytest.raises(ParameterError, match=r"8\.0 mm inside"):
        VirtualTime(configure("free_motion", settings=[*texts, "world.tool_points=2", "world.tool_length=0.03"]))


def test_the_gap_to_an_object_below_is_that_of_the_whole_tool() -> None:
    tip = load_robot("rcrt1").fk(load_robot("rcrt1").start)
    for points, radius in ((1, 0.0), (1, 0.004), (3, 0.004)):
        texts = [
            "world=plane",
            "world.gap=0.02",
            f"world.tool_radius={radius}",
            f"world.tool_points={points}",
            "world.tool_length=0.05",
        ]
        world = configure("free_motion", settings=texts).group("slave_sim").world
        assert world.distance(world.tool(tip), world.below(tip)) == pytest.approx(0.02)
