"""Videos: writes pictures of a camera, of all episodes one after the other, to the files of a data set."""

import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from fractions import Fraction
from pathlib import Path
from typing import Any

os.environ.setdefault("SVT_LOG", "1")  # the AV1 encoder would print its settings; errors remain

import av
import av.video.frame
import av.video.reformatter
import numpy as np
from numpy.typing import NDArray

from teleop_exchange.pictures import LIMITED, pixels

CODECS = {
    "av1": ("libsvtav1", {"g": "5", "crf": "30", "preset": "12", "svtav1-params": "fast-decode=0"}),
    "h264": ("libx264", {"g": "5", "crf": "23", "preset": "veryfast"}),
}
"""Encoder of FFmpeg and its options, by codec. A key frame every five frames: a learner reads single frames."""
LEAST_AV1 = 64  # smallest width and height [px] that the AV1 encoder takes
FILE_BYTES = 200 << 20
PATTERN = "videos/{video_key}/chunk-{chunk_index:03d}/file-{file_index:03d}.mp4"
_FILES = 1000
_QUANTILES = {"q01": 0.01, "q10": 0.1, "q50": 0.5, "q90": 0.9, "q99": 0.99}
_LOOKED_AT = 100
"""Number of frames of an episode whose colours are counted."""
_STEP = 4  # every fourth pixel of every fourth row is counted


@dataclass
class Video:
    """Video of a camera.

    Args:
        folder: Folder of the data set.
        key: Name of the feature.
        fps: Frames per second.
        codec: One of :data:`CODECS`.

    Attributes:
        height: Height of the video [px], even, from the first picture.
        width: Width of the video [px], even.
        colours: How often each of 256 values of red, green and blue was seen (3, 256).
        scaled: Number of frames whose picture had another size.
    """

    folder: Path
    key: str
    fps: int
    codec: str
    height: int = 0
    width: int = 0
    colours: NDArray[np.int64] = field(default_factory=lambda: np.zeros((3, 256), np.int64))
    scaled: int = 0
    _number: int = 0
    _frames: int = 0
    _bytes: int = 0
    _episode: NDArray[np.int64] = field(default_factory=lambda: np.zeros((3, 256), np.int64))
    _looked: int = 0
    _looked_before: int = 0
    _reformatter: Any = field(default_factory=av.video.reformatter.VideoReformatter)
    _container: Any = None
    _stream: Any = None

    def begin(self) -> dict[str, object]:
        """Begin an episode, in a new file if the current one is full; tell where it begins."""
        if self._bytes > FILE_BYTES:
            self.close()
            self._number, self._frames, self._bytes = self._number + 1, 0, 0
        self._looked_before += self._looked
        self._episode, self._looked = np.zeros_like(self._episode), 0
        chunk, file = divmod(self._number, _FILES)
        return {"chunk_index": chunk, "file_index": file, "from_timestamp": self._frames / self.fps}

    @property
    def _path(self) -> Path:
        chunk, file = divmod(self._number, _FILES)
        return self.folder / PATTERN.format(video_key=self.key, chunk_index=chunk, file_index=file)

    def add(self, frame: "av.VideoFrame", number: int, count: int) -> None:
        """Write a frame, which is the frame ``number`` of ``count`` frames of its episode."""
        if not self.width:
            self.width, self.height = max(2, frame.width // 2 * 2), max(2, frame.height // 2 * 2)
            self.codec = self.codec if min(self.width, self.height) >= LEAST_AV1 else "h264"
        self.scaled += (frame.width // 2 * 2, frame.height // 2 * 2) != (self.width, self.height)
        if number % max(1, count // _LOOKED_AT) == 0:
            self._look(pixels(frame)[::_STEP, ::_STEP])
        if self._container is None:
            self._open()
        made = self._reformatter.reformat(
            frame, self.width, self.height, "yuv420p", src_color_range=frame.color_range, dst_color_range=LIMITED
        )
        made.pts, made.time_base = self._frames, Fraction(1, self.fps)
        made.pict_type = av.video.frame.PictureType.NONE  # that of a JPEG would make each frame a key frame
        packets = self._stream.encode(made)
        self._bytes += sum(packet.size for packet in packets)
        self._container.mux(packets)
        self._frames += 1

    def _look(self, seen: NDArray[np.uint8]) -> None:
        counts = np.array([np.bincount(seen[:, :, i].ravel(), minlength=256) for i in range(3)])
        self._episode += counts
        self.colours += counts
        self._looked += 1

    def _open(self) -> None:
        self._path.parent.mkdir(parents=True, exist_ok=True)
        self._container = av.open(str(self._path), "w")
        encoder, options = CODECS[self.codec]
        self._stream = self._container.add_stream(encoder, self.fps, options=dict(options))
        self._stream.width, self._stream.height, self._stream.pix_fmt = self.width, self.height, "yuv420p"
        self._stream.codec_context.color_range = LIMITED
        with _as_scheduled_before():
            self._container.start_encoding()

    def end(self) -> tuple[dict[str, object], dict[str, Any]]:
        """End an episode; tell where it ends, and the statistics of its colours."""
        return {"to_timestamp": self._frames / self.fps}, _statistics(self._episode, self._looked)

    def statistics(self) -> dict[str, Any]:
        """Statistics of the colours of all episodes."""
        return _statistics(self.colours, self._looked_before + self._looked)

    def close(self) -> None:
        """Write what the encoder still holds, and finish the file."""
        if self._container is not None:
            self._container.mux(self._stream.encode(None))
            self._container.close()
            self._container = self._stream = None

    def feature(self) -> dict[str, object]:
        """Description of the feature in ``info.json``."""
        told = {
            "height": self.height, "width": self.width, "codec": self.codec, "pix_fmt": "yuv420p",
            "fps": self.fps, "channels": 3,
        }  # fmt: skip
        info = {f"video.{name}": value for name, value in told.items()} | {"has_audio": False, "is_depth_map": False}
        shape, names = [self.height, self.width, 3], ["height", "width", "channels"]
        return {"dtype": "video", "shape": shape, "names": names, "info": info}


@contextmanager
def _as_scheduled_before() -> Iterator[None]:
    """Give the calling thread, and threads that are started meanwhile, the scheduling that the caller had.

    The AV1 encoder gives all of them SCHED_FIFO 99 if the process may have it, and never takes it back: an export
    would come before every loop of the machine, and what the process starts later would inherit it.
    """
    known, policy, given = set(os.listdir("/proc/self/task")), os.sched_getscheduler(0), os.sched_getparam(0)
    try:
        yield
    finally:
        for thread in [0, *map(int, set(os.listdir("/proc/self/task")) - known)]:
            with suppress(ProcessLookupError):
                os.sched_setscheduler(thread, policy, given)


def _statistics(counts: NDArray[np.int64], frames: int) -> dict[str, Any]:
    """Extremes, mean, standard deviation and quantiles of red, green and blue, each 0 to 1, as ``(3, 1, 1)``."""
    levels, total = np.arange(256) / 255.0, counts.sum(axis=1)
    mean = counts @ levels / total
    below = counts.cumsum(axis=1) / total[:, None]
    found = {
        "min": levels[(counts > 0).argmax(axis=1)],
        "max": levels[255 - (counts[:, ::-1] > 0).argmax(axis=1)],
        "mean": mean,
        "std": np.sqrt(np.maximum(counts @ levels**2 / total - mean**2, 0.0)),
    }
    found |= {name: levels[(below >= share).argmax(axis=1)] for name, share in _QUANTILES.items()}
    return {name: values.reshape(3, 1, 1).tolist() for name, values in found.items()} | {"count": [frames]}
