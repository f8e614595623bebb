"""Simulated calibration: errors drawn from tolerances, and instruments that measure an arm."""

from collections.abc import Sequence

import numpy as np

from teleop_core.base.errors import ParameterError, UnknownNameError
from teleop_core.kernels.geometry import Array
from teleop_core.robots.link_errors import LinkErrors
from teleop_core.robots.robot import Robot
from teleop_lab.calibration import appendix_e, identifiable
from teleop_lab.calibration.identify import wanted_names
from teleop_lab.calibration.measured import CalibrationError, Measured
from teleop_lab.calibration.model import ChainModel, rotation_of
from teleop_lab.calibration.poses import optimal_poses, random_poses

TOLERANCES = {"cnc": 20e-6, "prototype": 100e-6}
"""Half widths of the tolerances [m] of milled and of rapid-prototyped parts, from Vongbunyong 2008, chapter 3."""
SEAT = 0.05
"""Lever arm [m] over which a tolerance rotates an axis. It is assumed as the size of a bearing seat or a link."""
RULER = "ruler"
CHOICES = ("optimal", "random")
_FAR = 0.5  # distance [m] from the base to a tracker with an unknown pose


def default_errors(robot: Robot) -> tuple[str, ...]:
    """Default errors of an arm: the tolerances of milled parts, and for the rcrt1 also the offset of d3."""
    offset = (f"d3={appendix_e.OFFSET_OF_D3}",) if robot.name == "rcrt1" else ()
    return ("cnc", *offset)


def true_errors(robot: Robot, texts: Sequence[str], rng: np.random.Generator) -> LinkErrors:
    """Link errors of an arm: drawn from tolerances, or given.

    Args:
        robot: The arm.
        texts: Names of :data:`TOLERANCES`, from which every error is drawn uniformly, and texts such as ``d3=5.5e-3``
            [m, rad], which replace the drawn value.
        rng: Random generator of the errors.

    Raises:
        UnknownNameError: A name is neither a tolerance nor an error.
        ParameterError: A value is not a number.
    """
    vector, given = np.zeros(4 * robot.n), {}
    for text in texts:
        name, equals, value = text.partition("=")
        if not equals:
            vector += _drawn(robot, name.strip(), rng)
            continue
        given[name.strip()] = _number(text, value)
    fixed = LinkErrors.of(robot, given)
    names = ChainModel.of(robot).names[: len(vector)]
    is_given = np.array([name in given for name in names])
    return LinkErrors.from_vector(np.where(is_given, fixed.vector, vector))


def _drawn(robot: Robot, name: str, rng: np.random.Generator) -> Array:
    if name not in TOLERANCES:
        raise UnknownNameError("errors", name, (*TOLERANCES, "NAME=VALUE, such as d3=5.5e-3"))
    model, width = ChainModel.of(robot), TOLERANCES[name]
    units = [model.unit(entry) for entry in model.names[: 4 * robot.n]]
    widths = np.array([width if unit == "m" else width / SEAT for unit in units])
    return np.asarray(rng.uniform(-widths, widths))


def _number(text: str, value: str) -> float:
    try:
        return float(value)
    except ValueError:
        raise ParameterError("errors", text, "NAME=NUMBER, such as d3=5.5e-3 [m, rad]") from None


def chosen_poses(
    model: ChainModel, count: int, choose: str, fit: str | Sequence[str], rng: np.random.Generator
) -> Array:
    """Joint vectors (count, n) for a tracker: "random", or "optimal" for the entries to be found.

    Raises:
        UnknownNameError: ``choose`` is unknown, or ``fit`` contains a name that is not a link error.
        CalibrationError: ``count`` is less than 1.
    """
    if choose not in CHOICES:
        raise UnknownNameError("choose", choose, CHOICES)
    if count < 1:
        raise CalibrationError(f"{count} poses are too few; choose at least 2")
    if choose == "random":
        return random_poses(model.robot, count, rng)
    names, pool = wanted_names(model, fit), random_poses(model.robot, 100, rng)
    J = model.jacobian(pool, np.zeros(len(model.names))).reshape(-1, len(model.names))
    kept, _ = identifiable.select(model, J, names, identifiable.WORST_CONDITION)
    return optimal_poses(model, count, kept or names, rng)


def tracked(
    model: ChainModel,
    errors: LinkErrors,
    q: Array,
    noise: float,
    rng: np.random.Generator,
    *,
    is_elsewhere: bool = False,
) -> Measured:
    """Simulated readings of a tracker at poses: the position of the tip plus noise on each axis.

    Args:
        model: The nominal arm.
        errors: Link errors of the arm.
        q: Joint vectors (N, n).
        noise: Standard deviation [m], >= 0.
        rng: Random generator of the noise.
        is_elsewhere: Whether the tracker measures in its own frame, which has a random pose.

    Raises:
        ParameterError: The noise is negative or not finite.
    """
    if not 0.0 <= noise < np.inf:
        raise ParameterError("noise", noise, "a finite number [m], >= 0")
    points = true_tips(model, errors, q) + rng.normal(0.0, noise, (len(q), 3))
    if is_elsewhere:
        points = points @ rotation_of(rng.uniform(-1.0, 1.0, 3)).T + rng.uniform(-_FAR, _FAR, 3)
    return Measured(joints=q, points=points)


def ruled(model: ChainModel, errors: LinkErrors, count: int) -> Measured:
    """Simulated readings of a ruler with 0.5 mm divisions, along one axis after the other, as in appendix E."""
    moves = appendix_e.ruler_moves(model.robot, count)
    assert moves.origins is not None
    way = true_tips(model, errors, moves.joints) - true_tips(model, errors, moves.origins)
    read = appendix_e.STEP * np.round(np.linalg.norm(way, axis=1) / appendix_e.STEP)
    return Measured(joints=moves.joints, origins=moves.origins, distances=read, labels=moves.labels)


def true_tips(model: ChainModel, errors: LinkErrors, q: Array) -> Array:
    """Positions of the tip (N, 3) [m] of an arm with link errors, in the arm's base."""
    return ChainModel.of(model.robot).tips(q, np.concatenate((errors.vector, np.zeros(6))))
