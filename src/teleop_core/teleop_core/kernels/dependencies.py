"""Dependencies of a kernel: one digest of everything from which its compiled code is made.

A compiled kernel on the disk is valid only for the sources and values from which it was made. Its digest covers the
text of its file and the values of all global constants that its code refers to, and the texts and values of every
kernel that it calls directly or indirectly.
"""

import hashlib
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
from enum import Enum
from functools import cache
from pathlib import Path
from types import CodeType, FunctionType, ModuleType
from typing import Any

import numpy as np

_PLAIN = (type(None), bool, int, float, complex, str, bytes)
# Modules whose functions numba identifies by name; these functions change only with numba's version.
_FOREIGN = frozenset(["builtins", "math", "cmath", "numpy", "numba", "llvmlite"])


def digest(function: FunctionType) -> str:
    """Hexadecimal digest of a function and all its dependencies, through any number of calls.

    Constants count with their value at the first call for this function. numba makes this call when it compiles the
    function or the function's first caller.
    """
    reached, waiting = {function: _own(function)}, [function]
    while waiting:
        for called in reached[waiting.pop()].called:
            if called not in reached:
                reached[called] = _own(called)
                waiting.append(called)
    first = reached.pop(function).digest
    return hexdigest((first, *sorted(own.digest for own in reached.values())))


def hexdigest(parts: Iterable[str]) -> str:
    """Digest of strings in their order."""
    sums = hashlib.blake2b(digest_size=16)
    for part in parts:
        sums.update(part.encode(errors="surrogatepass") + b"\0")
    return sums.hexdigest()


@dataclass(frozen=True)
class _Own:
    """Data of a single function: the digest of its source and constants, and the functions that it names."""

    digest: str
    called: tuple[FunctionType, ...]


@cache
def _own(function: FunctionType) -> _Own:
    tokens = Tokens()
    code = function.__code__
    # The stored code contains the module's name, and cannot be loaded if the file has another name.
    parts = [function.__module__ or "", function.__qualname__]
    parts.append(source_digest(code.co_filename) or _code_digest(code))
    parts.append(tokens.of(function.__defaults__))
    parts.extend(tokens.of(cell.cell_contents) for cell in function.__closure__ or ())
    names = frozenset(_names_in(code))
    for name in sorted(names & function.__globals__.keys()):
        # The names include attributes of records. If such a name is also a global, this does no harm.
        parts.append(f"{name}={tokens.of(function.__globals__[name], names - {name})}")
    return _Own(hexdigest(parts), tuple(tokens.functions))


def source_digest(file: str) -> str | None:
    """Digest of a file's bytes; None when there is no such file (a notebook, ``python -c``)."""
    try:
        stat = Path(file).stat()
    except OSError:
        return None
    return _bytes_digest(file, stat.st_mtime_ns, stat.st_size)


@cache
def _bytes_digest(file: str, _time_ns: int, _size: int) -> str:
    return hashlib.blake2b(Path(file).read_bytes(), digest_size=16).hexdigest()


def _code_digest(code: CodeType) -> str:
    """Digest of the instructions and literals of a code object and of the code objects nested in it."""
    parts = [code.co_code.hex(), repr((code.co_names, code.co_varnames, code.co_freevars))]
    for constant in code.co_consts:
        parts.append(_code_digest(constant) if isinstance(constant, CodeType) else repr(constant))
    return hexdigest(parts)


def _names_in(code: CodeType) -> Iterator[str]:
    """Names of globals and attributes in a code object and in the code objects nested in it."""
    yield from code.co_names
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            yield from _names_in(constant)


@dataclass(frozen=True)
class Tokens:
    """Makes texts that differ if constants differ, and collects the functions that it finds."""

    functions: dict[FunctionType, None] = field(default_factory=dict)

    def of(self, value: Any, names: frozenset[str] = frozenset()) -> str:
        """Token of a value.

        Args:
            value: A number, text, array, dtype, enumeration, kernel, module or a collection.
            names: Attributes that are considered if the value is a module.
        """
        if isinstance(value, Enum):
            return f"{type(value).__qualname__}.{value.name}={self.of(value.value)}"
        if isinstance(value, ModuleType):
            return self._of_module(value, names)
        if isinstance(value, tuple):
            fields = getattr(value, "_fields", "")
            return f"{type(value).__qualname__}{fields}({','.join(map(self.of, value))})"
        if callable(value):
            return self._of_type(value) if isinstance(value, type) else self._of_callable(value)
        return _plain_token(value)

    def _of_type(self, value: type) -> str:
        members = [self.of(member) for member in value] if issubclass(value, Enum) else []
        return f"{value.__module__}.{value.__qualname__}{members}"

    def _of_module(self, module: ModuleType, names: frozenset[str]) -> str:
        """Name of a module, with the values of its attributes that the code names."""
        if _is_foreign(module.__name__):
            return module.__name__
        values = vars(module)
        found = [f"{n}={self.of(values[n], names - {n})}" for n in sorted(names & values.keys())]
        return f"{module.__name__}({','.join(found)})"

    def _of_callable(self, value: Callable[..., Any]) -> str:
        """Type and name of a callable; kernels and Python functions are also added to ``functions``."""
        function = getattr(value, "py_func", getattr(value, "__wrapped__", value))
        place = f"{getattr(value, '__module__', '')}.{getattr(value, '__qualname__', '')}"
        if isinstance(function, FunctionType) and not _is_foreign(function.__module__ or ""):
            self.functions[function] = None
        return f"{type(value).__qualname__}:{place}"


def _is_foreign(module: str) -> bool:
    return module.partition(".")[0] in _FOREIGN


def _plain_token(value: Any) -> str:
    """Text of a number, string, array or dtype; of a type of numba its name.

    Compiled code does not read other objects, such as dictionaries and sets, so their type is sufficient.
    """
    if isinstance(value, np.generic | np.ndarray):
        content = hashlib.blake2b(value.tobytes(), digest_size=16).hexdigest()
        return f"{value.dtype!r}{value.shape}{value.flags.c_contiguous}:{content}"
    if isinstance(value, (*_PLAIN, np.dtype)):
        return f"{type(value).__name__}:{value!r}"
    kind = f"{type(value).__module__}.{type(value).__qualname__}"
    return f"{kind}:{value!r}" if kind.startswith("numba.core.types.") else kind
