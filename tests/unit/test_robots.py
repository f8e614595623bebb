"""Robots as parts: what one caller writes no other sees, and names lead to robots."""

from dataclasses import fields

import numpy as np
import pytest

from teleop_core.robots import list_robots, load_robot
from teleop_core.robots.drives import ENTRIES, Drives

robots = pytest.mark.parametrize("name", list_robots())


def arrays_of(robot):
    """Every public array of a robot, by name."""
    found = {name: getattr(robot, name) for name in ("lower", "upper", "home", "geometry_row")}
    found |= {"limits()": robot.limits(), "limits(dt)": robot.limits(1e-3)}
    for part in (robot.drives, robot.dynamics):
        values = {entry.name: getattr(part, entry.name) for entry in fields(part)}
        found |= {k: value for k, value in values.items() if isinstance(value, np.ndarray)}
    return found


# What is shared is read-only, what is writable is the caller's.


def test_a_robot_whose_drives_are_stopped_stops_no_other():
    speed = load_robot("rcrt1").drives.speed_limit.copy()
    with pytest.raises(ValueError, match="read-only"):
        load_robot("rcrt1").drives.speed_limit[:] = 0.0
    assert np.array_equal(load_robot("rcrt1").drives.speed_limit, speed)


@robots
def test_two_loads_share_no_array_that_can_be_written(name):
    one, two = arrays_of(load_robot(name)), arrays_of(load_robot(name))
    for entry, array in one.items():
        if array.flags.writeable:
            assert not any(np.shares_memory(array, other) for other in two.values()), entry


@robots
def test_writing_what_can_be_written_changes_no_answer(name):
    robot = load_robot(name)
    pose = robot.fk(robot.home)
    before = robot.fk(robot.home), robot.ik(pose).q, robot.limits(1e-3), robot.jacobian(robot.home)
    for array in arrays_of(robot).values():
        if array.flags.writeable:
            array[:] = 0
    after = robot.fk(robot.home), robot.ik(pose).q, robot.limits(1e-3), robot.jacobian(robot.home)
    assert all(np.array_equal(a, b) for a, b in zip(before, after, strict=True))


@robots
def test_tables_of_a_robot_are_read_only(name):
    arrays = arrays_of(load_robot(name))
    for entry in set(arrays) - {"geometry_row", "limits()", "limits(dt)"}:
        assert not arrays[entry].flags.writeable, entry
    with pytest.raises(TypeError):
        load_robot(name).geometry["L6"] = 1.0


def test_a_table_of_drives_keeps_what_it_was_made_with():
    values = {name: np.ones(2) for name in ENTRIES}
    drives = Drives(**values)
    values["inertia"][:] = 7.0
    assert np.array_equal(drives.inertia, [1.0, 1.0])
    assert values["inertia"].flags.writeable


@robots
def test_no_kernel_is_compiled_a_second_time_for_arrays_that_cannot_be_written(name):
    robot = load_robot(name)
    pose = robot.fk(robot.home)
    robot.ik(pose)
    robot.ik(pose, robot.home)
    robot.jacobian(robot.home)
    robot.ik_all(pose)
    robot.follow(pose[None], robot.home)
    for compiled in vars(robot.kernels).values():
        for signature in getattr(compiled, "signatures", ()):
            assert all(getattr(kind, "mutable", True) for kind in signature), compiled
