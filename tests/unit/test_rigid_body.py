"""Rigid body: inertia and bias from forward dynamics alone, against the closed form."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from present import present
from teleop_core.kernels import Array, pointer
from teleop_core.robots import drives, load_robot
from teleop_core.robots.arms import rcrt1_dynamics
from teleop_core.robots.dynamics.rigid_body import invert_positive, write_model

ROW = rcrt1_dynamics.link_row()
FORWARD = pointer(rcrt1_dynamics.DYNAMICS.acceleration, drives.ACCELERATION)
# Two solves of matrices whose entries differ by 2e5.
ROUNDING = 1e-9


def model(q: Array, dq: Array) -> tuple[Array, Array]:
    out = np.empty(42)
    write_model(FORWARD, ROW, q, dq, out)
    return out[:6], out[6:].reshape(6, 6)


angles = st.lists(st.floats(-1.5, 1.5), min_size=6, max_size=6).map(np.array)


@given(angles, angles)
def test_model_of_the_arm_is_its_closed_form(q: Array, dq: Array) -> None:
    q[2] = 0.35 + 0.01 * q[2]
    bias, inertia = model(q, dq)
    D, h, c = np.empty((3, 3)), np.empty(3), np.empty(6)
    rcrt1_dynamics.inertia_matrix(q, ROW, D)
    rcrt1_dynamics.velocity_effort(q, dq, ROW, h)
    rcrt1_dynamics.gravity_effort(q, ROW, c)
    assert np.allclose(inertia[:3, :3], D, rtol=ROUNDING, atol=ROUNDING)
    assert np.allclose(bias[:3], h + c[:3], rtol=ROUNDING, atol=ROUNDING)


@given(st.integers(1, 9), st.integers(0, 2**32 - 1))
def test_inverse_of_a_positive_definite_matrix_is_that_of_lapack(n: int, seed: int) -> None:
    root = np.random.default_rng(seed).normal(size=(n, n))
    A = root @ root.T + 0.1 * np.eye(n)
    found = A.copy()
    invert_positive(found)
    assert np.allclose(found, np.linalg.inv(A), rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("name", ["scara", "puma560", "stewart", "three_finger_hand"])
def test_model_of_axes_that_do_not_act_on_each_other_is_their_inertia(name: str) -> None:
    robot = load_robot(name)
    n, dynamics = robot.n, robot.dynamics
    out = np.empty(n + n * n)
    forward = pointer(present(dynamics).acceleration, drives.ACCELERATION)
    write_model(forward, present(dynamics).parameters.copy(), robot.home.copy(), np.ones(n), out)
    assert np.array_equal(out[:n], np.zeros(n))
    assert np.allclose(out[n:].reshape(n, n), np.diag(present(robot.drives).inertia), rtol=1e-14, atol=0)
