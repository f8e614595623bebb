"""LeRobot data set: recordings as episodes for learning, in version 3.0 of the format.

A data set is a folder with ``meta/info.json`` (features, rate, counts), ``meta/stats.json``, ``meta/tasks.parquet`` and
``meta/episodes`` (a row for each episode). ``data`` contains a row for each frame, and ``videos`` the pictures of each
camera. The ``lerobot`` package, version 0.6, reads the folder offline: ``LeRobotDataset("name", root=FOLDER)``.
"""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import NDArray

from teleop_core.base.errors import RecordingError, UnknownNameError
from teleop_core.session.recording import Recording
from teleop_exchange.frames import STATE, Frames, around, frames_of, opened
from teleop_exchange.pictures import Camera, Decoder, cameras_of
from teleop_exchange.ros_bags import RosBag
from teleop_exchange.videos import CODECS, FILE_BYTES, Video
from teleop_exchange.videos import PATTERN as VIDEO_PATTERN

VERSION = "v3.0"
FPS = 50
PICTURES, AGES = "observation.images.", "observation.age."
"""Beginnings of the names of a camera's features: its pictures, and their age [s]."""
_FILE_BYTES = 100 << 20
_FILES = 1000  # largest number of files in a folder
_PATTERN = "chunk-{chunk_index:03d}/file-{file_index:03d}.parquet"
_COUNTERS = ("timestamp", "frame_index", "episode_index", "index", "task_index")
_QUANTILES = {"q01": 0.01, "q10": 0.1, "q50": 0.5, "q90": 0.9, "q99": 0.99}
Numbers = dict[str, NDArray[np.float32] | NDArray[np.int64]]
Statistics = dict[str, dict[str, Any]]


@dataclass(frozen=True)
class DataSet:
    """What a data set shall contain.

    Attributes:
        task: Description of the task.
        fps: Frames per second; 0 for the rate of the fastest camera, or 50 without cameras.
        state: Topics of ``observation.state``; empty for those of the slave.
        action: ``joints``, ``tip``, or topics.
        cameras: Topics of pictures; None for all.
        codec: Codec of the videos.
    """

    task: str = "teleoperation"
    fps: int = 0
    state: tuple[str, ...] = ()
    action: tuple[str, ...] = ("joints",)
    cameras: tuple[str, ...] | None = None
    codec: str = "av1"


@dataclass
class _Files:
    """Data files written so far: the current file and its size."""

    folder: Path
    number: int = 0
    size: int = 0
    writer: pq.ParquetWriter | None = field(default=None, repr=False)

    @property
    def place(self) -> tuple[int, int]:
        """Numbers of the current folder and file."""
        return divmod(self.number, _FILES)

    def write(self, table: pa.Table) -> None:
        """Write an episode, into a new file if the current file is full."""
        if self.writer is not None and self.size + table.nbytes > _FILE_BYTES:
            self.close()
            self.number, self.size = self.number + 1, 0
        if self.writer is None:
            path = self.folder / _path(*self.place)
            path.parent.mkdir(parents=True, exist_ok=True)
            self.writer = pq.ParquetWriter(path, table.schema)
        self.writer.write_table(table)
        self.size += table.nbytes

    def close(self) -> None:
        """Finish the present file."""
        if self.writer is not None:
            self.writer.close()
            self.writer = None


def _path(chunk: int, file: int) -> str:
    return _PATTERN.format(chunk_index=chunk, file_index=file)


class _Writer:
    """Writes episodes one after the other."""

    def __init__(self, out: Path, wanted: DataSet, fps: int) -> None:
        self.out, self.wanted, self.fps = out, wanted, fps
        self.files, self.videos = _Files(out / "data"), dict[str, Video]()
        self.names: dict[str, list[str]] = {}
        self.episodes: list[dict[str, object]] = []
        self.numbers: list[Numbers] = []
        self.frames, self.notes = 0, list[str]()

    def add(self, where: Path, found: Frames, bag: RosBag | None, cameras: Sequence[Camera]) -> None:
        """Write an episode.

        Raises:
            RecordingError: The joints or the cameras are others than those of the first episode.
        """
        names = found.names | {AGES + camera.name: [camera.name] for camera in cameras}
        if self.episodes and names != self.names:
            raise RecordingError(where, "has other joints, arms or cameras than the first recording of the data set")
        self.names, number, told = names, len(self.episodes), dict[str, object]()
        starts = [int((camera.newest(found.time_ns) >= 0).argmax()) for camera in cameras]
        found = found.since(max(starts, default=0))
        numbers: Numbers = dict(found.numbers)
        for camera in cameras:
            assert bag is not None
            numbers[AGES + camera.name] = self._film(where, bag, camera, found, told)
        numbers |= _counters(len(found.time_ns), number, self.frames, self.fps)
        self.files.write(_table(numbers))
        self.episodes.append(told | _about(numbers, number, self.frames, self.wanted.task, self.files.place))
        self.frames += len(found.time_ns)
        self.numbers.append(numbers)

    def _film(
        self, where: Path, bag: RosBag, camera: Camera, found: Frames, told: dict[str, object]
    ) -> NDArray[np.float32]:
        """Write the pictures of an episode, and return their ages (n, 1) [s]."""
        key, count = PICTURES + camera.name, len(found.time_ns)
        video = self.videos.setdefault(key, Video(self.out, key, self.fps, self.wanted.codec))
        place, scaled, shown = video.begin(), video.scaled, np.empty(count, np.int64)
        for k, (number, frame) in enumerate(Decoder(bag, camera).frames(camera.newest(found.time_ns))):
            video.add(frame, k, count)
            shown[k] = number
        place_end, statistics_ = video.end()
        told |= {f"videos/{key}/{name}": value for name, value in (place | place_end).items()}
        told |= {f"stats/{key}/{name}": value for name, value in statistics_.items()}
        age = ((found.time_ns - camera.stamp_ns[shown]) * 1e-9).astype(np.float32)
        self.notes.append(_note(where, camera, shown, age, video.scaled - scaled))
        return age[:, None]

    def finish(self, robot: str) -> None:
        """Write what belongs to the whole data set."""
        for video in self.videos.values():
            video.close()
        whole: Numbers = {key: np.concatenate([one[key] for one in self.numbers]) for key in self.numbers[0]}
        found = statistics(whole) | {key: video.statistics() for key, video in self.videos.items()}
        _write_meta(self.out, self.episodes, found, self.wanted.task)
        info = _info(robot, self.names, self.videos, self.fps, len(self.episodes), self.frames)
        (self.out / "meta" / "info.json").write_text(json.dumps(info, indent=4), encoding="utf-8")

    def close(self) -> None:
        """Close all files, also after an error."""
        self.files.close()
        for video in self.videos.values():
            video.close()


def _note(where: Path, camera: Camera, shown: NDArray[np.int64], age: NDArray[np.float32], scaled: int) -> str:
    """A line on the pictures of an episode: how many there were, and how many frames had no new one."""
    repeated = len(shown) - len(np.unique(shown))
    told = f"{where.name}: {camera.name} ({camera.topic}): {len(np.unique(shown))} pictures in {len(shown)} frames"
    told += f", {repeated} frames without a new picture; age {np.median(age):.3f} s, at most {age.max():.3f} s"
    told += f"; {scaled} frames scaled to the size of the first" * bool(scaled)
    return "; ".join((told, *camera.notes))


def write_data_set(
    recordings: Sequence[Recording | Path], out: Path, wanted: DataSet
) -> tuple[int, tuple[str, ...], tuple[str, ...]]:
    """Write a data set.

    Args:
        recordings: Recordings that become the episodes, or paths of those in another storage than MCAP; all must have
            the same joints and cameras.
        out: Folder of the new data set.
        wanted: What it shall contain.

    Returns:
        Number of frames, the features that are not counters, and a line on the pictures of each episode and camera.

    Raises:
        RecordingError: A recording lacks a needed topic, or its joints or cameras differ from those of the first one.
        UnknownNameError: There is no such topic.
    """
    if wanted.codec not in CODECS:
        raise UnknownNameError("--video", wanted.codec, CODECS)
    surroundings, writer, robot = around(recordings), None, "teleop_core"
    try:
        for recording in recordings:
            with opened(recording) as bag:
                cameras = [] if bag is None else cameras_of(bag, wanted.cameras)
                if writer is None:
                    fastest = round(max((camera.rate for camera in cameras), default=0.0)) or FPS
                    writer = _Writer(out, wanted, wanted.fps or fastest)
                    robot = _robot(recording)
                found = frames_of(recording, writer.fps, wanted.state, wanted.action, surroundings)
                writer.add(recording if isinstance(recording, Path) else recording.bag.path, found, bag, cameras)
        assert writer is not None
        writer.finish(robot)
    finally:
        if writer is not None:
            writer.close()
    return writer.frames, (*writer.names, *writer.videos), tuple(writer.notes)


def _robot(recording: Recording | Path) -> str:
    """Name of the robot in a recording of this package."""
    return (isinstance(recording, Recording) and recording.metadata.get("robot")) or "teleop_core"


def _counters(count: int, episode: int, before: int, fps: int) -> Numbers:
    frame = np.arange(count, dtype=np.int64)
    return {
        "timestamp": (frame / fps).astype(np.float32),
        "frame_index": frame,
        "episode_index": np.full(count, episode, np.int64),
        "index": before + frame,
        "task_index": np.zeros(count, np.int64),
    }


def _table(numbers: Numbers) -> pa.Table:
    columns = {}
    for key, values in numbers.items():
        if values.ndim == 2 and values.shape[1] > 1:
            flat = pa.array(np.ascontiguousarray(values).reshape(-1))
            columns[key] = pa.FixedSizeListArray.from_arrays(flat, values.shape[1])
        else:
            columns[key] = pa.array(values.reshape(-1))
    return pa.table(columns)


def statistics(numbers: Numbers) -> Statistics:
    """Extremes, mean, standard deviation, quantiles and count of each column of each feature."""
    out: Statistics = {}
    for key, values in numbers.items():
        rows = values.reshape(len(values), -1)
        wide = rows.astype(np.float64)
        found = {
            "min": rows.min(axis=0).tolist(),
            "max": rows.max(axis=0).tolist(),
            "mean": wide.mean(axis=0).tolist(),
            "std": wide.std(axis=0).tolist(),
            "count": [len(rows)],
        }
        for name, share in _QUANTILES.items():
            found[name] = np.quantile(wide, share, axis=0).tolist()
        out[key] = found
    return out


def _about(numbers: Numbers, episode: int, before: int, task: str, place: tuple[int, int]) -> dict[str, object]:
    count = len(numbers[STATE])
    row: dict[str, object] = {
        "episode_index": episode,
        "tasks": [task],
        "length": count,
        "data/chunk_index": place[0],
        "data/file_index": place[1],
        "dataset_from_index": before,
        "dataset_to_index": before + count,
    }
    for key, found in statistics(numbers).items():
        row |= {f"stats/{key}/{name}": values for name, values in found.items()}
    return row | {"meta/episodes/chunk_index": 0, "meta/episodes/file_index": 0}


def _write_meta(out: Path, episodes: Sequence[dict[str, object]], found: Statistics, task: str) -> None:
    path = out / "meta" / "episodes" / _path(0, 0)
    path.parent.mkdir(parents=True, exist_ok=True)
    pq.write_table(pa.Table.from_pylist(list(episodes)), path)
    (out / "meta" / "stats.json").write_text(json.dumps(found, indent=4), encoding="utf-8")
    tasks = pd.DataFrame({"task_index": [0]}, index=pd.Index([task], name="task"))
    tasks.to_parquet(out / "meta" / "tasks.parquet")


def _info(
    robot: str, names: Mapping[str, Sequence[str]], videos: Mapping[str, Video], fps: int, episodes: int, frames: int
) -> dict[str, object]:
    features: dict[str, object] = {
        key: {"dtype": "float32", "shape": [len(found)], "names": list(found)} for key, found in names.items()
    }
    features |= {key: video.feature() for key, video in videos.items()}
    for key in _COUNTERS:
        kind = "float32" if key == "timestamp" else "int64"
        features[key] = {"dtype": kind, "shape": [1], "names": None}
    return {
        "codebase_version": VERSION,
        "robot_type": robot,
        "total_episodes": episodes,
        "total_frames": frames,
        "total_tasks": 1,
        "chunks_size": _FILES,
        "data_files_size_in_mb": _FILE_BYTES >> 20,
        "video_files_size_in_mb": FILE_BYTES >> 20,
        "fps": fps,
        "splits": {"train": f"0:{episodes}"},
        "data_path": f"data/{_PATTERN}",
        "video_path": VIDEO_PATTERN if videos else None,
        "features": features,
    }
