"""Room: small arrays of a kernel's own, which end with it."""

from typing import Any

import numpy as np
import pytest

from teleop_core.base import KernelError
from teleop_core.kernels import IS_COMPILED, Array, kernel
from teleop_core.kernels.room import room

compiled_only = pytest.mark.skipif(not IS_COMPILED, reason="looks at compiled code")


@kernel
def squares(values: Array, out: Array) -> None:
    own = room(3)
    for i in range(3):
        own[i] = values[i] * values[i]
    for i in range(3):
        out[i] += own[i]


@kernel
def doubly(values: Array, table: Array) -> int:
    first, second = room(3), room(3, 3)
    for i in range(3):
        first[i] = 0.0
        for k in range(3):
            second[i, k] = values[i] * values[k]
    for _ in range(2):
        squares(values, first)
    for i in range(3):
        for k in range(3):
            table[i, k] = first[i] if i == k else second[i, k]
    return second.shape[0] + second.size


def gives() -> Array:
    own = room(3)
    own[0] = 1.0
    return own


def test_a_kernel_computes_in_its_room_what_plain_python_does() -> None:
    values = np.array([1.0, -2.0, 3.0])
    compiled, plain = np.zeros((3, 3)), np.zeros((3, 3))
    assert doubly(values, compiled) == doubly.py_func(values, plain) == 12
    np.testing.assert_array_equal(compiled, plain)
    assert np.diag(plain).tolist() == [2.0, 8.0, 18.0]


@compiled_only
def test_a_kernel_with_room_takes_no_memory() -> None:
    fresh: Any = kernel(doubly.py_func).dispatcher  # type: ignore[attr-defined]
    fresh._has_cache = True  # what is kept on the disk cannot be looked at
    fresh(np.ones(3), np.zeros((3, 3)))
    text = fresh.inspect_llvm(fresh.signatures[0])
    body = text[text.index("define") :].split("\n}\n")[0]
    assert "NRT_" not in body


@compiled_only
def test_room_cannot_be_returned() -> None:
    with pytest.raises(KernelError, match="its scratch memory is free again"):
        kernel(gives)()


@compiled_only
def test_sizes_of_room_are_written_as_numbers() -> None:
    def grows(count: int) -> float:
        return float(room(count)[0])

    with pytest.raises(KernelError):
        kernel(grows)(3)
