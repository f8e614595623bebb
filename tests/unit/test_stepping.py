"""Stepping: a session that a program makes tick by tick, leads by hand, and begins again."""

from typing import Any

import numpy as np
import pytest

import teleop_core as tc
from present import present
from teleop_core.base.errors import ShapeError
from teleop_core.graph.operation import State

KINDS: Any = {
    "coarse": {},
    "delayed": {"delays": ["slave/servo_jp=0.02", "master/servo_cf=0.005"], "fixture": "box"},
    "hardware": {"plant": "hardware", "operator": "human"},
    "jointed handle": {"device.handle": "mma", "plant": "hardware"},
    "another robot": {"robot": "puma560"},
    "network": {"teleop.stages": ["network", "tremor_filter"], "network.preset": "loss_50", "operator": "human"},
}


def session(kind: str) -> tc.VirtualTime:
    return tc.VirtualTime(tc.configuration("coarse_box", settings=KINDS[kind]))


@pytest.mark.parametrize("kind", KINDS)
def test_a_session_of_single_steps_and_one_that_is_begun_again_are_that_of_a_run_to_the_bit(kind: str) -> None:
    own, stepped = session(kind), session(kind)
    first = own.run(1500)
    own.reset()
    assert own.now_ns == 0
    for other in (np.array([stepped.run(1)[0] for _ in range(1500)]), own.run(1500)):
        assert other.dtype == first.dtype
        for name in present(first.dtype.names):
            np.testing.assert_array_equal(other[name], first[name], err_msg=name)


def test_what_a_program_says_between_two_steps_holds_from_the_next_one_on() -> None:
    own: Any = tc.VirtualTime(tc.configuration("coarse_box", starts_at_home=True))
    own.run(8000)
    moving = own.run(1)[0]
    assert np.abs(own.run(1)[0]["slave_setpoint_js"] - moving["slave_setpoint_js"]).max() > 1e-6
    own.stages["slave"].request("stop")
    still = own.run(1)[0]
    assert still["slave_operation"][0] == State.FAULT
    np.testing.assert_array_equal(own.run(1)[0]["slave_setpoint_js"], still["slave_setpoint_js"])


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


def test_the_tip_goes_where_a_program_leads_the_hand_by_the_axes_and_the_gain() -> None:
    own = tc.Session("free_motion", settings={"coarse_gain": 0.5})
    begin = own.reset()
    assert begin.is_following
    assert begin.state is State.ENABLED
    assert begin.gain == pytest.approx(0.5)
    own.command([0.0, 0.02, 0.0])  # y of the master is z of the slave
    seen = own.step(50)
    assert seen.time == pytest.approx(begin.time + 1.0)
    np.testing.assert_allclose(seen.measured_cp[:3] - begin.measured_cp[:3], [0, 0, 0.01], atol=5e-4)
    np.testing.assert_array_equal(seen.servo_cp, own.values("slave/servo_cp"))


def test_a_clutch_that_a_program_presses_leaves_the_arm_where_it_is() -> None:
    own = tc.Session("free_motion")
    begin = own.reset()
    own.command([0.01, 0.01, 0.01], clutch=True)
    np.testing.assert_array_equal(own.step(25).servo_cp[:3], begin.servo_cp[:3])


def test_the_hand_goes_evenly_from_command_to_command() -> None:
    own = tc.Session("free_motion", period=0.1)
    own.reset()
    own.command([0.01, 0.0, 0.0])
    rows = own.runner.run(200)["hand_servo_cp"][:, 0]
    way = np.diff(rows)[np.diff(rows) > 0.0]  # samples go out at their own rate
    assert way.sum() == pytest.approx(0.01, rel=0.02)
    np.testing.assert_allclose(way, way[0], rtol=1e-6)


def test_a_program_that_leads_the_hand_gets_the_same_bits_again() -> None:
    own, found = tc.Session("coarse_box", settings={"plant": "hardware"}), []
    for _ in range(2):
        own.reset()
        for step in range(20):
            own.command([0.0005 * step, 0.0, 0.0])
            own.step()
        found.append(own.runner.run(1).tobytes())
    assert found[0] == found[1]
