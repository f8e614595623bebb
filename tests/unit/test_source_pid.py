"""Source's PID: the printed difference equations to the letter, and gains by the stated rule."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from present import present
from teleop_core.base import build
from teleop_core.kernels.geometry import Array
from teleop_core.robots import load_robot
from teleop_core.slave.controllers.source_pid import SOURCE_PID, SourcePidParameters, loaded_axes

ARM = load_robot("rcrt1")
DT = 1e-3


def gains(**parameters: tuple[float, ...]) -> Array:
    made = build(SourcePidParameters, parameters)
    return np.ascontiguousarray(SOURCE_PID.gains(made, ARM, present(ARM.drives).viscous))


@settings(max_examples=50, deadline=None)
@given(st.lists(st.tuples(st.floats(-0.1, 0.1), st.floats(-0.1, 0.1)), min_size=2, max_size=30))
def test_efforts_are_those_of_the_printed_equations(samples: list[tuple[float, float]]) -> None:
    table, memory, effort = gains(ki=(3.0,) * 6), np.zeros((6, 2)), np.zeros(6)
    integral, last = np.zeros(6), np.zeros(6)
    push, limit = np.full(6, 0.25), np.full(6, np.inf)
    for reference, joint in samples:
        q_ref, q = np.full(6, reference), np.full(6, joint)
        SOURCE_PID.control(table, memory, q_ref, q, push, limit, DT, effort)
        e = q_ref - q
        integral += table[:, 1] * DT * e
        expected = table[:, 0] * e + integral + table[:, 2] / DT * (e - last) + push
        last = e
        assert np.allclose(effort, expected, rtol=1e-12, atol=1e-12)


def test_only_the_axis_that_gravity_loads_unrelieved_has_integral_action() -> None:
    assert np.array_equal(loaded_axes(ARM), [False, False, True, False, False, False])
    assert np.array_equal(gains()[:, 1] > 0.0, loaded_axes(ARM))


@pytest.mark.parametrize("joint", range(6))
def test_closed_loop_poles_are_equal_and_real(joint: int) -> None:
    kp, ki, kd = gains()[joint]
    inertia, viscous = present(ARM.drives).inertia[joint], present(ARM.drives).viscous[joint]
    polynomial = [inertia, kd + viscous, kp] + ([ki] if ki > 0.0 else [])
    poles = np.roots(polynomial)
    # Roundings of a double and a triple root.
    assert np.allclose(poles, -present(ARM.drives).bandwidth[joint], rtol=1e-4)


def test_a_constant_error_without_integral_action_gives_a_constant_effort() -> None:
    table, memory, effort = gains(ki=(0.0,) * 6), np.zeros((6, 2)), np.zeros(6)
    off, zero, limit = np.full(6, 0.01), np.zeros(6), np.full(6, np.inf)
    SOURCE_PID.begin(memory, np.zeros(6), np.ones(6))  # what held the arm is let go
    found = []
    for _ in range(50):
        SOURCE_PID.control(table, memory, off, zero, zero, limit, DT, effort)
        found.append(effort.copy())
    assert np.allclose(found[1:], table[:, 0] * 0.01, rtol=1e-12)
