"""Images: machine code of kernels on the disk, which runs without the compiler.

The compiler and what it needs take 70 MB of memory and half a second of processor time. Machine code that was made once
needs neither: an image is that code, the places in it that need an address, and the names of what they need. Loading
copies the code into memory and writes the addresses. The compiler makes images in
:mod:`teleop_core.kernels.compiler.objects`; where there are no images, it is loaded and keeps its own files.

Images are used on Linux with x86-64.
"""

import ctypes
import hashlib
import marshal
import mmap
import os
import pickle
import platform
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from functools import cache
from importlib import import_module
from importlib.machinery import EXTENSION_SUFFIXES
from importlib.util import find_spec, module_from_spec, spec_from_file_location
from pathlib import Path
from struct import pack_into
from types import FunctionType, ModuleType
from typing import Any

import numpy as np

from teleop_core import __version__
from teleop_core.kernels import shipped, store
from teleop_core.kernels.dependencies import digest, hexdigest, source_digest
from teleop_core.kernels.kinds import UNKNOWN, Kinds

IS_SUPPORTED = sys.platform == "linux" and platform.machine() == "x86_64"
"""Whether this machine can run images."""
_CHECK = 16
_BROKEN = (OSError, EOFError, ValueError, TypeError, KeyError, AttributeError, ImportError, pickle.UnpicklingError)
"""Exceptions for files that are damaged or of another version."""


@dataclass(frozen=True)
class Code:
    """Machine code of a kernel in memory, for one tuple of kinds.

    Attributes:
        address: Address of the code, for calls of compiled code; 0 if it must be called through ``c_address``.
        c_address: Address of the code in the way of C; 0 if there is none.
        entry: Function for calls from Python, without a check of types; None if only compiled code can call it.
        result: Kind of the result.
        held: What must live as long as the code.
    """

    address: int
    c_address: int
    entry: Callable[..., Any] | None
    result: str
    held: object


@cache
def versions() -> tuple[str, ...]:
    """Texts that differ if the compiler or this package differ; part of the stamp of all stored code."""
    found = find_spec("numba")
    numba = source_digest(str(Path(found.origin).with_name("_version.py"))) if found and found.origin else None
    here = Path(__file__).parent
    own = sorted([*(here / "compiler").glob("*.py"), *(here / f"{name}.py" for name in _OWN)])
    checked = os.environ.get("NUMBA_BOUNDSCHECK", "")  # gives different code
    return str(numba), np.__version__, __version__, checked, *(source_digest(str(file)) or "" for file in own)


_OWN = ("dependencies", "images", "kinds", "layout", "room", "memory", "addresses")


def stamp_of(function: Any) -> tuple[str, ...]:
    """Texts that differ if the stored code of a function is no longer valid."""
    return *versions(), digest(function)


def places(function: FunctionType, stamp: tuple[str, ...], kinds: Kinds) -> Iterator[Path]:
    """Files in which the image of a function may be, the one that this user's processes write first.

    Args:
        function: The Python function of the kernel.
        stamp: Stamp of the function.
        kinds: Kinds of its arguments.
    """
    if not IS_SUPPORTED or UNKNOWN in kinds or "NUMBA_CACHE_DIR" in os.environ:
        return
    kept, name = store.place(function, stamp), _name(function)
    own = kept if kept is not None else _beside(function) / "__pycache__" / name
    yield own.with_name(f"{own.name}.{hexdigest((*kinds, *_processor()))[:24]}.nbo")
    for tier, folder in shipped.places(_beside(function) / "any.py"):
        yield folder / f"{name}.{hexdigest((*kinds, tier, ''))[:24]}.nbo"


def _beside(function: FunctionType) -> Path:
    """Folder of a function's source; of a function without one, the folder of this module."""
    file = Path(function.__code__.co_filename)
    return file.parent if file.suffix == ".py" else Path(__file__).parent


def _name(function: FunctionType) -> str:
    code = function.__code__
    name = f"{Path(code.co_filename).stem}.{function.__qualname__}-{code.co_firstlineno}"
    return (
        "".join(c if c.isalnum() or c in "._-" else "_" for c in name)
        + f".py{sys.version_info[0]}{sys.version_info[1]}"
    )


@cache
def _processor() -> tuple[str, str]:
    """The processor for which code is compiled: the one that the environment names, or this one."""
    asked = os.environ.get("NUMBA_CPU_NAME"), os.environ.get("NUMBA_CPU_FEATURES")
    if asked != (None, None):
        return asked[0] or "", asked[1] or ""
    return shipped.processor(), ""


def load(function: FunctionType, kinds: Kinds) -> Code | None:
    """Code of a kernel from the disk; None if there is none.

    Args:
        function: The Python function of the kernel.
        kinds: Kinds of its arguments.
    """
    stamp = stamp_of(function)
    for file in places(function, stamp, kinds):
        with suppress(*_BROKEN):
            data = file.read_bytes()
            if _sum(data[_CHECK:]) != data[:_CHECK]:
                continue
            kept = marshal.loads(data[_CHECK:])
            if kept["stamp"] == stamp and kept["kinds"] == kinds:
                made = _placed(kept)
                with suppress(OSError):  # the store keeps code that is used
                    os.utime(file)
                return made
    return None


def save(function: FunctionType, kinds: Kinds, image: dict[str, Any]) -> None:
    """Write an image, if the disk allows it.

    Args:
        function: The Python function of the kernel.
        kinds: Kinds of its arguments.
        image: What :func:`load` needs; see :mod:`teleop_core.kernels.compiler.objects`.
    """
    stamp = stamp_of(function)
    file = next(places(function, stamp, kinds), None)
    if file is None:
        return
    data = marshal.dumps({**image, "stamp": stamp, "kinds": kinds})
    with suppress(OSError):
        file.parent.mkdir(parents=True, exist_ok=True)
        new = file.with_name(f".{file.name}.{os.getpid()}.{threading.get_ident()}")
        new.write_bytes(_sum(data) + data)
        new.replace(file)


def _sum(data: bytes) -> bytes:
    """Sixteen bytes that differ if the data differ."""
    return hashlib.blake2b(data, digest_size=_CHECK).digest()


def _placed(image: dict[str, Any]) -> Code:
    """Code of an image, in memory."""
    size = image["size"]
    memory = mmap.mmap(-1, max(size, 1))
    base = ctypes.addressof(ctypes.c_char.from_buffer(memory))  # from now on the memory cannot be given back
    memory[: len(image["code"])] = image["code"]
    environments = []  # Python objects that code needs to return a result or to raise an exception
    for place, constants in image["environments"]:
        environment = helper("_dynfunc").Environment({})
        if constants:
            environment.consts[:] = pickle.loads(constants)
        environments.append(environment)
        pack_into("<Q", memory, place, id(environment))
    names = [address_of(name) for name in image["names"]]
    for place, which, addend in image["places"]:
        pack_into("<q", memory, place, (base if which < 0 else names[which]) + addend)
    pages = -(-size // mmap.PAGESIZE) * mmap.PAGESIZE
    if _c().mprotect(ctypes.c_void_p(base), ctypes.c_size_t(pages), mmap.PROT_READ | mmap.PROT_EXEC):
        raise OSError("the system forbids memory with code")
    held = (memory, environments)
    wrapper, entry = image["wrapper"], None
    if wrapper is not None:
        space = sys.modules.get(image["module"]) or import_module(image["module"])
        entry = helper("_dynfunc").make_function(
            space, image["name"], f"compiled {image['name']}", base + wrapper, environments[0], held
        )
    address, c_address = (0 if image[one] is None else base + image[one] for one in ("address", "c_address"))
    return Code(address, c_address, entry, image["result"], held)


@cache
def address_of(name: str) -> int:
    """Address of a C function or an object of Python, NumPy's helpers or the C library.

    Raises:
        ImportError: There is none of that name.
    """
    for prefix, module in (("numba_", "_helperlib"), ("NRT_", "core.runtime._nrt_python"), ("", "_helperlib")):
        if name.startswith(prefix):
            known = helper(module).c_helpers.get(name.removeprefix(prefix))
            if known is not None:
                return int(known)
    try:
        return ctypes.addressof(ctypes.c_char.in_dll(_c(), name))
    except ValueError as error:
        raise ImportError(f"no symbol {name!r}") from error


@cache
def _c() -> Any:
    return ctypes.CDLL(None)


@cache
def helper(name: str) -> ModuleType:
    """Extension module of numba, which is loaded without numba."""
    whole = f"numba.{name}"
    if whole in sys.modules:
        return sys.modules[whole]
    found = find_spec("numba")
    assert found is not None
    assert found.origin is not None
    path = Path(found.origin).parent.joinpath(*name.split("."))
    file = next(made for made in (path.with_name(path.name + end) for end in EXTENSION_SUFFIXES) if made.exists())
    spec = spec_from_file_location(whole, file)
    assert spec is not None
    assert spec.loader is not None
    module = sys.modules[whole] = module_from_spec(spec)
    spec.loader.exec_module(module)
    return module
