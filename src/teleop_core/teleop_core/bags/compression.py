"""Compression of MCAP chunks: the three kinds the format knows, by their names in it."""

from collections.abc import Callable

import lz4.frame
import zstandard

NAMES = ("zstd", "lz4", "none")
DamagedError = (zstandard.ZstdError, RuntimeError, ValueError, EOFError)


def compressor(name: str, level: int) -> Callable[[bytes], bytes]:
    """Function that compresses one chunk; the same bytes give the same result."""
    if name == "zstd":
        return zstandard.ZstdCompressor(level=level).compress
    if name == "lz4":
        return lambda data: bytes(lz4.frame.compress(data, compression_level=level))
    return bytes


def decompress(name: str, data: bytes, size: int) -> bytes:
    """Chunk of ``size`` bytes as it was before.

    Args:
        name: As in the chunk's record; empty for none.
        data: Compressed bytes.
        size: Bytes it must have, [bytes].

    Raises:
        ValueError: Another size, or an unknown compression. Damage raises one of DamagedError.
    """
    if name == "zstd":
        out = zstandard.ZstdDecompressor().decompress(data, max_output_size=size)
    elif name == "lz4":
        out = bytes(lz4.frame.decompress(data))
    elif name == "":
        out = data
    else:
        raise ValueError(f"compressed with {name!r}, must be zstd, lz4 or none")
    if len(out) != size:
        raise ValueError(f"{len(out)} bytes after decompression, must be {size}")
    return out
