"""Recordings of a drill: check whether our reader and other readers can open them."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from mcap.exceptions import McapError
from mcap.reader import make_reader

from teleop_core.bags.finding import mcap_files
from teleop_core.bags.reader import Bag, recover
from teleop_core.base.errors import TeleopError
from teleop_core.graph.topics import DIAGNOSTICS, SLAVE_MEASURED_JS, SLAVE_OPERATION
from teleop_drill.drill.exercise import Cure
from teleop_drill.drill.measure import Stamps
from teleop_drill.drill.outcome import FaultOutcome

Counted = dict[str, tuple[Stamps, Stamps]]
"""Sending times and stamps of the messages of each stream [ns], by the name of the stream."""
LONGEST_LOSS = 0.2
"""Largest loss of recorded time when a process ends [s]."""
DISCOVERY = 1.5
"""Time after which all processes have discovered a restarted node [s]."""
_REPORT_NS = 1_500_000_000  # time after which a node has reported its counts [ns]

_ON_THE_WAY_NS = 5_000_000
"""Messages that were sent within this time before a fault may not reach the recorder [ns]. The value is assumed as some
ticks and a turn of the recorder."""


@dataclass(frozen=True)
class RecordingState:
    """State of a recording.

    Attributes:
        text: Text about the state of the recording.
        is_good: Whether the state is as expected.
        is_saved: Whether the recording can be read up to its end, possibly only after ``recover``.
        bag: The recording, or the result of ``recover``, if it can be read.
    """

    text: str
    is_good: bool
    is_saved: bool = False
    bag: Bag | None = None


def check_recording(path: Path, killed_ns: int | None = None) -> RecordingState:
    """Open a recording with our reader and with that of the ``mcap`` package.

    Args:
        path: Directory of the recording.
        killed_ns: Time at which the recorder was killed or its disk failed [ns]; None if it could close the file.
    """
    try:
        if killed_ns is None:
            return _opened(Bag(path))
        return _saved(path, killed_ns)
    except (TeleopError, McapError, OSError) as error:
        return RecordingState(" ".join(str(error).split()), is_good=False)


def _opened(bag: Bag) -> RecordingState:
    ours = sum(topic.count for topic in bag.topics.values())
    theirs = 0
    for file in mcap_files(bag.path):
        with file.open("rb") as opened:
            reader = make_reader(opened, validate_crcs=True)
            summary = reader.get_summary()
            if summary is None or summary.statistics is None:
                return RecordingState("mcap finds no summary", is_good=False)
            theirs += summary.statistics.message_count
            for _ in reader.iter_messages(topics=[f"/{SLAVE_OPERATION.name}"]):
                pass
    if ours != theirs:
        return RecordingState(f"{ours} messages, mcap finds {theirs}", is_good=False)
    return RecordingState("intact", is_good=True, is_saved=True, bag=bag)


def _saved(path: Path, killed_ns: int) -> RecordingState:
    saved, _ = recover(path, path.with_name(f"{path.name}_recovered"))
    bag = Bag(saved)
    last_ns = int(bag.read(SLAVE_MEASURED_JS).log_ns[-1])
    lost = max(0.0, 1e-9 * (killed_ns - last_ns))
    text = f"all but the last {lost:.3f} s"
    return RecordingState(text, is_good=lost <= LONGEST_LOSS, is_saved=True, bag=bag)


def missing(bag: Bag, name: str, heard: tuple[Stamps, Stamps]) -> Stamps:
    """Times [ns] of messages that the drill's tap received and that are missing in the recording.

    Args:
        bag: The recording.
        name: Topic.
        heard: Time of sending and stamp of each received message, both (N,) [ns]; stamps may repeat.
    """
    sent_ns, stamps = heard
    if name not in bag.topics or not bag.topics[name].count:
        return sent_ns
    kept, counts = np.unique(bag.read(name).stamp_ns, return_counts=True)
    at = np.minimum(np.searchsorted(kept, stamps), len(kept) - 1)
    have = np.where(kept[at] == stamps, counts[at], 0)
    return sent_ns[_repeats(stamps) >= have]


def told_lost(bag: Bag, name: str, begin_ns: int, end_ns: int) -> int:
    """Number of messages of a topic that the recorder itself reported as lost in an interval [ns]."""
    reports = bag.reports(DIAGNOSTICS) if DIAGNOSTICS.name in bag.topics else []
    key = f"lost.{name}"
    counts = [(one.stamp_ns, int(one.values[key])) for one in reports if key in one.values]
    before = [count for ns, count in counts if ns <= begin_ns]
    until = [count for ns, count in counts if ns <= end_ns + _REPORT_NS]
    return (until[-1] if until else 0) - (before[-1] if before else 0)


def within(heard: Counted, begin_ns: int, end_ns: int) -> Counted:
    """Messages that were sent in an interval [ns], without its end."""
    chosen = {name: (sent >= begin_ns) & (sent < end_ns) for name, (sent, _) in heard.items()}
    return {name: (heard[name][0][own], heard[name][1][own]) for name, own in chosen.items()}


@dataclass(frozen=True)
class Recorded:
    """A recording, and the faults of the session during it.

    Attributes:
        path: Its directory.
        outcomes: Faults during it, each with its begin [ns].
        heard: Messages that the drill's own tap received.
        until_ns: Planned end of the recording [ns].
        killed_ns: Time at which the recorder was killed or its disk failed [ns]; None if it could close the file.
    """

    path: Path
    outcomes: list[tuple[int, FaultOutcome]]
    heard: Counted
    until_ns: int
    killed_ns: int | None


def judge_recording(one: Recorded, tick: float) -> None:
    """Write into each outcome the effect of its fault on the recording; one message is expected per `tick` [s]."""
    verdict = check_recording(one.path, one.killed_ns)
    until_ns = one.until_ns
    if one.killed_ns is not None:
        until_ns = one.killed_ns - round(1e9 * LONGEST_LOSS)
    begins = [begin_ns for begin_ns, _ in one.outcomes]
    gone: dict[str, Stamps] = {}
    if verdict.bag is not None:
        heard = within(one.heard, begins[0], until_ns)
        gone = {name: missing(verdict.bag, name, two) for name, two in heard.items()}
    starts = [ns - _ON_THE_WAY_NS for ns in begins]
    for (_, outcome), begin_ns, end_ns in zip(one.outcomes, starts, [*starts[1:], until_ns], strict=True):
        outcome.recording, outcome.is_recorded = verdict.text, verdict.is_good
        if verdict.is_saved and not outcome.exercise.cuts_recording:
            outcome.recording, outcome.is_recorded = "intact", True
        lost = {name: int(np.sum((ns >= begin_ns) & (ns < end_ns))) for name, ns in gone.items()}
        if Cure.RESTART in outcome.exercise.cures and verdict.bag is not None:
            # Messages that a node sends before its readers have discovered it are accepted as missing if the recorder
            # reports them.
            for name, count in lost.items():
                told = told_lost(verdict.bag, name, begin_ns, end_ns) if count else 0
                lost[name] = count - min(told, round(DISCOVERY / tick))
        outcome.note_loss(max(lost.values(), default=0) * tick)


def _repeats(stamps: Stamps) -> Stamps:
    """Number of equal stamps before each stamp, shape (N,)."""
    order = np.argsort(stamps, kind="stable")
    ordered = stamps[order]
    begins = np.flatnonzero(np.diff(ordered, prepend=ordered[:1] - 1))
    found = np.empty(len(stamps), np.int64)
    lengths = np.diff(np.append(begins, len(stamps)))
    found[order] = np.arange(len(stamps)) - np.repeat(begins, lengths)
    return found
