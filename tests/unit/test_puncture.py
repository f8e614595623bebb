"""Puncture: a membrane that gives way, and the push on a needle in the channel behind it."""

from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

import teleop_core as tc
from led_tip import PIECES, along_z, lead, wandering
from present import present
from teleop_core.session.configuration import configure
from teleop_core.session.virtual import VirtualTime

TOP = -0.072  # of the block in the scenario ``puncture`` [m]


def test_the_push_rises_to_the_puncture_force_and_falls_to_the_cutting_force() -> None:
    for stiffness in (200.0, 50_000.0):
        push = lead(along_z(2e-3, -12e-3), world_stiffness=stiffness)[0][:, 2]
        first = int(push.argmax())
        assert push[first] == pytest.approx(0.5, rel=1e-9)
        assert (np.diff(push[:first]) >= 0.0).all()
        assert push[first + 1] == pytest.approx(0.1, abs=5e-3)


def test_a_push_below_the_puncture_force_is_that_of_a_surface_that_is_whole() -> None:
    way = along_z(2e-3, -2.4e-3, 2e-3)
    pricked, whole = (lead(way, puncture_force=force) for force in (0.5, 0.0))
    np.testing.assert_array_equal(pricked[0], whole[0])
    assert pricked[2].punctures == 0


def test_friction_of_the_shaft_grows_with_depth_and_turns_with_the_motion() -> None:
    way = along_z(2e-3, -15e-3, 2e-3)
    push, _, s = lead(way)
    depth, turned = -way[:-1, 2], int(way[:, 2].argmin())
    inwards = slice(turned - 100, turned - 10)
    np.testing.assert_allclose(push[inwards, 2], 0.1 + 20.0 * depth[inwards], rtol=1e-9)
    outwards = slice(turned + 300, len(push))
    expected = -20.0 * np.maximum(depth[outwards], 0.0)
    np.testing.assert_allclose(push[outwards, 2], expected, atol=1e-9)
    assert s.punctures == 1


def test_cutting_costs_the_cutting_force_times_the_way_however_stiff_the_tissue_is() -> None:
    way = along_z(2e-3, -15e-3)
    first, last = (int(np.argmax(way[:, 2] < z)) for z in (-10e-3, -14e-3))
    for stiffness in (200.0, 50_000.0):
        lost = lead(way, world_stiffness=stiffness, shaft_friction=0.0)[1]
        expected = 0.1 * (way[first, 2] - way[last, 2])
        assert lost[last] - lost[first] == pytest.approx(expected, rel=1e-6)


def test_a_needle_that_rests_is_held_by_its_friction_for_ever() -> None:
    at_rest = np.full(3000, -12e-3)
    z = np.concatenate((along_z(2e-3, -12e-3)[:, 2], at_rest, at_rest + 1e-4, at_rest))
    push = lead(np.column_stack((np.zeros((len(z), 2)), z)))[0][:, 2]
    starts = len(z) - 9000 + 3000 * np.arange(3)
    for start in starts:
        assert np.ptp(push[start + 1 : start + 2998]) == 0.0
    assert push[starts[0] + 9] == pytest.approx(0.1 + 20.0 * 12e-3)
    assert push[-9] == pytest.approx(push[starts[0] + 9])  # the short way bent it alone


def test_a_second_entry_meets_the_shaft_alone_until_it_cuts_deeper() -> None:
    push, _, s = lead(along_z(2e-3, -10e-3, 2e-3, -14e-3))
    z = along_z(2e-3, -10e-3, 2e-3, -14e-3)[:-1, 2]
    second = np.arange(len(z)) > len(z) - 700
    in_old, deeper = second & (z < 0.0) & (z > -9e-3), second & (z < -11e-3)
    np.testing.assert_allclose(push[in_old, 2], -20.0 * z[in_old], rtol=1e-6)
    np.testing.assert_allclose(push[deeper, 2], 0.1 - 20.0 * z[deeper], rtol=1e-6)
    assert s.punctures == 1


def test_a_needle_out_of_its_channel_feels_nothing_and_meets_a_whole_surface_elsewhere() -> None:
    way = along_z(2e-3, -8e-3, 2e-3, -8e-3, 2e-3)
    for aside, punctures in ((1.9e-3, 1), (2.1e-3, 2)):
        moved = way.copy()
        moved[len(way) // 2 :, 0] = aside
        push, _, s = lead(moved)
        assert not push[way[:-1, 2] > 0.0].any()
        assert s.punctures == punctures


def test_a_needle_that_leaves_the_rim_of_its_hole_as_it_enters_is_in_the_hole() -> None:
    entry = np.array([(1.95e-3, 0.0, 3e-4), (2.05e-3, 0.0, -3e-4), (2.05e-3, 0.0, -6e-4)])
    rim = np.linspace((0.0, 0.0, 2e-3), entry[0], 200, endpoint=False)
    way = np.concatenate((along_z(2e-3, -8e-3, 2e-3), rim, entry, entry[2:]))
    push, lost, s = lead(way)
    assert s.punctures == 1
    np.testing.assert_allclose(push[-2:, 2], (20.0 * 3e-4, 20.0 * 6e-4), rtol=1e-9)
    assert np.diff(lost).min() >= -1e-8


def test_a_channel_holds_the_needle_sideways_with_the_stiffness_of_the_object() -> None:
    way = along_z(2e-3, -10e-3, -10e-3)
    way[-150:, 0] = np.linspace(0.0, 1e-3, 150)
    push = lead(way)[0]
    np.testing.assert_allclose(push[-100:, 0], -200.0 * way[-101:-1, 0], rtol=1e-9)


def test_a_hole_is_entered_from_its_own_side_alone() -> None:
    """By a tip that goes around a box of 30 mm, along the channel that was made from above."""
    corners = np.array([(0.0, 17e-3), (0.05, 17e-3), (0.05, -17e-3), (0.0, -17e-3)])
    around = np.concatenate([np.linspace(a, b, 300) for a, b in pairwise(corners)])
    around = np.column_stack((np.zeros(len(around)), around))
    below = along_z(-17e-3, -14e-3)
    push, _, s = lead(np.concatenate((along_z(17e-3, 8e-3, 17e-3), around, below)), "box")
    assert s.punctures == 1
    assert push[-1, 2] == pytest.approx(-200.0 * 1e-3, rel=0.02)


@settings(max_examples=60, deadline=None, derandomize=True)
@given(
    seed=st.integers(0, 10_000),
    stiffness=st.floats(100.0, 50_000.0),
    damping=st.floats(0.0, 3.0),
    friction=st.sampled_from([0.0, 0.4]),
    puncture=st.floats(0.05, 10.0),
    cutting=st.floats(0.0, 15.0),
    shaft=st.floats(0.0, 10_000.0),
    hole=st.floats(2e-4, 1e-2),
)
def test_no_motion_of_a_needle_gets_energy_from_what_it_punctures(
    seed: int,
    stiffness: float,
    damping: float,
    friction: float,
    puncture: float,
    cutting: float,
    shaft: float,
    hole: float,
) -> None:
    """In no tick: what it gave grows by what is stored, or more."""
    way = wandering(seed)
    _, lost, _ = lead(
        way,
        world_stiffness=stiffness,
        world_damping=damping,
        world_friction=friction,
        puncture_force=puncture,
        cutting_force=cutting,
        shaft_friction=shaft,
        hole_radius=hole,
    )
    # Where the force has a corner, the sum over the pieces of a tick errs by as much.
    piece = np.abs(np.diff(way, axis=0)).max() / PIECES
    assert lost[0] == 0.0
    assert np.diff(lost).min() >= -1e-5 * lost[-1] - 0.25 * stiffness * piece * piece


@pytest.mark.parametrize("name", ["box", "sphere", "cylinder", "capsule"])
def test_a_closed_motion_through_any_object_costs_energy(name: str) -> None:
    top = {"box": 0.015, "sphere": 0.015, "cylinder": 0.015, "capsule": 0.01}[name]
    for seed in range(20):
        _, lost, s = lead(wandering(seed) + np.array((0.0, 0.0, top)), name)
        assert lost.min() > -1e-6
        assert lost[-1] > 0.0 or not s.punctures


@pytest.fixture(scope="module")
def pierced() -> tuple[VirtualTime, NDArray[np.void]]:
    """Session of the scenario ``puncture``, and its signals."""
    session = VirtualTime(configure("puncture"))
    return session, session.run(24_000)


def test_in_the_scenario_the_hand_pierces_a_membrane_once_and_enters_it_twice(
    pierced: tuple[VirtualTime, NDArray[np.void]],
) -> None:
    session, rows = pierced
    stage: Any
    stage, push, z = session.stages["slave_sim"], rows["slave_true_cf"], rows["slave_true_cp"][:, 2]
    drops = np.flatnonzero(np.diff(push[:, 2]) < -0.3)
    assert len(drops) == 1
    assert push[:, 2].max() == push[drops[0], 2] == pytest.approx(0.5, rel=1e-9)
    assert np.sum(np.diff((z < TOP - 5e-3).astype(int)) == 1) == 2
    assert not push[z > TOP].any()
    assert not rows["slave_operation"][:, 4].any()
    assert (stage.punctures, stage.depth) == (1, 0.0)


def test_the_hand_feels_the_membrane_give_way(pierced: tuple[VirtualTime, NDArray[np.void]]) -> None:
    force = pierced[1]["master_servo_cf"][:, :3]
    size = np.linalg.norm(force, axis=1)
    assert size.max() == pytest.approx(0.5, rel=1e-2)
    assert -np.diff(size).min() > 0.3


def test_the_stage_tells_punctures_and_depth_and_forgets_them_at_its_begin() -> None:
    session = VirtualTime(configure("puncture"))
    stage: Any
    rows, stage = session.run(11_800), session.stages["slave_sim"]
    assert stage.punctures == 1
    assert stage.depth == pytest.approx(TOP - rows["slave_true_cp"][-1, 2], abs=1e-4)
    stage.reset()
    assert (stage.punctures, stage.depth) == (0, 0.0)


@pytest.mark.parametrize("plant", ["ideal", "hardware"])
def test_an_arm_with_a_needle_is_given_no_energy_by_what_it_punctures(plant: str) -> None:
    rows = VirtualTime(configure("puncture", settings=[f"plant={plant}"])).run(24_000)
    force, tip = rows["slave_true_cf"][:, :3], rows["slave_true_cp"][:, :3]
    power = np.einsum("ij,ij->i", 0.5 * (force[1:] + force[:-1]), np.diff(tip, axis=0))
    given_to_it = np.cumsum(power)
    assert force[:, 2].max() == pytest.approx(0.5, rel=1e-9)
    assert given_to_it.min() < -1e-3
    assert given_to_it.max() <= 1e-3 * np.abs(power).sum()


def test_the_score_has_the_fall_of_the_force() -> None:
    score = tc.run("puncture", duration=12.0).score()
    assert score.value("touch.peak_n") == pytest.approx(0.5, rel=1e-3)
    assert score.value("touch.drop_n") == pytest.approx(0.4, abs=0.02)
    assert present(tc.run("palpation", duration=10.0).score().value("touch.drop_n")) < 0.05


def test_without_a_puncture_force_nothing_of_a_needle_changes_a_bit() -> None:
    needles = ["world.cutting_force=3.0", "world.shaft_friction=500.0", "world.hole_radius=0.01"]
    plain, other = (VirtualTime(configure("palpation", settings=given)).run(10_000) for given in ([], needles))
    assert plain["slave_true_cf"].any()
    for name in present(plain.dtype.names):
        np.testing.assert_array_equal(plain[name], other[name])
