"""Programs: lists of copies and calls, executed once per tick."""

import os
import subprocess
import sys

import numpy as np
import pytest

from teleop_core.kernels import Array, kernel, raise_pending
from teleop_core.kernels.program import Program
from teleop_core.kernels.progress import compiled_count


@kernel
def add_one(values: Array) -> None:
    for i in range(values.shape[0]):
        values[i] += 1.0


def run(program: Program, count: int, first_ns: int = 10, tick_ns: int = 5) -> None:
    program.clock.first_ns, program.clock.tick_ns, program.clock.count = first_ns, tick_ns, count
    program.run()
    raise_pending()


def test_steps_are_executed_in_their_order_once_per_tick() -> None:
    made, a, b, rows = Program(), np.zeros(3), np.zeros(3), np.zeros((4, 3))
    made.call(add_one, a)
    made.copy(a, b)
    made.call(add_one, a)
    made.copy(b, rows, to_rows=True)
    run(made, 3)
    assert rows.tolist() == [[1.0] * 3, [3.0] * 3, [5.0] * 3, [0.0] * 3]
    assert a.tolist() == [6.0] * 3


def test_rows_of_records_are_read_and_written_tick_by_tick() -> None:
    kind = [("odd", "i4"), ("value", "f8", (2,)), ("small", "u1", (3,))]
    samples, rows, here = np.zeros(3, kind), np.zeros(3, kind), np.zeros(2)
    samples["value"], samples["small"] = np.arange(6.0).reshape(3, 2), [[1, 2, 3], [4, 5, 6], [7, 8, 9]]
    small, made = np.zeros(3, np.uint8), Program()
    made.copy(samples["value"], here, from_rows=True)
    made.copy(samples["small"], small, from_rows=True)
    made.call(add_one, here)
    made.copy(here, rows["value"], to_rows=True)
    made.copy(small, rows["small"], to_rows=True)
    run(made, 3)
    assert rows["value"].tolist() == (samples["value"] + 1.0).tolist()
    assert rows["small"].tolist() == samples["small"].tolist()
    assert not rows["odd"].any()


def test_the_time_of_a_tick_can_be_copied() -> None:
    made, times = Program(), np.zeros(3, np.int64)
    made.copy(made.now_ns, times, to_rows=True)
    run(made, 3, 100, 7)
    assert times.tolist() == [100, 107, 114]


def test_steps_of_a_trigger_are_executed_when_it_is_new() -> None:
    made, stamps, count = Program(), np.array([4, 4, 6, 6, 6, 9]), np.zeros(1)
    stamp, answered, after = np.zeros((), np.int64), np.zeros((), np.int64), np.zeros(1)
    made.copy(stamps, stamp, from_rows=True)
    with made.unless_equal(stamp, answered):
        made.call(add_one, count)
    made.call(add_one, after)
    run(made, 6)
    assert count.tolist() == [3.0]
    assert after.tolist() == [6.0]
    assert answered == 9


def test_copies_that_are_neighbours_on_one_side_alone_stay_two() -> None:
    made, source, target = Program(), np.arange(1.0, 7.0), np.zeros(6)
    made.copy(source[:2], target[:2])
    made.copy(source[2:4], target[2:4])
    made.copy(source[4:5], target[5:])
    made.copy(source[:1], target[4:5])
    run(made, 1)
    assert target.tolist() == [1.0, 2.0, 3.0, 4.0, 1.0, 5.0]


def test_a_copy_before_a_trigger_does_not_grow_by_one_after_it() -> None:
    made, source, target = Program(), np.array([1.0, 2.0]), np.zeros(2)
    known = np.zeros((), np.int64)
    made.copy(source[:1], target[:1])
    with made.unless_equal(known, known.copy()):
        made.copy(source[1:], target[1:])
    run(made, 1)
    assert target.tolist() == [1.0, 0.0]


def test_an_exception_of_a_plain_function_ends_the_run_after_its_tick() -> None:
    made, seen, count = Program(), list[int](), np.zeros(1)

    def fail_at_three() -> None:
        seen.append(len(seen))
        if len(seen) == 3:
            raise ValueError("three")

    made.call(fail_at_three)
    made.call(add_one, count)
    with pytest.raises(ValueError, match="three"):
        run(made, 10)
    assert len(seen) == 3


def test_another_program_compiles_nothing() -> None:
    first = Program()
    first.call(add_one, np.zeros(2))
    run(first, 1)
    before, other, values = compiled_count(), Program(), np.zeros(7)
    for _ in range(3):
        other.call(add_one, values)
        other.copy(values[:3], values[3:6])
    run(other, 2)
    assert compiled_count() == before
    assert values.tolist() == [6.0, 6.0, 6.0, 6.0, 6.0, 6.0, 6.0]


SESSION = """
import hashlib
from teleop_core.session import api, virtual
rows = virtual.VirtualTime(api.configuration("coarse_box", texts=["teleop.duration=1"])).run(20)
print(hashlib.sha256(rows.tobytes()).hexdigest())
"""


@pytest.mark.slow
def test_a_session_in_plain_python_has_the_bits_of_a_compiled_one() -> None:
    compiled, plain = (
        subprocess.run(
            [sys.executable, "-c", SESSION],
            env=os.environ | {"NUMBA_DISABLE_JIT": off},
            capture_output=True,
            text=True,
            check=True,
        ).stdout
        for off in ("0", "1")
    )
    assert compiled == plain
