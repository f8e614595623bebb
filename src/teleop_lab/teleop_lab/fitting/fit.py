"""Fit: finds the faults of a real arm from its rest positions, by simulation of the same moves.

Free parameters are the dry friction of joints, the bias of amplifiers, and weights that no source states. With a
controller without integral action, the rest error of a joint is the effort of these faults divided by Kp. So the fitted
numbers are valid only for the gains of the fit.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares
from scipy.stats import chi2, t

from teleop_core.base.errors import ParameterError, TeleopError, UnknownNameError
from teleop_core.kernels.geometry import Array
from teleop_core.robots import hardware, load_robot_set
from teleop_core.robots.robot import Robot
from teleop_core.slave import pair, slave_sim
from teleop_core.slave.plants.hardware import faults_of
from teleop_lab.fitting.fit_result import FitResult, Fitted
from teleop_lab.fitting.rest_table import RestTable
from teleop_lab.fitting.rests import rest_positions

_WEAK = 0.1  # share of the largest singular value below which a direction is not identifiable
_STEP = 0.01  # step of finite differences, in units of the start value
_SHARE = 0.95  # confidence level of intervals
_ROUNDS = 60
_UNITS = {"coulomb": "N·m or N", "bias": "N·m or N", "weight": "kg·m"}
_WANDER = 0.3  # relative variation of friction that is simulated to measure its effect
# Number of simulated runs, divided by the number of runs in the table. The position at which a joint sticks is
# practically random. A change of the last bit changes the spread of ten runs by 1/10, and the spread of forty runs by
# 1/30.
_TIMES = 4


LOSSES: dict[str, Callable[[Array], Array]] = {
    "cauchy": lambda r: 1.0 / (1.0 + r**2),
    "huber": lambda r: 1.0 / np.maximum(1.0, np.abs(r)),
    "soft_l1": lambda r: 1.0 / np.sqrt(1.0 + r**2),
    "linear": np.ones_like,
}
"""Losses by their names in scipy; each function returns the weight of a residual."""


class FitError(TeleopError):
    """A fit has no solution: it does not converge, or its parameters cannot be distinguished."""


class _Problem:
    """Rest positions of a robot as a function of scaled numbers; the scale follows from the errors in the table."""

    def __init__(self, robot: Robot, parameters: pair.ArmParameters, table: RestTable, free: Sequence[str]) -> None:
        self.robot, self.parameters, self.table, self.free = robot, parameters, table, tuple(free)
        stiffness = np.abs(slave_sim.SlaveSim(parameters).arm.gains[:, 0])
        off = np.abs(table.mean).mean(axis=0)
        self.scales = np.array([self._scale(name, off * stiffness) for name in free])
        self.one_sided = one_sided(robot, table)
        assert robot.drives is not None
        self.spread = np.maximum(table.spread, robot.drives.encoder_step)

    def _scale(self, name: str, effort: Array) -> float:
        kind, _, of = name.partition(".")
        if kind != "weight":
            return float(effort[self.robot.joint_names.index(of)])
        model = self.robot.dynamics
        assert model is not None
        change = np.zeros(self.robot.n)
        row = model.parameters.copy()
        row[model.unknown[of]] += 1.0
        model.gravity(self.robot.home.copy(), row, change)
        before = np.zeros(self.robot.n)
        model.gravity(self.robot.home.copy(), model.parameters.copy(), before)
        lever = np.abs(change - before)
        axis = int(lever.argmax())
        if lever[axis] == 0.0:
            raise ParameterError("free", name, "a weight that loads a joint at home")
        return float(effort[axis] / lever[axis])

    def faults(self, x: Array, wander: Array | None = None) -> hardware.Hardware:
        """Return the arm's faults with the values of the scaled numbers ``x``."""
        base, model = faults_of(self.robot), self.robot.dynamics
        assert model is not None
        coulomb, bias = base.coulomb.copy(), np.zeros(self.robot.n)
        row = model.parameters.copy()
        for name, value in zip(self.free, x * self.scales, strict=True):
            kind, _, of = name.partition(".")
            if kind == "weight":
                row[model.unknown[of]] = value
            else:
                axis = self.robot.joint_names.index(of)
                (coulomb if kind == "coulomb" else bias)[axis] = value
        still = np.zeros(self.robot.n) if wander is None else wander
        return replace(base, coulomb=coulomb, bias=bias, wander=still, dynamics=row)

    def rests(self, x: Array, runs: int = 1, wander: Array | None = None) -> Array:
        """Simulated rest positions minus targets (k, runs, n); they are smooth in ``x`` if friction does not vary."""
        faults, table = self.faults(x, wander), self.table
        inside = np.clip(table.targets, self.robot.lower, self.robot.upper)
        is_smooth = wander is None
        rests = rest_positions(self.parameters, inside, runs, faults, is_smooth=is_smooth)
        return rests - inside[:, None]

    def residuals(self, x: Array) -> Array:
        """Simulated minus measured rest positions, divided by the standard deviation of the runs, as a vector."""
        predicted, measured = self.rests(x)[:, 0], self.table.mean
        predicted = np.where(self.one_sided, np.abs(predicted), predicted)
        measured = np.where(self.one_sided, np.abs(measured), measured)
        return np.asarray(((predicted - measured) / self.spread).ravel())

    def slopes(self, x: Array) -> Array:
        """Derivatives of the residuals, by central differences."""
        columns = []
        for i in range(len(x)):
            step = np.zeros(len(x))
            step[i] = _STEP
            columns.append((self.residuals(x + step) - self.residuals(x - step)) / (2.0 * _STEP))
        return np.stack(columns, axis=1)


def one_sided(robot: Robot, table: RestTable) -> NDArray[np.bool_]:
    """Axes (n,) whose targets are all approached from the same side, in moves from home."""
    way = np.sign(table.targets - robot.home)
    return np.asarray(np.abs(way.sum(axis=0)) == len(way))


def default_free(robot: Robot, table: RestTable) -> tuple[str, ...]:
    """Names of the numbers that a table determines for a robot, for :func:`fit`.

    These numbers are the dry friction of every axis without an integrator for gravity, and weights that no source
    states. The bias of such an axis is included if its targets are approached from both sides and gravity does not load
    it.
    """
    from teleop_core.slave.controllers.source_pid import loaded_axes

    model, loaded, single = robot.dynamics, loaded_axes(robot), one_sided(robot, table)
    assert model is not None
    stuck = [name for name, is_loaded in zip(robot.joint_names, loaded, strict=True) if not is_loaded]
    free_of_weight = ~(loaded | model.compensated)
    both = [
        name
        for name, is_free, is_single in zip(robot.joint_names, free_of_weight, single, strict=True)
        if is_free and not is_single
    ]
    return (
        *(f"coulomb.{name}" for name in stuck),
        *(f"bias.{name}" for name in both),
        *(f"weight.{name}" for name in model.unknown),
    )


def fit(
    table: RestTable,
    parameters: pair.ArmParameters,
    free: Sequence[str] | None = None,
    progress: Callable[[float], None] = lambda share: None,
    *,
    loss: str = "cauchy",
) -> FitResult:
    """Fit numbers of the plant ``hardware`` to the rest positions of a machine.

    Residuals are divided by the standard deviation of the runs. Cauchy's loss reduces the weight of points that the
    model cannot explain. The confidence intervals are those of M-estimates. The variation of friction is computed
    afterwards, from the spread of the runs.

    Args:
        table: Measured rest positions.
        parameters: The slave, its controller and gains; its plant must be ``hardware``.
        free: ``coulomb.<joint>``, ``bias.<joint>``, ``weight.<name>``; None for :func:`default_free`.
        progress: Called with the completed share.
        loss: One of :data:`LOSSES`.

    Raises:
        ParameterError: The plant of the slave is not ``hardware``.
        UnknownNameError: ``loss`` is unknown, or ``free`` contains a number that cannot be fitted.
        FitError: The fit does not converge, or parameters cannot be distinguished; the message names them.
    """
    robot = load_robot_set(parameters.robot, parameters.geometry)
    if parameters.plant.kind.kind != "hardware":
        raise ParameterError("slave_sim.plant", parameters.plant.kind.kind, "hardware")
    if loss not in LOSSES:
        raise UnknownNameError("loss", loss, LOSSES)
    names = default_free(robot, table) if free is None else tuple(free)
    _insist_on_known(names, robot)
    problem = _Problem(robot, parameters, table, names)
    start = np.array([0.1 if name.startswith("bias") else 1.0 for name in names])
    lower = [0.0 if name.startswith("coulomb") else -np.inf for name in names]
    slopes = problem.slopes(start)
    _insist_on_identifiable(names, slopes)
    progress(0.1)
    found = least_squares(
        problem.residuals,
        start,
        jac=problem.slopes,
        bounds=(lower, np.inf),  # type: ignore[arg-type]
        loss=loss,
        max_nfev=_ROUNDS,
        xtol=1e-4,
        ftol=1e-4,
    )
    if not found.success:
        raise FitError(f"the fit did not converge in {_ROUNDS} rounds; its cost is {found.cost:.3g}")
    progress(0.7)
    return _result(problem, found.x, problem.slopes(found.x), LOSSES[loss], progress)


def _insist_on_known(names: Sequence[str], robot: Robot) -> None:
    assert robot.dynamics is not None
    known = [f"{kind}.{joint}" for kind in ("coulomb", "bias") for joint in robot.joint_names]
    known += [f"weight.{name}" for name in robot.dynamics.unknown]
    for name in names:
        if name not in known:
            raise UnknownNameError("free", name, known)
    if not names or len(set(names)) < len(names):
        raise ParameterError("free", list(names), "one name or more, each once")


def _insist_on_identifiable(names: Sequence[str], slopes: Array) -> None:
    """Raise an error for parameters that the table does not determine or cannot distinguish from others."""
    sizes = np.linalg.norm(slopes, axis=0)
    unseen = [name for name, size in zip(names, sizes, strict=True) if size < _WEAK * sizes.max()]
    if unseen or not sizes.any():
        text = ", ".join(unseen or names)
        raise FitError(f"not identifiable from this table, because they have no effect on it: {text}")
    if len(slopes) < len(names):
        raise FitError(
            f"{len(names)} parameters need at least {len(names)} rest positions; the table has {len(slopes)}"
        )
    _, values, directions = np.linalg.svd(slopes / sizes)
    for value, direction in zip(values, directions, strict=False):
        if value < _WEAK * values[0]:
            mixed = [n for n, part in zip(names, direction, strict=True) if abs(part) > 0.1]
            text = ", ".join(mixed)
            raise FitError(f"not identifiable from this table, because their effects are alike: {text}")


def _result(
    problem: _Problem, x: Array, slopes: Array, weigh: Callable[[Array], Array], progress: Callable[[float], None]
) -> FitResult:
    residuals = problem.residuals(x)
    used = np.abs(slopes).max(axis=1) > 0.0
    freedom = max(int(used.sum()) - len(x), 1)
    weights = weigh(residuals)  # covariance of an M-estimate: Huber 1967
    bend = np.linalg.inv(slopes.T @ (slopes * weights[:, None]))
    pull = slopes * (weights * residuals)[:, None]
    covariance = used.sum() / freedom * bend @ (pull.T @ pull) @ bend
    half = t.ppf(0.5 + 0.5 * _SHARE, freedom) * np.sqrt(np.diag(covariance))
    values = np.stack((x, x - half, x + half), axis=1) * problem.scales[:, None]
    numbers = [
        Fitted(name, _UNITS[name.partition(".")[0]], *row)
        for name, row in zip(problem.free, values.tolist(), strict=True)
    ]
    wander, spread = _wander(problem, x, progress)
    assert problem.robot.drives is not None
    step = problem.robot.drives.encoder_step
    return FitResult(
        problem.robot.name, problem.robot.joint_names, problem.table.name, (*numbers, *wander),
        problem.table.mean, problem.rests(x)[:, 0], problem.table.spread, spread, step,
        problem.one_sided,
    )  # fmt: skip


def _wander(problem: _Problem, x: Array, progress: Callable[[float], None]) -> tuple[list[Fitted], Array]:
    """Variation (n,) of friction about its fitted value, from the spread of the runs."""
    runs = max(10, *(len(rests) for rests in problem.table.rests))
    robot, measured = problem.robot, problem.table.spread

    def spread(wander: Array, runs: int) -> Array:
        rests = problem.rests(x, runs, wander)
        off = rests - rests.mean(axis=1, keepdims=True)
        return np.asarray(np.sqrt((off**2).sum(axis=(0, 1)) / (off.shape[0] * (runs - 1))))

    answered = spread(np.full(robot.n, _WANDER), _TIMES * runs)
    progress(0.85)
    share = {
        name: _WANDER * measured[i] / answered[i]
        for i, name in enumerate(robot.joint_names)
        if f"coulomb.{name}" in problem.free and answered[i] > 0.0
    }
    wander = np.array([share.get(name, 0.0) for name in robot.joint_names])
    freedom = sum(len(rests) - 1 for rests in problem.table.rests)
    low, high = np.sqrt(freedom / chi2.ppf([0.5 + 0.5 * _SHARE, 0.5 - 0.5 * _SHARE], freedom))
    numbers = [Fitted(f"wander.{name}", "", float(w), float(w * low), float(w * high)) for name, w in share.items()]
    predicted = spread(wander, runs)
    progress(1.0)
    return numbers, predicted
