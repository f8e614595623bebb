"""Accuracy of a tip, with the statistics of appendix E: RMS, standard deviation and largest error."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from teleop_core.kernels.geometry import Array
from teleop_lab.calibration.identify import Found, identify, residuals
from teleop_lab.calibration.measured import Measured
from teleop_lab.calibration.model import FRAME

AXES, TOTAL = ("x", "y", "z"), "total"
_FOLDS = 5
# A reading is probably misread if its residual, divided by the typical residual, exceeds this. With normal noise one
# reading in a million exceeds it.
_MISREAD = 5.0


class Spread(NamedTuple):
    """Statistics of errors [m]: root mean square, standard deviation (n - 1), largest magnitude."""

    rms: float
    deviation: float
    largest: float


def spread(errors: Array) -> Spread:
    """Spread of errors (N,) [m], N >= 1; the deviation of a single error is 0."""
    deviation = float(np.std(errors, ddof=1)) if len(errors) > 1 else 0.0
    return Spread(float(np.sqrt(np.mean(errors**2))), deviation, float(np.abs(errors).max()))


@dataclass(frozen=True)
class Accuracy:
    """Errors of the tip before and after a calibration, by axis and in total.

    Attributes:
        where: Text that describes the poses at which the accuracy was measured.
        before: Spread with the nominal arm.
        after: Spread with the found errors.
    """

    where: str
    before: Mapping[str, Spread]
    after: Mapping[str, Spread]


def of_points(errors: Array) -> dict[str, Spread]:
    """Spreads of errors (N, 3) by axis and in total; an error is NaN if its coordinate was not read.

    The total is the spread of the lengths (N,) of the errors. If no point was read along all three axes, the total is
    the spread of all readings.
    """
    out = {}
    for axis, column in zip(AXES, errors.T, strict=True):
        read = column[np.isfinite(column)]
        if len(read):
            out[axis] = spread(read)
    whole = errors[np.isfinite(errors).all(axis=1)]
    total = np.linalg.norm(whole, axis=1) if len(whole) else errors[np.isfinite(errors)]
    return out | {TOTAL: spread(total)}


def of_distances(errors: Array, labels: tuple[str, ...]) -> dict[str, Spread]:
    """Spreads of errors (N,) for each label, and the total spread of all errors."""
    names = np.array(labels)
    return {name: spread(errors[names == name]) for name in dict.fromkeys(labels)} | {TOTAL: spread(errors)}


def _spreads(measured: Measured, rest: Array) -> dict[str, Spread]:
    if measured.points is None:
        return of_distances(rest, measured.labels)
    errors = np.full(measured.points.shape, np.nan)
    errors[np.isfinite(measured.points)] = rest
    return of_points(errors)


def at_measured(found: Found, measured: Measured) -> Accuracy:
    """Accuracy at the poses from which the errors were found."""
    zero = np.zeros_like(found.vector)
    return Accuracy(
        f"at the {len(measured)} poses measured",
        _spreads(measured, residuals(found.model, measured, zero)),
        _spreads(measured, residuals(found.model, measured, found.vector)),
    )


def at_fresh(found: Found, fresh: Measured) -> Accuracy:
    """Accuracy at new poses, at which the exact points are known."""
    accuracy = at_measured(found, fresh)
    return Accuracy(f"at {len(fresh)} fresh poses", accuracy.before, accuracy.after)


def left_out(found: Found, measured: Measured) -> Accuracy | None:
    """Accuracy by cross-validation, in which each fifth of the measured poses is left out once.

    Returns None if too few poses remain.
    """
    links = [name for name in found.names if name not in FRAME]
    finds_frame = len(links) < len(found.names)
    fold, rest = np.arange(len(measured)) % _FOLDS, []
    if not links or measured.readings * (_FOLDS - 1) // _FOLDS <= len(found.names):
        return None
    for k in range(_FOLDS):
        others, part = measured.part(fold != k), measured.part(fold == k)
        if not len(part):
            return None
        again = identify(found.model, others, links, finds_frame=finds_frame, worst_condition=1e9)
        rest.append(residuals(again.model, part, again.vector))
    order = np.concatenate([np.flatnonzero(fold == k) for k in range(_FOLDS)])
    after = _spreads(measured.part(order), np.concatenate(rest))
    text = f"at {len(measured)} poses, each by those measured without its fifth"
    return Accuracy(text, at_measured(found, measured).before, after)


class Misread(NamedTuple):
    """Pose that does not fit: its number from 1, its residual [m], and the ratio to the typical residual."""

    pose: int
    off: float
    times: float


def misread(found: Found, measured: Measured) -> Misread | None:
    """Return the pose with the largest residual, if its reading is probably wrong.

    Source:
        Median of the magnitudes divided by 0.6745, instead of a standard deviation: Hampel 1974.
    """
    rest = np.abs(residuals(found.model, measured, found.vector))
    typical = float(np.median(rest)) / 0.6745
    worst = int(np.argmax(rest))
    if len(rest) < 2 * _FOLDS or rest[worst] <= _MISREAD * typical:
        return None
    poses = np.arange(len(measured))
    if measured.points is not None:
        poses = np.repeat(poses, 3)[np.isfinite(measured.points).ravel()]
    off = float(rest[worst])
    return Misread(int(poses[worst]) + 1, off, off / typical if typical > 0.0 else np.inf)
