"""Identification: least squares for the link errors that the measurements can distinguish."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares
from scipy.stats import t as student

from teleop_core.kernels.geometry import Array
from teleop_core.robots.link_errors import LinkErrors
from teleop_lab.calibration.identifiable import WORST_CONDITION, Left, condition, select
from teleop_lab.calibration.measured import CalibrationError, Measured
from teleop_lab.calibration.model import FRAME, ChainModel, aligned

LEVEL = 0.95
"""Level of the confidence intervals."""
NOT_SURE = "is not told from zero"
# Largest plausible error of an angle [rad], and of a length divided by the arm's length.
_ABSURD = 0.35


@dataclass(frozen=True, eq=False)
class Found:
    """Result of the least squares of a calibration.

    Attributes:
        names: The k entries that were found.
        values: Values of the found entries (k,) [m, rad].
        half_widths: Half widths of the confidence intervals (k,) [m, rad].
        vector: All entries of the model; zero for entries that were not found.
        left: Requested entries that were fixed at zero.
        condition: Ratio of the largest to the smallest singular value.
        residual: RMS of the residuals [m]; the sum of squares is divided by ``freedom``.
        freedom: Number of readings minus number of found entries.
        model: The model with the frame of the measurement.
    """

    names: tuple[str, ...]
    values: Array
    half_widths: Array
    vector: Array
    left: tuple[Left, ...]
    condition: float
    residual: float
    freedom: int
    model: ChainModel

    def equivalent(self, errors: LinkErrors, q: Array) -> dict[str, float]:
        """Values that a perfect fit would find for an arm with the given errors [m, rad].

        A found entry represents all entries with the same effect, so its value is their sum.

        Args:
            errors: Errors of a simulated arm.
            q: Joint vectors (N, n); N must be large.
        """
        told = [left.name for left in self.left if left.reason.startswith(NOT_SURE)]
        basis = [*self.names, *told]
        J = self.model.jacobian(q, np.zeros_like(self.vector)).reshape(-1, len(self.vector))
        moved = J[:, : 4 * errors.n] @ errors.vector
        columns = J[:, [self.model.names.index(name) for name in basis]]
        x = np.linalg.lstsq(columns, moved, rcond=None)[0]
        return {name: float(value) for name, value in zip(basis, x, strict=True)}

    @property
    def errors(self) -> LinkErrors:
        """Link errors of the arm; entries that were not found are zero."""
        return LinkErrors.from_vector(self.vector[: 4 * self.model.chain.n])


def residuals(model: ChainModel, measured: Measured, vector: Array) -> Array:
    """Readings that the model predicts, minus the real readings (m,) [m]."""
    tips = model.tips(measured.joints, vector)
    if measured.points is not None:
        return np.asarray((tips - measured.points)[np.isfinite(measured.points)])
    assert measured.origins is not None
    assert measured.distances is not None
    way = tips - model.tips(measured.origins, vector)
    return np.asarray(np.linalg.norm(way, axis=1) - measured.distances)


def slopes(model: ChainModel, measured: Measured, vector: Array) -> Array:
    """Derivatives of :func:`residuals` with respect to all entries of the model, (m, 4n + 6)."""
    J = model.jacobian(measured.joints, vector)
    if measured.points is not None:
        return np.asarray(J[np.isfinite(measured.points)])
    assert measured.origins is not None
    way = model.tips(measured.joints, vector) - model.tips(measured.origins, vector)
    way /= np.linalg.norm(way, axis=1, keepdims=True)
    return np.einsum("ni,nij->nj", way, J - model.jacobian(measured.origins, vector))


def wanted_names(model: ChainModel, fit: str | Sequence[str]) -> tuple[str, ...]:
    """Names of the entries to find: "all" link errors, joint "offsets", or the given names.

    Raises:
        UnknownNameError: A name is not an entry of the model.
    """
    links = model.names[: -len(FRAME)]
    if fit == "all":
        return links
    if fit == "offsets":
        return model.offsets
    given = (fit,) if isinstance(fit, str) else tuple(fit)
    LinkErrors.of(model.robot, dict.fromkeys(given, 0.0))
    return tuple(name for name in links if name in given)


def identify(
    model: ChainModel,
    measured: Measured,
    fit: str | Sequence[str] = "all",
    *,
    finds_frame: bool = False,
    keeps_all: bool = False,
    worst_condition: float = WORST_CONDITION,
) -> Found:
    """Find the link errors for which the model agrees best with the measurement, by least squares.

    Args:
        model: Model of the nominal arm.
        measured: Readings.
        fit: "all" link errors, joint "offsets", or names of entries. All named entries must be distinguishable.
        finds_frame: Whether the pose of the base in the frame of the measurement is also estimated.
        keeps_all: Whether the result contains entries whose confidence interval contains zero. Otherwise these entries
            are fixed at zero, the least certain first, unless ``fit`` names them. An entry that does not differ from
            zero fits noise, and causes errors of the tip at poses that were not measured.
        worst_condition: Ratio of singular values above which entries are left out, > 1.

    Raises:
        UnknownNameError: ``fit`` contains a name that is not a link error.
        CalibrationError: There are too few readings, named entries cannot be distinguished, or the search does not
            converge near the nominal arm.
    """
    is_named = fit not in ("all", "offsets")
    names = wanted_names(model, fit)
    if finds_frame and measured.points is None:
        raise CalibrationError("distances do not depend on the frame; leave out the frame")
    if finds_frame:
        model, names = aligned_model(model, measured), (*names, *FRAME)
    _check_count(measured, 1 if not is_named else len(names))
    zero = np.zeros(len(model.names))
    kept, left = select(model, slopes(model, measured, zero), names, worst_condition)
    if is_named and left:
        told = "; ".join(f"{entry.name} {entry.reason}" for entry in left)
        raise CalibrationError(f"not identifiable from these {len(measured)} poses: {told}")
    if not kept:
        raise CalibrationError(f"none of {', '.join(names)} is identifiable from these {len(measured)} poses")
    _check_count(measured, len(kept))
    found = _solved(model, measured, kept, left)
    return found if is_named or keeps_all else _pruned(found, measured)


def _pruned(found: Found, measured: Measured) -> Found:
    """Remove entries that do not differ from zero, one by one, and return the result without them."""
    while True:
        sure = np.abs(found.values) / np.maximum(found.half_widths, np.finfo(float).tiny)
        sure[[name in FRAME for name in found.names]] = np.inf
        if not len(sure) or sure.min() >= 1.0:
            return found
        i = int(np.argmin(sure))
        name = found.names[i]
        value, half = 1e3 * found.values[i], 1e3 * found.half_widths[i]
        reason = f"{NOT_SURE}: {value:.3g} ± {half:.3g} m{found.model.unit(name)}"
        left = (*found.left, Left(name, reason))
        names = tuple(other for other in found.names if other != name)
        found = _solved(found.model, measured, names, left)


def aligned_model(model: ChainModel, measured: Measured) -> ChainModel:
    """Return the model with the frame in which the nominal arm fits the points best.

    Raises:
        CalibrationError: Fewer than three points have all three coordinates.
    """
    assert measured.points is not None
    whole = np.isfinite(measured.points).all(axis=1)
    if whole.sum() < 3:
        raise CalibrationError("a frame is found from at least three poses with x, y and z")
    drawn = model.tips(measured.joints[whole], np.zeros(len(model.names)))
    return ChainModel(model.robot, model.chain, aligned(drawn, measured.points[whole]))


def _check_count(measured: Measured, entries: int) -> None:
    readings = measured.readings
    if readings <= entries:
        raise CalibrationError(
            f"{len(measured)} poses give {readings} readings, too few for {entries} unknowns; "
            f"measure more than {entries} readings, better three times as many, or fit fewer"
        )


def _solved(model: ChainModel, measured: Measured, names: tuple[str, ...], left: tuple[Left, ...]) -> Found:
    at = [model.names.index(name) for name in names]
    vector = np.zeros(len(model.names))

    def of(x: Array) -> Array:
        vector[at] = x
        return vector

    if not names:
        return _drawn(model, measured, left)
    scale = np.array([model.size if model.unit(name) == "m" else 1.0 for name in names])
    answer = least_squares(
        lambda x: residuals(model, measured, of(x)),
        np.zeros(len(at)),
        jac=lambda x: slopes(model, measured, of(x))[:, at],
        x_scale=scale,
        xtol=1e-13,
        ftol=1e-13,
        gtol=1e-15,
        max_nfev=100,
    )
    _check_answer(names, answer.x, scale, int(answer.status), str(answer.message))
    of(answer.x)
    J, freedom = slopes(model, measured, vector)[:, at], measured.readings - len(at)
    variance = float(answer.fun @ answer.fun) / freedom
    spread = np.sqrt(variance * np.diag(np.linalg.inv(J.T @ J)))
    half_widths = float(student.ppf(0.5 * (1.0 + LEVEL), freedom)) * spread
    return Found(
        names, answer.x.copy(), half_widths, vector.copy(), left, condition(J), float(np.sqrt(variance)), freedom, model
    )


def _drawn(model: ChainModel, measured: Measured, left: tuple[Left, ...]) -> Found:
    """Result without any found error; it means that the readings agree with the nominal arm."""
    vector, none = np.zeros(len(model.names)), np.zeros(0)
    rest = residuals(model, measured, vector)
    spread = float(np.sqrt(np.mean(rest**2)))
    return Found((), none, none, vector, left, 1.0, spread, len(rest), model)


def _check_answer(names: tuple[str, ...], x: Array, scale: Array, status: int, message: str) -> None:
    """Raise an error if the search did not converge, or converged far from the nominal arm."""
    if status <= 0:
        raise CalibrationError(f"least squares did not converge: {message}")
    far = np.abs(np.where([name in FRAME for name in names], 0.0, x)) > _ABSURD * scale
    if far.any():
        i = int(np.argmax(far))
        raise CalibrationError(
            f"least squares ended far from the drawing, {names[i]} is off by {x[i]:.3g}: are "
            "these poses of this robot, in its units and base? (an unknown base: frame unknown)"
        )
