"""Kernels on disk: what is kept is thrown away when anything changes that it was made from."""

import os
import re
import shutil
import subprocess
import sys
from contextlib import chdir
from pathlib import Path

import pytest

from copies import run_copy
from teleop_core.kernels import IS_COMPILED, store
from teleop_core.kernels.compiler import SUPPORTED, check_version

pytestmark = pytest.mark.skipif(not IS_COMPILED, reason="nothing is kept of what is not compiled")

CALLS = {
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
print(scaled.hits)
""",
}

CONSTANTS = {
    "values.py": """
from enum import IntEnum

import numpy as np

FIELDS = ("gain", "zero")
OFFSET = 1.0
WEIGHTS = (1.0, 2.0)
TABLE = np.array([5.0, 6.0])
IS_ON = True
PLACES = {"first": 0, "second": 1}

class Mode(IntEnum):
    SLOW = 0
    FAST = 2
""",
    "outer.py": """
import numpy as np

import values
from teleop_core.kernels import inner, kernel
from values import IS_ON, PLACES, TABLE, WEIGHTS, Mode

ZERO = values.FIELDS.index("zero")
SECOND = PLACES["second"]

@kernel
def from_names(row):
    return row[ZERO]

@kernel
def from_dictionary(row):
    return row[SECOND]

@inner
def offset(x):
    return x + values.OFFSET

@kernel
def from_called(row):
    return offset(row[0])

@kernel
def from_tuple(row):
    return row[0] * WEIGHTS[1]

@kernel
def from_array(row):
    return row[0] + TABLE[0]

@kernel
def from_flag(row):
    return row[0] if IS_ON else row[1]

@kernel
def from_choice(row):
    return row[1] if int(row[0]) - 8 == Mode.FAST else row[0]

@kernel
def from_nested(row):
    def shifted(x):
        return x + values.OFFSET
    return shifted(row[1])

kernels = (from_names, from_dictionary, from_called, from_tuple, from_array, from_flag,
           from_choice, from_nested)
print(*(kernel(np.array([10.0, 20.0])) for kernel in kernels))
print(sum(kernel.hits for kernel in kernels))
""",
}

CHANGES = {
    '("gain", "zero")': '("zero", "gain")',
    "OFFSET = 1.0": "OFFSET = 3.0",
    "(1.0, 2.0)": "(1.0, 4.0)",
    "[5.0, 6.0]": "[7.0, 6.0]",
    "IS_ON = True": "IS_ON = not 1",
    '"first": 0, "second": 1': '"first": 1, "second": 0',
    "FAST = 2": "FAST = 1",
}

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
print(tick.hits)
""",
}


def run(folder: Path) -> tuple[list[float], int]:
    """Values and cache hits of a process that imports the modules for the first time."""
    return ran(folder, {**os.environ, "PYTHONDONTWRITEBYTECODE": "1", "NUMBA_CACHE_DIR": str(folder / "c")})


def ran(folder: Path, env: dict[str, str]) -> tuple[list[float], int]:
    with chdir(folder):
        done = run_copy(["outer.py"], env=env)
    assert done.returncode == 0, done.stderr
    values, hits = done.stdout.splitlines()
    return [float(value) for value in values.split()], int(hits)


def write(path: Path, text: str) -> None:
    """File whose time says nothing: all versions have the same."""
    path.write_text(text)
    os.utime(path, (1_000_000_000, 1_000_000_000))


def write_all(folder: Path, modules: dict[str, str]) -> Path:
    for name, text in modules.items():
        write(folder / name, text)
    return folder


def again(folder: Path) -> Path:
    """The folder as it was when this was first called for it; kernels are kept for its path."""
    kept = folder.with_name(f"{folder.name}_kept")
    if kept.exists():
        shutil.rmtree(folder)
        shutil.copytree(kept, folder)
    else:
        shutil.copytree(folder, kept)
    return folder


@pytest.fixture(scope="module")
def calls_run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = write_all(tmp_path_factory.mktemp("calls"), CALLS)
    assert run(folder) == ([70.0, 7.0], 0)
    return folder


@pytest.fixture
def calls(calls_run: Path) -> Path:
    """Folder of calls after a first run, the same for each test."""
    return again(calls_run)


CONSTANT_VALUES = [20.0, 20.0, 11.0, 20.0, 15.0, 10.0, 20.0, 21.0]


@pytest.fixture(scope="module")
def constants_run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = write_all(tmp_path_factory.mktemp("constants"), CONSTANTS)
    assert run(folder) == (CONSTANT_VALUES, 0)
    return folder


@pytest.fixture
def constants(constants_run: Path) -> Path:
    """Folder of constants after a first run, the same for each test."""
    return again(constants_run)


def test_kernels_of_unchanged_files_come_from_the_cache(calls: Path) -> None:
    assert run(calls) == ([70.0, 7.0], 1)


@pytest.mark.parametrize("name", ["inner.py", "middle.py", "outer.py"])
def test_change_of_one_digit_in_a_called_file_reaches_its_cached_callers(calls: Path, name: str) -> None:
    changed = CALLS[name].replace("2.0 * x", "5.0 * x").replace("+ 1.0", "+ 4.0")
    write(calls / name, changed.replace("10.0 *", "20.0 *"))
    assert (
        run(calls)
        == {"inner.py": ([160.0, 16.0], 0), "middle.py": ([100.0, 10.0], 0), "outer.py": ([140.0, 7.0], 0)}[name]
    )


def test_changed_constant_of_another_module_reaches_every_cached_kernel_that_uses_it(constants: Path) -> None:
    assert run(constants) == (CONSTANT_VALUES, len(CONSTANT_VALUES))
    text = CONSTANTS["values.py"]
    for old, new in CHANGES.items():
        assert old in text
        text = text.replace(old, new)
    write(constants / "values.py", text)
    assert run(constants) == ([10.0, 10.0, 13.0, 40.0, 17.0, 20.0, 10.0, 23.0], 0)


def test_constant_that_no_kernel_uses_leaves_the_cache_alone(constants: Path) -> None:
    write(constants / "values.py", CONSTANTS["values.py"] + "OTHER = 1\n")
    assert run(constants) == (CONSTANT_VALUES, len(CONSTANT_VALUES))


def test_kernel_from_generated_source_is_compiled_once_for_all_processes(tmp_path: Path) -> None:
    folder = write_all(tmp_path, GENERATED)
    assert run(folder) == ([9.0], 0)
    assert run(folder) == ([9.0], 1)
    write(folder / "constant.py", "OFFSET = 2.0")
    assert run(folder) == ([12.0], 0)


def test_kernel_without_a_source_file_works_and_leaves_nothing_on_the_disk(tmp_path: Path) -> None:
    text = CALLS["inner.py"] + "print(factor(4.0))"
    for arguments, given in ((["-c", text], ""), (["-"], text)):
        done = subprocess.run(
            [sys.executable, *arguments],
            input=given,
            capture_output=True,
            text=True,
            check=True,
            env={**os.environ, "NUMBA_CACHE_DIR": str(tmp_path / "cache")},
        )
        assert done.stdout == "8.0\n"
    assert not list(tmp_path.rglob("*factor*"))


def test_kept_kernels_of_a_file_serve_it_under_one_module_name_only(tmp_path: Path) -> None:
    load = """
import sys
from importlib.util import module_from_spec, spec_from_file_location

spec = spec_from_file_location("first", "inner.py")
module = sys.modules["first"] = module_from_spec(spec)
spec.loader.exec_module(module)
print(module.factor(3.0))
print(module.factor.hits)
"""
    folder = write_all(tmp_path, {"inner.py": CALLS["inner.py"], "outer.py": load})
    assert [run(folder), run(folder)] == [([6.0], 0), ([6.0], 1)]
    write(folder / "outer.py", load.replace("first", "second"))
    assert [run(folder), run(folder)] == [([6.0], 0), ([6.0], 1)]


def test_broken_files_of_the_cache_are_made_again(calls: Path) -> None:
    files = sorted((calls / "c").rglob("*.nb?"))
    assert len(files) > 3
    for k, file in enumerate(files):  # empty, or cut in half
        file.write_bytes(file.read_bytes()[: (k % 2) * file.stat().st_size // 2])
    assert run(calls) == ([70.0, 7.0], 0)
    assert run(calls) == ([70.0, 7.0], 1)


def test_kernel_works_while_another_version_keeps_what_this_one_cannot_read(tmp_path: Path) -> None:
    folder = write_all(tmp_path, CALLS)
    (folder / "outer.py").write_text("""
import pickle
from pathlib import Path
import numba
from middle import plus_one
from teleop_core.kernels import compiler

load = compiler._Cache.load_overload

def loaded(self, *arguments):
    found = load(self, *arguments)
    index = Path(self._cache_file._index_path)
    index.parent.mkdir(parents=True, exist_ok=True)
    index.write_bytes(pickle.dumps(numba.__version__) + b"ca_later_module\\nItsRecord\\n.")
    return found

compiler._Cache.load_overload = loaded
print(plus_one(3.0), plus_one(4))
compiler._Cache.load_overload = load
print(plus_one.hits)
""")
    assert run(folder) == ([7.0, 9.0], 0)
    (folder / "outer.py").write_text("""
from middle import plus_one
print(plus_one(4))
print(plus_one.hits)
""")
    assert run(folder) == ([9.0], 1)


def test_kernel_works_where_its_cache_cannot_be_written_any_more(tmp_path: Path) -> None:
    folder = write_all(tmp_path, CALLS)
    (folder / "outer.py").write_text("""
import shutil
from pathlib import Path
from middle import plus_one

first = plus_one(3.0)
shutil.rmtree("c")
Path("c").write_text("a file in place of the folder")
print(first, plus_one(4))
print(0)
""")
    assert run(folder) == ([7.0, 9.0], 0)


def test_versions_of_numba_in_setup_are_those_that_the_kernels_are_written_for() -> None:
    setup = Path(__file__).parents[2] / "src/teleop_core/setup.py"
    bounds = re.findall(r'"numba>=(\d+)\.(\d+),<(\d+)\.(\d+)"', setup.read_text())
    assert [tuple(map(int, found)) for found in bounds] == [SUPPORTED[0] + SUPPORTED[1]]


@pytest.mark.parametrize("found", ["0.67.0", "0.69.0dev0+5.g12ab", "1.0.1"])
def test_another_version_of_numba_is_refused_in_one_line(found: str) -> None:
    expected = rf"^numba is {re.escape(found)}, must be >= 0\.68 and < 0\.69$"
    with pytest.raises(ImportError, match=expected):
        check_version(found)


PAIRS = "from typing import NamedTuple\n\nclass {0}(NamedTuple):\n    first: float\n    second: float\n"
TOTAL = """
from pairs import {0}
from teleop_core.kernels import kernel

@kernel
def total(pair) -> float:
    return pair.first + pair.second

print(total({0}(1.0, 2.0)))
print(total.hits)
"""


def test_kernels_kept_for_a_class_that_is_gone_are_compiled_anew(tmp_path: Path) -> None:
    for name in ("Pair", "Couple"):
        files = {"pairs.py": PAIRS, "outer.py": TOTAL}
        write_all(tmp_path, {file: text.format(name) for file, text in files.items()})
        assert run(tmp_path) == ([3.0], 0)
        assert run(tmp_path) == ([3.0], 1)


def in_store(folder: Path, place: Path) -> tuple[list[float], int]:
    """What the script prints where the store is at a place, and how many kernels it found there."""
    env = {**os.environ, "PYTHONDONTWRITEBYTECODE": "1", "TELEOP_KERNELS": str(place)}
    env.pop("NUMBA_CACHE_DIR", None)
    return ran(folder, env)


@pytest.fixture(scope="module")
def stored_run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("stored")
    for copy in (folder / "first", folder / "second"):
        copy.mkdir()
        write_all(copy, CALLS)
    assert in_store(folder / "first", folder / "kept") == ([70.0, 7.0], 0)
    return folder


@pytest.fixture
def stored(stored_run: Path) -> Path:
    """Two copies of a source and the store, after a run of the first; the same for each test."""
    return again(stored_run)


def test_a_second_copy_of_a_source_finds_what_the_first_one_compiled(stored: Path) -> None:
    assert in_store(stored / "second", stored / "kept") == ([70.0, 7.0], 1)
    assert not list(stored.glob("*/__pycache__/*.nb?"))


def test_a_copy_that_differs_takes_nothing_of_the_other_and_leaves_it_there(stored: Path) -> None:
    first, second, place = (stored / name for name in ("first", "second", "kept"))
    write(second / "inner.py", CALLS["inner.py"].replace("2.0 * x", "5.0 * x"))
    assert in_store(second, place) == ([160.0, 16.0], 0)
    assert in_store(first, place) == ([70.0, 7.0], 1)


def test_what_nobody_used_for_long_is_removed_from_the_store(stored: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    place = stored / "kept"
    monkeypatch.setenv("TELEOP_KERNELS", str(place))
    monkeypatch.delenv("NUMBA_CACHE_DIR", raising=False)
    old = sorted(place.rglob("factor-*.nbi"))
    assert old
    for file in old:
        os.utime(file, (1e9, 1e9))
    assert store.prune() >= 2 * len(old)
    assert not list(place.rglob("factor-*"))
    assert in_store(stored / "first", place)[0] == [70.0, 7.0]


LATE = """
import numpy as np
from teleop_core.kernels import kernel

@kernel
def size(values):
    return values.size

print(size(np.zeros(2)), flush=True)
"""


def test_a_kernel_is_kept_only_while_no_other_process_writes_there(tmp_path: Path) -> None:
    write(tmp_path / "late.py", LATE)
    env = {**os.environ, "TELEOP_KERNELS": str(tmp_path / "kept")}
    env.pop("NUMBA_CACHE_DIR", None)
    command = [sys.executable, "late.py"]
    first = subprocess.run(command, cwd=tmp_path, env=env, check=True, capture_output=True)
    (index,) = (tmp_path / "kept").rglob("size-*.nbi")
    for file in index.parent.glob(f"{index.stem}.*"):
        file.unlink()
    with store.locked(index.parent):
        again = subprocess.Popen(command, cwd=tmp_path, env=env, stdout=subprocess.PIPE)
        while not waits_for_a_lock(again.pid):
            assert again.poll() is None, "it did not wait"
        assert not index.exists()
    assert again.communicate()[0] == first.stdout
    assert index.exists()


def waits_for_a_lock(pid: int) -> bool:
    """Whether a process stands in a queue for the lock of a file."""
    lines = Path("/proc/locks").read_text().splitlines()
    return any("->" in line and f" {pid} " in line for line in lines)
