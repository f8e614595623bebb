"""Plain Python functions in the place of kernels."""

import threading
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from numba import types

from teleop_core.base import KernelError
from teleop_core.kernels import IS_COMPILED, Array, kernel, pointer, raise_pending

compiled_only = pytest.mark.skipif(not IS_COMPILED, reason="measures the compiler")

ROW, TABLE = types.float64[::1], types.float64[:, ::1]


@kernel
def call_with_row(function: Callable[..., Any], row: Array, count: int) -> float:
    total = 0.0
    for i in range(count):
        total += function(row, float(i))
    return total


def test_plain_function_serves_in_place_of_a_kernel() -> None:
    @kernel
    def compiled(row: Any, x: Any) -> Any:
        row[0] += x
        return row[0]

    def plain(row: Array, x: float) -> float:
        assert isinstance(x, float)
        row[0] += x
        return row[0]

    signature = types.float64(ROW, types.float64)
    first, second = np.zeros(3), np.zeros(3)
    expected = call_with_row(pointer(compiled, signature), first, 5)
    assert call_with_row(pointer(plain, signature), second, 5) == expected == 20.0
    assert np.array_equal(first, second)
    raise_pending()


def test_kernel_is_made_a_pointer_once_for_each_signature_and_a_plain_function_each_time() -> None:
    @kernel
    def compiled(row: Any) -> Any:
        return row[0]

    def plain(row: Any) -> Any:
        return row[0]

    whole, real = types.int64(ROW), types.float64(ROW)
    assert pointer(compiled, real) is pointer(compiled, real)
    if IS_COMPILED:  # of one Python function there is nothing else to make
        assert pointer(compiled, real) is not pointer(compiled, whole)
        assert pointer(plain, real) is not pointer(plain, real)
    assert pointer(compiled, real)(np.full(1, 2.5)) == 2.5


def test_an_error_in_a_kernel_that_is_called_through_a_pointer_ends_its_caller() -> None:
    @kernel
    def broken(row: Any, x: Any) -> Any:
        if x > 1.0:
            raise ValueError("beyond")
        return row[0]

    made = pointer(broken, types.float64(ROW, types.float64))
    assert call_with_row(made, np.ones(3), 2) == 2.0
    with pytest.raises(ValueError, match="beyond"):
        call_with_row(made, np.ones(3), 3)


def test_plain_function_gets_tables_flags_and_counts() -> None:
    seen = []

    def plain(table: Array, flag: bool, count: int) -> int:
        seen.append((table.shape, flag, count))
        table[1, 2] = count
        return count + 1

    @kernel
    def call(function: Callable[..., object], table: Array, flag: bool) -> object:
        return function(table, flag, 7)

    table = np.zeros((2, 3))
    signature = types.int64(TABLE, types.boolean, types.int64)
    assert call(pointer(plain, signature), table, True) == 8
    assert seen == [((2, 3), True, 7)]
    assert table[1, 2] == 7.0
    assert call(pointer(plain, signature), np.zeros((4, 3)), False) == 8
    assert seen[1] == ((4, 3), False, 7)


def test_plain_function_may_return_nothing_and_may_be_any_callable() -> None:
    class Mover:
        def __init__(self) -> None:
            self.calls = 0

        def __call__(self, row: Array) -> None:
            self.calls += 1
            row[:] = self.calls

    @kernel
    def call(function: Callable[..., object], row: Array) -> None:
        function(row)
        function(row)

    mover, row = Mover(), np.zeros(2)
    call(pointer(mover, types.void(ROW)), row)
    assert row.tolist() == [2.0, 2.0]


def test_plain_function_called_from_python_is_itself() -> None:
    def plain(row: Array, x: float) -> None:
        raise ValueError("from Python at once")

    with pytest.raises(ValueError, match="at once"):
        pointer(plain, types.float64(ROW, types.float64))(np.zeros(1), 0.0)
    raise_pending()


@compiled_only
def test_first_exception_of_a_plain_function_waits_until_the_block_is_over() -> None:
    def plain(row: Array, x: float) -> float:
        if x >= 2.0:
            raise ValueError(f"tick {x}")
        return 1.0

    row = np.full(2, 5.0)
    assert call_with_row(pointer(plain, types.float64(ROW, types.float64)), row, 5) == 2.0
    assert row.tolist() == [5.0, 5.0]
    with pytest.raises(ValueError, match=r"tick 2\.0"):
        raise_pending()
    raise_pending()


@compiled_only
def test_result_of_another_type_counts_as_an_exception() -> None:
    def wrong(row: Array, x: float) -> str:
        return "three"

    call_with_row(pointer(wrong, types.float64(ROW, types.float64)), np.zeros(1), 1)
    with pytest.raises(ValueError, match="three"):
        raise_pending()


@compiled_only
def test_plain_functions_run_in_threads_and_each_thread_gets_its_own_exceptions() -> None:
    def plain(row: Array, x: float) -> float:
        row[0] += 1.0
        if threading.current_thread().name == "bad":
            raise ValueError("bad")
        return x

    function = pointer(plain, types.float64(ROW, types.float64))
    found: dict[str, tuple[Any, Any, str | None]] = {}

    def work() -> None:
        row = np.zeros(2)
        total: Any = call_with_row(function, row, 2_000)
        try:
            raise_pending()
        except ValueError as error:
            found[threading.current_thread().name] = (total, row[0], str(error))
        else:
            found[threading.current_thread().name] = (total, row[0], None)

    threads = [threading.Thread(target=work, name=name) for name in ("good", "bad", "fine")]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    good = (1_999_000.0, 2_000.0, None)
    assert found == {"good": good, "fine": good, "bad": (0.0, 2_000.0, "bad")}
    raise_pending()


@compiled_only
@pytest.mark.parametrize(
    ("signature", "message"),
    [
        (types.float64(ROW), r"test_kernel_callables.py:\d+: 'takes_two' must take 1 argument"),
        (types.float64(ROW, ROW, ROW), "'takes_two' must take 3 arguments"),
        (types.float64(ROW, types.float32), "argument 2 of 'takes_two' is float32, must be float64, int64, bool"),
        (types.float64(ROW, types.float64[:]), "argument 2 of 'takes_two' is array.*must be .* C-contiguous"),
        (types.complex128(ROW, ROW), "result of 'takes_two' is complex128, must be void, float64 or int64"),
    ],
)
def test_signature_that_a_plain_function_cannot_have_is_refused(signature: Any, message: str) -> None:
    def takes_two(row: Any, x: Any) -> float:
        return 0.0

    with pytest.raises(KernelError, match=message):
        pointer(takes_two, signature)
