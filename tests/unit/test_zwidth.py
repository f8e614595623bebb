"""Z-width: our device renders walls as stiff as the laws of sampled walls allow, and no stiffer."""

import pytest

from present import present
from teleop_lab import experiments
from teleop_lab.experiments import zwidth
from teleop_lab.experiments.comparison import Comparison
from teleop_lab.experiments.one_axis import Grip, exact_boundary, sampled_boundary
from teleop_lab.experiments.outcome import Outcome
from teleop_lab.experiments.sampled_wall import (
    SampledDevice,
    Wall,
    is_restless,
    passive_boundary,
    press_energy,
    wall_growth,
)
from teleop_lab.experiments.stability import GRIPS

PUSHES = [1.0 + share / 8.0 for share in range(1, 8)]


@pytest.fixture(scope="module")
def outcome() -> Outcome:
    return experiments.run("zwidth")


def rows(outcome: Outcome, *parts: str) -> list[Comparison]:
    return [row for row in outcome.rows if all(part in row.group for part in parts)]


# Stability.


def test_our_device_stands_a_late_wall_as_the_linear_law_says(outcome: Outcome) -> None:
    found = rows(outcome, "linear law", "B = 0")
    assert len(found) == len(zwidth.LATE)
    assert all(row.agrees for row in found)


@pytest.mark.parametrize("damping", zwidth.WALL_DAMPINGS)
def test_our_device_stands_the_wall_of_the_exact_axis_with_a_damper_too(outcome: Outcome, damping: float) -> None:
    found = rows(outcome, "exact sampled axis", f"B = {damping:g}")
    assert len(found) == len(zwidth.LATE)
    assert all(abs(present(row.difference)) < 0.02 * present(row.published) for row in found)


def test_what_misses_is_the_linear_law_with_a_damper(outcome: Outcome) -> None:
    missed = {(row.group, row.quantity) for row in outcome.rows if row.agrees is False}
    damped = "stable, linear law of Gil 2009, B = 5 N·s/m"
    assert missed == {(damped, f"force {late} ms later") for late in (1, 2, 3, 5, 10)}


@pytest.mark.parametrize("damping", zwidth.WALL_DAMPINGS)
def test_a_wall_swings_up_above_the_exact_boundary_and_down_below_it(damping: float) -> None:
    exact = sampled_boundary(zwidth.BARE, 1, damping)
    below, above = (wall_growth(zwidth.BARE, Wall(share * exact, damping, 1)) for share in (0.98, 1.02))
    assert below < 0.0 < above


@pytest.mark.parametrize("grip", GRIPS.values(), ids=GRIPS)
@pytest.mark.parametrize("late", [0, 1, 20, 100])
def test_a_sampled_axis_has_the_boundary_of_one_that_is_late_by_half_a_tick_more(grip: Grip, late: int) -> None:
    assert sampled_boundary(grip, late) == pytest.approx(exact_boundary(grip, 1e-3 * late), rel=0.02)


# Energy.


@pytest.mark.parametrize(("damping", "wall_damping"), zwidth.DAMPINGS)
@pytest.mark.parametrize("speed", [1e-3, 0.03, 0.3])
def test_a_passive_wall_gives_no_energy_in_any_press_and_a_stiffer_one_does(
    damping: float, wall_damping: float, speed: float
) -> None:
    law = zwidth.passive_law(damping, wall_damping)
    soft, stiff = (
        max(press_energy(damping, Wall(stiffness, wall_damping), n, speed) for n in (1, 2, 3, 7, 30))
        for stiffness in (0.98 * law, 1.02 * law + 20.0)
    )
    assert soft < 0.0 < stiff


@pytest.mark.parametrize("length", [1, 2, 3, 10])
def test_a_press_gives_energy_from_the_stiffness_of_its_law_on_at_every_speed(length: int) -> None:
    law = zwidth.press_law(5.0, 3.0, length)
    for speed in (1e-3, 0.03, 0.3):
        assert passive_boundary(5.0, 3.0, length, speed) == pytest.approx(law, rel=5e-3)


def test_a_wall_gives_energy_long_before_it_diverges() -> None:
    loose = GRIPS["loose"]
    assert zwidth.passive_law(loose.damping, loose.damping) == 0.0
    assert press_energy(loose.damping, Wall(100.0, loose.damping), 1, 0.05) > 0.0
    assert wall_growth(loose, Wall(0.98 * 19_672.0, loose.damping)) < 0.0
    assert wall_growth(loose, Wall(1.02 * 19_672.0, loose.damping)) > 0.0


# Steps of the reading and dry friction.


@pytest.mark.parametrize(("friction", "resolution"), zwidth.DEVICES)
def test_friction_holds_a_device_between_steps_up_to_its_law(friction: float, resolution: float) -> None:
    law = zwidth.quiet_law(friction, resolution)
    below, above = Wall(0.97 * law), Wall(1.03 * law)
    assert not any(is_restless(below, friction, resolution, push) for push in PUSHES)
    assert any(is_restless(above, friction, resolution, push) for push in PUSHES)


def test_a_restless_wall_pushes_by_one_step_of_its_force() -> None:
    friction, resolution = zwidth.DEVICES[0]
    wall = Wall(1.1 * zwidth.quiet_law(friction, resolution))
    loop = SampledDevice(Grip(0.045, 1.0, 0.1), wall, friction=friction, position_resolution=resolution)
    loop.aim(loop.origin + 1.5 * wall.stiffness * resolution)
    forces = [loop.step() for _ in range(600)][-100:]
    assert max(forces) - min(forces) == pytest.approx(wall.stiffness * resolution, rel=1e-9)


def test_the_law_of_our_own_device_is_the_one_that_the_walls_know(outcome: Outcome) -> None:
    row = rows(outcome, "rests")[0]
    assert row.published == pytest.approx(9454.5)
    assert row.agrees
    assert any("assumed" in note for note in outcome.notes)
