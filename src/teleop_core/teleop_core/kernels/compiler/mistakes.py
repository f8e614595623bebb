"""Mistakes in kernels: shortens the compiler's long message to one line with file and line number."""

import re
import textwrap
from collections.abc import Callable, Iterator, Sequence
from difflib import get_close_matches
from pathlib import Path
from types import CodeType
from typing import Any

from numba import types

from teleop_core.base.errors import KernelError

_PACKAGE = Path(__file__).parents[2]
_LONGEST = 300  # largest number of characters of a reason: two or three lines of a terminal

# Names in numba's messages: a record has all its fields in its name, a literal has its type and value.
_RECORD = re.compile(r"Record\(\[.*?\)\], \d+, (?:True|False)\)")
_LITERAL = re.compile(r"Literal\[(\w+)\]\(([^()]*)\)")
_MISSING = re.compile(r"No implementation of function .*?>>> (.*?)\n", re.DOTALL)
_REJECTED = re.compile(r"raised a specific error:\s+\w+: (.*?)\n")
_UNBOUND = re.compile(r'Cannot bind .* due to "\w+: (.*?)"\.')


def kernel_error(error: BaseException, function: Callable[..., Any], arguments: Sequence[Any]) -> KernelError:
    """Error that describes in one line the mistake in a kernel and its position.

    Args:
        error: Exception of numba.
        function: The Python function that numba compiled.
        arguments: Types for which the function was compiled.
    """
    code = function.__code__
    place = _location(error) or (code.co_filename, code.co_firstlineno)
    reason = _unknown_field(error)
    if reason is None:
        reason = f"kernel {code.co_name!r}: " + (_bad_argument(code, arguments) or _reason(error))
    return KernelError(f"{_shown(place[0])}:{place[1]}", reason)


def place_of(function: object) -> str:
    """File and line of a function; for another object, the name of its type."""
    code = getattr(function, "__code__", None)
    if not isinstance(code, CodeType):
        return type(function).__qualname__
    return f"{_shown(code.co_filename)}:{code.co_firstlineno}"


def _shown(file: str) -> str:
    """Path of a file relative to the package or the working directory, if the file is inside of it."""
    for folder in (_PACKAGE, Path.cwd()):
        if Path(file).is_relative_to(folder):
            return Path(file).relative_to(folder).as_posix()
    return file


def _frames(error: BaseException) -> Iterator[dict[str, Any]]:
    """Local variables of the frames through which the error passed, the innermost frame first."""
    frames, trace = [], error.__traceback__
    while trace is not None:
        frames.append(trace.tb_frame.f_locals)
        trace = trace.tb_next
    return reversed(frames)


def _location(error: BaseException) -> tuple[str, int] | None:
    """File and line of the error; if the error has none, those of the statement that numba was compiling."""
    places = [getattr(error, "loc", None)]
    places += [getattr(frame.get("self"), "loc", None) for frame in _frames(error)]
    for place in places:
        file, line = getattr(place, "filename", None), getattr(place, "line", None)
        if isinstance(file, str) and isinstance(line, int):
            return file, line
    return None


def _unknown_field(error: BaseException) -> str | None:
    """Reason for a field that a record does not have, with the list of its fields."""
    if not isinstance(error, KeyError):
        return None
    record = next((f["self"] for f in _frames(error) if isinstance(f.get("self"), types.Record)), None)
    if record is None:
        return None
    wanted, fields = str(error.args[0]), list(record.fields)
    close = get_close_matches(wanted, fields, 1)
    hint = f"; did you mean {close[0]!r}?" if close else ""
    return f"record has no field {wanted!r}{hint} (fields: {', '.join(fields)})"


def _bad_argument(code: CodeType, arguments: Sequence[Any]) -> str | None:
    """Reason for an argument that no kernel can accept."""
    for name, kind in zip(code.co_varnames, arguments, strict=False):
        if isinstance(kind, types.PyObject):
            return f"argument {name!r} must be a number, array, record, function or tuple of them"
    return None


def _reason(error: BaseException) -> str:
    """Shortest part of numba's message that describes the mistake."""
    text = re.sub(r"^Failed in \w+ mode pipeline \(step: .*?\)\n", "", str(error).strip())
    text = _LITERAL.sub(r"\1 \2", _RECORD.sub("record", text))
    if found := _MISSING.match(text):
        rejected = _REJECTED.search(text)
        reason = f"no {found[1].strip()}" + (f": {rejected[1]}" if rejected else "")
    elif found := _UNBOUND.match(text):
        reason = f"wrong call of a kernel: {found[1]}"
    else:
        reason = re.split(r"\n\n|\nDuring: |\.\.? Raised from |, defined at ", text)[0]
    return textwrap.shorten(reason or type(error).__name__, _LONGEST, placeholder=" …")
