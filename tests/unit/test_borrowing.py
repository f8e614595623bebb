"""Borrowing: kernels that look at arrays count no holders, and what others make is freed."""

import sys
from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple, cast

import numpy as np
import pytest
from numba.core import runtime

from teleop_core.base.workers import apart
from teleop_core.kernels import IS_COMPILED, Array, inner, kernel

pytestmark = pytest.mark.skipif(not IS_COMPILED, reason="looks at compiled code")


class Arm(NamedTuple):
    """What a kernel is handed."""

    q: Array
    table: Array


@inner
def shifted(q: Array, by: float) -> Array:
    found = np.empty(q.shape[0])
    for i in range(q.shape[0]):
        found[i] = q[i] + by
    return found


@inner
def first_row(arm: Arm) -> Any:
    return arm.table[0]


@inner
def total(q: Array) -> float:
    found = 0.0
    for i in range(len(q)):
        found += q[i]
    return found


@kernel
def looks(arm: Arm) -> float:
    found = 0.0
    for row in arm.table:
        found += total(row[1:]) + total(arm.q)
    arm.q[0] = found
    return found


@kernel
def makes(arm: Arm) -> float:
    found = 0.0
    for i in range(arm.q.shape[0]):
        found += total(shifted(arm.q, float(i)))
    return found


@kernel
def adds(arm: Arm) -> Any:
    both = arm.q + arm.table[0]
    return both[0]


@kernel
def picks(arm: Arm) -> float:
    return total(arm.q[arm.q > 0.0])


@kernel
def hands_on(arm: Arm) -> float:
    return total(first_row(arm))


@kernel
def gives(arm: Arm) -> Array:
    return arm.q


def arm() -> Arm:
    return Arm(np.arange(4.0), np.arange(12.0).reshape(3, 4))


def code_of(function: Any, *arguments: object) -> str:
    """Code of a kernel that is compiled anew: what is kept on the disk cannot be looked at."""
    fresh: Any = kernel(function.py_func).dispatcher  # type: ignore[attr-defined]
    fresh._has_cache = True
    fresh(*arguments)
    text: str = fresh.inspect_llvm(fresh.signatures[0])
    return text[text.index("define") :].split("\n}\n", maxsplit=1)[0]


def test_a_kernel_that_only_looks_at_arrays_counts_no_holders() -> None:
    own = arm()
    assert looks(own) == 6.0 + 22.0 + 38.0 - 12.0 + 3 * 6.0
    assert "NRT_incref" not in code_of(looks, arm())
    assert "NRT_incref" in code_of(gives, arm())


@pytest.mark.parametrize("function", [looks, makes, adds, picks, hands_on, gives])
def test_calls_leave_their_arguments_with_the_holders_that_they_had(function: Callable[[Arm], object]) -> None:
    own = arm()
    function(own)
    before = [sys.getrefcount(array) for array in own]
    for _ in range(100):
        function(own)
    assert [sys.getrefcount(array) for array in own] == before


@pytest.mark.parametrize("function", [looks, makes, adds, picks, hands_on])
def test_arrays_that_a_kernel_makes_are_freed(function: Callable[[Arm], object]) -> None:
    function(arm())
    alloc, free, mi_alloc, mi_free = apart(partial(counted, function))  # where no thread of another test allocates
    assert alloc == free
    assert mi_alloc == mi_free


def counted(function: Callable[[Arm], object]) -> list[int]:
    """Numbers of blocks and arrays that fifty calls allocate and free."""
    own, memory = arm(), cast(Any, runtime)
    memory._nrt_python.memsys_enable_stats()
    before = memory.rtsys.get_allocation_stats()
    for _ in range(50):
        function(own)
    after = memory.rtsys.get_allocation_stats()
    return [getattr(after, name) - getattr(before, name) for name in ("alloc", "free", "mi_alloc", "mi_free")]


def test_an_array_that_was_handed_through_outlives_the_call() -> None:
    own = arm()
    found = gives(own)
    del own
    assert found.tolist() == [0.0, 1.0, 2.0, 3.0]
