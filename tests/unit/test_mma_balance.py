"""MMA shoulder balance: published torques and spring, and the load it leaves (H14-H19)."""

import math

import numpy as np
import pytest

from teleop_machines import mma_balance

# Half of the last digit that the source prints.
TENTH_OF_MILLINEWTON_METRE, TENTH_OF_MICROMETRE = 0.5e-4, 0.5e-7
AT_45_DEGREES, LEVEL = math.radians(135.0), math.radians(90.0)


def total() -> float:
    return sum(mma_balance.MASSES.values())


def test_masses_add_up_to_less_than_the_printed_total() -> None:  # H14
    assert math.isclose(total(), 0.30736, abs_tol=1e-12)
    assert abs(total() - 0.31036) > 2.9e-3


def test_gravity_torques_of_both_poses_are_the_published_ones() -> None:  # H15
    # 1.03497 is printed cut, 1.0349.
    first, second = (
        mma_balance.gravity_torque(total(), mma_balance.ARM_AT_45_DEGREES),
        mma_balance.gravity_torque(total(), mma_balance.ARM_LEVEL),
    )
    assert math.isclose(first, 1.03497, abs_tol=1e-5)
    assert math.isclose(second, 1.1926, abs_tol=TENTH_OF_MILLINEWTON_METRE)


def test_spring_triangle_is_the_published_one() -> None:  # H16
    spring = mma_balance.ShoulderSpring()
    for value, printed in (
        (spring.length(AT_45_DEGREES), 51.7373e-3),
        (spring.lever(AT_45_DEGREES), 10.7151e-3),
        (spring.length(LEVEL), 39.5980e-3),
        (spring.lever(LEVEL), 19.7990e-3),
    ):
        assert math.isclose(value, printed, abs_tol=TENTH_OF_MICROMETRE)
    deflection = spring.length(AT_45_DEGREES) - spring.length(LEVEL)
    assert math.isclose(deflection, 12.139e-3, abs_tol=0.5e-6)


def test_rate_from_the_printed_rounded_inputs_is_the_printed_one() -> None:  # H17
    rate = mma_balance.matching_rate(0.1577, 12.1392e-3, 19.7989e-3)
    # Seven digits printed from inputs of four to six; 0.01 N/m covers their rounding.
    assert math.isclose(rate, 656.146, abs_tol=0.01)
    assert math.isclose(1.15 * rate, 754.57, abs_tol=0.01)


def test_rate_from_unrounded_inputs() -> None:  # H17
    spring = mma_balance.ShoulderSpring()
    difference = mma_balance.gravity_torque(total(), mma_balance.ARM_LEVEL) - mma_balance.gravity_torque(
        total(), mma_balance.ARM_AT_45_DEGREES
    )
    deflection = spring.length(AT_45_DEGREES) - spring.length(LEVEL)
    rate = mma_balance.matching_rate(float(difference), float(deflection), float(spring.lever(LEVEL)))
    assert math.isclose(rate, 655.95, abs_tol=0.005)
    assert math.isclose(1.15 * rate, 754.34, abs_tol=0.005)


def test_coil_has_the_published_dimensions() -> None:  # H18
    wound = mma_balance.coil()
    assert wound.turns == 13
    # The source cuts 3.695 to 3.69.
    assert math.isclose(wound.slenderness, 3.69, abs_tol=0.0051)
    assert math.isclose(wound.solid_length, 19.50e-3, abs_tol=1e-12)
    assert math.isclose(wound.spring_index, 9.33, abs_tol=0.005)
    assert math.isclose(wound.pitch, 4.31e-3, abs_tol=0.005e-3)


@pytest.mark.parametrize(("modulus", "turns"), [(40.9e9, 13), (44.2e9, 13), (79.3e9, 24)])
def test_thirteen_turns_ask_for_a_soft_wire(modulus: float, turns: int) -> None:
    # 40.9 and 44.2 GPa are the rounded edges of 12.5 and 13.5 turns.
    assert abs(mma_balance.coil(shear_modulus=modulus).turns - turns) <= (0 if turns == 24 else 1)
    assert mma_balance.coil(shear_modulus=42.5e9).turns == 13


def test_published_spring_leaves_most_of_the_load_in_both_poses() -> None:
    load = mma_balance.shoulder_load(np.radians([-45.0, 0.0]))
    assert np.allclose(load.gravity, [1.03497, 1.1926], rtol=0, atol=TENTH_OF_MILLINEWTON_METRE)
    # 0.181 and 1.011 N·m in the notes to the source; its free length is cut to 51.73 mm.
    assert np.allclose(load.spring, [0.0, 0.181], rtol=0, atol=5e-4)
    assert np.allclose(load.residual, [1.035, 1.011], rtol=0, atol=5e-4)


def test_spring_that_balances_the_worst_pose_is_far_stiffer() -> None:
    rate = mma_balance.matching_rate(1.1926, 12.1392e-3, 19.7989e-3)
    assert math.isclose(rate, 4962.0, abs_tol=0.5)
    spring = mma_balance.ShoulderSpring(rate=rate, free_length=51.7373e-3)
    assert abs(mma_balance.shoulder_load(0.0, spring).residual) < 1e-4


def test_spring_never_pulls() -> None:
    openings = np.linspace(0.0, math.pi, 50)
    torques = mma_balance.ShoulderSpring().torque(openings)
    assert (torques >= 0.0).all()
    # Beyond 135° the anchors are further apart than the spring is long.
    assert (torques[openings > AT_45_DEGREES + 1e-3] == 0.0).all()
