"""Objects: makes images of what the compiler has made.

The compiler writes object files (ELF, System V ABI for AMD64) in the large code model: every address is a word of eight
bytes, which only has to be filled in.
"""

import pickle
from struct import calcsize, iter_unpack, unpack_from
from typing import Any

from numba.core.environment import lookup_environment

from teleop_core.kernels.images import IS_SUPPORTED, address_of

_ALLOCATED, _RELA, _SYMBOLS, _COMMON, _NOTHING = 2, 4, 2, 0xFFF2, 0
_ABSOLUTE = 1  # R_X86_64_64
_UNWINDING = ".eh_frame"
_BASE = -1


def image(found: Any, *, is_c: bool) -> dict[str, Any] | None:
    """What :func:`teleop_core.kernels.images.load` needs; None if the code cannot run without the compiler.

    Args:
        found: Result of the compiler.
        is_c: Whether the code is called in the way of C.
    """
    if not IS_SUPPORTED or found.reload_init:
        return None
    names = found.fndesc
    library = found.library
    file = _ObjectFile(getattr(library, "object_code", None) or library._get_compiled_object())
    environments = _environments(found, file)
    if environments is None or not file.is_plain or not all(map(_is_known, file.names)):
        return None
    return {
        "code": file.code,
        "size": file.size,
        "names": file.names,
        "places": file.places,
        "environments": environments,
        "address": None if is_c else file.symbols[names.llvm_func_name],
        "c_address": file.symbols[names.llvm_cfunc_wrapper_name] if is_c else None,
        "wrapper": None if is_c else file.symbols[names.llvm_cpython_wrapper_name],
        "result": str(found.signature.return_type),
        "module": names.lookup_module().__name__,
        "name": names.qualname.split(".")[-1],
    }


def _is_known(name: str) -> bool:
    try:
        return address_of(name) != 0
    except ImportError:
        return False


def _environments(found: Any, file: "_ObjectFile") -> list[tuple[int, bytes]] | None:
    """Places of the pointers to environments, with their contents; the function's own environment comes first."""
    own = found.fndesc.env_name
    made = []
    for name in sorted(file.common, key=lambda name: name != own):
        environment = found.environment if name == own else lookup_environment(name)
        if environment is None or not environment.can_cache():
            return None
        constants = pickle.dumps(environment.consts) if environment.consts else b""
        made.append((file.symbols[name], constants))
    return made


class _ObjectFile:
    """Contents of an object file, laid out in memory.

    Attributes:
        code: Bytes of its sections.
        size: Size in memory, with space for what is only declared.
        symbols: Offset of each symbol.
        common: Names of the symbols that are only declared.
        names: Names of the symbols of others.
        places: Offset of each word to fill in, the number of the symbol of others or -1, and what to add.
        is_plain: Whether nothing else is to do.
    """

    def __init__(self, data: bytes) -> None:
        begin, width, count, of_names = (*unpack_from("<Q", data, 40), *unpack_from("<HHH", data, 58))
        sections = [unpack_from("<IIQQQQIIQQ", data, begin + i * width) for i in range(count)]
        text = sections[of_names][4]
        titles = [data[text + one[0] : data.index(b"\0", text + one[0])].decode() for one in sections]
        self.code, self.is_plain = b"", True
        self.symbols: dict[str, int] = {}
        self.common: list[str] = []
        self.names: list[str] = []
        self.places: list[tuple[int, int, int]] = []
        offsets: dict[int, int] = {}
        for i, (_, kind, flags, _, place, size, _, _, align, _) in enumerate(sections):
            if flags & _ALLOCATED and titles[i] != _UNWINDING:
                self.is_plain &= kind == 1  # bytes, not zeroes that the program would change
                self.code += bytes(-len(self.code) % max(align, 16))
                offsets[i] = len(self.code)
                self.code += data[place : place + size]
        self.size = -(-len(self.code) // 16) * 16
        table = next(one for one in sections if one[1] == _SYMBOLS)
        symbols = self._read_symbols(data, table, sections[table[6]][4], offsets)
        for one in sections:
            if one[1] == _RELA and one[7] in offsets:
                self._read_places(data, one, offsets[one[7]], symbols)
            elif one[1] == 9 and one[7] in offsets:  # places without what to add
                self.is_plain = False

    def _read_symbols(
        self, data: bytes, table: Any, text: int, offsets: dict[int, int]
    ) -> list[tuple[int, int] | None]:
        """Number and offset of each symbol of the file; None for those without a place in memory."""
        found: list[tuple[int, int] | None] = []
        others: dict[str, int] = {}
        rows = data[table[4] : table[4] + table[5]]
        for at, kind, _, section, value, size in iter_unpack("<IBBHQQ", rows):
            name = data[text + at : data.index(b"\0", text + at)].decode()
            if section == _COMMON:
                self.common.append(name)
                self.symbols[name] = self.size
                found.append((_BASE, self.size))
                self.size += max(size, 8)
            elif section == _NOTHING and name:
                found.append((others.setdefault(name, len(others)), 0))
            elif section in offsets:
                if kind & 15 != 3 and name:  # not a section
                    self.symbols[name] = offsets[section] + value
                found.append((_BASE, offsets[section] + value))
            else:
                found.append(None)
        self.names = list(others)
        return found

    def _read_places(self, data: bytes, section: Any, begin: int, symbols: list[tuple[int, int] | None]) -> None:
        rows = data[section[4] : section[4] + section[5]]
        assert section[9] == calcsize("<QQq")
        for place, about, addend in iter_unpack("<QQq", rows):
            symbol = symbols[about >> 32]
            if about & 0xFFFFFFFF != _ABSOLUTE or symbol is None:
                self.is_plain = False
                return
            which, offset = symbol
            self.places.append((begin + place, which, offset + addend))
