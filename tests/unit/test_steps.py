"""Steps of setpoints: speeds are those of each two setpoints, however many are judged together."""

import numpy as np

from teleop_core.bags.messages import layout
from teleop_core.graph.signals import DT
from teleop_core.graph.topics import SLAVE_SETPOINT_JS
from teleop_core.robots import load_robot
from teleop_drill.simulation.steps import StepReader, StepSpeeds


def test_each_step_is_judged_wherever_blocks_of_setpoints_begin() -> None:
    robot = load_robot("rcrt1")
    form, rng = layout(SLAVE_SETPOINT_JS, robot.joint_names), np.random.default_rng(3)
    q = robot.home + 1e-3 * np.cumsum(rng.uniform(-1.0, 1.0, (200, robot.n)), axis=0)
    tips = np.array([robot.fk(one)[:3, 3] for one in q])
    speeds, ways = np.abs(np.diff(q, axis=0)) / DT, np.linalg.norm(np.diff(tips, axis=0), axis=1) / DT
    for size in (1, 2, 63, 64, 65, 200):
        reader, every = StepReader(form, robot), list[StepSpeeds | None]()
        for k, one in enumerate(q):
            reader.add(form.encode_one(k, one) + b"\0\0")  # rclpy pads the end of some messages
            if (k + 1) % size == 0 or k == len(q) - 1:
                every.append(reader.steps())
        found = [one for one in every if one is not None]
        assert len(found) == len(every)
        assert sum(one.number for one in found) == len(q) - 1
        np.testing.assert_allclose(np.max([one.joints for one in found], axis=0), speeds.max(axis=0), atol=1e-9)
        np.testing.assert_allclose(max(one.tip for one in found), ways.max(), atol=1e-9)
        assert np.array_equal(found[-1].setpoint, q[-1])
        at = 0
        for one in found:
            own = slice(at, at + one.number)
            if one.number:
                np.testing.assert_allclose(one.joints, speeds[own].max(axis=0), atol=1e-9)
                np.testing.assert_allclose(one.tip, ways[own].max(), atol=1e-9)
            at += one.number


def test_a_message_of_another_form_ends_the_row_of_steps() -> None:
    robot = load_robot("rcrt1")
    form = layout(SLAVE_SETPOINT_JS, robot.joint_names)
    reader = StepReader(form, robot)
    assert reader.steps() is None
    reader.add(bytes(form.size))
    assert reader.steps() is None
    reader.add(form.encode_one(0, robot.home))
    assert (first := reader.steps()) is not None
    assert first.number == 0


def test_a_setpoint_that_is_not_a_number_is_infinitely_fast() -> None:
    robot = load_robot("rcrt1")
    form = layout(SLAVE_SETPOINT_JS, robot.joint_names)
    reader = StepReader(form, robot)
    reader.add(form.encode_one(0, robot.home * np.nan))
    assert (found := reader.steps()) is not None
    assert np.isinf([*found.joints, found.tip]).all()
