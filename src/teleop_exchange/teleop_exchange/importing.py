"""Import: converts a file of another program to a recording of this package."""

import hashlib
import json
import shlex
import shutil
from collections.abc import Iterator, Mapping
from dataclasses import asdict, replace
from functools import lru_cache
from pathlib import Path
from types import MappingProxyType

import numpy as np

from teleop_core.bags.arms import ARMS_KEY
from teleop_core.bags.finding import check_new
from teleop_core.bags.writer import BagWriter
from teleop_core.base.errors import ParameterError, RecordingError
from teleop_core.graph.topics import HAND_JAW, MASTER_BUTTONS, MASTER_MEASURED_CP, Topic
from teleop_core.kernels.geometry import Array
from teleop_exchange.import_report import ImportReport, summary
from teleop_exchange.imported_motion import Motion
from teleop_exchange.options import Changes, ImportOptions, Option, options_of
from teleop_exchange.times import Stamps

ROWS = 20_000
"""Number of rows that are written together."""


def import_recording(
    file: Path | str,
    out: Path | str,
    options: ImportOptions | None = None,
    *,
    arms: Mapping[str, Changes] = MappingProxyType({}),
    **changes: Option,
) -> ImportReport:
    """Make a recording from a file: CSV, TSV, Parquet, rosbag2 (MCAP, db3) or a ROS 1 bag.

    The recording contains ``master/measured_cp`` with every usable sample at its own time, and ``master/buttons`` if
    the file contains buttons. :func:`teleop_core.replay` runs it through the graph.

    Args:
        file: File to import.
        out: Directory of the new recording; it is removed after an error.
        options: Import options; options that are not given are guessed, and the report states the guesses.
        arms: Options of each hand of a file with several hands, in addition to the common options: ``{"left":
            {"position": "1-3"}, "right": {"position": "4-6"}}``. The first hand belongs to the default arm.
        **changes: Options by name: ``position=("x", "y", "z"), unit="mm"``.

    Returns:
        Report of the import. ``report.recording`` is the recording, and ``print(report)`` shows the report. For several
        hands the report is that of the first hand, and ``report.others`` contains the reports of the other hands.

    Raises:
        RecordingError: The file is missing, damaged, empty, or not a motion, or ``out`` exists.
        ParameterError: An option is wrong.
        UnknownNameError: A column or topic does not exist; the message lists all existing columns or topics.
    """
    path, out = Path(file), Path(out)
    wanted = options_of(options or ImportOptions(), arms, changes)
    if any(one.episode == "all" for one in wanted.values()):
        raise ParameterError("--episode", "all", "the number of one episode; `import_episodes` imports all of them")
    check_new(out)
    motions = {arm: Motion(path, one) for arm, one in wanted.items()}
    first_ns = min(int(motion.stamp_ns[0]) for motion in motions.values())
    for motion in motions.values():
        motion.begin(first_ns)
    found = [
        summary(path.name, out, motion, arm, shlex.join(wanted[arm].as_arguments())) for arm, motion in motions.items()
    ]
    report = replace(found[0], others=tuple(found[1:]))
    write(motions, out, _about(path, out, wanted, report))
    return report


def write(motions: Mapping[str, Motion], out: Path, metadata: dict[str, str]) -> None:
    """Write the motion of each arm to a recording, the default arm first; after an error no directory remains."""
    streams: dict[Topic, tuple[Stamps, Array]] = {}
    for number, (arm, motion) in enumerate(motions.items()):
        name = arm if number else ""
        streams[MASTER_MEASURED_CP.of_arm(name)] = (motion.stamp_ns, motion.poses)
        if (closings := motion.closings()) is not None:
            streams[HAND_JAW.of_arm(name)] = closings
        if (presses := motion.presses()) is not None:
            stamps, pressed = presses
            streams[MASTER_BUTTONS.of_arm(name)] = (stamps, pressed.astype(np.float64))
    try:
        with BagWriter(out, list(streams), (), metadata=metadata) as writer:
            for block in _blocks(streams):
                writer.write_block(block)
    except BaseException as error:
        # A directory that another process made in the meantime must not be removed.
        if not (isinstance(error, RecordingError) and "exists already" in error.reason):
            shutil.rmtree(out, ignore_errors=True)
        raise


def _blocks(streams: Mapping[Topic, tuple[Stamps, Array]]) -> Iterator[dict[Topic, tuple[Stamps, Array, Stamps]]]:
    """Yield successive time intervals, each with the samples of all streams."""
    ends = np.sort(np.concatenate([s[ROWS - 1 :: ROWS] for s, _ in streams.values()]))
    written = dict.fromkeys(streams, 0)
    for end in (*ends, np.iinfo(np.int64).max):
        block = {}
        for topic, (stamps, values) in streams.items():
            part = slice(written[topic], int(np.searchsorted(stamps, end, side="right")))
            block[topic] = (stamps[part], values[part], stamps[part])
            written[topic] = part.stop
        yield block


def command_of(path: Path, out: Path, options: Mapping[str, ImportOptions]) -> str:
    """Command line that imports a file, with the options of each arm."""
    words = ["teleop", "import", path.name, "--out", out.name]
    for arm, one in options.items():
        own = one.as_arguments()
        words += ["--arm", arm, shlex.join(own)] if arm else own
    return shlex.join(words)


def _about(path: Path, out: Path, options: Mapping[str, ImportOptions], report: ImportReport) -> dict[str, str]:
    """Metadata that allow an import to be repeated."""
    from teleop_core import __version__

    named = {} if "" in options else {ARMS_KEY: " ".join(options)}
    return named | {
        "version": __version__,
        "imported_from": path.name,
        "imported_sha256": checksum(path),
        "imported_by": command_of(path, out, options),
        "imported_mapping": "; ".join(report.told),
        "imported_counts": json.dumps(asdict(report.counts)),
    }


def checksum(path: Path) -> str:
    """SHA-256 of a file; for a directory, of the message files in it, in the order of their names."""
    files = [path]
    if path.is_dir():
        files = sorted(f for f in path.iterdir() if f.is_file() and f.suffix != ".yaml")
    stats = [file.stat() for file in files]
    return _checksum(tuple((file, stat.st_size, stat.st_mtime_ns) for file, stat in zip(files, stats, strict=True)))


@lru_cache(1)  # the episodes of a data set share its file
def _checksum(files: tuple[tuple[Path, int, int], ...]) -> str:
    """SHA-256 of files with their sizes and times of change."""
    found = hashlib.sha256()
    for file, _, _ in files:
        with file.open("rb") as stream:
            while data := stream.read(1 << 20):
                found.update(data)
    return found.hexdigest()
