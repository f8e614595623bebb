"""Experiments drift and puncture: a far hand that touches ten times, or pricks a membrane."""

import numpy as np
import pytest

from teleop_lab.experiments import Bench, drift, puncture
from teleop_lab.experiments.drift import report as drifts
from teleop_lab.experiments.puncture import report as punctures

FAR = drift.ROUND_TRIPS[-1]
FORCE = ("position_force", "none")


@pytest.fixture(scope="module")
def steel() -> dict[str, drift.Drift]:
    return {kind: drift.measure_drift(Bench(), ("steel", kind, FAR)) for kind in drift.PASSIVITIES}


@pytest.fixture(scope="module")
def pricked() -> dict[tuple[tuple[str, str], float], puncture.Puncture]:
    jobs = [(FORCE, 0.0), (FORCE, 0.2), (("position_position", "none"), 0.2), (("position_force", "wave"), 0.4)]
    return {job: puncture.measure_puncture(Bench(), job) for job in jobs}


@pytest.mark.parametrize("material", drift.MATERIALS)
def test_ten_contacts_700_ms_away_leave_no_drift_that_grows_with_tdpa(
    material: str, steel: dict[str, drift.Drift]
) -> None:
    found = steel["tdpa"] if material == "steel" else drift.measure_drift(Bench(), (material, "tdpa", FAR))
    assert len(found.left) == drift.CONTACTS
    # Until the hand has paid what the first contact cost, the arm goes slowly.
    assert 1e3 * found.left.max() < 3.0 * drift.GOAL_MM
    assert 1e3 * found.left[1:].max() < drift.GOAL_MM
    assert 1e3 * found.rest < 0.1
    assert found.leaving.min() > (1e-4 if material == "tissue" else 2e-3)  # held back in touch


def test_a_command_that_nothing_holds_back_has_no_drift_but_gives_more_energy(steel: dict[str, drift.Drift]) -> None:
    assert steel["none"].peak == 0.0
    assert steel["none"].given > 0.1
    for kind in ("tank", "tdpa", "wave"):  # their drags take energy
        assert steel[kind].given < 0.0


def test_a_tank_holds_a_command_back_before_steel_and_leaves_no_drift_either(steel: dict[str, drift.Drift]) -> None:
    assert len(steel["tank"].left) == drift.CONTACTS  # no drive had to give all it has
    assert steel["tank"].peak > 2e-3
    assert 1e3 * steel["tank"].left.max() < drift.GOAL_MM


def test_tdpa_presses_steel_no_harder_than_the_arm_that_is_on_its_way(steel: dict[str, drift.Drift]) -> None:
    assert 5.0 < steel["tdpa"].force < 18.5


def test_a_hand_notices_a_puncture_as_soon_as_the_news_is_there(
    pricked: dict[tuple[tuple[str, str], float], puncture.Puncture],
) -> None:
    for late in (0.0, 0.2):
        found = pricked[FORCE, late]
        assert 0.5 * late < found.notice < 0.5 * late + 0.01
        assert found.tip_drop == pytest.approx(0.4, abs=0.01)
        assert found.hand_drop == pytest.approx(found.tip_drop, abs=0.01)


def test_the_tip_overshoots_by_the_way_of_round_trip_and_reaction_and_by_what_springs(
    pricked: dict[tuple[tuple[str, str], float], puncture.Puncture],
) -> None:
    assert puncture.least_overshoot(0.2) - puncture.least_overshoot(0.0) == pytest.approx(0.2 * puncture.SPEED)
    for late in (0.0, 0.2):
        more = pricked[FORCE, late].overshoot - puncture.least_overshoot(late)
        # Hand and tissue spring by 0.4 N over the hand's stiffness of 300 N/m at most, and the arm.
        assert 0.0 < more < 2.5e-3
    assert pricked[FORCE, 0.2].overshoot > pricked[FORCE, 0.0].overshoot


def test_a_hand_that_feels_its_own_spring_alone_does_not_notice(
    pricked: dict[tuple[tuple[str, str], float], puncture.Puncture],
) -> None:
    found = pricked[("position_position", "none"), 0.2]
    assert found.notice == np.inf
    assert found.hand_drop < 0.05


def test_waves_over_400_ms_do_not_get_through_the_membrane(
    pricked: dict[tuple[tuple[str, str], float], puncture.Puncture],
) -> None:
    assert np.isnan(pricked[("position_force", "wave"), 0.4].notice)


def test_rows_say_what_was_stopped_held_or_not_noticed_and_all_figures_have_numbers(
    steel: dict[str, drift.Drift], pricked: dict[tuple[tuple[str, str], float], puncture.Puncture]
) -> None:
    few = drift.Drift(np.zeros(3), np.zeros(3), 0.0, 0.0, 0.0, 1.0)
    ways = {("steel", kind, FAR): found for kind, found in steel.items()}
    found = drifts(ways | {("tissue", "tank", FAR): few})
    assert [row.note for row in found.rows if "ended" in row.quantity][-1] == "the arm was stopped"
    assert sum("before the next" in row.quantity for row in found.rows) == len(drift.PASSIVITIES)
    told = {row.note for row in punctures(pricked).rows}
    assert told == {"", "the hand does not notice", "the membrane holds"}
    for figure in (*found.figures, *punctures(pricked).figures):
        assert figure.traces
        assert all(np.isfinite(trace["y"]).all() for trace in figure.traces)
