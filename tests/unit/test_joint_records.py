"""Records with arrays over joints: their compiled code serves any number of joints."""

from typing import Annotated

import numpy as np
import pytest

from teleop_core.graph import assign
from teleop_core.kernels import (
    Array,
    Fields,
    IntegerPerJoint,
    Integers,
    PerJoint,
    Vector3,
    kernel,
    record,
    record_array,
)
from teleop_core.kernels.progress import compiled_count

JOINTS = range(1, 17)


class Arm(Fields):
    speed: PerJoint
    total: float
    inertia: Annotated[Array, "joints", "joints"]
    place: Vector3
    ticks: IntegerPerJoint
    jacobian: Annotated[Array, 3, "joints"]
    count: int
    last: PerJoint


@kernel
def sizes(arm: Arm, found: Integers) -> None:
    found[0], found[1], found[2] = arm.speed.shape[0], arm.inertia.shape[0], arm.inertia.shape[1]
    found[3], found[4], found[5] = arm.place.shape[0], arm.ticks.shape[0], arm.jacobian.shape[0]
    found[6], found[7] = arm.jacobian.shape[1], arm.last.shape[0]


@kernel
def fill(arm: Arm) -> None:
    """Write another number into each element."""
    n = 0.0
    for i in range(arm.speed.shape[0]):
        arm.speed[i], arm.ticks[i], arm.last[i] = n, i - 7, n + 0.5
        for j in range(arm.speed.shape[0]):
            n += 1.0
            arm.inertia[i, j] = n
        for k in range(3):
            n += 1.0
            arm.jacobian[k, i], arm.place[k] = n, n
    arm.total, arm.count = n, arm.last.shape[0]


@kernel
def mirror(arm: Arm, values: Array) -> None:
    """Write whole fields, as array and by name."""
    arm.speed = values
    arm["last"] = arm.speed
    arm.inertia[:, 0] = 2.0 * arm.last


def test_one_compiled_kernel_serves_every_number_of_joints() -> None:
    fill(record(Arm, 2))
    before = compiled_count()
    for n in JOINTS:
        found, plain = record(Arm, n), record(Arm, n)
        fill(found)
        fill.py_func(plain)
        assert found.count == n
        assert found == plain
    assert compiled_count() == before


@pytest.mark.parametrize("n", [1, 3, 7])
def test_compiled_code_sees_the_sizes_that_numpy_sees(n: int) -> None:
    found = np.zeros(8, np.int64)
    sizes(record(Arm, n), found)
    assert found.tolist() == [n, n, n, 3, n, 3, n, n]


@pytest.mark.parametrize("n", [2, 9])
def test_whole_fields_are_written_as_in_plain_python(n: int) -> None:
    found, plain, values = record(Arm, n), record(Arm, n), np.arange(1.0, n + 1.0)
    mirror(found, values)
    mirror.py_func(plain, values)
    assert found == plain
    assert found.last.tolist() == values.tolist()


def test_each_record_of_several_has_its_own_arrays() -> None:
    many, one = record_array(Arm, 3, 5), record(Arm, 5)
    fill(many[1])
    fill(one)
    assert many[1] == one
    assert not np.any(many[0].speed)
    assert not np.any(many[2].speed)


def test_a_record_that_is_set_to_zero_keeps_its_number_of_joints() -> None:
    arm = record(Arm, 4)
    fill(arm)
    assign(arm, 0)
    assert not np.any(arm.inertia)
    fill(arm)
    assert arm.count == 4


def test_a_copy_has_the_number_of_joints_of_the_original() -> None:
    arm = record(Arm, 6)
    copied = arm.copy()  # type: ignore[attr-defined]
    fill(copied)
    assert copied.count == 6
    assert not np.any(arm.speed)
