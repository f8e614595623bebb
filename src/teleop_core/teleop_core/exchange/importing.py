"""Import: a file of others becomes a recording of ours."""

import hashlib
import json
import shlex
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from teleop_core.bags.writer import BagWriter
from teleop_core.errors import RecordingError
from teleop_core.exchange.gathering import gather
from teleop_core.exchange.motion import Motion
from teleop_core.exchange.opening import open_source
from teleop_core.exchange.options import ImportOptions, Option
from teleop_core.exchange.report import ImportReport, summary
from teleop_core.exchange.spool import Spool
from teleop_core.exchange.times import Stamps
from teleop_core.geometry import Array
from teleop_core.topics import MASTER_BUTTONS, MASTER_MEASURED_CP, Topic

_READ = 1 << 20


def import_recording(
    file: Path | str, out: Path | str, options: ImportOptions | None = None, **changes: Option
) -> ImportReport:
    """Make a recording of a file: CSV, TSV, Parquet, rosbag2 (MCAP, db3) or a ROS 1 bag.

    The recording holds ``master/measured_cp`` with every usable sample at its own time, and
    ``master/buttons`` where buttons were found. :func:`teleop_core.replay` runs it through the
    graph.

    Args:
        file: What is imported.
        out: Directory of the recording, made here; nothing is left there after an error.
        options: What is taken of the file; what is not said is guessed and told.
        **changes: Options by name: ``position=("x", "y", "z"), unit="mm"``.

    Returns:
        What was found; ``report.recording`` is the recording, ``print(report)`` shows it.

    Raises:
        RecordingError: The file is missing, damaged, empty, or no motion; or ``out`` exists.
        ParameterError: An option is wrong.
        UnknownNameError: A column or topic is not there; those that are there are listed.
    """
    path, out = Path(file), Path(out)
    wanted = (options or ImportOptions()).changed(**changes)
    if out.exists():
        raise RecordingError(out, "exists already; choose another --out")
    with opened(path, wanted) as motion:
        report = summary(path.name, out, motion)
        write(motion, out, _about(path, out, wanted, report))
    return report


@contextmanager
def opened(path: Path, options: ImportOptions) -> Iterator[Motion]:
    """Motion of a file, as long as it is needed."""
    source = open_source(path, options)
    with Spool(7) as spool:
        yield Motion(path, gather(source, options, spool), options)


def write(motion: Motion, out: Path, metadata: dict[str, str]) -> None:
    """Record a motion; the directory is there as a whole or not at all."""
    presses = motion.presses()
    topics = [MASTER_MEASURED_CP] + ([MASTER_BUTTONS] if presses is not None else [])
    try:
        with BagWriter(out, topics, (), metadata=metadata) as writer:
            written = 0
            for stamps, poses in motion.blocks():
                block: dict[Topic, tuple[Stamps, Array, Stamps]] = {
                    MASTER_MEASURED_CP: (stamps, poses, stamps)
                }
                if presses is not None:
                    end = int(np.searchsorted(presses[0], stamps[-1], side="right"))
                    block[MASTER_BUTTONS] = _pressed(presses, written, end)
                    written = end
                writer.write_block(block)
            if presses is not None:
                writer.write_block({MASTER_BUTTONS: _pressed(presses, written, len(presses[0]))})
    except BaseException as error:
        # A directory that another process made in the meantime is not ours to remove.
        if not (isinstance(error, RecordingError) and "exists already" in error.reason):
            shutil.rmtree(out, ignore_errors=True)
        raise


def _pressed(
    presses: tuple[Stamps, NDArray[np.uint8]], begin: int, end: int
) -> tuple[Stamps, Array, Stamps]:
    stamps = presses[0][begin:end]
    return stamps, presses[1][begin:end].astype(np.float64), stamps


def _about(path: Path, out: Path, options: ImportOptions, report: ImportReport) -> dict[str, str]:
    """Names and texts by which an import can be repeated."""
    from teleop_core import __version__

    words = ["teleop", "import", path.name, "--out", out.name, *options.as_arguments()]
    return {
        "version": __version__,
        "imported_from": path.name,
        "imported_sha256": checksum(path),
        "imported_by": shlex.join(words),
        "imported_mapping": "; ".join(report.told),
        "imported_counts": json.dumps(asdict(report.counts)),
    }


def checksum(path: Path) -> str:
    """SHA-256 of a file; of a directory over the files of messages in it, by name."""
    files = [path]
    if path.is_dir():
        files = sorted(f for f in path.iterdir() if f.is_file() and f.suffix != ".yaml")
    found = hashlib.sha256()
    for file in files:
        with file.open("rb") as stream:
            while data := stream.read(_READ):
                found.update(data)
    return found.hexdigest()
