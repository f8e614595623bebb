"""Contacts: what the device renders, and the energy that it takes and gives back."""

import math
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from held_master import HeldMaster
from recipes import Recipe
from teleop_core.base.parameters import build
from teleop_core.coupling.mapping import gains, walls
from teleop_core.evaluation import Score, evaluate
from teleop_core.graph.topics import MASTER_CONTACT
from teleop_core.hand.master import hand_mechanics, haptic_master
from teleop_core.hand.master.device import DeviceParameters
from teleop_core.hand.operators.behaviour import OperatorParameters
from teleop_core.hand.operators.rest import REST_POSITION
from teleop_core.kernels.geometry import Array
from teleop_core.session import api, notes

COLUMN = {name: index for index, name in enumerate(MASTER_CONTACT.columns)}
CALM = hand_mechanics.HandParameters()
STILL = build(OperatorParameters, {"kind": "hold", "rotation": 0.0, "tremor_amplitude": 0.0, "patience": 0.0})


def master(hand: hand_mechanics.HandParameters = CALM, **device: Any) -> HeldMaster:
    return HeldMaster(STILL, haptic_master.HapticMasterParameters(hand=hand, device=DeviceParameters(**device)))


def push(device: HeldMaster, forces: Array) -> Iterator[Any]:
    """Places (N, 3) [m], forces (N, 3) [N] and contacts (N, 5) of ticks with commanded forces."""
    rows = []
    for force in forces:
        device.signals["master_servo_cf"][:3] = force
        device.step()
        applied = device.signals["master_measured_cf"][:3].copy()
        contact = device.signals["master_contact"].copy()
        rows.append((device.state["position"].copy(), applied, contact))
    return (np.array(column) for column in zip(*rows, strict=True))


# What the device renders.


@pytest.mark.parametrize("thermal_time", [0.1, 1.0, 5.0])
@pytest.mark.parametrize("command", [1.0, 2.0, 3.3, 50.0])
def test_mean_square_of_the_force_never_exceeds_the_continuous_one(thermal_time: float, command: float) -> None:
    forces = np.zeros((6000, 3))
    forces[:, 1] = command * np.sign(np.sin(np.arange(6000) / 200.0)) * (np.arange(6000) > 50)
    _, applied, _ = push(master(thermal_time=thermal_time), forces)
    share, heat, hottest = -math.expm1(-1e-3 / thermal_time), 0.0, 0.0
    for square in (applied**2).sum(axis=1):
        heat += (square - heat) * share
        hottest = max(hottest, heat)
    assert hottest <= 0.88**2 * (1.0 + 1e-9)
    if thermal_time < 2.0:  # it is used, not just kept away from
        assert hottest > 0.7 * 0.88**2


def test_a_force_that_stays_falls_smoothly_from_the_peak_to_the_continuous_one() -> None:
    _, applied, contacts = push(master(thermal_time=2.0), np.tile((0.0, 0.0, -5.0), (12_000, 1)))
    size = -applied[:, 2]
    assert size[0] == pytest.approx(3.3, rel=1e-12)
    assert size[-1] == pytest.approx(0.88, rel=1e-3)
    assert (np.diff(size) <= 1e-12).all()
    assert np.abs(np.diff(size)).max() < 0.05
    assert np.allclose(size, contacts[:, COLUMN["largest_force"]], rtol=1e-12, atol=0)


def test_a_force_below_the_continuous_one_is_never_cut() -> None:
    _, applied, _ = push(master(thermal_time=0.1), np.tile((0.87, 0.0, 0.0), (5000, 1)))
    assert (applied[:, 0] == 0.87).all()


def test_motors_cool_while_nothing_is_asked_of_them() -> None:
    device = master(thermal_time=1.0)
    push(device, np.tile((3.3, 0.0, 0.0), (5000, 1)))
    push(device, np.zeros((5000, 3)))
    _, applied, _ = push(device, np.tile((3.3, 0.0, 0.0), (1, 1)))
    assert applied[0, 0] == pytest.approx(3.3, rel=1e-12)


def test_friction_is_one_force_in_whatever_direction_it_slides() -> None:
    direction = np.array((0.6, 0.0, 0.8))
    device = master(stiffness=(1e6,) * 3)
    places, _, _ = push(device, np.tile(1.26 * direction, (4000, 1)))
    moved = places[-1] - REST_POSITION
    # The hand's spring of 300 N/m holds what friction leaves; what swings may stop a little off.
    assert np.linalg.norm(moved) * 300.0 == pytest.approx(1.0, abs=0.26)
    assert moved @ direction == pytest.approx(np.linalg.norm(moved), rel=1e-2)


# The energy.


def test_energy_of_a_contact_is_force_times_way() -> None:
    forces = np.zeros((600, 3))
    forces[100:200], forces[300:500] = (0.8, 0.3, 0.0), (0.0, 0.0, -1.1)
    places, applied, contacts = push(master(friction=0.05), forces)
    work = (applied * np.diff(places, axis=0, prepend=[REST_POSITION])).sum(axis=1)
    assert list(np.unique(contacts[:, COLUMN["number"]])) == [0.0, 1.0, 2.0]
    for stretch in (slice(100, 200), slice(300, 500)):
        own, last = work[stretch], contacts[stretch][-1]
        assert last[COLUMN["taken"]] == pytest.approx(-own[own < 0.0].sum(), rel=1e-9, abs=1e-15)
        assert last[COLUMN["returned"]] == pytest.approx(own[own > 0.0].sum(), rel=1e-9)
        way = np.linalg.norm(np.diff(places[stretch.start - 1 : stretch.stop], axis=0), axis=1)
        assert last[COLUMN["friction"]] == pytest.approx(0.05 * way.sum(), rel=1e-9)
    # After a contact its numbers stand until the next one.
    assert (contacts[200:300] == contacts[199]).all(axis=None)


# The score.


def recorded(path: Path, rows: Array) -> Score:
    """Score of a recording whose contact topic holds these rows (N, 5), 100 ticks each."""
    recipe = Recipe(count=100 * len(rows))
    recipe.rows[MASTER_CONTACT] = (recipe.stamps, np.repeat(rows, 100, axis=0), recipe.stamps)
    return evaluate(recipe.write(path))


def test_contacts_are_scored_by_their_last_sample(tmp_path: Path) -> None:
    rows = np.array(
        [
            (0, 0, 0, 0, 3.3),
            (1, 2e-5, 0, 1e-6, 3.3),
            (1, 8e-5, 6e-5, 1e-6, 3.1),
            (2, 1e-4, 1.1e-4, 5e-6, 2.0),
            (3, 1e-9, 2e-9, 0.0, 3.3),
            (4, 4e-3, 1e-3, 1e-3, 3.3),
        ]
    )
    score = recorded(tmp_path / "bag", rows)
    found = {key: score.value(f"contact.{key}") for key in (
        "count", "touches", "feeding", "feeding_device", "returned_max", "gain_max_uj",
        "taken_max_mj", "worst_s", "largest_force_min_n",
    )}  # fmt: skip
    assert found == {
        "count": 3,
        "touches": 1,
        "feeding": 1,
        "feeding_device": 1,
        "returned_max": pytest.approx(1.1),
        "gain_max_uj": pytest.approx(10.0),
        "taken_max_mj": pytest.approx(4.0),
        "worst_s": pytest.approx(0.3),
        "largest_force_min_n": 2.0,
    }


def test_a_session_without_contact_has_none(tmp_path: Path) -> None:
    score = recorded(tmp_path / "bag", np.array([(0, 0, 0, 0, 3.3)]))
    assert score.value("contact.count") == 0
    assert score.value("contact.returned_max") is None


def test_recording_that_does_not_tell_of_contacts_says_so(tmp_path: Path) -> None:
    bag = Recipe().write(tmp_path / "bag")
    assert bag.topics[MASTER_CONTACT.name].count == 0
    score = evaluate(bag)
    assert score.value("contact.count") is None
    assert any(row.value == "none recorded" for result in score.results for row in result.rows)


# Walls that the device cannot render.


@pytest.mark.parametrize(
    ("settings", "told"),
    [
        ({}, ""),
        ({"stiffness": 1020.0}, ""),
        ({"stiffness": 1100.0}, "along z (1020 N/m): the hand feels 529 N/m"),
        ({"wall": "source"}, "3300 N/m, more than the device's own stiffness along x, y, z"),
        ({"wall": "step"}, "along x, y, z (1260, 2310, 1020 N/m): the hand feels 1260, 2310, 1020"),
        ({"wall": "step", "max_force": 0.0}, ""),
    ],
)
def test_a_wall_stiffer_than_the_device_is_told_with_what_the_hand_feels(
    settings: Mapping[str, Any], told: str
) -> None:
    note = notes.rendered_note(DeviceParameters(), gains.FixtureParameters(**settings))
    assert told in note
    assert bool(note) is bool(told)


DEVICE = DeviceParameters()
# Stiffness [N/m], delay [s] at which contacts with a damped wall were seen to give back more than
# they took (101 to 189 %), each at 10 N·s/m and 1 kHz.
BROKEN = ((1260.0, 0.0), (2310.0, 0.0), (1000.0, 1e-3), (5000.0, 1e-3))
HELD = ((1000.0, 0.0), (333.0, 1e-3), (140.0, 3e-3))


@pytest.mark.parametrize(("stiffness", "delay"), [*BROKEN, *HELD])
def test_walls_that_were_seen_to_feed_a_hand_are_told_and_others_are_not(stiffness: float, delay: float) -> None:
    note = notes.passive_note(DEVICE, gains.FixtureParameters(stiffness=stiffness), delay)
    assert ("may return more energy than it absorbs" in note) == bool(note) == ((stiffness, delay) in BROKEN)


@pytest.mark.parametrize("wall", ["source", "soft", "step"])
def test_a_wall_without_damping_is_told_whatever_its_stiffness(wall: str) -> None:
    assert "the wall has no damping" in notes.passive_note(DEVICE, gains.FixtureParameters(wall=wall), 0.0)
    for silent in ({"max_force": 0.0}, {"side": "slave"}):  # the hand feels nothing
        assert not notes.passive_note(DEVICE, gains.FixtureParameters(wall=wall, **silent), 0.0)
        assert not notes.rendered_note(DEVICE, gains.FixtureParameters(wall=wall, **silent))


def test_passive_stiffness_falls_with_delay_and_coarse_readings_and_gains_nothing_by_damping() -> None:
    given = {"damping": 10.0, "period": 1e-3, "delay": 0.0, "friction": 0.26, "step": 55e-6}
    assert math.isclose(walls.passive_stiffness(**given), 1000.0)
    assert walls.passive_stiffness(**given | {"delay": 1e-3}) < 0.34 * 1000.0
    assert walls.passive_stiffness(**given | {"damping": 5.0}) == 500.0
    assert walls.passive_stiffness(**given | {"damping": 50.0}) == walls.passive_stiffness(**given)
    assert walls.passive_stiffness(**given | {"step": 1e-3}) == 520.0  # Abbott and Okamura
    assert walls.passive_stiffness(**given | {"damping": 0.0}) == 0.0


def test_a_declared_delay_between_device_and_wall_counts() -> None:
    late = api.configuration("coarse_box", delays={"master/servo_cf": 1e-3})
    assert "2 ms from sample to force, the wall is passive up to 333 N/m" in " ".join(notes.notes_of(late))
    both = dict.fromkeys(("master/measured_cp", "master/servo_cf"), 1e-3)
    assert "3 ms from sample to force" in " ".join(notes.notes_of(api.configuration("coarse_box", delays=both)))
    elsewhere = api.configuration("coarse_box", delays={"slave/servo_cp": 1e-3})
    assert not notes.notes_of(elsewhere)
    assert len(notes.notes_of(api.configuration("coarse_box"), transport=1e-3)) == 1


def test_sessions_and_their_arms_tell_what_their_devices_cannot_render() -> None:
    arms = api.configuration(arms=["left", "right"], settings={"right/fixture.wall": "source"})
    assert {note.split(":")[0] for note in notes.notes_of(arms)} == {"arm 'right'"}
    assert not notes.notes_of(api.configuration("coarse_box"))
