"""Runner: a session in virtual time, recorded block by block, and its replay."""

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from numpy.typing import NDArray

from teleop_core import topics
from teleop_core.bags.reader import Bag, Series
from teleop_core.bags.reports import report
from teleop_core.bags.writer import BagWriter
from teleop_core.errors import RecordingError
from teleop_core.geometry import Array, rotation_vectors
from teleop_core.session.configuration import Configuration, Layer, parse_layer
from teleop_core.session.graph import STAGES, Graph
from teleop_core.signals import STATE_FIELDS, TICK_NS, make_signals
from teleop_core.topics import STREAMS

BLOCK = 1000
"""Ticks per block: one second, one chunk of the recording."""

Progress = Callable[[int, int], None]


def _silent(done: int, total: int) -> None:
    """Show no progress."""


def simulate(configuration: Configuration, out: Path, progress: Progress = _silent) -> int:
    """Run a session in virtual time and record it.

    Args:
        configuration: What runs.
        out: Directory of the recording, made here.
        progress: Called with ticks done and ticks in all, after every simulated second.

    Returns:
        Number of ticks.

    Raises:
        RecordingError: The directory exists, cannot be written, or the disk is full.
    """
    ticks = max(1, round(configuration.groups["teleop"].duration * 1e3))
    graph = Graph(configuration.groups, recorded_path(configuration))

    def blocks() -> Iterator[Any]:
        for done in range(0, ticks, BLOCK):
            yield graph.run(min(BLOCK, ticks - done))

    return _record(graph, configuration, out, blocks(), ticks, progress)


def replay(bag: Bag, configuration: Configuration, out: Path, progress: Progress = _silent) -> int:
    """Run the recorded master through the graph again, in virtual time, and record it.

    Ticks are 1 ms apart, from the first to the last recorded sample; a tick for which none was
    recorded holds the one before it. For a recording of virtual time every tick has its own
    sample, so the same configuration gives the same slave motion, bit for bit.

    Args:
        bag: Recording with master/measured_cp and master/buttons.
        configuration: What the samples run through.
        out: Directory of the new recording, made here.
        progress: As in :func:`simulate`.

    Returns:
        Number of ticks.

    Raises:
        RecordingError: The bag lacks a topic, or the directory is as in :func:`simulate`.
    """
    bag.require((topics.MASTER_MEASURED_CP, topics.MASTER_BUTTONS))
    recorded = [topic for topic in MASTER_TOPICS if topic.name in bag.topics]
    series = bag.read_many(recorded)
    poses = series[topics.MASTER_MEASURED_CP.name]
    stamps = np.arange(poses.stamp_ns[0], poses.stamp_ns[-1] + 1, TICK_NS)
    graph = Graph(configuration.groups)

    def blocks() -> Iterator[Any]:
        for done in range(0, len(stamps), BLOCK):
            samples = make_signals(graph.robot.n, len(stamps[done : done + BLOCK]))
            samples["stamp_ns"] = stamps[done : done + BLOCK]
            for topic in recorded:
                _hold(series[topic.name], samples["stamp_ns"], samples[topic.field])
            yield graph.replay(samples)

    return _record(graph, configuration, out, blocks(), len(stamps), progress)


MASTER_TOPICS = STAGES[0].writes


def _hold(series: Series, stamps_ns: NDArray[np.int64], values: Array) -> None:
    """Write into ``values`` (N, width) the newest sample at each stamp; before the first: as is."""
    at = np.searchsorted(series.stamp_ns, stamps_ns, side="right") - 1
    values[at >= 0] = series.values[at[at >= 0]]


def recorded_configuration(bag: Bag) -> tuple[Layer, str]:
    """Configuration and scenario that a recording was made with; empty ones for foreign bags.

    Raises:
        TeleopError: The stored configuration is not one.
    """
    text = bag.metadata.get("configuration")
    layer = parse_layer(yaml.safe_load(text), f"{bag.path}: configuration") if text else {}
    return layer, bag.metadata.get("scenario", "")


def recorded_path(configuration: Configuration) -> tuple[Array, Array] | None:
    """Path for an operator who follows a recording, None for any other.

    Raises:
        RecordingError: The recording is missing or lacks master/measured_cp.
    """
    path = configuration.groups["haptic_master"].path
    if path.kind != "bag":
        return None
    bag = Bag(Path(path.bag))
    bag.require((topics.MASTER_MEASURED_CP,))
    series = bag.read(topics.MASTER_MEASURED_CP)
    times = (series.stamp_ns - series.stamp_ns[0]) * 1e-9
    moves = series.values[:, :3] - series.values[0, :3]
    return times, np.hstack((moves, rotation_vectors(series.values[:, 3:])))


def _record(
    graph: Graph,
    configuration: Configuration,
    out: Path,
    blocks: Iterator[Any],
    ticks: int,
    progress: Progress,
) -> int:
    written = (*STREAMS, topics.TELEOP_STATE)
    done, last_state = 0, np.full(len(STATE_FIELDS), np.nan)
    with BagWriter(
        out,
        written,
        graph.robot.joint_names,
        parameters=configuration.groups["recorder"],
        metadata=describe(configuration),
    ) as writer:
        for block in blocks:
            write_signals(writer, block)
            last_state = _write_state(writer, block, last_state)
            done += len(block)
            progress(done, ticks)
    if not done:
        raise RecordingError(out, "holds no ticks")
    return done  # fmt: skip


def describe(configuration: Configuration) -> dict[str, str]:
    """Names and texts stored with a recording, so that it can be repeated."""
    from teleop_core import __version__

    return {
        "version": __version__,
        "scenario": configuration.scenario,
        "robot": configuration.groups["slave_sim"].robot,
        "seed": str(configuration.groups["haptic_master"].seed),
        "configuration": configuration.text(),
    }


def write_signals(writer: BagWriter, block: Any) -> None:
    """Record a block of signals; setpoints carry the stamp of the command in force."""
    log_ns = block["stamp_ns"]
    setpoints = {topics.SLAVE_SETPOINT_JS, topics.SLAVE_SETPOINT_CP}
    writer.write_block(
        {
            topic: (block["setpoint_stamp_ns" if topic in setpoints else "stamp_ns"],
                    block[topic.field], log_ns)
            for topic in STREAMS
        }
    )  # fmt: skip


def state_report(stamp_ns: int, state: Array) -> bytes:
    """Message of teleop/state, as CDR bytes, for one row of :data:`STATE_FIELDS`."""
    values = {name: repr(float(value)) for name, value in zip(STATE_FIELDS, state, strict=True)}
    return report(stamp_ns, "teleop", 0, state_text(state), values)


def state_text(state: Array) -> str:
    """State in words: CLUTCHED or FOLLOWING or ALIGNING, mode and fixture."""
    named = dict(zip(STATE_FIELDS, state, strict=True))
    doing = "CLUTCHED" if named["is_clutched"] else "FOLLOWING"
    if not named["is_following"]:
        doing = "ALIGNING"
    mode = "fine" if named["is_fine"] else "coarse"
    return f"{doing} {mode}{', box on' if named['is_fixture_on'] else ''}"


def _write_state(writer: BagWriter, block: Any, last: Array) -> Array:
    """Record teleop/state where it changed; returns the last row."""
    states = block["teleop_state"]
    changed = (states != np.vstack((last, states[:-1]))).any(axis=1)
    for i in np.flatnonzero(changed):
        stamp = int(block["stamp_ns"][i])
        writer.write(topics.TELEOP_STATE, stamp, state_report(stamp, states[i]))
    return np.array(states[-1])
