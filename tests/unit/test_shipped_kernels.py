"""Kernels of a wheel are loaded where the processor can run them, and compiled elsewhere."""

import importlib.util
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from teleop_core.kernels import IS_COMPILED
from teleop_core.kernels.shipped import FOLDER, TIER, is_tier

SOURCES = Path(__file__).parents[2] / "src"
SCRIPT = """
import numpy as np
from teleop_core.kernels.geometry import multiply_quaternions, turn_between
from teleop_core.kernels import kernel_from_source
from teleop_core.kernels.progress import compiled_count

text = "def both(a, b, c):\\n    multiply(a, b, c)\\n    multiply(c, a, b)"
both = kernel_from_source(text, "both", {"multiply": multiply_quaternions})
a, b, c, d = np.array([[0.1, 0.2, 0.3, 0.4], [0.7, -0.3, 0.1, 0.2], [0.0] * 4, [0.0] * 4])
both(a, b, c)
turn_between(a, b, d[:3])
print(compiled_count(), np.array([b, c, d]).tobytes().hex())
"""
READ = f"""
import sys
read = []
sys.addaudithook(lambda event, of: read.append(str(of[0])) if event == "open" else None)
{SCRIPT}
print(any({TIER!r} in name for name in read))
"""
PLACES = """
from pathlib import Path
import teleop_core.kernels.geometry as module
from teleop_core.kernels.shipped import places
print(*(tier for tier, _ in places(Path(module.__file__))), *places(Path.cwd() / "own.py"))
"""


def _script() -> Any:
    spec = importlib.util.spec_from_file_location("build_wheels", SOURCES / "build_wheels.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


wheels = _script()
pytestmark = [
    pytest.mark.skipif(not IS_COMPILED, reason="nothing is compiled in pure Python"),
    pytest.mark.skipif(not is_tier(), reason="this processor is of no such tier"),
]


@pytest.fixture(scope="module")
def shipped(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, str]:
    """Sources with the kernels of the script, as a wheel holds them; and what the script prints."""
    tree = wheels.copied(wheels.CORE, tmp_path_factory.mktemp("wheel") / "tree")
    compiled = wheels.run(tree, None, SCRIPT).split()
    assert int(compiled[0]) >= 3
    for file in _kept(tree):
        file.unlink()
    wheels.compile_kernels(tree, SCRIPT)
    return tree, compiled[1]


@pytest.fixture
def tree(shipped: tuple[Path, str]) -> Iterator[Path]:
    """The sources, left as they were."""
    root, _ = shipped
    before = {file: file.read_bytes() for file in root.rglob("*") if file.is_file()}
    yield root
    for file in root.rglob("*"):
        if file.is_file() and file not in before:
            file.unlink()
    for file, content in before.items():
        file.write_bytes(content)


def _kept(tree: Path) -> list[Path]:
    return list(tree.rglob("__pycache__/*.nb?"))


@pytest.mark.parametrize("tier", [None, TIER])
def test_shipped_kernels_are_loaded_and_give_the_bits_of_compiled_ones(
    shipped: tuple[Path, str], tree: Path, tier: str | None
) -> None:
    count, bits = wheels.run(tree, tier, SCRIPT).split()
    assert (count, bits) == ("0", shipped[1])
    assert not _kept(tree)


def test_processors_of_the_tier_have_shipped_kernels_and_others_and_own_files_have_none(tree: Path) -> None:
    assert wheels.run(tree, None, PLACES).split() == [TIER]
    assert wheels.run(tree, "generic", PLACES).split() == []


def test_kernels_that_were_compiled_here_come_before_shipped_ones(tree: Path) -> None:
    place = tree / "teleop_core/kernels" / FOLDER.name
    assert wheels.run(tree, None, READ).split()[2:] == ["True"]
    place.rename(place.with_name("away"))
    assert wheels.run(tree, None, SCRIPT).split()[0] != "0"
    place.with_name("away").rename(place)
    count, _, *read = wheels.run(tree, None, READ).split()
    assert (count, read) == ("0", ["False"])


def test_kernels_are_compiled_where_shipped_ones_are_broken(shipped: tuple[Path, str], tree: Path) -> None:
    for k, file in enumerate((tree / "teleop_core/kernels" / FOLDER.name).rglob("*.nb[co]")):
        file.write_bytes(b"no kernel" if k % 2 else b"")
    count, bits = wheels.run(tree, None, SCRIPT).split()
    assert int(count) >= 3
    assert bits == shipped[1]


def test_kernels_of_a_changed_source_are_compiled(shipped: tuple[Path, str], tree: Path) -> None:
    source = tree / "teleop_core/kernels/geometry.py"
    source.write_text(source.read_text() + "\n# changed\n")
    count, bits = wheels.run(tree, None, SCRIPT).split()
    assert int(count) >= 3
    assert bits == shipped[1]
