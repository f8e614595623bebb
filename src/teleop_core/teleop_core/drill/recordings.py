"""Recordings of a drill: whether what was recorded can be opened, by us and by others."""

from dataclasses import dataclass
from pathlib import Path

from mcap.exceptions import McapError
from mcap.reader import make_reader

from teleop_core.bags.finding import mcap_files
from teleop_core.bags.reader import Bag, recover
from teleop_core.errors import TeleopError
from teleop_core.topics import SLAVE_MEASURED_JS, SLAVE_OPERATION

LONGEST_LOSS = 0.2
"""What the end of a process may cost at most [s]."""


@dataclass(frozen=True)
class Verdict:
    """What became of a recording.

    Attributes:
        text: In words.
        is_good: Whether that is as it should be.
        is_saved: Whether what was recorded up to its end can be read, if only after ``recover``.
    """

    text: str
    is_good: bool
    is_saved: bool = False


def check_recording(path: Path, killed_ns: int | None = None) -> Verdict:
    """Open a recording with our reader and with that of the ``mcap`` package.

    Args:
        path: Its directory.
        killed_ns: When its writer lost its process or its disk [ns]; None if it was to close it.
    """
    try:
        if killed_ns is None:
            return _opened(Bag(path))
        return _saved(path, killed_ns)
    except (TeleopError, McapError, OSError) as error:
        return Verdict(" ".join(str(error).split()), is_good=False)


def _opened(bag: Bag) -> Verdict:
    ours = sum(topic.count for topic in bag.topics.values())
    theirs = 0
    for file in mcap_files(bag.path):
        with file.open("rb") as opened:
            reader = make_reader(opened, validate_crcs=True)
            summary = reader.get_summary()
            if summary is None or summary.statistics is None:
                return Verdict("mcap finds no summary", is_good=False)
            theirs += summary.statistics.message_count
            for _ in reader.iter_messages(topics=[f"/{SLAVE_OPERATION.name}"]):
                pass
    if ours != theirs:
        return Verdict(f"{ours} messages, mcap finds {theirs}", is_good=False)
    return Verdict("intact", is_good=True, is_saved=True)


def _saved(path: Path, killed_ns: int) -> Verdict:
    saved, _ = recover(path, path.with_name(f"{path.name}_recovered"))
    last_ns = int(Bag(saved).read(SLAVE_MEASURED_JS).log_ns[-1])
    lost = max(0.0, 1e-9 * (killed_ns - last_ns))
    text = f"all but the last {lost:.3f} s"
    return Verdict(text, is_good=lost <= LONGEST_LOSS, is_saved=True)
