"""Mistakes in kernels: one line with the place and the reason."""

import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numba import types

from teleop_core.base.errors import KernelError
from teleop_core.kernels import IS_COMPILED, bound, inner, kernel, pointer, records

pytestmark = pytest.mark.skipif(not IS_COMPILED, reason="it is the compiler that finds them")
ROW = types.float64[::1]


def uncached(text: str, name: str) -> Any:
    """Kernel of a text; it has no file, so every process compiles it."""
    space = {"kernel": kernel, "inner": inner}
    exec(text, space)
    return space[name]


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


@pytest.mark.parametrize("line", MISTAKES)
def test_mistake_in_a_kernel_is_one_line_with_its_place(line: str) -> None:
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


def test_mistake_in_a_pointer_or_an_argument_has_its_place_too() -> None:
    wrong = uncached("@kernel\ndef wrong(row):\n    return row.gain\n", "wrong")
    with pytest.raises(KernelError, match="<string>:3: kernel 'wrong': Unknown attribute 'gain'"):
        pointer(wrong, types.float64(ROW))
    with pytest.raises(KernelError, match="kernel 'wrong': argument 'row' must be a number, array"):
        wrong({"gain": 1.0})


def test_place_of_a_mistake_is_counted_from_the_package_or_the_working_directory(tmp_path: Path) -> None:
    text = "from teleop_core.kernels import kernel\n@kernel\ndef f(x):\n    return x.gain\nf(1.0)\n"
    (tmp_path / "own.py").write_text(text)
    done = subprocess.run([sys.executable, "own.py"], cwd=tmp_path, capture_output=True, text=True, check=False)
    last = done.stderr.splitlines()[-1]
    assert last.startswith("teleop_core.base.errors.KernelError: own.py:4: kernel 'f': Unknown attri")
