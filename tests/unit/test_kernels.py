"""Kernels: what the decorators give, plain functions in their place, mistakes, pure Python."""

import os
import subprocess
import sys
import threading

import numpy as np
import pytest
from numba import types

from teleop_core.errors import KernelError
from teleop_core.geometry import multiply_quaternions
from teleop_core.kernels import (
    IS_COMPILED,
    bound,
    inner,
    is_kernel,
    kernel,
    kernel_from_source,
    pointer,
    raise_pending,
    records,
)

compiled_only = pytest.mark.skipif(not IS_COMPILED, reason="measures the compiler")

ROW, TABLE = types.float64[::1], types.float64[:, ::1]


def uncached(text: str, name: str):
    """Kernel of a text; it has no file, so every process compiles it."""
    space = {"kernel": kernel, "inner": inner}
    exec(text, space)
    return space[name]


@inner
def power(x, n):
    return x**n


@kernel
def polynomial(x):
    return power(x, 2) + power(x, 3)


@kernel
def call_with_row(function, row, count):
    total = 0.0
    for i in range(count):
        total += function(row, float(i))
    return total


def test_kernel_bound_to_its_arguments_does_the_same():
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
def test_inner_kernel_refuses_a_call_from_python_and_serves_kernels():
    assert polynomial(2.0) == 12.0
    with pytest.raises(TypeError, match="power is called by kernels only"):
        power(2.0, 3)


@compiled_only
def test_numbers_written_in_a_call_share_one_compilation():
    called = "@inner\ndef power(x, n):\n    return x**n\n"
    caller = "@kernel\ndef both(x):\n    return power(x, 2) + power(x, 3)\n"
    both = uncached(called + caller, "both")
    assert both(2.0) == 12.0
    assert len(both.py_func.__globals__["power"].overloads) == 1


def test_what_the_decorators_made_is_told_from_other_functions():
    def plain(x):
        return x

    assert all(is_kernel(value) for value in (power, polynomial, multiply_quaternions))
    assert is_kernel(kernel_from_source("def f(x): return x", "f", {}))
    assert not any(is_kernel(value) for value in (plain, plain(1), np.sin, None, [], kernel))


def test_python_function_of_a_kernel_does_the_same():
    assert polynomial.py_func.__name__ == polynomial.__name__ == "polynomial"
    assert polynomial(2.0) == 12.0


def test_record_has_its_fields_as_attributes_and_shares_its_memory():
    rows = records([("gain", "f8"), ("point", "f8", (3,)), ("count", "i8")], 2)
    row = rows[1]
    row.gain, row.count = 2.5, 4
    row.point[:] = 1.0
    assert rows["gain"].tolist() == [0.0, 2.5]
    assert rows["count"].tolist() == [0, 4]
    assert rows["point"].sum() == 3.0


def test_field_named_like_something_that_numpy_numbers_have_is_the_field():
    @kernel
    def total(row):
        row.min = 3.0
        return row.size + row.min

    row = records([("size", "f8"), ("min", "f8")])[0]
    row.size = 4.0
    assert total(row) == 7.0
    assert (row.size, row.min) == (4.0, 3.0)
    with pytest.raises(AttributeError, match="record has no field 'sise'"):
        row.sise = 1.0
    with pytest.raises(AttributeError, match="no attribute 'sise'"):
        print(row.sise)


def test_kernel_from_source_calls_what_it_is_given_and_is_made_once():
    text = "def twice(x):\n    return polynomial(x) * FACTOR\n"
    made = kernel_from_source(text, "twice", {"polynomial": polynomial, "FACTOR": 2.0})
    assert made(2.0) == 24.0
    assert kernel_from_source(text, "twice", {"polynomial": polynomial, "FACTOR": 2.0}) is made
    assert kernel_from_source(text, "twice", {"polynomial": polynomial, "FACTOR": 3.0})(2.0) == 36.0


def test_traceback_of_generated_source_shows_its_line():
    broken = kernel_from_source("def pick(row, i):\n    return row[i]\n", "pick", {})
    with pytest.raises(IndexError) as raised:
        broken.py_func([], 3)
    assert str(raised.traceback[-1].statement).strip() == "return row[i]"


# --- plain functions in the place of kernels


def test_plain_function_serves_in_place_of_a_kernel():
    @kernel
    def compiled(row, x):
        row[0] += x
        return row[0]

    def plain(row, x):
        assert isinstance(x, float)
        row[0] += x
        return row[0]

    signature = types.float64(ROW, types.float64)
    first, second = np.zeros(3), np.zeros(3)
    expected = call_with_row(pointer(compiled, signature), first, 5)
    assert call_with_row(pointer(plain, signature), second, 5) == expected == 20.0
    assert np.array_equal(first, second)
    raise_pending()


def test_plain_function_gets_tables_flags_and_counts():
    seen = []

    def plain(table, flag, count):
        seen.append((table.shape, flag, count))
        table[1, 2] = count
        return count + 1

    @kernel
    def call(function, table, flag):
        return function(table, flag, 7)

    table = np.zeros((2, 3))
    signature = types.int64(TABLE, types.boolean, types.int64)
    assert call(pointer(plain, signature), table, True) == 8
    assert seen == [((2, 3), True, 7)]
    assert table[1, 2] == 7.0
    assert call(pointer(plain, signature), np.zeros((4, 3)), False) == 8
    assert seen[1] == ((4, 3), False, 7)


def test_plain_function_may_return_nothing_and_may_be_any_callable():
    class Mover:
        def __init__(self):
            self.calls = 0

        def __call__(self, row):
            self.calls += 1
            row[:] = self.calls

    @kernel
    def call(function, row):
        function(row)
        function(row)

    mover, row = Mover(), np.zeros(2)
    call(pointer(mover, types.void(ROW)), row)
    assert row.tolist() == [2.0, 2.0]


def test_plain_function_called_from_python_is_itself():
    def plain(row, x):
        raise ValueError("from Python at once")

    with pytest.raises(ValueError, match="at once"):
        pointer(plain, types.float64(ROW, types.float64))(np.zeros(1), 0.0)
    raise_pending()


@compiled_only
def test_first_exception_of_a_plain_function_waits_until_the_block_is_over():
    def plain(row, x):
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
def test_result_of_another_type_counts_as_an_exception():
    call_with_row(
        pointer(lambda row, x: "three", types.float64(ROW, types.float64)), np.zeros(1), 1
    )
    with pytest.raises(ValueError, match="three"):
        raise_pending()


@compiled_only
def test_plain_functions_run_in_threads_and_each_thread_gets_its_own_exceptions():
    def plain(row, x):
        row[0] += 1.0
        if threading.current_thread().name == "bad":
            raise ValueError("bad")
        return x

    function = pointer(plain, types.float64(ROW, types.float64))
    found = {}

    def work():
        row = np.zeros(2)
        total = call_with_row(function, row, 2_000)
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
        (types.float64(ROW), r"test_kernels.py:\d+: 'takes_two' must take 1 argument"),
        (types.float64(ROW, ROW, ROW), "'takes_two' must take 3 arguments"),
        (
            types.float64(ROW, types.float32),
            "argument 2 of 'takes_two' is float32, must be float64, int64, bool",
        ),
        (
            types.float64(ROW, types.float64[:]),
            "argument 2 of 'takes_two' is array.*must be .* C-contiguous",
        ),
        (
            types.complex128(ROW, ROW),
            "result of 'takes_two' is complex128, must be void, float64 or int64",
        ),
    ],
)
def test_signature_that_a_plain_function_cannot_have_is_refused(signature, message):
    def takes_two(row, x):
        return 0.0

    with pytest.raises(KernelError, match=message):
        pointer(takes_two, signature)


# --- mistakes


MISTAKES = {
    "return row.gian": r":5: record has no field 'gian'; did you mean 'gain'\? "
    r"\(fields: gain, zero, point\)",
    "row.gian = 2.0": ":5: record has no field 'gian'",
    "return deep(row)": ":2: record has no field 'zeroo'; did you mean 'zero'",
    "return row.qqq": r":5: record has no field 'qqq' \(fields: gain, zero, point\)",
    "return row.gain + 'a'": r":5: kernel 'wrong': no add\(float64, str a\)",
    "return nothing(row)": ":5: kernel 'wrong': NameError: name 'nothing' is not defined",
    "return deep(row, 2)": ":5: kernel 'wrong': .* too many positional arguments",
    "return row.point.foo()": ":5: kernel 'wrong': Unknown attribute 'foo' of type nestedarray",
    "return row.point[0, 1]": ":5: kernel 'wrong': .*cannot index .* with 2 indices",
    "return np.linalg.nonsense(row)": "kernel 'wrong': .*no attribute 'nonsense'",
    "with row as r: pass": "kernel 'wrong': The 'with .* construct is not supported",
    "return [x for x in row.point if x].foo": "kernel 'wrong': Unknown attribute 'foo' of type",
}


@compiled_only
@pytest.mark.parametrize("line", MISTAKES)
def test_mistake_in_a_kernel_is_one_line_with_its_place(line):
    text = f"@inner\ndef deep(row): return row.zeroo\n@kernel\ndef wrong(row):\n    {line}\n"
    wrong = uncached(text, "wrong")
    wrong.py_func.__globals__["np"] = np
    row = records([("gain", "f8"), ("zero", "f8"), ("point", "f8", (3,))])[0]
    for way in (wrong, lambda row: bound(wrong, row)()):
        with pytest.raises(KernelError, match="^<string>.*" + MISTAKES[line]) as raised:
            way(row)
        assert "\n" not in str(raised.value)
        assert len(str(raised.value)) < 400
        assert raised.value.__cause__ is not None


@compiled_only
def test_mistake_in_a_pointer_or_an_argument_has_its_place_too():
    wrong = uncached("@kernel\ndef wrong(row):\n    return row.gain\n", "wrong")
    with pytest.raises(KernelError, match="<string>:3: kernel 'wrong': Unknown attribute 'gain'"):
        pointer(wrong, types.float64(ROW))
    with pytest.raises(KernelError, match="kernel 'wrong': argument 'row' must be a number, array"):
        wrong({"gain": 1.0})


@compiled_only
def test_place_of_a_mistake_is_counted_from_the_package_or_the_working_directory(tmp_path):
    text = "from teleop_core.kernels import kernel\n@kernel\ndef f(x):\n    return x.gain\nf(1.0)\n"
    (tmp_path / "own.py").write_text(text)
    done = subprocess.run(
        [sys.executable, "own.py"], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    last = done.stderr.splitlines()[-1]
    assert last.startswith("teleop_core.errors.KernelError: own.py:4: kernel 'f': Unknown attri")


# --- pure Python


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


def test_without_the_compiler_kernels_are_python_functions_that_give_the_same():
    done = subprocess.run(
        [sys.executable, "-c", PURE], capture_output=True, text=True, check=True,
        env={**os.environ, "NUMBA_DISABLE_JIT": "1"},
    )  # fmt: skip
    assert done.stdout.splitlines() == ["False function True True False", "2.0 4.0 2.0 None"]
