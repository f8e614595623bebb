"""Scoring: computes the score of a recording in one pass; the memory use does not grow with its length."""

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from teleop_core.bags.arms import arm_names, of_arm
from teleop_core.bags.reader import Bag
from teleop_core.base.errors import EvaluationError, PartError, RecordingError, UnknownNameError
from teleop_core.evaluation.bands import Band, bands_of
from teleop_core.evaluation.context import Accumulator, Context
from teleop_core.evaluation.figure import Figure
from teleop_core.evaluation.metric import Metric
from teleop_core.evaluation.metrics.breaks import HaltMetric
from teleop_core.evaluation.metrics.reach import COMPARABLE, ReachScore
from teleop_core.evaluation.metrics.reach import GROUP as REACH_GROUP
from teleop_core.evaluation.origin import read_origin
from teleop_core.evaluation.plain import Plain, leaves, plain
from teleop_core.evaluation.published import Gains
from teleop_core.evaluation.registry import METRICS, all_metrics
from teleop_core.evaluation.rows import TableRow
from teleop_core.evaluation.score import Result, Score, ScoredRecording
from teleop_core.evaluation.state_history import StateHistory, read_history
from teleop_core.evaluation.windows import DisorderError, Seconds, Span, Window, span_of, whole, windows
from teleop_core.graph.topics import (
    MASTER_MEASURED_CP,
    SLAVE_MEASURED_CP,
    SLAVE_SERVO_CP,
    SLAVE_SETPOINT_CP,
    TELEOP_STATE,
    Topic,
)

REQUIRED = (SLAVE_MEASURED_CP, SLAVE_SETPOINT_CP, SLAVE_SERVO_CP)
"""Topics that every score requires. Values that need other topics are None if those topics are missing."""


class ReportedScore(NamedTuple):
    """A score, the metrics that make the plots of a page, and the intervals in which the slave was limited."""

    score: Score
    metrics: tuple[Metric, ...]
    bands: tuple[Band, ...]

    def figures(self) -> list[Figure]:
        """Plots in the order of the metrics.

        Raises:
            EvaluationError: A metric cannot draw its plots; the error text names the metric.
        """
        place, found = self.score.session.place, []
        for metric in self.metrics:
            with _named(place, metric):
                figures = metric.figures()
                _insist(metric, "figures", figures, Figure)
                found += figures
        return found


def evaluate(bag: Bag, arm: str = "", further: Sequence[type[Metric]] = (), span: Seconds | None = None) -> Score:
    """Score of one arm of a recording.

    Args:
        bag: The recording.
        arm: Name of the arm; empty for the default arm.
        further: Metrics in addition to the metrics of the registry.
        span: Begin and end [s] of the scored part, since the first message; None for the whole recording. Counts of
            messages and reports of nodes always cover the whole recording.

    Raises:
        ParameterError: The span is empty or lies beyond the recording.
        PartError: An added metric is not a valid metric, or its values do not match its keys.
        EvaluationError: Nothing in the recording can be compared, or a metric fails.
        RecordingError: The recording lacks one of :data:`REQUIRED`, or is damaged.
        UnknownNameError: The recording has no such arm.
    """
    return study(bag, arm, further, span).score


def scores(bag: Bag, further: Sequence[type[Metric]] = (), span: Seconds | None = None) -> list[Score]:
    """Scores of all arms of a recording, the default arm first; see :func:`evaluate`."""
    return [found.score for found in studies(bag, further, span)]


def measure(bag: Bag, keys: Iterable[str], arm: str = "") -> dict[str, float | None]:
    """Numbers under some keys of a score; runs only the metrics that have these keys.

    Args:
        bag: The recording.
        keys: Keys such as ``task.time_s``.
        arm: As in :func:`evaluate`.

    Returns:
        Numbers by key; None if a key is not applicable.

    Raises:
        UnknownNameError: There is no such metric or key.
        EvaluationError: A value is a text, or a metric fails.
        RecordingError: The recording is damaged.
        PartError: The values of a metric do not match its keys.
    """
    wanted = list(keys)
    context, metrics = _run(of_arm(bag, arm), arm or arm_names(bag)[0], _makers(wanted), None)
    known = {
        ".".join((metric.place(), *path)): value
        for metric in metrics
        for path, value in leaves(_result(context, metric).json or {}).items()
    }
    found: dict[str, float | None] = {}
    for key in wanted:
        if key not in known:
            raise UnknownNameError("key of a score", key, known)
        if isinstance(value := known[key], str):
            raise EvaluationError(f"{key} of {bag.path} is {value!r}, must be a number")
        found[key] = value
    return found


def streams_of(keys: Iterable[str]) -> frozenset[str]:
    """Names of the streams that :func:`measure` reads for some keys, as declared by their metrics.

    Some metrics read further streams.
    """
    read = {topic.name for maker in _makers(keys) for topic in maker.topics}
    return frozenset(read | {SLAVE_MEASURED_CP.name, TELEOP_STATE.name})


def _makers(keys: Iterable[str]) -> list[type[Metric]]:
    places = {key.partition(".")[0] for key in keys}
    return [found for found in map(METRICS.find, METRICS) if found.place() in places]


def study(bag: Bag, arm: str = "", further: Sequence[type[Metric]] = (), span: Seconds | None = None) -> ReportedScore:
    """Score of one arm with its metrics. Raises the same errors as :func:`evaluate`."""
    makers = all_metrics(further)
    view = of_arm(bag, arm)
    _insist_on_a_slave(view)
    context, metrics = _run(view, arm or arm_names(bag)[0], makers, span_of(bag, span))
    results = tuple(_result(context, metric) for metric in metrics)
    score = Score(_session(context), _compared(results))
    if not score.samples.scored:
        halt = next(metric.values() for metric in metrics if isinstance(metric, HaltMetric))
        if halt["reason"] is not None:
            raise EvaluationError(f"{bag.path}: the arm followed nothing that could be scored: {halt['reason']}")
        whose = f" of arm {arm}" * bool(arm) + " in the span" * (span is not None)
        raise EvaluationError(
            f"{bag.path}: no {SLAVE_MEASURED_CP.name}{whose} has a valid "
            f"{SLAVE_SETPOINT_CP.name} of the same tick; they must be recorded together"
        )
    return ReportedScore(score, tuple(metrics), bands_of(context))


def _insist_on_a_slave(bag: Bag) -> None:
    """Refuse a recording without the slave's streams; a hand without a slave can be replayed.

    Raises:
        EvaluationError: The recording has the motion of a hand alone.
        RecordingError: It lacks one of :data:`REQUIRED` for another reason.
    """
    recorded = {name for name, info in bag.topics.items() if info.count}
    if MASTER_MEASURED_CP.name in recorded and recorded.isdisjoint(topic.name for topic in REQUIRED):
        told = "has the motion of a hand and no slave, so there is nothing to score"
        raise EvaluationError(f"{bag.path}: {told}; let a slave follow it: teleop replay {bag.path} --out OUT")
    bag.require(REQUIRED)


def studies(bag: Bag, further: Sequence[type[Metric]] = (), span: Seconds | None = None) -> list[ReportedScore]:
    """Scores of all arms with their metrics, the default arm first; see :func:`evaluate`."""
    return [study(bag, arm, further, span) for arm in arm_names(bag)]


Cut = Callable[[Bag, Iterable[Topic], StateHistory, int], Iterable[Window]]


def _run(bag: Bag, arm: str, makers: Sequence[type[Metric]], span: Span | None) -> tuple[Context, list[Metric]]:
    """Metrics after they have processed the whole recording, or the given span of it."""
    history, origin = read_history(bag), read_origin(bag, arm)
    try:
        context = Context(bag, arm, history, origin, span)
        return context, _feed(context, makers, windows)
    except DisorderError:
        context = Context(bag, arm, history, origin, span)
        return context, _feed(context, makers, whole)


def _feed(context: Context, makers: Sequence[type[Metric]], cut: Cut) -> list[Metric]:
    place, metrics = str(context.bag.path), []
    for maker in makers:
        with _named(place, maker):
            context.read(maker.topics)
            metrics.append(context.shared(maker))
    context.shared(Gains)
    accumulators = context.begin()
    found = cut(context.bag, context.topics, context.history, context.origin.lag)
    # Recordings of foreign devices may contain infinite values; such samples are left out and counted.
    with np.errstate(invalid="ignore", over="ignore"):
        for window in context.span.cut(found) if context.span else found:
            for accumulator in accumulators:
                with _named(place, accumulator):
                    accumulator.add(window)
    return metrics


@contextmanager
def _named(place: str, part: Accumulator | type[Metric]) -> Iterator[None]:
    """Convert an exception of a metric into a one-line error that names the metric.

    Errors of the recording are passed on.
    """
    try:
        yield
    except (RecordingError, PartError):
        raise
    except Exception as error:  # a user's metric can raise any exception
        name = getattr(part, "name", type(part).__name__)
        reason = " ".join(f"{type(error).__name__}: {error}".split())
        raise EvaluationError(f"{place}: the metric {name!r} failed with {reason}") from error


def _result(context: Context, metric: Metric) -> Result:
    with _named(str(context.bag.path), metric):
        values, rows = metric.values(), metric.rows()
        _insist(metric, "rows", rows, TableRow)
        tree = _checked(metric, plain(values))
        return Result(metric.name, metric.place(), values, tree if metric.keys else None, tuple(rows))


def _compared(results: tuple[Result, ...]) -> tuple[Result, ...]:
    """Results that are compared with published values only if the slave followed nearly all the time.

    If it followed for less time, a row states this instead: the slave did not track the motion that the hand asked
    for.
    """
    reach = next((result.values for result in results if isinstance(result.values, ReachScore)), None)
    share = reach.followed_share if reach is not None else None
    if share is not None and share >= COMPARABLE:
        return results
    note = TableRow(REACH_GROUP, "too little to compare", "", _too_little(share))
    found = []
    for result in results:
        rows = tuple(replace(entry, is_met=None) for entry in result.rows)
        has_marks = any(entry.is_met is not None for entry in result.rows)
        found.append(replace(result, rows=rows if has_marks else result.rows))
    if all(old is new or old.rows == new.rows for old, new in zip(results, found, strict=True)):
        return results  # there was nothing to compare
    return tuple(
        replace(result, rows=(*result.rows, note)) if isinstance(result.values, ReachScore) else result
        for result in found
    )


def _too_little(share: float | None) -> str:
    """Text with the share of followed time and the required share.

    The share is rounded down, so that it is visibly smaller.
    """
    if share is None:
        return "not known"
    return f"{math.floor(1000.0 * share) / 10.0:.1f} % < {100.0 * COMPARABLE:.0f} %"


def _insist(metric: Metric, method: str, found: object, kind: type[object]) -> None:
    if not isinstance(found, list) or not all(isinstance(entry, kind) for entry in found):
        expected = f"a metric whose {method}() is a list of {kind.__name__}"
        raise PartError("metric", metric.name, f"{expected}, not {found!r}")


def _checked(metric: Metric, tree: dict[str, Plain]) -> dict[str, Plain]:
    """The values, after a check that they have exactly the metric's keys."""
    paths = [(metric.place(), *path) for path in leaves(tree)]
    given = {".".join(path) for path in paths if any(key.covers(path) for key in metric.keys)}
    names = {name for key in metric.keys for name in key.names() if "<" not in name}
    foreign = {".".join(path) for path in paths} - given
    if foreign or names - given:
        fault = f"gives {min(foreign)}" if foreign else f"lacks {min(names - given)}"
        expected = ", ".join(key.path for key in metric.keys) or "none"
        raise PartError("metric", metric.name, f"consistent with its keys ({expected}); it {fault}")
    return tree


def _session(context: Context) -> ScoredRecording:
    bag, span = context.bag, context.span
    seed = bag.metadata.get("seed", "")
    return ScoredRecording(
        name=bag.path.resolve().name,
        scenario=bag.metadata.get("scenario") or None,
        robot=context.robot,
        seed=int(seed) if seed.isascii() and seed.isdigit() else None,
        duration_s=(bag.end_ns - bag.start_ns) * 1e-9,
        gain=context.shared(Gains).gain,
        arm=context.arm,
        plant=context.origin.plant,
        controller=context.origin.controller,
        from_s=0.0 if span is None else (span.first_ns - bag.start_ns) * 1e-9,
        missing="; ".join(context.missing()) or None,
        to_s=((bag.end_ns if span is None else span.last_ns) - bag.start_ns) * 1e-9,
    )
