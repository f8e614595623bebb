"""LeRobot data set: recordings as episodes for learning, in version 3.0 of the format.

A data set is a folder with ``meta/info.json`` (features, rate, counts), ``meta/stats.json``, ``meta/tasks.parquet``,
``meta/episodes`` (a row for each episode) and ``data`` (a row for each frame, a group of rows for each episode). It
contains no pictures. The ``lerobot`` package, version 0.4, reads the folder offline: ``LeRobotDataset("name",
root=FOLDER)``.
"""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import NDArray

from teleop_core.bags.arms import topic_prefix
from teleop_core.base.errors import RecordingError
from teleop_core.graph.topics import (
    SLAVE_JAW_OBJECT_CP,
    SLAVE_MEASURED_CP,
    SLAVE_MEASURED_JS,
    SLAVE_SERVO_CP,
    SLAVE_SERVO_JP,
    TASK_STATE,
    Topic,
)
from teleop_core.kernels.geometry import Array
from teleop_core.session.recording import Recording
from teleop_exchange.joining import Streams

VERSION = "v3.0"
FPS = 50
STATE, ACTION = "observation.state", "action"
SURROUNDINGS = "observation.environment_state"
"""Feature with the goal of the task and the pose of the object. Policies such as ACT need this feature or pictures."""
_GOAL = ("goal_x", "goal_y", "goal_z", "goal_qw", "goal_qx", "goal_qy", "goal_qz", "width")
_AROUND: dict[Topic, tuple[str, ...]] = {TASK_STATE: _GOAL, SLAVE_JAW_OBJECT_CP: ()}  # all columns of the pose
_FILE_BYTES = 100 << 20
_FILES = 1000  # largest number of files in a folder
_PATTERN = "chunk-{chunk_index:03d}/file-{file_index:03d}.parquet"
_COUNTERS = ("timestamp", "frame_index", "episode_index", "index", "task_index")
_QUANTILES = {"q01": 0.01, "q10": 0.1, "q50": 0.5, "q90": 0.9, "q99": 0.99}
Numbers = dict[str, NDArray[np.float32] | NDArray[np.int64]]
Statistics = dict[str, dict[str, list[float]]]


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


def write_data_set(
    recordings: Sequence[Recording], out: Path, fps: int, action: str, task: str
) -> tuple[int, tuple[str, ...]]:
    """Write a data set.

    Args:
        recordings: Recordings that become the episodes; all must have the same joints.
        out: Folder of the new data set.
        fps: Frames per second.
        action: ``joints`` or ``tip``.
        task: Description of the task.

    Returns:
        Number of frames, and the features that are not counters.

    Raises:
        RecordingError: A recording lacks a needed topic, or its joints differ from those of the first recording.
    """
    files, episodes, frames = _Files(out / "data"), [], 0
    names: dict[str, list[str]] = {}
    all_numbers: list[Numbers] = []
    around = [topic for topic in _AROUND if all(_has(recording, topic) for recording in recordings)]
    try:
        for number, recording in enumerate(recordings):
            found, numbers = _episode(recording, fps, action, around)
            if names and found != names:
                reason = "has other joints or arms than the first recording of the data set"
                raise RecordingError(recording.bag.path, reason)
            names = found
            numbers = numbers | _counters(len(numbers[STATE]), number, frames, fps)
            files.write(_table(numbers))
            episodes.append(_about(numbers, number, frames, task, files.place))
            frames += len(numbers[STATE])
            all_numbers.append(numbers)
    finally:
        files.close()
    whole: Numbers = {key: np.concatenate([one[key] for one in all_numbers]) for key in all_numbers[0]}
    _write_meta(out, episodes, statistics(whole), task)
    info = _info(recordings[0], names, fps, len(episodes), frames)
    (out / "meta" / "info.json").write_text(json.dumps(info, indent=4), encoding="utf-8")
    return frames, tuple(names)


def _has(recording: Recording, topic: Topic) -> bool:
    """Whether each arm of a recording has messages of a topic."""
    names = [topic_prefix(recording.bag, arm) + topic.name for arm in recording.arms]
    return all(name in recording.bag.topics and recording.bag.topics[name].count for name in names)


def _episode(
    recording: Recording, fps: int, action: str, around: Sequence[Topic]
) -> tuple[dict[str, list[str]], Numbers]:
    """Names and numbers (frames, columns) of the features of a recording.

    A frame contains the newest message of each topic. Frames at which a topic has had no message are left out.
    """
    keys = (STATE, *[SURROUNDINGS] * bool(around), ACTION)
    bag, names, topics = recording.bag, {key: list[str]() for key in keys}, []
    told = SLAVE_SERVO_JP if action == "joints" else SLAVE_SERVO_CP
    for arm in recording.arms:
        prefix = topic_prefix(bag, arm)
        measured = ((STATE, SLAVE_MEASURED_JS), (STATE, SLAVE_MEASURED_CP))
        for key, topic in (*measured, *((SURROUNDINGS, topic) for topic in around), (ACTION, told)):
            topics.append((key, prefix, prefix + topic.name))
    bag.require([name for _, _, name in topics])
    streams = Streams(recording, [name for _, _, name in topics])
    parts: dict[str, list[Array]] = {key: [] for key in keys}
    pieces = list(streams.sampled(fps))
    for key, prefix, name in topics:
        columns = [c for c in streams.columns[name] if not c.endswith((".velocity", ".effort"))]
        if wanted := next((own for topic, own in _AROUND.items() if name == prefix + topic.name), ()):
            columns = [c for c in columns if c.removesuffix(".position") in wanted]
        at = [streams.columns[name].index(column) for column in columns]
        parts[key].append(np.concatenate([piece.values[name][:, at] for piece in pieces]))
        tip = {SLAVE_MEASURED_CP.name: "tip.", SLAVE_SERVO_CP.name: "tip.", SLAVE_JAW_OBJECT_CP.name: "object."}.get(
            name.removeprefix(prefix), ""
        )
        names[key] += [prefix + tip + column.removesuffix(".position") for column in columns]
    numbers = {key: np.hstack(found).astype(np.float32) for key, found in parts.items()}
    is_known = np.isfinite(np.hstack(list(numbers.values()))).all(axis=1)
    if not is_known.any():
        raise RecordingError(bag.path, "has no time at which all topics of the data set are known")
    first = int(is_known.argmax())
    return names, {key: found[first:] for key, found in numbers.items()}


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
        if values.ndim == 2:
            flat = pa.array(np.ascontiguousarray(values).reshape(-1))
            columns[key] = pa.FixedSizeListArray.from_arrays(flat, values.shape[1])
        else:
            columns[key] = pa.array(values)
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
    recording: Recording, names: Mapping[str, Sequence[str]], fps: int, episodes: int, frames: int
) -> dict[str, object]:
    features: dict[str, object] = {
        key: {"dtype": "float32", "shape": [len(found)], "names": list(found)} for key, found in names.items()
    }
    for key in _COUNTERS:
        kind = "float32" if key == "timestamp" else "int64"
        features[key] = {"dtype": kind, "shape": [1], "names": None}
    return {
        "codebase_version": VERSION,
        "robot_type": recording.metadata.get("robot") or "teleop_core",
        "total_episodes": episodes,
        "total_frames": frames,
        "total_tasks": 1,
        "chunks_size": _FILES,
        "data_files_size_in_mb": _FILE_BYTES >> 20,
        "video_files_size_in_mb": 200,
        "fps": fps,
        "splits": {"train": f"0:{episodes}"},
        "data_path": f"data/{_PATTERN}",
        "video_path": None,
        "features": features,
    }
