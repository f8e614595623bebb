"""Published experiments of the RCRT-1, repeated on the simulated system, beside their figures."""

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from teleop_core.graph import STATE, TICK_NS, topics
from teleop_core.kernels.geometry import Array, roll_pitch_yaw, rotations_from_quaternions
from teleop_core.session.configuration import configure
from teleop_core.session.runner import session_ticks
from teleop_core.session.virtual import VirtualTime
from teleop_core.slave.commands import CommandStatus

DEGREE, MM = math.pi / 180.0, 1e-3
# Table 8.2: RMS and largest position error [mm]; rotation error below 0.9 degrees.
PUBLISHED = {"coarse_box": (0.338, 0.702), "fine_box": (0.293, 0.791)}
BOX_MM = {"coarse_box": 30.0, "fine_box": 3.0}


def session(scenario: str, *settings: str) -> NDArray[np.void]:
    configuration = configure(scenario, settings=settings)
    virtual = VirtualTime(configuration)
    return virtual.run(session_ticks(configuration, virtual))


@pytest.fixture(scope="module", params=PUBLISHED)
def box(request: pytest.FixtureRequest) -> tuple[str, NDArray[np.void]]:
    """Name of a box scenario and its signals, whole."""
    return request.param, session(request.param)


def position_error_mm(block: NDArray[np.void], reference: str = "slave_setpoint_cp") -> Array:
    off = block["slave_measured_cp"][:, :3] - block[reference][:, :3]
    return np.linalg.norm(off, axis=1) / MM


def rotation_error_degrees(block: NDArray[np.void]) -> Array:
    angles = [
        roll_pitch_yaw(rotations_from_quaternions(block[topic][:, 3:]))
        for topic in ("slave_measured_cp", "slave_setpoint_cp")
    ]
    return np.abs((angles[0] - angles[1] + math.pi) % (2 * math.pi) - math.pi) / DEGREE


def following(block: NDArray[np.void]) -> NDArray[np.void]:
    """Rows of a session in which the slave follows the hand."""
    return block[block["command_status"] == CommandStatus.FRESH]


def test_largest_errors_are_of_the_published_size_but_smaller(box: tuple[str, NDArray[np.void]]) -> None:
    name, block = box
    largest = position_error_mm(following(block)).max()
    assert 0.5 < largest / PUBLISHED[name][1] < 1.0


def test_rotation_error_stays_below_the_published_limit(box: tuple[str, NDArray[np.void]]) -> None:  # case 28
    assert rotation_error_degrees(box[1]).max() < 0.9


def test_slave_stays_in_the_box_within_a_millimetre(box: tuple[str, NDArray[np.void]]) -> None:  # case 30
    name, block = box
    state = block["teleop_state"]
    on = state[:, STATE["is_fixture_on"]] > 0.0
    center = state[on][:, STATE["fixture_center_x"] : STATE["fixture_center_x"] + 3]
    size = state[on][:, STATE["fixture_size_x"] : STATE["fixture_size_x"] + 3]
    assert on.sum() > 40_000
    assert np.allclose(size / MM, BOX_MM[name], rtol=0, atol=1e-9)
    outside = np.abs(block["slave_measured_cp"][on, :3] - center) - 0.5 * size
    assert outside.max() < 1.0 * MM
    # The hand wants to go 5 mm beyond the walls at the sides: it was held back, not just slow.
    wanted_out = np.abs(block["master_servo_cf"][on, :3]).max()
    assert wanted_out > 0.3


def test_device_never_pushes_harder_than_it_can(box: tuple[str, NDArray[np.void]]) -> None:
    force = np.linalg.norm(box[1]["master_measured_cf"][:, :3], axis=1)
    assert force.max() <= 3.3 * (1 + 1e-12)


def test_stamps_step_by_one_tick(box: tuple[str, NDArray[np.void]]) -> None:  # case 31
    _, block = box
    assert np.array_equal(np.diff(block["now_ns"]), np.full(len(block) - 1, TICK_NS))
    for topic in topics.STREAMS:
        is_sent = block[f"{topic.field}_ns"] > topics.NO_COMMAND_NS  # no command is in force on the way to the start
        assert is_sent[np.argmax(is_sent) :].all(), topic.name
        late_ns = TICK_NS if topic is topics.SLAVE_MEASURED_CP else 0  # of what the arm said before
        sent_ns = block["now_ns"][is_sent] - late_ns
        assert np.array_equal(block[f"{topic.field}_ns"][is_sent], sent_ns), topic.name


@pytest.mark.parametrize("seed", [1, 2])
def test_inverse_kinematics_keeps_the_tool_within_the_published_rotation_error(seed: int) -> None:
    # Home is a wrist singularity: noise of the gimbal there must not send joint 4 to its limit.
    block = session("free_motion", f"seed={seed}", "duration=20.0")
    left = topics.SLAVE_REACH.columns.index("rotation_residual")
    assert block["slave_reach"][:, left].max() < 0.9 * DEGREE


def test_toggled_fixture_does_not_disturb_the_motion() -> None:  # case 31
    # A box far larger than the motion pushes never: with and without it the bits are the same.
    settings = ("fixture.box.size=[0.5, 0.5, 0.5]", "duration=10.0")
    on = session("coarse_box", *settings)
    off = session("coarse_box", *settings, "buttons.fixture=[]")
    assert on["teleop_state"][:, STATE["is_fixture_on"]].any()
    for topic in ("slave_servo_jp", "slave_measured_js", "master_measured_cp"):
        assert np.array_equal(on[topic], off[topic]), topic
