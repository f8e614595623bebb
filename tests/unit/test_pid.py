"""PID: poles where they are claimed, no windup, no derivative kick."""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.linalg import expm

from teleop_core.kernels.geometry import Array
from teleop_core.robots.arms.rcrt1_dynamics import DRIVES
from teleop_core.slave.controllers.pid import critically_damped_gains, pid_step

DT = 1e-3
GAINS = np.stack(critically_damped_gains(DRIVES.inertia, DRIVES.viscous, DRIVES.bandwidth), axis=1)
AXES = (0, 2, 5)


def run(
    errors: Any,
    gains: Sequence[float] | Array = (2.0, 0.0, 0.0),
    limit: float = math.inf,
    memory: Array | None = None,
    feedforward: float = 0.0,
) -> tuple[Array, Array]:
    """Efforts for a sequence of errors, and the memory after it."""
    memory = np.array([0.0, -errors[0], 0.0]) if memory is None else memory
    row = np.array(gains, dtype=float)
    efforts = [pid_step(0.0, -e, row, memory, feedforward, limit, DT) for e in errors]
    return np.array(efforts), memory


def loop_matrix(axis: int) -> Array:
    """One tick of an axis under its PID, linear: states q, dq, integral, last q, its rate."""
    inertia, viscous = DRIVES.inertia[axis], DRIVES.viscous[axis]
    plant = np.array([[0, 1, 0], [0, -viscous / inertia, 1 / inertia], [0, 0, 0]])
    one_tick = expm(plant * DT)

    def tick(state: Array) -> Array:
        memory = state[2:].copy()
        effort = pid_step(0.0, state[0], GAINS[axis], memory, 0.0, math.inf, DT)
        moved = one_tick @ np.array([state[0], state[1], effort])
        return np.array([moved[0], moved[1], *memory])

    return np.stack([tick(unit) for unit in np.eye(5)], axis=1)


@given(st.floats(1e-4, 50.0), st.floats(0.0, 1.0), st.floats(1.0, 300.0))
def test_gains_put_three_poles_at_the_bandwidth(inertia: float, friction_share: float, bandwidth: float) -> None:
    viscous = friction_share * 3.0 * inertia * bandwidth
    kp, ki, kd = critically_damped_gains(np.array([inertia]), np.array([viscous]), np.array([bandwidth]))
    polynomial = np.array([inertia, (viscous + kd)[0], kp[0], ki[0]])
    wanted = inertia * np.poly([-bandwidth] * 3)
    assert np.allclose(polynomial, wanted, rtol=1e-12, atol=0)
    _, _, kd = critically_damped_gains(np.array([1.0]), np.array([100.0]), np.array([10.0]))
    assert kd[0] == 0.0  # friction damps more than is wanted


@pytest.mark.parametrize("axis", AXES)
def test_sampled_loop_of_every_axis_is_stable_and_well_damped(axis: int) -> None:
    poles = np.linalg.eigvals(loop_matrix(axis))
    poles = np.log(poles[np.abs(poles) > 1e-6].astype(complex)) / DT
    slow = poles[np.abs(poles) < 2.0 * DRIVES.bandwidth[axis]]
    # The tick and the rate filter delay by 2 ms, an eighth of the pole's time constant: the
    # triple pole splits and its slow pair comes to two thirds of the bandwidth.
    assert len(slow) >= 2
    assert poles.real.max() < -0.6 * DRIVES.bandwidth[axis]
    damping = -slow.real / np.abs(slow)
    assert damping.min() > 0.9


@pytest.mark.parametrize("axis", AXES)
def test_a_step_of_the_setpoint_gives_the_derivative_no_kick(axis: int) -> None:
    memory, gains = np.zeros(3), GAINS[axis].copy()
    gains[:2] = 0.0
    assert pid_step(1.0, 0.0, gains, memory, 0.0, math.inf, DT) == 0.0


def test_proportional_part_is_immediate_and_the_feedforward_is_added_before_the_limit() -> None:
    efforts, _ = run([0.5, -0.25])
    assert np.array_equal(efforts, (1.0, -0.5))
    efforts, _ = run([0.5], feedforward=3.0, limit=3.5)
    assert efforts[0] == 3.5
    assert run([0.5], feedforward=3.0)[0][0] == 4.0


def test_integral_part_sums_the_error_and_the_derivative_reaches_its_rate_within_ten_ticks() -> None:
    efforts, memory = run([0.5] * 1000, gains=(0.0, 2.0, 0.0))
    assert math.isclose(efforts[-1], 2.0 * 0.5 * 1.0, rel_tol=1e-12)
    assert math.isclose(memory[0], 1.0, rel_tol=1e-12)
    errors = np.arange(20) * DT * 3.0
    efforts, _ = run(errors, gains=(0.0, 0.0, 2.0))
    # The filter halves what is missing in every tick.
    assert math.isclose(efforts[10], 6.0, rel_tol=2.0**-9)
    assert (np.diff(efforts[1:]) > 0.0).all()


efforts_and_gains = st.tuples(st.floats(0.0, 1e4), st.floats(0.0, 1e5), st.floats(0.0, 1e2))


@given(st.lists(st.floats(-10.0, 10.0), min_size=1, max_size=50), efforts_and_gains)
def test_effort_never_exceeds_the_limit(errors: list[float], gains: tuple[float, float, float]) -> None:
    efforts, _ = run(errors, gains, limit=5.9)
    assert np.abs(efforts).max() <= 5.9


@given(st.lists(st.floats(-1.0, 1.0), min_size=1, max_size=300), st.sampled_from(list(AXES)))
def test_integral_never_grows_beyond_what_the_drive_can_give(errors: list[float], axis: int) -> None:
    limit, memory = DRIVES.effort_limit[axis], np.zeros(3)
    for error in np.repeat(errors, 3):
        pid_step(0.0, -error, GAINS[axis], memory, 0.0, limit, DT)
        # It grows only while the whole effort is inside the limit, so the other parts, of at
        # most this size, may hold it at limit plus themselves.
        rest = GAINS[axis, 0] * 1.0 + GAINS[axis, 2] * 2.0 / DT
        assert abs(memory[0]) <= limit + rest + GAINS[axis, 1] * DT


@pytest.mark.parametrize("axis", AXES)
def test_integral_stands_still_while_a_drive_is_saturated_which_ends_as_soon_as_the_error_turns(axis: int) -> None:
    limit = DRIVES.effort_limit[axis]
    error = 2.0 * limit / GAINS[axis, 0]
    _, memory = run([error] * 10_000, GAINS[axis], limit)
    assert memory[0] == 0.0
    efforts, _ = run([-error] * 3, GAINS[axis], limit, memory)
    assert (efforts == -limit).all()


def test_integral_may_shrink_while_the_drive_is_saturated() -> None:
    memory = np.array([100.0, 0.1, 0.0])
    pid_step(0.0, 0.1, np.array([1.0, 50.0, 0.0]), memory, 0.0, 5.9, DT)
    assert memory[0] < 100.0
