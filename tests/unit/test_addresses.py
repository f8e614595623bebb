"""Kernels called by address: any arguments, one caller."""

from typing import Any, NamedTuple

import numpy as np
import pytest
from numba import types

from teleop_core.kernels import (
    Array,
    Fields,
    PerJoint,
    Vector3,
    addressed,
    call_address,
    kernel,
    pointer,
    raise_pending,
    record,
)
from teleop_core.kernels.addresses import copy_memory, word_at
from teleop_core.kernels.progress import compiled_count


class Spring(Fields):
    pull: PerJoint
    anchor: Vector3
    stiffness: float


class Parts(NamedTuple):
    law: Any
    plane: Array
    spring: Spring


LAW = types.void(types.float64[::1], types.float64)


@kernel
def double(values: Array, factor: float) -> None:
    for i in range(values.shape[0]):
        values[i] *= 2.0 * factor


@kernel
def everything(
    parts: Parts, column: Array, rows: Any, spring: Spring, pair: tuple[int, float], is_on: bool, small: Any
) -> None:
    """Write into each array and record what the other arguments contain."""
    column[:] = pair[0] + pair[1] + small
    for i in range(spring.pull.shape[0]):
        spring.pull[i] = parts.spring.pull[i] + rows[1].stiffness
    parts.plane[1, 0] = 5.0 if is_on else 6.0
    parts.law(spring.anchor, 3.0)


@kernel
def run_all(table: Any) -> None:
    for i in range(table.shape[0]):
        call_address(table[i, 0], table[i, 1])


def _run(made: Any) -> None:
    run_all(table_of(made))
    raise_pending()


def arguments(joints: int) -> tuple[Any, ...]:
    from teleop_core.kernels import record_array

    spring, other, rows = record(Spring, joints), record(Spring, joints), record_array(Spring, 3, joints)
    other.pull[:] = np.arange(joints)
    spring.anchor[:] = 1.0, 2.0, 3.0
    rows["stiffness"] = [1.0, 10.0, 100.0]
    parts = Parts(pointer(double, LAW), np.zeros((2, 3)), other)
    return parts, np.zeros((4, 2))[:, 1], rows, spring, (7, 0.25), True, np.int32(-2)


def table_of(*bound: Any) -> Any:
    return np.array([[one.address, one.block_address] for one in bound], np.int64)


def test_a_kernel_called_by_address_does_what_the_kernel_does() -> None:
    direct, by_address = arguments(5), arguments(5)
    everything.py_func(*direct)
    made = addressed(everything, *by_address)
    run_all(table_of(made))
    for expected, found in zip(direct[1:4], by_address[1:4], strict=True):
        assert np.array_equal(expected, found)
    assert by_address[1].tolist() == [5.25] * 4
    assert by_address[3].pull.tolist() == [10.0, 11.0, 12.0, 13.0, 14.0]
    assert by_address[3].anchor.tolist() == [6.0, 12.0, 18.0]
    assert by_address[0].plane.tolist() == direct[0].plane.tolist()


def test_a_list_of_other_kernels_and_sizes_compiles_nothing_in_its_caller() -> None:
    held = [addressed(everything, *arguments(n)) for n in (2, 3)]
    run_all(table_of(*held))
    before = compiled_count()
    more = [addressed(everything, *arguments(n)) for n in (4, 16)]
    run_all(table_of(*more, *held))
    assert compiled_count() == before


def test_a_plain_python_function_is_called_by_address_too() -> None:
    seen: list[int] = []
    made = addressed(seen.append, 4)
    run_all(table_of(made, made))
    assert seen == [4, 4]


def test_an_exception_of_a_plain_python_function_is_raised_after_the_list() -> None:
    made = addressed(int, "four")
    with pytest.raises(ValueError, match="four"):
        _run(made)


@kernel
def take_all(source: Array, target: Array) -> None:
    target[:] = source


def test_what_a_kernel_called_by_address_raises_comes_to_its_caller() -> None:
    made = addressed(take_all, np.ones(3), np.zeros(2))
    with pytest.raises(ValueError, match=r"size|shape"):
        run_all(table_of(made))


def test_memory_is_copied_from_address_to_address() -> None:
    source, target = np.arange(5.0), np.zeros(5)

    @kernel
    def move_odd(a: int, b: int) -> None:
        copy_memory(a, b, 19)

    @kernel
    def move(a: int, b: int) -> int:
        copy_memory(a + 8, b, 24)
        return word_at(b + 8)

    copy_bytes = np.arange(20, dtype=np.uint8), np.zeros(20, np.uint8)
    move_odd(copy_bytes[0].ctypes.data, copy_bytes[1].ctypes.data)
    assert copy_bytes[1].tolist() == [*range(19), 0]
    word = move(source.ctypes.data, target.ctypes.data)
    assert target.tolist() == [1.0, 2.0, 3.0, 0.0, 0.0]
    assert np.array([word]).view(np.float64)[0] == 2.0
