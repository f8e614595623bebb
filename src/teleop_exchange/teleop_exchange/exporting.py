"""Export: converts recordings to tables (CSV or Parquet), or to a data set for robot learning."""

import shutil
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pyarrow as pa
import pyarrow.csv as pc
import pyarrow.parquet as pq

from teleop_core.bags.finding import check_new
from teleop_core.base.errors import ParameterError, RecordingError, UnknownNameError
from teleop_core.graph.topics import BY_NAME, Kind
from teleop_core.session.recording import Recording, open_recording
from teleop_exchange.joining import Joined, Streams

if TYPE_CHECKING:
    from teleop_exchange.lerobot import DataSet

_BY_COLUMN = {
    **dict.fromkeys("xyz", "m"),
    **dict.fromkeys(("qw", "qx", "qy", "qz"), "1"),
    **dict.fromkeys(("vx", "vy", "vz"), "m/s"),
    **dict.fromkeys(("wx", "wy", "wz"), "rad/s"),
    **dict.fromkeys(("fx", "fy", "fz"), "N"),
    **dict.fromkeys(("tx", "ty", "tz"), "Nm"),
}


def unit_of(topic: str, column: str) -> str:
    """Unit of a column of a topic; empty if it has no unit.

    Joints may be revolute or prismatic, so the unit of their positions is "rad or m".
    """
    known = next((t for n, t in BY_NAME.items() if topic == n or topic.endswith(f"/{n}")), None)
    if known is not None and known.columns:
        return _of_number(column)
    if known is not None and known.kind is Kind.JAW:
        return {"velocity": "rad/s", "effort": "Nm"}.get(column, "rad")
    if known is None or not known.kind.has_joints:
        return _BY_COLUMN.get(column, "")
    last = column.rpartition(".")[2]
    return {"velocity": "rad/s or m/s", "effort": "Nm or N"}.get(last, "rad or m")


def _of_number(column: str) -> str:
    """Unit of a named number, for example in a report."""
    if column.startswith(("fixture_center", "fixture_size")):
        return "m"
    if column == "position_residual" or column in {"cut_x", "cut_y", "cut_z"}:
        return "m"
    if column in {"rotation_residual", "jaw"} or column.startswith("cut_r"):
        return "rad"
    return {"force": "N", "slid": "m"}.get(column, "")


FORMATS = ("csv", "parquet", "lerobot")
OneRecording = Recording | Path | str


@dataclass(frozen=True)
class ExportReport:
    """Result of an export.

    Attributes:
        out: File or directory that was made.
        rows: Number of rows; for a data set, the number of frames.
        columns: Names of the columns; for a data set, the names of the features.
        episodes: Number of exported recordings.
        notes: For a data set, a line on the pictures of each episode and camera.
    """

    out: Path
    rows: int
    columns: tuple[str, ...]
    episodes: int = 1
    notes: tuple[str, ...] = ()

    def __str__(self) -> str:
        if self.episodes > 1 or self.out.is_dir():
            told = f"{self.out}: {self.episodes} episodes, {self.rows} frames of " + ", ".join(self.columns)
            return "\n".join((*self.notes, told))
        return f"{self.out}: {self.rows} rows, {len(self.columns)} columns"


def export_recording(
    recording: OneRecording | Sequence[OneRecording],
    out: Path | str,
    format: str | None = None,  # noqa: A002
    *,
    topics: Iterable[str] = (),
    rate: float | None = None,
    units: bool = False,
    action: str | Sequence[str] = "joints",
    state: Sequence[str] = (),
    cameras: Sequence[str] | None = None,
    video: str = "av1",
    task: str = "teleoperation",
) -> ExportReport:
    """Write recordings in a format of other programs.

    The first column of a table is the time [s] since the recording began. Each number of each topic has a further
    column, named as in :meth:`teleop_core.Recording.frame`: ``slave/measured_cp.x``. Each time at which a topic has a
    message gives a row. In this row the columns of topics without a message are empty; only reports such as
    ``teleop/state`` keep their last values. Parquet files contain the units of columns as metadata.

    A LeRobot data set (version 3.0 of the format) contains one episode for each recording. ``observation.state``
    contains the slave's joints and the pose of its tip; ``action`` contains the commands. Each camera has a video,
    ``observation.images.<camera>``, of the newest picture that was taken before each frame, and
    ``observation.age.<camera>``, the age of that picture [s]. Recordings of other writers may be in any storage that
    :func:`import_recording` reads.

    Args:
        recording: A recording or its path; several for a data set.
        out: Path of the new file or of the new directory of a data set; it is removed after an error.
        format: ``csv``, ``parquet`` or ``lerobot``; None chooses by the extension of ``out``.
        topics: Topics of a table; empty for all topics.
        rate: Rows per second [Hz]; each row contains the newest values. None stands for a row at the time of each
            message; in a data set for the rate of the fastest camera, or 50 Hz.
        units: Whether names of columns end with the unit, as in ``slave/measured_cp.x [m]``.
        action: For a data set: ``joints`` (``slave/servo_jp``), ``tip`` (``slave/servo_cp``), or topics.
        state: For a data set: topics of ``observation.state``; empty for those of the slave. In recordings without a
            slave, joint states are the state, and topics whose names tell a command are the action.
        cameras: For a data set: topics of pictures; None for all of them.
        video: For a data set: codec of the videos, ``av1`` or ``h264``, which is made four times as fast.
        task: For a data set: description of the task.

    Returns:
        Report of the export.

    Raises:
        RecordingError: A recording cannot be read, or ``out`` exists or cannot be written.
        UnknownNameError: The format or a topic is unknown.
        ParameterError: A value is not allowed for the format.
    """
    several = [recording] if isinstance(recording, OneRecording) else list(recording)
    path = Path(out)
    chosen = format or _by_name(path)
    if chosen not in FORMATS:
        raise UnknownNameError("--format", chosen, FORMATS)
    if rate is not None and not 0.0 < rate <= 1e6:
        raise ParameterError("--rate", rate, "above 0 Hz")
    check_new(path)
    if not several:
        raise ParameterError("recording", [], "at least one recording")
    if chosen == "lerobot":
        from teleop_exchange.lerobot import DataSet

        actions = (action,) if isinstance(action, str) else tuple(action)
        seen = None if cameras is None else tuple(cameras)
        return _data_set(several, path, DataSet(task, _whole_rate(rate), tuple(state), actions, seen, video))
    opened = [one if isinstance(one, Recording) else open_recording(one) for one in several]
    if len(opened) > 1:
        raise ParameterError("recordings", len(opened), f"one for {chosen}; lerobot takes several")
    streams = Streams(opened[0], topics)
    rows = streams.joined() if rate is None else streams.sampled(rate)
    schema = _schema(streams, units=units)
    with whole(path) as draft:
        written = _write(streams, rows, schema, draft, chosen, is_packed=path.suffix == ".gz")
    return ExportReport(path, written, tuple(schema.names))


def _by_name(path: Path) -> str:
    """Format by the extension of a name; a name without extension means a data set."""
    name = path.name.lower().removesuffix(".gz")
    for chosen in ("csv", "parquet"):
        if name.endswith(f".{chosen}"):
            return chosen
    if not path.suffix:
        return "lerobot"
    raise ParameterError(
        "--out",
        path.name,
        "a name that ends with .csv, .csv.gz or .parquet, or a directory for lerobot; else give --format",
    )


def _whole_rate(rate: float | None) -> int:
    if rate is not None and rate != round(rate):
        raise ParameterError("--rate", rate, "a whole number for lerobot")
    return round(rate or 0)


def _data_set(several: Sequence[OneRecording], path: Path, wanted: "DataSet") -> ExportReport:
    from teleop_exchange.frames import open_any
    from teleop_exchange.lerobot import write_data_set

    opened = [one if isinstance(one, Recording) else open_any(one) for one in several]
    with whole(path) as draft:
        frames, features, notes = write_data_set(opened, draft, wanted)
    return ExportReport(path, frames, features, len(opened), notes)


@contextmanager
def whole(path: Path) -> Iterator[Path]:
    """Yield a draft file next to a path.

    The draft replaces the path after complete writing; an error removes the draft.

    Raises:
        RecordingError: The draft cannot be written.
    """
    draft = path.with_name(f".{path.name}.part")
    try:
        _remove(draft)
        draft.parent.mkdir(parents=True, exist_ok=True)
        yield draft
        draft.rename(path)
    except OSError as error:
        raise RecordingError(path, f"cannot be written: {error.strerror or error}") from error
    finally:
        _remove(draft)


def _remove(draft: Path) -> None:
    if draft.is_dir():
        shutil.rmtree(draft, ignore_errors=True)
    else:
        draft.unlink(missing_ok=True)


def _schema(streams: Streams, *, units: bool) -> pa.Schema:
    found = [("time", "s")]
    for topic, columns in streams.columns.items():
        found += [(f"{topic}.{column}", unit_of(topic, column)) for column in columns]
    return pa.schema(
        pa.field(f"{name} [{unit}]" if units and unit else name, pa.float64(), metadata={"unit": unit})
        for name, unit in found
    )


def _write(
    streams: Streams, rows: Iterable[Joined], schema: pa.Schema, draft: Path, chosen: str, *, is_packed: bool
) -> int:
    written = 0
    packed = "gzip" if is_packed and chosen == "csv" else None
    with pa.output_stream(str(draft), compression=packed) as file:
        writer: Callable[..., pc.CSVWriter | pq.ParquetWriter] = pq.ParquetWriter
        if chosen == "csv":
            writer = pc.CSVWriter
        with writer(file, schema) as table:
            for piece in rows:
                table.write_table(_table(streams, piece, schema))
                written += len(piece.time_ns)
    return written


def _table(streams: Streams, piece: Joined, schema: pa.Schema) -> pa.Table:
    columns = [(piece.time_ns - streams.start_ns) * 1e-9]
    for topic in streams.columns:
        columns += list(np.ascontiguousarray(piece.values[topic].T))
    # NaN becomes an empty cell.
    return pa.Table.from_arrays([pa.array(column, pa.float64(), from_pandas=True) for column in columns], schema=schema)
