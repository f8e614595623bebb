"""Packing: arrays and texts of a page as base64 of raw deflate streams, which browsers unpack."""

import base64
import zlib
from hashlib import blake2b
from math import isfinite
from typing import Any

import numpy as np

from teleop_core.evaluation.figure import Numbers

_LEVEL = 4  # compression level; the usual level 6 takes twice the time and saves 2 % of the bytes


class Arrays:
    """Arrays of a page, each packed once."""

    def __init__(self) -> None:
        self._packed: dict[bytes, tuple[int, str]] = {}  # packed arrays by their contents

    def named(self, tree: Any) -> Any:
        """Return a trace or layout in which indices of the list replace arrays of numbers."""
        if isinstance(tree, dict):
            return {key: self.named(value) for key, value in tree.items()}
        if isinstance(tree, (list, tuple)):
            return [self.named(value) for value in tree]
        if isinstance(tree, np.ndarray) and tree.ndim == 1 and tree.dtype.kind in "fiu":
            return {"array": self._place(tree)}
        if isinstance(tree, (np.ndarray, np.generic)):
            return self.named(tree.tolist())
        return None if isinstance(tree, float) and not isfinite(tree) else tree

    def packed(self) -> list[str]:
        """All packed arrays, in the order of their indices."""
        return [data for _, data in self._packed.values()]

    def _place(self, array: Numbers) -> int:
        name = blake2b(array.tobytes(), person=array.dtype.str.encode()).digest()
        if name not in self._packed:
            self._packed[name] = len(self._packed), packed(array)
        return self._packed[name][0]


def packed(values: Numbers) -> str:
    """Pack numbers (N,) as float32: differences of their bit patterns, the lowest bytes of all numbers first."""
    bits = np.asarray(values, "<f4").view("<u4")
    changes = np.diff(bits, prepend=np.zeros(1, "<u4"))  # modulo 2³²
    return deflated(changes.view(np.uint8).reshape(-1, 4).T.tobytes())


def deflated(data: bytes) -> str:
    """Bytes as base64 of a raw deflate stream."""
    packer = zlib.compressobj(_LEVEL, zlib.DEFLATED, -zlib.MAX_WBITS, 9)
    return base64.b64encode(packer.compress(data) + packer.flush()).decode("ascii")
