"""Machine code of kernels runs without the compiler, which is loaded when something must be compiled."""

import os
import subprocess
import sys
from enum import IntEnum
from itertools import combinations
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest

from teleop_core.kernels import IS_COMPILED, Fields, PerJoint, kernel, kinds, pointer, record, record_array, store
from teleop_core.kernels.kinds import UNKNOWN, kind_of

pytestmark = pytest.mark.skipif(not IS_COMPILED, reason="nothing is compiled in pure Python")

FORBID = """
import os
import sys
if "FORBID" in os.environ:
    sys.modules["numba.core"] = None  # so that an import of numba fails
"""
SESSION = (
    FORBID
    + """
import hashlib
from teleop_core.session import api
from teleop_core.session.virtual import VirtualTime
run = VirtualTime(api.configuration("coarse_box", texts=["teleop.stages=[network]"])).run(50)
print(hashlib.sha256(run.tobytes()).hexdigest())
"""
)
OWN = (
    FORBID
    + """
import numpy as np
from teleop_core.kernels import addressed, bound, kernel, pointer, record, Fields, held, raise_pending

class Spring(Fields):
    stiffness: float
    count: int

@kernel
def double(x: float) -> float:
    return 2.0 * x

@kernel
def count(x: float) -> int:
    return int(x)

@kernel
def pull(s, row, of, names):
    if row[0] < 0.0:
        raise ValueError("it is below zero")
    s.count += 1
    row[0] = of(row[0]) * s.stiffness + names[1]
    return row[0] > 10.0

@kernel
def made(n: int):
    out = np.zeros(n)
    out[0] = np.sin(n) + np.hypot(n, 3.0)
    return out.sum(), out.size

spring, row = record(Spring), np.array([3.0])
spring.stiffness = 2.0
law = "float64(float64)"
print(pull(spring, row, pointer(double, law), (1, 0.5)), row, spring.count)
print(pull(spring, row, pointer(count, law), (1, 0.5)), row, spring.count)
print(bound(pull, spring, row, pointer(double, law), (1, 0.5))(), row)
held(pull, spring, row, pointer(double, law), (1, 0.5))()
print(row, made(4))
print("numba" in sys.modules)
if "FORBID" not in os.environ:  # the compiler makes an exception again
    try:
        pull(spring, np.array([-1.0]), pointer(double, law), (1, 0.5))
    except ValueError as error:
        print(error)
"""
)


def run(folder: Path, text: str, **more: str) -> "subprocess.CompletedProcess[str]":
    """Run a script whose kernels are stored in the folder."""
    known = {name: value for name, value in os.environ.items() if not name.startswith("NUMBA_")}
    (folder / "script.py").write_text(text)
    return subprocess.run(
        [sys.executable, "script.py"],
        cwd=folder,
        env={**known, "TELEOP_KERNELS": str(folder / "kernels"), **more},
        capture_output=True,
        text=True,
        check=False,
    )


def test_a_session_runs_without_the_compiler_to_the_same_bits(tmp_path: Path) -> None:
    kept = {"TELEOP_KERNELS": str(store.folder() or "")}
    first, second = run(tmp_path, SESSION, **kept), run(tmp_path, SESSION, **kept, FORBID="1")
    assert second.returncode == 0, second.stderr
    assert first.stdout == second.stdout


def test_every_way_to_call_a_kernel_works_without_the_compiler(tmp_path: Path) -> None:
    refused = run(tmp_path, OWN, FORBID="1")
    assert "numba.core" in refused.stderr, "there was nothing stored"
    first, second = run(tmp_path, OWN), run(tmp_path, OWN)
    *values, was_loaded, error = first.stdout.splitlines()
    assert (was_loaded, error) == ("True", "it is below zero"), first.stderr
    assert second.stdout.splitlines() == [*values, "False", error]
    assert run(tmp_path, OWN, FORBID="1").stdout.splitlines() == [*values, "False"]


def test_a_damaged_image_is_made_again(tmp_path: Path) -> None:
    first = run(tmp_path, OWN)
    images = sorted((tmp_path / "kernels").rglob("*.nbo"))
    assert len(images) >= 6
    for k, file in enumerate(images):
        data = bytearray(file.read_bytes())
        data[len(data) // 2] ^= 1
        file.write_bytes((bytes(data), b"", data[: len(data) // 2])[k % 3])
    assert run(tmp_path, OWN).stdout == first.stdout
    assert run(tmp_path, OWN, FORBID="1").returncode == 0


def test_code_of_an_older_source_is_not_run(tmp_path: Path) -> None:
    first = run(tmp_path, OWN, TELEOP_KERNELS="")  # beside the source, where all versions have one name
    assert list(tmp_path.rglob("__pycache__/*.nbo"))
    later = run(tmp_path, OWN.replace("2.0 * x", "3.0 * x"), TELEOP_KERNELS="")
    assert later.returncode == 0
    assert later.stdout.splitlines()[0] != first.stdout.splitlines()[0]


class Pair(NamedTuple):
    first: float
    second: Any


class Couple(NamedTuple):
    first: float
    second: Any


class Mode(IntEnum):
    SLOW = 0


class Arm(Fields):
    speed: PerJoint
    total: float


class Turned(Fields):
    total: float
    speed: PerJoint


class Plain(Fields):
    total: float
    count: int


class Counted(Fields):
    count: int
    total: float


@kernel
def half(x: float) -> float:
    return 0.5 * x


def readonly(values: Any) -> Any:
    values.flags.writeable = False
    return values


TABLE = np.zeros((4, 4))
VALUES: list[Any] = [
    1.0, np.float64(2.0), np.float32(1.0), 1, np.int64(3), np.int32(3), True, np.bool_(False), None, 2**63,
    np.zeros(3), np.zeros(9),
    np.zeros(6)[::2], TABLE, TABLE.T, TABLE[:, :2], TABLE[:2], TABLE[1], readonly(np.zeros(3)),
    np.zeros(3, np.float32), np.zeros(3, np.int64), np.zeros(3, bool), np.zeros(3, ">f8"), np.zeros((2, 2, 2)),
    record(Arm, 6), record(Arm, 7), record(Turned, 6), record(Plain), record(Counted), record_array(Plain, 3),
    record_array(Arm, 3, 6), record_array(Arm, 3, 7)[::2], record_array(Plain, 3)[::2],
    (1.0, 2.0), (1, 2.0), (1.0,), ((1.0,), 2.0), (np.zeros(3),), Pair(1.0, 2.0), Couple(1.0, 2.0), Pair(1.0, 2),
    pointer(half, "float64(float64)"), pointer(half, "int64(float64)"), pointer(half, "float64(int64)"),
]  # fmt: skip


def test_two_values_have_one_kind_exactly_if_the_compiler_gives_them_one_type() -> None:
    from teleop_core.kernels.compiler import types_of

    found = [kind_of(value) for value in VALUES]
    types = types_of(tuple(VALUES))
    for (a, kind, type_a), (b, other, type_b) in combinations(zip(VALUES, found, types, strict=True), 2):
        if UNKNOWN not in (kind, other):
            assert (kind == other) == (type_a == type_b), (a, b, kind, other)
    assert found.count(UNKNOWN) == 2


def test_new_types_of_records_take_no_more_and_more_memory() -> None:
    for _ in range(5000):
        kind_of(record_array(Plain, 2))
    assert max(len(kinds._dtypes), len(kinds._arrays)) <= kinds._MOST
    assert kind_of(record(Plain)) == kind_of(record(Plain)) != kind_of(record(Counted))


def test_a_value_that_only_the_compiler_knows_has_no_kind() -> None:
    assert kind_of(Mode.SLOW) == kind_of((1, Mode.SLOW)) == kind_of("text") == UNKNOWN
