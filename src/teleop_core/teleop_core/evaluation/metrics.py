"""Metrics: a recording becomes a score, in one pass and in memory that does not grow with it."""

from typing import NamedTuple

import numpy as np

from teleop_core.bags.reader import Bag
from teleop_core.errors import EvaluationError
from teleop_core.evaluation.score import Score, Session
from teleop_core.evaluation.state_history import read_history
from teleop_core.evaluation.streams import TopicScore
from teleop_core.evaluation.tally import Tally
from teleop_core.evaluation.ticks import read_counts, tick_score
from teleop_core.evaluation.traces import Drawing
from teleop_core.evaluation.windows import DisorderError, whole, windows
from teleop_core.topics import (
    SLAVE_MEASURED_CP,
    SLAVE_SERVO_CP,
    SLAVE_SETPOINT_CP,
    STREAMS,
)

REQUIRED = (SLAVE_MEASURED_CP, SLAVE_SETPOINT_CP, SLAVE_SERVO_CP)
"""Topics without which there is no score; what needs others is None without them."""


class Study(NamedTuple):
    """A score, and what a page draws beside it."""

    score: Score
    drawing: Drawing


def evaluate(bag: Bag) -> Score:
    """Score of a recording.

    Raises:
        EvaluationError: Nothing in it can be compared.
        RecordingError: It lacks one of :data:`REQUIRED`, or is damaged.
    """
    return study(bag).score


def study(bag: Bag) -> Study:
    """Score of a recording with its traces; raises as :func:`evaluate`."""
    bag.require(REQUIRED)
    tally = _tally(bag)
    if not tally.samples.scored:
        raise EvaluationError(
            f"{bag.path}: no {SLAVE_MEASURED_CP.name} has a valid {SLAVE_SETPOINT_CP.name} "
            "of the same tick; they must be recorded together"
        )
    return Study(_score(bag, tally), tally.drawing)


def _tally(bag: Bag) -> Tally:
    topics = [
        topic for topic in STREAMS if topic.name in bag.topics and bag.topics[topic.name].count
    ]
    history = read_history(bag)
    # What foreign devices record may be infinite; such samples are left out and counted.
    with np.errstate(invalid="ignore", over="ignore"):
        try:
            tally = Tally(bag, history)
            for window in windows(bag, topics):
                tally.add(window)
        except DisorderError:
            tally = Tally(bag, history)
            for window in whole(bag, topics):
                tally.add(window)
    return tally


def _score(bag: Bag, tally: Tally) -> Score:
    counts = read_counts(bag)
    stamps = tally.stamps[SLAVE_MEASURED_CP.name]
    period_us = stamps.period_us
    return Score(
        session=_session(bag, tally),
        samples=tally.samples,
        position_error_mm=tally.setpoint.position.spread(),
        orientation_error_deg=tally.setpoint.orientation(),
        command_error_mm=tally.command.position.spread(),
        command_orientation_error_deg=tally.command.orientation(),
        fixture=tally.fixture.score(None if period_us is None else period_us * 1e-6),
        force_n=tally.force.spread(),
        latency_ms=tally.delays.delays(),
        ticks=tick_score(counts, bag.topics[SLAVE_MEASURED_CP.name].count, stamps.gaps()),
        nodes=counts,
        topics={
            name: TopicScore(
                info.count, tally.stamps[name].gaps() if name in tally.stamps else None
            )
            for name, info in sorted(bag.topics.items())
        },
    )


def _session(bag: Bag, tally: Tally) -> Session:
    seed = bag.metadata.get("seed", "")
    return Session(
        name=bag.path.resolve().name,
        scenario=bag.metadata.get("scenario") or None,
        robot=bag.metadata.get("robot") or None,
        seed=int(seed) if seed.isascii() and seed.isdigit() else None,
        duration_s=(bag.end_ns - bag.start_ns) * 1e-9,
        gain=tally.gain,
    )
