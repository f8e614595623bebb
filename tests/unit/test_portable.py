"""Portable: what decides the bits of a session calls nothing that a processor may round anew."""

import ast
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.linalg import expm

import teleop_core
import teleop_machines
from teleop_core.kernels import portable

PACKAGE = Path(teleop_core.__file__).parent
MACHINES = Path(teleop_machines.__file__).parent
ROOMS = ("hand", "coupling", "kernels", "kinematics", "robots", "session", "slave", "graph/signals.py")
"""What computes the values of a session's streams, or of its drawings; all machines do too."""
ELSEWHERE = {
    "robots/dexterity.py": "measures of dexterity, printed and plotted",
    "machines/hand_grasp.py": "grasps, which no session solves",
    "robots/inertias.py": "asks for signs alone",
    "machines/mma_balance.py": "springs of the handle, printed and plotted",
    "machines/mobility.py": "asks for a rank alone",
    "robots/rank.py": "asks for ranks, and for directions that differ by more than rounding",
    "machines/rps3_modes.py": "all ways to assemble it, which no session asks for",
    "machines/stewart.py": "asks for ranks and signs alone",
}
"""Files of these rooms that decide no bits of a session, and why."""
BLAS = {"linalg", "dot", "matmul", "inner", "vdot", "tensordot", "einsum", "cov", "corrcoef"}
VECTORISED = {
    "exp", "exp2", "expm1", "log", "log2", "log10", "log1p", "power", "float_power", "cbrt", "tan",
    "sinh", "cosh", "tanh", "arcsin", "arccos", "arctan", "arctan2", "arcsinh", "arccosh",
    "arctanh", "asin", "acos", "atan", "atan2", "pow",
}  # fmt: skip
NUMPY = {f"{module}.{name}" for module in ("np", "numpy") for name in BLAS | VECTORISED}
PLAIN_POWERS = {2, 0.5, -1}  # NumPy squares, takes roots and divides for these


def mistakes(text: str, file: str = "text") -> list[str]:
    """Every call of the kinds above, as ``file:line: what``."""
    found: list[str] = []
    _look(ast.parse(text), file, is_compiled=False, found=found)
    return found


def _look(node: Any, file: str, *, is_compiled: bool, found: list[str]) -> None:
    if isinstance(node, ast.FunctionDef):
        decorators = {ast.unparse(each) for each in node.decorator_list}
        is_compiled = is_compiled or bool(decorators & {"kernel", "inner"})
    if what := _mistake(node, is_compiled):
        found.append(f"{file}:{node.lineno}: {what}")
    for child in ast.iter_child_nodes(node):
        _look(child, file, is_compiled=is_compiled, found=found)


def _mistake(node: ast.AST, is_compiled: bool) -> str:
    if isinstance(node, ast.BinOp | ast.AugAssign) and isinstance(node.op, ast.MatMult):
        return "@"
    if isinstance(node, ast.Import | ast.ImportFrom) and "scipy" in ast.unparse(node):
        return "scipy"
    if isinstance(node, ast.Attribute) and ast.unparse(node) in NUMPY:
        return ast.unparse(node)
    if isinstance(node, ast.Call) and ast.unparse(node.func).endswith(".dot"):
        return ".dot()"
    if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Pow) and not is_compiled:
        powers = {ast.unparse(ast.Constant(power)) for power in PLAIN_POWERS}
        is_plain = ast.unparse(node.right) in powers or isinstance(node.left, ast.Constant)
        return "" if is_plain else "** (multiply, or math.pow of numbers)"
    return ""


def test_nothing_that_decides_bits_calls_blas_or_a_vectorised_function() -> None:
    files = [file for room in ROOMS for file in sorted((PACKAGE / room).glob("**/*.py"))]
    files += [PACKAGE / room for room in ROOMS if room.endswith(".py")]
    names = [file.relative_to(PACKAGE).as_posix() for file in files]
    machines = sorted(MACHINES.glob("**/*.py"))
    files += machines
    names += [f"machines/{file.relative_to(MACHINES).as_posix()}" for file in machines]
    assert not set(ELSEWHERE) - set(names)
    found = [
        mistake
        for file, name in zip(files, names, strict=True)
        if name not in ELSEWHERE
        for mistake in mistakes(file.read_text(), name)
    ]
    assert not found, "\n".join(["use teleop_core.kernels.portable in place of:", *found])


@pytest.mark.parametrize(
    ("text", "what"),
    [
        ("a = b @ c", "@"),
        ("a @= c", "@"),
        ("n = np.linalg.norm(v)", "np.linalg"),
        ("n = np.einsum('i,i', v, v)", "np.einsum"),
        ("from scipy.linalg import solve", "scipy"),
        ("n = v.dot(v)", ".dot()"),
        ("y = np.exp(x)", "np.exp"),
        ("y = x**3", "**"),
        ("@kernel\ndef f(x):\n    return np.dot(x, x)", "np.dot"),
    ],
)
def test_the_rule_finds_what_it_is_for(text: str, what: str) -> None:
    assert any(what in mistake for mistake in mistakes(text))


@pytest.mark.parametrize(
    ("a", "b"), [((3,), (3,)), ((4, 3), (3,)), ((3,), (3, 5)), ((7, 2, 3), (7, 3, 4)), ((2, 3), (7, 3, 3))]
)
def test_products_are_those_of_numpy(a: tuple[int, ...], b: tuple[int, ...]) -> None:
    rng = np.random.default_rng(1)
    left, right = rng.normal(size=a), rng.normal(size=b)
    np.testing.assert_allclose(portable.product(left, right), left @ right, rtol=0.0, atol=1e-14)


def test_lengths_dots_and_functions_are_those_of_numpy() -> None:
    rng = np.random.default_rng(2)
    x, y = rng.normal(size=(2, 5, 4))
    np.testing.assert_allclose(portable.length(x), np.linalg.norm(x, axis=1), rtol=1e-15)
    np.testing.assert_allclose(portable.dot(x, y), (x * y).sum(axis=1), rtol=1e-12)
    np.testing.assert_allclose(portable.exponential(x), np.exp(x), rtol=1e-15)
    np.testing.assert_allclose(portable.arctangent(x, y), np.arctan2(x, y), rtol=1e-15)
    assert portable.arctangent(1.0, np.zeros(2)).tolist() == [0.5 * math.pi] * 2


def test_an_inverse_motion_leads_back() -> None:
    from teleop_core.kernels.geometry import rotation, transform

    there = transform(rotation("x", 0.7), np.array([0.1, -0.2, 0.3]))
    np.testing.assert_allclose(portable.product(portable.inverse_motion(there), there), np.eye(4), atol=1e-15)


@pytest.mark.parametrize("size", [0.0, 1e-3, 1.0, 30.0])
def test_the_exponential_of_a_matrix_is_scipys(size: float) -> None:
    rng = np.random.default_rng(4)
    for n in (1, 3, 8):
        matrix = size * rng.normal(size=(n, n))
        expected = expm(matrix)
        error = np.abs(portable.matrix_exponential(matrix) - expected).max()
        assert error < 1e-12 * np.abs(expected).max()
