"""Import: a file of others becomes a recording of ours."""

import hashlib
import json
import shlex
import shutil
from collections.abc import Iterator, Mapping
from contextlib import ExitStack
from dataclasses import asdict, replace
from itertools import zip_longest
from pathlib import Path
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from teleop_core.bags.arms import ARMS_KEY
from teleop_core.bags.writer import BagWriter
from teleop_core.base.errors import RecordingError
from teleop_core.graph.topics import MASTER_BUTTONS, MASTER_MEASURED_CP, Topic
from teleop_core.kernels.geometry import Array
from teleop_exchange.import_report import ImportReport, summary
from teleop_exchange.imported_motion import Motion
from teleop_exchange.options import ImportOptions, Option
from teleop_exchange.presets import options_of
from teleop_exchange.spool import Spool
from teleop_exchange.times import Stamps

_READ = 1 << 20


def import_recording(
    file: Path | str,
    out: Path | str,
    options: ImportOptions | None = None,
    *,
    preset: str = "",
    arms: Mapping[str, Mapping[str, Option]] = MappingProxyType({}),
    **changes: Option,
) -> ImportReport:
    """Make a recording of a file: CSV, TSV, Parquet, rosbag2 (MCAP, db3) or a ROS 1 bag.

    The recording holds ``master/measured_cp`` with every usable sample at its own time, and
    ``master/buttons`` where buttons were found. :func:`teleop_core.replay` runs it through the
    graph.

    Args:
        file: What is imported.
        out: Directory of the recording, made here; nothing is left there after an error.
        options: What is taken of the file; what is not said is guessed and told.
        preset: Options for files of a known system:
            :data:`~teleop_exchange.presets.PRESETS`.
        arms: Several hands of one file, each with options beside those of all: ``{"left":
            {"position": "1-3"}, "right": {"position": "4-6"}}``. The first is the default arm.
        **changes: Options by name: ``position=("x", "y", "z"), unit="mm"``.

    Returns:
        What was found; ``report.recording`` is the recording, ``print(report)`` shows it. Of
        several hands it is that of the first, and ``report.others`` has the others.

    Raises:
        RecordingError: The file is missing, damaged, empty, or no motion; or ``out`` exists.
        ParameterError: An option is wrong.
        UnknownNameError: A column or topic is not there; those that are there are listed.
    """
    path, out = Path(file), Path(out)
    wanted = options_of(options or ImportOptions(), preset, arms, changes)
    if out.exists():
        raise RecordingError(out, "exists already; choose another --out")
    with ExitStack() as spools:
        motions = {
            arm: Motion(path, one, spools.enter_context(Spool(7))) for arm, one in wanted.items()
        }
        first_ns = min(int(motion.stamp_ns[0]) for motion in motions.values())
        for motion in motions.values():
            motion.begin(first_ns)
        found = [summary(path.name, out, motion, arm) for arm, motion in motions.items()]
        report = replace(found[0], others=tuple(found[1:]))
        write(motions, out, _about(path, out, wanted, report))
    return report


Block = dict[Topic, tuple[Stamps, Array, Stamps]]


def write(motions: Mapping[str, Motion], out: Path, metadata: dict[str, str]) -> None:
    """Record the motion of each arm, the default one first; the directory is whole or not there."""
    hands = [_Hand(arm if number else "", m) for number, (arm, m) in enumerate(motions.items())]
    topics = [topic for hand in hands for topic in hand.topics]
    try:
        with BagWriter(out, topics, (), metadata=metadata) as writer:
            for blocks in zip_longest(*(hand.blocks() for hand in hands), fillvalue={}):
                writer.write_block({t: part for block in blocks for t, part in block.items()})
    except BaseException as error:
        # A directory that another process made in the meantime is not ours to remove.
        if not (isinstance(error, RecordingError) and "exists already" in error.reason):
            shutil.rmtree(out, ignore_errors=True)
        raise


class _Hand:
    """Topics and blocks of one arm; its buttons stand in the block of the poses at their time."""

    def __init__(self, arm: str, motion: Motion) -> None:
        self._motion, self._presses = motion, motion.presses()
        self._poses, self._buttons = MASTER_MEASURED_CP.of_arm(arm), MASTER_BUTTONS.of_arm(arm)
        self.topics = [self._poses] + [self._buttons] * (self._presses is not None)

    def blocks(self) -> Iterator[Block]:
        written = 0
        for stamps, poses in self._motion.blocks():
            block: Block = {self._poses: (stamps, poses, stamps)}
            if self._presses is not None:
                end = int(np.searchsorted(self._presses[0], stamps[-1], side="right"))
                block[self._buttons] = _pressed(self._presses, written, end)
                written = end
            yield block
        if self._presses is not None:
            yield {self._buttons: _pressed(self._presses, written, len(self._presses[0]))}


def _pressed(
    presses: tuple[Stamps, NDArray[np.uint8]], begin: int, end: int
) -> tuple[Stamps, Array, Stamps]:
    stamps = presses[0][begin:end]
    return stamps, presses[1][begin:end].astype(np.float64), stamps


def command_of(path: Path, out: Path, options: Mapping[str, ImportOptions]) -> str:
    """Command that makes a recording of a file, with the options of each arm."""
    words = ["teleop", "import", path.name, "--out", out.name]
    for arm, one in options.items():
        own = one.as_arguments()
        words += ["--arm", arm, shlex.join(own)] if arm else own
    return shlex.join(words)


def _about(
    path: Path, out: Path, options: Mapping[str, ImportOptions], report: ImportReport
) -> dict[str, str]:
    """Names and texts by which an import can be repeated."""
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
