"""Branches: which branches of Python functions a schedule ran, at a few per cent of its time.

A tracer of Python makes a schedule four to five times as long. So this module compiles the functions of some packages
again, with a mark at the begin of each branch, and gives them the marked code. A mark sets one byte. Kernels are
compiled by Numba from their own source, and stay as they are; with ``NUMBA_DISABLE_JIT=1`` they are Python functions,
and have marks too.
"""

import ast
import sys
from collections.abc import Iterable, Iterator
from pathlib import Path
from types import CodeType, FunctionType, ModuleType

from teleop_core.kernels import IS_COMPILED

PACKAGES = ("teleop_core.nodes", "teleop_core.bags", "teleop_core.slave.operation")
"""Packages whose branches are marked."""
_MARKS = "__branches__"
_KERNELS = {"kernel", "inner"}


class Branches:
    """Branches of all loaded modules of some packages.

    A branch is a side of an ``if``, a loop that begins a round, a loop that ends by its condition, a case of a
    ``match``, or a handled exception. Its name is the file, the line and the side, as in ``nodes/slave.py:120 else``.

    Args:
        packages: Names of the packages.
    """

    def __init__(self, packages: tuple[str, ...] = PACKAGES) -> None:
        self._packages, self._names = packages, list[str]()
        self._marks, self._seen = bytearray(), set[str]()

    def begin(self) -> None:
        """Forget what ran so far, and mark the modules that were loaded since the last call."""
        for name, module in sorted(sys.modules.items()):
            if name in self._seen or not name.startswith(tuple(f"{one}." for one in self._packages)):
                continue
            self._seen.add(name)
            self._mark(module)
        self._marks[:] = bytes(len(self._names))

    def ran(self) -> list[str]:
        """Names of the branches that ran since :meth:`begin`."""
        return [name for name, mark in zip(self._names, self._marks, strict=True) if mark]

    @property
    def names(self) -> tuple[str, ...]:
        """Names of all marked branches."""
        return tuple(self._names)

    def _mark(self, module: ModuleType) -> None:
        path = Path(module.__file__ or "")
        place = f"{path.parent.name}/{path.name}"
        tree = _Marker(place, self._names).visit(ast.parse(path.read_bytes()))
        code = compile(ast.fix_missing_locations(tree), str(path), "exec", dont_inherit=True)
        marked = {(one.co_qualname, one.co_firstlineno): one for one in _codes(code)}
        vars(module)[_MARKS] = self._marks
        for function in _functions(vars(module).values(), module.__name__):
            old = function.__code__
            new = marked.get((old.co_qualname, old.co_firstlineno))
            if new is not None and new.co_freevars == old.co_freevars and any(map(_is_marked, (new, *_codes(new)))):
                function.__code__ = new


class _Marker(ast.NodeTransformer):
    """Puts a mark at the begin of each branch in functions that are not compiled."""

    def __init__(self, place: str, names: list[str]) -> None:
        self._place, self._names, self._depth = place, names, 0

    def visit_FunctionDef(self, node: ast.FunctionDef) -> ast.AST:
        if IS_COMPILED and any(isinstance(one, ast.Name) and one.id in _KERNELS for one in node.decorator_list):
            return node
        self._depth += 1
        self.generic_visit(node)
        self._depth -= 1
        return node

    def visit_If(self, node: ast.If) -> ast.AST:
        return self._sides(node, has_other=True)

    def visit_For(self, node: ast.For) -> ast.AST:
        return self._sides(node, has_other=True)

    def visit_While(self, node: ast.While) -> ast.AST:
        return self._sides(node, has_other=not isinstance(node.test, ast.Constant))

    def visit_ExceptHandler(self, node: ast.ExceptHandler) -> ast.AST:
        return self._sides(node, has_other=False)

    def visit_match_case(self, node: ast.match_case) -> ast.AST:
        return self._sides(node, has_other=False)

    def _sides(
        self, node: ast.If | ast.For | ast.While | ast.ExceptHandler | ast.match_case, *, has_other: bool
    ) -> ast.AST:
        self.generic_visit(node)
        if self._depth:
            line = node.pattern.lineno if isinstance(node, ast.match_case) else node.lineno
            node.body.insert(0, self._new(node.body[0], f"{line}"))
            if has_other and not isinstance(node, ast.ExceptHandler | ast.match_case):
                node.orelse.insert(0, self._new(node.body[0], f"{line} else"))
        return node

    def _new(self, at: ast.stmt, name: str) -> ast.stmt:
        (mark,) = ast.parse(f"{_MARKS}[{len(self._names)}] = 1").body
        self._names.append(f"{self._place}:{name}")
        for one in ast.walk(mark):
            ast.copy_location(one, at)
        return mark


def _codes(code: CodeType) -> Iterator[CodeType]:
    """All code objects inside of a code object."""
    for one in code.co_consts:
        if isinstance(one, CodeType):
            yield one
            yield from _codes(one)


def _is_marked(code: CodeType) -> bool:
    return _MARKS in code.co_names


def _functions(values: Iterable[object], module: str) -> Iterator[FunctionType]:
    """Functions of a module, those of its classes and those in decorators included."""
    for value in list(values):
        if isinstance(value, type):
            if value.__module__ == module:
                yield from _functions(vars(value).values(), module)
            continue
        parts = [value, *(getattr(value, name, None) for name in ("fget", "fset", "func", "__func__", "__wrapped__"))]
        yield from (one for one in parts if isinstance(one, FunctionType) and one.__module__ == module)
