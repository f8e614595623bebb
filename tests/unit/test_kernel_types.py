"""Types of kernels: what mypy tells somebody who calls them wrongly."""

import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]

START = """
import numpy as np
from numba import types

from teleop_core.kernels.geometry import (
    Array,
    compose,
    is_rigid,
    multiply_quaternions,
    rotate_by_vector,
)
from teleop_core.graph.row import Row
from teleop_core.kernels import Kernel, bound, inner, kernel, pointer
from teleop_core.kernels.fields import Fields, Vector3, record


@kernel
def spring(position: Array, stiffness: float, count: int, force: Array) -> float:
    force[0] = -stiffness * position[0] * count
    return stiffness


@inner
def half(x: float) -> float:
    return 0.5 * x


class State(Fields):
    held: Vector3
    count: int


class Wider(State):
    speed: float


@inner
def hold(s: State, row: Row) -> None:
    s.held[0] = row.slave_servo_cp[0] + s.count


state, wider = record(State), record(Wider)
row, table = np.zeros(3), np.zeros((4, 4))
"""

RIGHT = """
energy: float = spring(row, 2.0, 3, force=row)
whole: float = spring(row, 2, 3, row)
multiply_quaternions(row, row, row)
rigid: bool = is_rigid(table)
step = bound(spring, row, 2.0, 3, row)
again: float = step()
call = pointer(spring, types.float64(types.float64[::1]))
through: float = call(row, 2.0, 3, row)
same: float = spring.py_func(row, 2.0, 3, row)


@kernel
def twice(x: float, other: Kernel[[float], float]) -> float:
    return half(x) + other(x)


twice(1.0, half)


@kernel
def tick(s: Wider, signals: Row, dt: float) -> None:
    hold(s, signals)
    s.speed = dt * signals.now_ns
"""

WRONG = (
    "state.heldd[0] = 1.0",
    "state.speed = 1.0",
    "state.count = 'many'",
    "def late(row: Row) -> int: return row.slave_servo_cp_nss",
    "def wrong(s: State, row: Row) -> None: tick(s, row, 1e-3)",
    "spring(row, 2.0, 3)",
    "spring(2.0, 2.0, 3, row)",
    "spring(row, row, 3, row)",
    "spring(row, 2.0, 'three', row)",
    "spring(row, 2.0, 3, power=row)",
    "name: str = spring(row, 2.0, 3, row)",
    "rotate_by_vector(row, row, row)",
    "bound(spring, row, 2.0, 3)",
    "pointer(half, types.float64(types.float64))('one')",
)


def mypy(folder: Path, text: str) -> list[int]:
    """Lines of a user's module in which strict mypy finds errors."""
    (folder / "user.py").write_text(text)
    command = [sys.executable, "-m", "mypy", "--strict", "--config-file", "pyproject.toml"]
    done = subprocess.run(
        [*command, "--no-error-summary", "--no-pretty", str(folder / "user.py")],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=False,
    )
    assert not done.stderr
    errors = [line for line in done.stdout.splitlines() if ": error: " in line]
    ours = [line for line in errors if "user.py:" in line]
    return sorted({int(line.partition("user.py:")[2].partition(":")[0]) for line in ours})


@pytest.mark.slow
def test_type_checker_finds_every_wrong_call_of_a_kernel_and_no_right_one(tmp_path: Path) -> None:
    start = START + RIGHT
    first = len(start.splitlines()) + 1
    wrong = list(range(first, first + len(WRONG)))
    assert mypy(tmp_path, start + "\n".join(WRONG) + "\n") == wrong
