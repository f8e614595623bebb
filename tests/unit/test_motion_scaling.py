"""Motion scaling: published frame mapping and gain ratchet, clutch, modes, box and force."""

import math
from typing import Any

import numpy as np
import pytest

from scaling_desk import ALIGNED, ANY_HAND, HOME, MM, Desk
from teleop_core.base import build
from teleop_core.coupling.mapping import gains, motion_scaling
from teleop_core.graph import TICK_NS, topics
from teleop_core.hand.operators.rest import REST_POSITION, REST_TILT
from teleop_core.kernels.geometry import Array, quaternion_from_rotation, rotation, rotation_from_quaternion

DEGREE = math.pi / 180.0
# Sums and products of a few numbers of size one.
ROUNDING = 1e-14
# Box centres are reported to a nanometre.
NANOMETRE = 1e-9


def test_the_wall_stands_around_the_stylus_and_the_slave_goes_by_what_is_left_of_it() -> None:
    desk = Desk(fixture=gains.FixtureParameters(wall="soft"))
    desk.step()
    out, force = desk.row["master_filtered_out"], desk.row["master_servo_cf"]
    size = desk.scaling.parameters["size"][0]
    out[:] = [size, 0.0, 0.0]
    desk.step()
    desk.press("fixture")
    before = desk.row["slave_servo_cp"][:3].copy()
    assert not force.any()  # the box stands around the stylus, not around what is left of it
    out[0] = 1.5 * size + 1.0 * MM  # the tip trembles out of the box
    desk.step()
    assert force[0] < 0.0
    np.testing.assert_array_equal(desk.row["slave_servo_cp"][:3], before)
    out[0] = size
    desk.step()
    assert not force.any()
    desk.hold("clutch")
    for share in np.linspace(1.0, 5.0, 20):  # what is left comes late while the box is carried
        out[0] = share * size
        desk.step()
        assert not force.any()


def mapped(stylus: Array, tool_roll: float) -> Array:
    scaling = motion_scaling.MotionScaling(gains.MotionScalingParameters(tool_roll=tool_roll, **ALIGNED))
    quaternion, tool, out = np.empty(4), np.empty(4), np.empty((3, 3))
    quaternion_from_rotation(np.ascontiguousarray(stylus), quaternion)
    motion_scaling.mapped_orientation(scaling.parameters, quaternion, tool)
    rotation_from_quaternion(tool, out)
    return out


def slave_axes(master: tuple[float, float, float], **values: Any) -> Array:
    scaling, out = motion_scaling.MotionScaling(gains.MotionScalingParameters(**values)), np.empty(3)
    motion_scaling.to_slave_axes(scaling.parameters, np.array(master), out)
    return out


def test_place_maps_to_the_published_axes() -> None:  # case 17
    assert np.array_equal(slave_axes((1.0, 2.0, 3.0)), (-3.0, -1.0, 2.0))


def test_every_stylus_attitude_maps_to_the_published_product() -> None:  # case 17
    rng = np.random.default_rng(2)
    base = np.array([[0, 0, -1], [-1, 0, 0], [0, 1, 0]])
    for angles in rng.uniform(-3.0, 3.0, (50, 3)):
        stylus = rotation("z", angles[0]) @ rotation("y", angles[1]) @ rotation("x", angles[2])
        expected = base @ stylus @ np.diag([1, -1, -1])
        assert np.allclose(mapped(stylus, 0.0), expected, rtol=0, atol=1e-13)


def test_stylus_in_the_inkwell_points_the_tool_as_at_home() -> None:  # case 18
    tool = mapped(rotation("x", -23.4 * DEGREE), math.pi / 2)
    assert np.allclose(tool, HOME[:3, :3], rtol=0, atol=ROUNDING)
    out = slave_axes((0.0, -194.414, -416.901))
    assert np.allclose(out, (416.901, 0.0, -194.414), rtol=0, atol=ROUNDING)


def test_home_offset_is_the_published_one_and_its_corrected_form() -> None:  # case 19
    inkwell = np.array(REST_POSITION) / MM
    printed_home = np.array([0.0, -194.414, -416.901])
    assert np.allclose(printed_home - inkwell, (0.0, -128.903, -328.787), rtol=0, atol=1e-9)
    # The same with the home of the joint table: x_P = -y_S, y_P = z_S, z_P = -x_S.
    x, y, z = HOME[:3, 3] / MM
    assert np.allclose(np.array([-y, z, -x]) - inkwell, (0, -116.383, -332.218), atol=5e-4)


def test_first_command_is_the_home_of_the_slave_and_moves_nothing() -> None:
    desk = Desk(**ALIGNED)
    desk.turn = rotation("x", REST_TILT)
    assert np.array_equal(desk.step(), HOME[:3, 3])
    assert np.allclose(desk.attitude(), HOME[:3, :3], rtol=0, atol=ROUNDING)
    # Already aligned: the stylus is followed absolutely from the start.
    desk.step(turn=rotation("y", 0.3))
    assert np.allclose(desk.attitude(), mapped(desk.turn, math.pi / 2), rtol=0, atol=ROUNDING)


def test_gains_ratchet_the_slave_as_published() -> None:  # case 20
    desk = Desk()
    start = desk.step()
    desk.step((10 * MM, 0, 0))
    between = desk.press("mode")
    assert np.allclose(between - start, (0, -10 * MM, 0), rtol=0, atol=ROUNDING)
    desk.step((10 * MM, 0, 0))
    desk.press("mode")
    end = desk.step((-10 * MM, 0, 0))
    assert np.allclose(end - start, (0, -1 * MM, 0), rtol=0, atol=ROUNDING)


def test_mode_parameter_switches_the_mode_at_run_time_and_others_leave_that_of_the_button() -> None:
    desk = Desk()
    desk.step()
    desk.press("mode")
    desk.scaling.retune(gains.MotionScalingParameters(plausible=ANY_HAND, coarse_gain=2.0))
    desk.step()
    assert desk.state("is_fine") == 1.0
    desk.press("mode")
    desk.scaling.retune(gains.MotionScalingParameters(plausible=ANY_HAND, mode="fine"))
    desk.step()
    assert (desk.state("is_fine"), desk.state("gain")) == (1.0, 0.1)


def test_a_command_of_many_scaled_turns_stays_a_turn() -> None:
    desk = Desk(rotation_gain=0.5)
    for _ in range(5000):
        desk.step(turn=rotation("x", 0.3))
    size = np.linalg.norm(desk.row["slave_servo_cp"][3:])
    assert abs(size - 1.0) <= 2.0 * np.finfo(float).eps


def test_clutching_without_turning_keeps_the_attitude_absolute() -> None:
    desk = Desk(**ALIGNED)
    desk.turn = rotation("x", REST_TILT)
    desk.step()
    desk.hold("clutch")
    desk.step((3 * MM, 0, 0), rotation("z", 0.4))
    desk.step((3 * MM, 0, 0), rotation("z", -0.4))
    desk.hold("clutch", is_held=False)
    desk.step()
    desk.step(turn=rotation("y", 0.3))
    assert np.allclose(desk.attitude(), mapped(desk.turn, math.pi / 2), rtol=0, atol=1e-13)


def test_slave_that_does_not_follow_holds_the_command_at_its_setpoint() -> None:
    desk = Desk()
    desk.step()
    desk.step((5 * MM, 0, 0), does_follow=False)
    stuck = desk.row["slave_setpoint_cp"].copy()
    for _ in range(200):
        command = desk.step((0.1 * MM, 0, 0), does_follow=False)
    assert desk.state("is_following") == 0.0
    assert np.array_equal(command, stuck[:3])
    assert np.array_equal(desk.step(), stuck[:3])


@pytest.mark.parametrize(("silent", "follows"), [(2, True), (3, False)])
def test_slave_of_a_slow_master_may_be_silent_for_two_samples(silent: int, follows: bool) -> None:
    desk = Desk()
    desk.step()
    for _ in range(1 + silent + 1):  # heard in the first; the last judges those before
        desk.step((1 * MM, 0, 0), stamp_step_ns=80_000_000, does_follow=False)
    assert desk.state("is_following") == float(follows)


def test_after_a_pause_of_the_master_the_command_is_where_the_slave_is_by_then() -> None:
    desk = Desk()
    for _ in range(5):
        desk.step((1 * MM, 0, 0))
    desk.row["slave_setpoint_cp_ns"] = desk.row["master_measured_cp_ns"] - TICK_NS
    desk.step((1 * MM, 0, 0), does_follow=False)
    desk.row["slave_setpoint_cp_ns"] = desk.row["master_measured_cp_ns"]
    desk.row["slave_setpoint_cp"][:3] += (0.01, 0.0, 0.02)
    elsewhere = desk.row["slave_setpoint_cp"][:3].copy()
    assert np.array_equal(desk.step((1 * MM, 0, 0), stamp_step_ns=3_000_000_000), elsewhere)


@pytest.mark.parametrize("late", [2, 3, 40])
def test_slave_follows_however_late_as_long_as_newer_commands_come_into_force(late: int) -> None:
    desk, step_ns = Desk(), 80_000_000
    desk.step()
    stamps = [int(desk.row["master_measured_cp_ns"])]
    for _ in range(late + 6):
        desk.row["slave_setpoint_cp_ns"] = stamps[max(0, len(stamps) - 1 - late)]
        desk.step((1 * MM, 0, 0), stamp_step_ns=step_ns, does_follow=False)
        stamps.append(int(desk.row["master_measured_cp_ns"]))
    assert desk.state("is_following") == 1.0
    for _ in range(4):
        desk.step((1 * MM, 0, 0), stamp_step_ns=step_ns, does_follow=False)
    assert desk.state("is_following") == 0.0


def test_reset_starts_again_at_the_setpoint_with_the_box_off_and_the_mode_of_the_parameters() -> None:
    desk = Desk()
    desk.step()
    desk.press("fixture")
    desk.press("mode")
    before = desk.step((5 * MM, 0, 0))
    desk.scaling.reset()
    assert np.array_equal(desk.step((30 * MM, 0, 0), rotation("z", 1.0)), before)
    assert (desk.state("is_fixture_on"), desk.state("is_fine")) == (0.0, 0.0)


@pytest.mark.parametrize("button", ["fixture", "mode"])
def test_button_that_stays_pressed_toggles_once(button: str) -> None:
    desk = Desk()
    desk.step()
    desk.hold(button)
    name = {"fixture": "is_fixture_on", "mode": "is_fine"}[button]
    for _ in range(5):
        desk.step()
        assert desk.state(name) == 1.0


def test_box_is_put_around_the_slave_where_the_button_was_pressed() -> None:
    desk = Desk(fixture=build(gains.FixtureParameters, {"box.size": (0.01, 0.02, 0.03)}))
    desk.step()
    desk.step((2 * MM, 0, 0))
    desk.hold("fixture")
    at_press = desk.step((1 * MM, 0, 0))
    center, size = desk.box()
    assert np.allclose(center, at_press, rtol=0, atol=NANOMETRE)
    # Slave axes are the master's -z, -x, y.
    assert np.allclose(size, (0.03, 0.01, 0.02), rtol=0, atol=ROUNDING)
    desk.step((4 * MM, 0, 0))
    assert np.allclose(desk.box()[0], at_press, rtol=0, atol=NANOMETRE)


def test_box_switched_on_while_clutched_stands_around_the_slave() -> None:
    desk = Desk(fixture=gains.FixtureParameters(wall="soft"))
    held = desk.step()
    desk.hold("clutch")
    desk.step((1 * MM, 0, 0))
    desk.hold("fixture")
    desk.step((1 * MM, 0, 0))
    assert np.allclose(desk.box()[0], held, rtol=0, atol=NANOMETRE)
    # Half a box further the hand feels its wall.
    desk.hold("clutch", is_held=False)
    desk.step()
    desk.step((15 * MM, 0, 0))
    assert math.isclose(np.abs(desk.row["master_servo_cf"]).max(), 0.0, abs_tol=1e-9)
    desk.step((1 * MM, 0, 0))
    assert math.isclose(desk.row["master_servo_cf"][0], -1.0, abs_tol=1e-9)


def test_size_of_the_box_follows_the_gain_and_a_second_press_takes_it_and_its_force_away() -> None:
    desk = Desk()
    desk.step()
    desk.press("fixture")
    for size in (3 * MM, 30 * MM):
        desk.press("mode")
        assert np.allclose(desk.box()[1], size, rtol=0, atol=ROUNDING)
    desk.step((20 * MM, 0, 0))
    assert desk.row["master_servo_cf"][0] < 0.0
    place = desk.press("fixture")
    assert not desk.row["master_servo_cf"].any()
    assert not np.concatenate(desk.box()).any()
    assert np.array_equal(desk.step(), place)


@pytest.mark.parametrize(
    ("wall", "mm", "newton"),
    [
        ("soft", 15.5, -0.5),
        ("soft", 17.0, -2.0),
        ("soft", 30.0, -3.3),
        ("step", 15.1, -3.3),
        ("source", 15.5, -1.65),
        ("source", 16.5, -3.3),
    ],
)
def test_wall_pushes_the_hand_back(wall: str, mm: float, newton: float) -> None:
    desk = Desk(fixture=gains.FixtureParameters(wall=wall))
    desk.step()
    desk.press("fixture")
    desk.step((mm * MM, 0, 0))
    expected = (newton, 0, 0, 0, 0, 0)
    assert np.allclose(desk.row["master_servo_cf"], expected, rtol=0, atol=1e-9)


def test_a_slave_that_does_not_follow_for_long_is_aligned_anew_once() -> None:
    desk = Desk()
    desk.row["slave_setpoint_cp_ns"] = topics.NO_COMMAND_NS
    for _ in range(1000):  # it homes
        desk.step(does_follow=False)
    assert not any("anew" in text for text in desk.scaling.concerns())
    for _ in range(2):
        for _ in range(50):
            desk.step((MM, 0, 0))
        for _ in range(1000):
            desk.step(does_follow=False)
    (told,) = desk.scaling.concerns()
    assert "2 times" in told
