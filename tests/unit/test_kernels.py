"""Compiled kernels: the disk cache notices changes in everything that a kernel calls."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from teleop_core import kernels as compiled
from teleop_core.geometry import multiply_quaternions

MODULES = {
    "inner.py": """
from teleop_core.kernels import kernel

@kernel
def factor(x: float) -> float:
    return 2.0 * x
""",
    "middle.py": """
from teleop_core.kernels import kernel
from inner import factor

@kernel
def plus_one(x: float) -> float:
    return factor(x) + 1.0
""",
    "outer.py": """
from numba import types
from teleop_core.kernels import kernel, pointer
from middle import plus_one

@kernel
def scaled(x: float) -> float:
    return 10.0 * plus_one(x)

@kernel
def through(function, x: float) -> float:
    return function(x)

print(scaled(3.0), through(pointer(plus_one, types.float64(types.float64)), 3.0))
print(sum(scaled.stats.cache_hits.values()))
""",
}


def run(folder: Path) -> tuple[list[float], int]:
    """Values and cache hits of a fresh process that imports the modules."""
    done = subprocess.run(
        [sys.executable, "outer.py"], cwd=folder, capture_output=True, text=True, check=True,
        env={**os.environ, "PYTHONDONTWRITEBYTECODE": "1", "NUMBA_CACHE_DIR": str(folder / "c")},
    )  # fmt: skip
    values, hits = done.stdout.splitlines()
    return [float(value) for value in values.split()], int(hits)


@pytest.fixture
def package(tmp_path):
    for name, text in MODULES.items():
        write(tmp_path / name, text, age=100)
    return tmp_path


def write(path: Path, text: str, age: float) -> None:
    """File that was last changed ``age`` seconds before the newest one can be."""
    path.write_text(text)
    os.utime(path, (1_000_000_000 - age, 1_000_000_000 - age))


def test_kernels_of_unchanged_files_come_from_the_cache(package):
    assert run(package) == ([70.0, 7.0], 0)
    assert run(package) == ([70.0, 7.0], 1)


@pytest.mark.parametrize("name", ["inner.py", "middle.py"])
def test_change_in_a_called_file_reaches_its_cached_callers(package, name):
    run(package)
    changed = MODULES[name].replace("2.0 * x", "5.0 * x").replace("+ 1.0", "+ 4.0")
    write(package / name, changed, age=50)
    expected = 16.0 if name == "inner.py" else 10.0
    assert run(package) == ([10.0 * expected, expected], 0)


def test_older_version_of_a_called_file_is_noticed_too(package):
    run(package)
    # Restored from a backup: older than the cache, and longer by a comment.
    write(package / "inner.py", MODULES["inner.py"].replace("2.0", "3.0") + "# old\n", age=500)
    assert run(package)[0] == [100.0, 10.0]


@pytest.mark.parametrize("name", ["inner.py", "middle.py", "outer.py"])
def test_older_version_of_the_same_length_is_noticed_too(package, name):
    run(package)
    old = MODULES[name].replace("2.0 * x", "3.0 * x").replace("+ 1.0", "+ 4.0")
    write(package / name, old.replace("10.0 *", "20.0 *"), age=500)
    assert run(package)[0] != [70.0, 7.0]


def test_kernel_bound_to_its_arguments_does_the_same():
    a, b = np.array([0.5, 0.5, 0.5, 0.5]), np.array([0.8, 0.0, 0.6, 0.0])
    direct, through = np.empty(4), np.empty(4)
    multiply_quaternions(a, b, direct)
    step = compiled.bound(multiply_quaternions, a, b, through)
    step()
    assert np.array_equal(direct, through)
    a[:] = (1.0, 0.0, 0.0, 0.0)
    step()
    assert np.array_equal(through, b)


@compiled.inner
def power(x, n):
    return x**n


@compiled.kernel
def polynomial(x):
    return power(x, 2) + power(x, 3)


def test_inner_kernel_refuses_a_call_from_python_and_serves_kernels():
    assert polynomial(2.0) == 12.0
    with pytest.raises(TypeError, match="power is called by kernels only"):
        power(2.0, 3)


def test_numbers_written_in_a_call_share_one_compilation():
    polynomial(2.0)
    assert len(power.overloads) == 1


GENERATED = {
    "constant.py": "OFFSET = 1.0",
    "part.py": """
import constant
from teleop_core.kernels import kernel

@kernel
def moved(x: float) -> float:
    return x + constant.OFFSET
""",
    "outer.py": """
from part import moved
from teleop_core.kernels import kernel_from_source

tick = kernel_from_source(
    "def tick(x):\\n    return moved(x) * SCALE", "tick", {"moved": moved, "SCALE": 3.0}
)
print(tick(2.0))
print(sum(tick.stats.cache_hits.values()))
""",
}


def test_kernel_from_generated_source_is_compiled_once_for_all_processes(tmp_path):
    for name, text in GENERATED.items():
        write(tmp_path / name, text, age=100)
    assert run(tmp_path) == ([9.0], 0)
    assert run(tmp_path) == ([9.0], 1)
    write(tmp_path / "constant.py", "OFFSET = 2.0", age=100)
    assert run(tmp_path) == ([12.0], 0)
