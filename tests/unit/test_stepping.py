"""Stepping: a session that a program makes tick by tick, and begins again."""

from typing import Any

import numpy as np
import pytest

import teleop_core as tc
from present import present
from teleop_core.base.errors import ShapeError
from teleop_core.slave.operation import State

KINDS: Any = {
    "coarse": {},
    "delayed": {"delays": ["slave/servo_jp=0.02", "master/servo_cf=0.005"], "fixture": "box"},
    "hardware": {"plant": "hardware", "operator": "human"},
    "jointed handle": {"device.handle": "mma", "plant": "hardware"},
    "another robot": {"robot": "puma560"},
}


def session(kind: str) -> tc.VirtualTime:
    return tc.VirtualTime(tc.configuration("coarse_box", settings=KINDS[kind]))


@pytest.mark.parametrize("kind", KINDS)
def test_a_session_of_single_steps_is_that_of_a_run_to_the_bit(kind: str) -> None:
    run, stepped = session(kind), session(kind)
    block = run.run(1500)
    rows = np.array([stepped.step() for _ in range(1500)])
    assert rows.dtype == block.dtype
    for name in present(block.dtype.names):
        np.testing.assert_array_equal(rows[name], block[name], err_msg=name)


@pytest.mark.parametrize("kind", KINDS)
def test_a_session_that_is_begun_again_repeats_itself_to_the_bit(kind: str) -> None:
    own = session(kind)
    first = own.run(1500)
    own.reset()
    assert own.now_ns == 0
    second = own.run(1500)
    for name in present(first.dtype.names):
        np.testing.assert_array_equal(second[name], first[name], err_msg=name)


def test_what_a_program_says_between_two_steps_holds_from_the_next_one_on() -> None:
    own: Any = tc.VirtualTime(tc.configuration("coarse_box", starts_at_home=True))
    own.run(8000)
    moving = own.step()
    assert np.abs(own.step()["slave_setpoint_js"] - moving["slave_setpoint_js"]).max() > 1e-6
    own.stages["slave"].request("stop")
    still = own.step()
    assert still["slave_operation"][0] == State.FAULT
    np.testing.assert_array_equal(own.step()["slave_setpoint_js"], still["slave_setpoint_js"])


def test_rows_that_are_filled_again_hold_what_new_ones_would() -> None:
    own, again = (session("coarse") for _ in range(2))
    rows = again.rows(50)
    for _ in range(3):
        assert again.run(50, rows) is rows
        assert rows.tobytes() == own.run(50).tobytes()
    wrong: Any
    for wrong in (again.rows(49), np.zeros(50)):
        with pytest.raises(ShapeError, match="rows of this session"):
            again.run(50, wrong)
