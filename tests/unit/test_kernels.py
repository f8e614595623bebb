"""Kernels: what the decorators give, with the compiler and without."""

import os
import subprocess
import sys
from typing import Any

import numpy as np
import pytest

from teleop_core.kernels import IS_COMPILED, bound, inner, is_kernel, kernel, kernel_from_source, records
from teleop_core.kernels.geometry import multiply_quaternions

compiled_only = pytest.mark.skipif(not IS_COMPILED, reason="measures the compiler")


def uncached(text: str, name: str) -> Any:
    """Kernel of a text; it has no file, so every process compiles it."""
    space = {"kernel": kernel, "inner": inner}
    exec(text, space)
    return space[name]


@inner
def power(x: float, n: int) -> float:
    return x**n


@kernel
def polynomial(x: float) -> float:
    return power(x, 2) + power(x, 3)


def test_kernel_bound_to_its_arguments_does_the_same() -> None:
    a, b = np.array([0.5, 0.5, 0.5, 0.5]), np.array([0.8, 0.0, 0.6, 0.0])
    direct, through = np.empty(4), np.empty(4)
    multiply_quaternions(a, b, direct)
    step = bound(multiply_quaternions, a, b, through)
    step()
    assert np.array_equal(direct, through)
    a[:] = (1.0, 0.0, 0.0, 0.0)
    step()
    assert np.array_equal(through, b)


@compiled_only
def test_inner_kernel_refuses_a_call_from_python_and_serves_kernels() -> None:
    assert polynomial(2.0) == 12.0
    with pytest.raises(TypeError, match="power is called by kernels only"):
        power(2.0, 3)


@compiled_only
def test_numbers_written_in_a_call_share_one_compilation() -> None:
    called = "@inner\ndef power(x, n):\n    return x**n\n"
    caller = "@kernel\ndef both(x):\n    return power(x, 2) + power(x, 3)\n"
    both = uncached(called + caller, "both")
    assert both(2.0) == 12.0
    assert len(both.py_func.__globals__["power"].dispatcher.overloads) == 1


@compiled_only
def test_arrays_and_fields_of_all_lengths_share_one_compilation() -> None:
    called = "@inner\ndef first(x):\n    return x[0]\n"
    caller = "@kernel\ndef both(r, x):\n    return first(r.two) + first(r.three) + first(x)\n"
    both = uncached(called + caller, "both")
    record = records([("two", "f8", (2,)), ("three", "f8", (3,))])[0]
    record.two[:], record.three[:] = (1.0, 2.0), (4.0, 5.0, 6.0)
    assert both(record, np.array([10.0])) == 15.0
    assert len(both.py_func.__globals__["first"].dispatcher.overloads) == 1


SLICE = """
import numpy as np
from teleop_core.kernels import kernel
from teleop_core.kernels.progress import compiled_count

@kernel
def fill(row, values):
    row[:, 0] = values

row = np.zeros((3, 2))
fill(row, np.ones(3))
print(row[:, 0].sum(), compiled_count())
try:
    fill(row, np.ones(4))
except ValueError as error:
    print(error)
"""


@compiled_only
def test_slice_is_assigned_and_checked_without_compiling_functions_on_texts() -> None:
    command = [sys.executable, "-c", SLICE]
    done = subprocess.run(command, capture_output=True, text=True, timeout=100, check=True)
    assert done.stdout == "3.0 2\ncannot assign slice from input of different size\n"


def test_what_the_decorators_made_is_told_from_other_functions() -> None:
    def plain(x: int) -> int:
        return x

    assert all(is_kernel(value) for value in (power, polynomial, multiply_quaternions))
    assert is_kernel(kernel_from_source("def f(x): return x", "f", {}))
    assert not any(map(is_kernel, (plain, plain(1), np.sin, None, [], kernel)))


def test_record_has_its_fields_as_attributes_and_shares_its_memory() -> None:
    rows = records([("gain", "f8"), ("point", "f8", (3,)), ("count", "i8")], 2)
    row = rows[1]
    row.gain, row.count = 2.5, 4
    row.point[:] = 1.0
    assert rows["gain"].tolist() == [0.0, 2.5]
    assert rows["count"].tolist() == [0, 4]
    assert rows["point"].sum() == 3.0


def test_field_named_like_something_that_numpy_numbers_have_is_the_field() -> None:
    @kernel
    def total(row: Any) -> Any:
        row.min = 3.0
        return row.size + row.min

    row = records([("size", "f8"), ("min", "f8")])[0]
    row.size = 4.0
    assert total(row) == 7.0
    assert (row.size, row.min) == (4.0, 3.0)
    with pytest.raises(AttributeError, match="record has no field 'sise'"):
        row.sise = 1.0
    with pytest.raises(AttributeError, match="record has no field 'sise'; did you mean 'size'"):
        print(row.sise)


def test_kernel_from_source_calls_what_it_is_given_and_is_made_once() -> None:
    text = "def twice(x):\n    return polynomial(x) * FACTOR\n"
    made = kernel_from_source(text, "twice", {"polynomial": polynomial, "FACTOR": 2.0})
    assert made(2.0) == 24.0
    assert kernel_from_source(text, "twice", {"polynomial": polynomial, "FACTOR": 2.0}) is made
    assert kernel_from_source(text, "twice", {"polynomial": polynomial, "FACTOR": 3.0})(2.0) == 36.0


def test_kernel_that_makes_an_array_is_called_by_a_generated_one_that_is_compiled_before_it() -> None:
    text = "@kernel\ndef swapped(x, y):\n    pair = np.empty(2)\n    pair[0], pair[1] = y, x\n"
    space = {"kernel": kernel, "np": np}
    exec(text + "    return pair[0] - pair[1]\n", space)
    source = "def call(x, y):\n    return swapped(x, y)\n"
    assert kernel_from_source(source, "call", {"swapped": space["swapped"]})(1.0, 3.0) == 2.0


def test_traceback_of_generated_source_shows_its_line() -> None:
    broken = kernel_from_source("def pick(row, i):\n    return row[i]\n", "pick", {})
    with pytest.raises(IndexError) as raised:
        broken.py_func([], 3)
    assert str(raised.traceback[-1].statement).strip() == "return row[i]"


PURE = """
import numpy as np
from numba import types
from teleop_core.kernels import (IS_COMPILED, bound, inner, is_kernel, kernel, kernel_from_source,
                                 pointer, raise_pending, records)

@inner
def deep(row): return row.gain

@kernel
def top(row, function): return function(deep(row))

row = records([("gain", "f8")])[0]
row.gain = 4.0
half = pointer(kernel_from_source("def half(x): return x * HALF", "half", {"HALF": 0.5}),
               types.float64(types.float64))
print(IS_COMPILED, type(top).__name__, top.py_func is top, is_kernel(deep), is_kernel(print))
print(top(row, half), deep(row), bound(top, row, half)(), raise_pending())
"""


def test_without_the_compiler_kernels_are_python_functions_that_give_the_same() -> None:
    done = subprocess.run(
        [sys.executable, "-c", PURE],
        capture_output=True,
        text=True,
        check=True,
        env={**os.environ, "NUMBA_DISABLE_JIT": "1"},
    )
    assert done.stdout.splitlines() == ["False function True True False", "2.0 4.0 2.0 None"]
