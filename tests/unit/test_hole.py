"""Hole: a peg in it, and the scenario ``peg``."""

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import teleop_core as tc
from free_tool import drag, fly
from teleop_console.world_nodes import object_outline
from teleop_core.kernels.geometry import Array
from teleop_core.robots import load_robot
from teleop_core.shapes.hole import HoleParameters

TILTED = (0.6, 0.0, 0.8)


@pytest.mark.parametrize("clearance", [1e-4, 5e-4])
def test_a_peg_beside_the_axis_feels_the_wall_beyond_the_clearance_alone(clearance: float) -> None:
    parameters = HoleParameters(radius=0.005 + clearance)
    for beside in (0.0, 0.9 * clearance, 1.5 * clearance):
        felt, *_ = drag((beside, 0.0, -0.02), (0, 0, -1), np.zeros((1, 6)), "hole", parameters,
                        points=3, tool_length=0.01, tool_radius=0.005)  # fmt: skip
        expected = -3.0 * 1000.0 * max(beside - clearance, 0.0)
        assert felt[0, 0] == pytest.approx(expected, abs=1e-9)


def test_a_tilted_peg_touches_with_both_ends_and_feels_a_moment() -> None:
    """Whitney's wedge (1982): two contacts, on opposite walls, that turn the peg straight."""
    tilt, length, clearance = 0.06, 0.02, 5e-4
    axis = np.array([math.sin(tilt), 0.0, -math.cos(tilt)])
    middle = np.array([0.0, 0.0, -0.015])
    felt, *_ = drag(middle + 0.5 * length * axis, axis, np.zeros((1, 6)), "hole",
                    HoleParameters(radius=0.005 + clearance), points=2, tool_length=length,
                    tool_radius=0.005)  # fmt: skip
    push = 1000.0 * (0.5 * length * math.sin(tilt) - clearance)
    assert np.abs(felt[0, :3]).max() < 1e-9
    assert felt[0, 4] == pytest.approx(push * length * math.cos(tilt), rel=1e-6)


def test_the_chamfer_leads_a_peg_into_the_hole_and_without_it_the_peg_rests_on_the_plate() -> None:
    """A heavy peg with a round end and friction that falls 4.5 mm beside the axis."""
    depths = {}
    for chamfer in (0.003, 0.0):
        flight = fly((0.0045, 0.0, 0.006), (0.0, 0.0, 0.0), 1500, name="hole", points=3,
                     parameters=HoleParameters(chamfer=chamfer, thickness=1.0),
                     tool_radius=0.005, mass=0.2, inertia=1.0, world_stiffness=5000.0,
                     world_damping=3.0, gravity=(0.0, 0.0, -1.0),
                     world_friction=0.4)  # fmt: skip
        depths[chamfer] = -flight["place"][-1, 2]
    assert depths[0.003] > 0.05
    assert depths[0.0] < 0.0


def test_depth_counts_in_the_hole_alone() -> None:
    hole = HoleParameters(axis=TILTED)
    axis, beside = np.array(TILTED), np.array([0.8, 0.0, -0.6])

    def depth(*ways: Array) -> float:
        return hole.depth(np.array(ways))

    assert depth(0.01 * axis) == 0.0
    assert depth(-0.01 * axis + 0.004 * beside, -0.004 * axis) == pytest.approx(0.01)
    assert depth(-0.01 * axis + 0.02 * beside) == 0.0
    assert depth(-0.04 * axis) == 0.0


def test_the_page_draws_its_edges() -> None:
    robot = load_robot("rcrt1")
    values: dict[str, Any] = {"kind": "hole", "place": (0.3, 0.0, 0.0), "hole.axis": TILTED, "tool_points": 5}
    drawn = object_outline(values, robot)
    assert len(drawn) == 5 * 40


# The scenario.


@pytest.fixture(scope="module")
def session(tmp_path_factory: pytest.TempPathFactory) -> tc.Recording:
    """Recording of the scenario ``peg``."""
    return tc.run("peg", out=tmp_path_factory.mktemp("peg") / "bag")


def in_hole(recording: tc.Recording) -> tuple[Array, Array, Array]:
    """Depth (N,) and distance from the axis (N, 3) [m] of the tip, and its wrench (N, 6)."""
    place, force = recording["slave/true_cp"], recording["slave/true_cf"]
    last = np.searchsorted(force.stamp_ns, place.stamp_ns, side="right") - 1
    axis = np.array([0.9178, 0.0, -0.3971])
    axis /= np.linalg.norm(axis)
    ways = place.values[:, :3] - (0.258, -0.2749, -0.0512)
    depth = ways @ axis
    return depth, ways - depth[:, None] * axis, force.values[last]


def test_the_hand_takes_the_peg_into_the_hole_and_out_again(session: tc.Recording) -> None:
    depth, beside, wrench = in_hole(session)
    touched = np.flatnonzero(wrench[:, :3].any(axis=1))
    deepest = np.argmax(depth[touched[0] :]) + touched[0]
    assert 0.018 < depth[deepest] < 0.02
    assert depth[-1] < -0.02
    assert np.linalg.norm(beside[deepest]) < 0.6e-3  # the clearance, and how far the wall gives
    assert np.linalg.norm(beside[touched[0]]) > 0.7e-3  # where it began


def test_the_walls_turn_the_peg_and_hold_it_back_within_friction(session: tc.Recording) -> None:
    _, _, wrench = in_hole(session)
    force, torque = (np.linalg.norm(part, axis=1) for part in (wrench[:, :3], wrench[:, 3:]))
    assert 0.1 < force.max() < 0.5
    assert 1e-3 < torque.max() < 0.5 * 0.02
    assert (torque <= (0.02 + 0.005) * 5 * force.max()).all()


def test_the_score_tells_depth_resistance_and_torque(session: tc.Recording) -> None:
    depth, _, wrench = in_hole(session)
    score = session.score()
    is_touching = wrench[:, :3].any(axis=1)
    axis = np.array([-0.9178, 0.0, 0.3971])
    assert score.value("insertion.depth_mm") == pytest.approx(1e3 * depth[is_touching].max(), abs=0.05)
    against = wrench[:, :3] @ axis / np.linalg.norm(axis)
    assert score.value("insertion.resistance_n") == pytest.approx(against.max(), rel=1e-6)
    torque = np.linalg.norm(wrench[:, 3:], axis=1).max()
    assert score.value("insertion.torque_nm") == pytest.approx(torque, rel=1e-6)
    assert score.value("touch.peak_n") == pytest.approx(np.linalg.norm(wrench[:, :3], axis=1).max(), rel=1e-6)


def test_a_session_without_a_hole_has_no_insertion(tmp_path: Path) -> None:
    score = tc.run("free_motion", duration=1.0, out=tmp_path / "bag").score()
    assert score.value("insertion.depth_mm") is None
