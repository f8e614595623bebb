"""Calibration: the real geometry of an arm, from measured positions of its tip.

:func:`simulate` simulates the measurement of an arm with known errors. :func:`calibrate` uses your measurements::

    from teleop_lab.calibration import calibrate, read_measured, simulate
    from teleop_core.robots import load_robot

    robot = load_robot("rcrt1")
    print(simulate(robot, poses=40, noise=0.1e-3, errors=["cnc", "d3=5.5e-3"]))
    print(calibrate(robot, read_measured("poses.csv", robot)))
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from teleop_core.robots.link_errors import LinkErrors
from teleop_core.robots.robot import Robot
from teleop_lab.calibration import appendix_e
from teleop_lab.calibration.accuracy import Accuracy, at_fresh, at_measured, left_out
from teleop_lab.calibration.identify import Found, identify
from teleop_lab.calibration.measured import CalibrationError, Measured, read_measured
from teleop_lab.calibration.model import FRAME, ChainModel
from teleop_lab.calibration.poses import random_poses
from teleop_lab.calibration.simulate import RULER, chosen_poses, default_errors, ruled, tracked, true_errors

if TYPE_CHECKING:
    from teleop_lab.calibration.corrected import Table

__all__ = [
    "Accuracy",
    "Calibration",
    "CalibrationError",
    "ChainModel",
    "Found",
    "LinkErrors",
    "Measured",
    "appendix_e",
    "calibrate",
    "read_measured",
    "simulate",
]
FRESH = 500
"""Number of poses at which the result of a simulated calibration is tested."""


@dataclass(frozen=True, eq=False)
class Calibration:
    """Result of a calibration, and its accuracy.

    Attributes:
        robot: The nominal arm.
        measured: The readings.
        found: Link errors and their confidence intervals.
        fitted: Accuracy at the measured poses.
        tried: Accuracy at poses that were not used to find the errors; None if there are too few poses.
        truth: Errors of a simulated arm; None for a real arm.
        equivalent: Values of the found entries that a perfect fit would give for ``truth``. If several entries have the
            same effect, the value of the found entry is their sum. Empty for a real arm.
    """

    robot: Robot
    measured: Measured
    found: Found
    fitted: Accuracy
    tried: Accuracy | None
    truth: LinkErrors | None = None
    equivalent: Mapping[str, float] = field(default_factory=dict)

    def __str__(self) -> str:
        from teleop_lab.calibration.report import text

        return text(self)

    def to_json(self) -> dict[str, object]:
        """All numbers [m, rad] as plain values for JSON."""
        from teleop_lab.calibration.report import content

        return content(self)

    def table(self) -> "Table":
        """Denavit-Hartenberg table of the calibrated arm for :func:`teleop_core.robots.robot_from_table`."""
        from teleop_lab.calibration.corrected import corrected_table

        return corrected_table(self.robot, self.found.errors)


def calibrate(
    robot: Robot,
    measured: Measured,
    fit: str | Sequence[str] = "all",
    *,
    finds_frame: bool = False,
    keeps_all: bool = False,
) -> Calibration:
    """Identify the link errors of an arm from measurements.

    Args:
        robot: The nominal arm; it must be a chain of links.
        measured: Points or distances of the tip, for example from :func:`read_measured`.
        fit: "all" link errors, joint "offsets", or names such as ["d3", "theta2"].
        finds_frame: Whether the points are in a frame with an unknown pose, such as the frame of a tracker.
        keeps_all: Whether the result contains errors that do not differ significantly from zero.

    Raises:
        ParameterError: The robot is not a chain.
        UnknownNameError: ``fit`` contains a name that is not a link error.
        CalibrationError: There are too few poses, errors cannot be distinguished, or the search does not converge.
    """
    model = ChainModel.of(robot)
    found = identify(model, measured, fit, finds_frame=finds_frame, keeps_all=keeps_all)
    return Calibration(robot, measured, found, at_measured(found, measured), left_out(found, measured))


def simulate(
    robot: Robot,
    *,
    poses: int = 40,
    noise: float | str = 0.1e-3,
    errors: Sequence[str] | None = None,
    fit: str | Sequence[str] | None = None,
    choose: str = "optimal",
    finds_frame: bool = False,
    keeps_all: bool = False,
    seed: int = 1,
) -> Calibration:
    """Calibrate an arm with known errors from simulated measurements.

    Args:
        robot: The nominal arm; it must be a chain of links.
        poses: Number of measured poses.
        noise: Standard deviation of a tracker on each axis [m], or "ruler" for a ruler with 0.5 mm divisions that
            measures along one axis after the other.
        errors: Tolerances and values for :func:`~teleop_lab.calibration.simulate.true_errors`. None stands for "cnc";
            for the rcrt1 it includes the published offset of d3.
        fit: As in :func:`calibrate`; None for "all", or for "offsets" with a ruler.
        choose: "optimal" or "random" poses of a tracker.
        finds_frame: Whether the frame of the tracker is unknown; then its pose is also estimated.
        keeps_all: Whether the result contains errors that do not differ significantly from zero.
        seed: Seed of poses, errors and noise.

    Raises:
        ParameterError, UnknownNameError, CalibrationError: The reasons of :func:`calibrate`, or an impossible value.
    """
    model, rng = ChainModel.of(robot), np.random.default_rng(seed)
    truth = true_errors(robot, default_errors(robot) if errors is None else errors, rng)
    is_ruler = noise == RULER
    wanted = fit if fit is not None else "offsets" if is_ruler else "all"
    if isinstance(noise, str):
        if not is_ruler:
            raise CalibrationError(f"noise is {noise!r}, must be a number [m] or {RULER!r}")
        measured = ruled(model, truth, poses)
    else:
        q = chosen_poses(model, poses, choose, wanted, rng)
        measured = tracked(model, truth, q, noise, rng, is_elsewhere=finds_frame)
    found = identify(model, measured, wanted, finds_frame=finds_frame, keeps_all=keeps_all)
    sums = found.equivalent(truth, random_poses(robot, FRESH, rng))
    return Calibration(
        robot,
        measured,
        found,
        at_measured(found, measured),
        _tried(found, truth, measured, finds_frame, rng),
        truth,
        {name: value for name, value in sums.items() if name not in FRAME},
    )


def _tried(
    found: Found, truth: LinkErrors, measured: Measured, finds_frame: bool, rng: np.random.Generator
) -> Accuracy | None:
    """Accuracy at new poses without noise; for a tracker with an unknown frame, accuracy by cross-validation."""
    if finds_frame:
        return left_out(found, measured)
    q = random_poses(found.model.robot, FRESH, rng)
    return at_fresh(found, tracked(ChainModel.of(found.model.robot), truth, q, 0.0, rng))
