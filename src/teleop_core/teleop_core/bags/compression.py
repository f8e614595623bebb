"""Compression of MCAP chunks: the three methods of the format, by their names in files."""

from collections.abc import Callable

import lz4.frame
import zstandard

from teleop_core.base.texts import shown

NAMES = ("zstd", "lz4", "none")
LARGEST = 128 << 20
"""Largest size of an unpacked chunk [bytes]. Chunks of ``ros2 bag`` and of the mcap tools are a hundred times smaller.
Three chunks are unpacked ahead; even three chunks of this size fit into the memory of any machine."""
DamagedError = (zstandard.ZstdError, RuntimeError, ValueError, EOFError)


def compressor(name: str, level: int) -> Callable[[bytes], bytes]:
    """Function that compresses one chunk; equal bytes give equal results."""
    if name == "zstd":
        return zstandard.ZstdCompressor(level=level).compress
    if name == "lz4":
        return lambda data: bytes(lz4.frame.compress(data, compression_level=level))
    return bytes


def decompress(name: str, data: bytes, size: int) -> bytes:
    """Chunk of ``size`` bytes, as it was before compression.

    A chunk larger than :data:`LARGEST` is not unpacked, whatever size its record states.

    Args:
        name: Name of the compression in the chunk's record; empty for none.
        data: Compressed bytes.
        size: Size that the unpacked chunk must have, [bytes].

    Raises:
        ValueError: The unpacked chunk has another size or is too large, or the compression is unknown. Damaged data
            raise one of DamagedError.
    """
    if name not in {"zstd", "lz4", ""}:
        raise ValueError(f"compressed with {shown(name)}, must be zstd, lz4 or none")
    if name and size > LARGEST:
        raise ValueError(f"{size} bytes when unpacked, must be at most {LARGEST}")
    out = data if not name else _unzstd(data, size) if name == "zstd" else _unlz4(data, size)
    if len(out) != size:
        raise ValueError(f"{len(out)} bytes after decompression, must be {size}")
    return out


def _unzstd(data: bytes, size: int) -> bytes:
    """Unpack at most ``size`` bytes. The size that a frame states is checked first, since the library trusts it."""
    told = zstandard.frame_content_size(data)
    if told not in {-1, size}:  # -1: the frame does not state its size
        raise ValueError(f"a frame states {told} bytes, must state {size}")
    return zstandard.ZstdDecompressor().decompress(data, max_output_size=size)


def _unlz4(data: bytes, size: int) -> bytes:
    """Unpack at most ``size + 1`` bytes."""
    return bytes(lz4.frame.LZ4FrameDecompressor().decompress(data, max_length=size + 1))
