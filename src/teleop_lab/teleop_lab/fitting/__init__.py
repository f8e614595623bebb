"""Fitting: numbers of a plant from measurements on the machine.

:func:`fit_plant` is the function behind ``teleop fit``::

    import teleop_core as tc

    print(tc.fit_plant())  # tables 7.1-7.6 of the RCRT-1's source
"""

from collections.abc import Callable, Iterable, Sequence
from pathlib import Path

from teleop_core.session.runner import silent
from teleop_core.slave.parameters import SlaveParameters
from teleop_core.slave.slave_sim import SlaveSimParameters
from teleop_lab.fitting.fit import LOSSES, FitError, default_free, fit
from teleop_lab.fitting.fit_result import FitResult, Fitted
from teleop_lab.fitting.rest_table import PUBLISHED, RestTable, read_rests

__all__ = [
    "LOSSES",
    "PUBLISHED",
    "FitError",
    "FitResult",
    "Fitted",
    "RestTable",
    "default_free",
    "fit",
    "fit_plant",
    "read_rests",
]


def fit_plant(
    table: Path | str | None = None,
    *,
    robot: str = "rcrt1",
    free: Sequence[str] | None = None,
    files: Iterable[Path | str] = (),
    texts: Iterable[str] = (),
    loss: str = "cauchy",
    progress: Callable[[float], None] = silent,
) -> FitResult:
    """Fit the plant ``hardware`` of a robot to the rest positions of its joints.

    Args:
        table: CSV file for :func:`read_rests`; None for the published table of the RCRT-1.
        robot: Robot of the table's joints.
        free: Names of the fitted numbers, as in :func:`fit`; None for those that the table determines.
        files: Parameter files of the slave; without a file, the controller is the source's PID.
        texts: Parameters of the slave as ``key=value``; they override the files.
        loss: One of :data:`LOSSES`; it determines how much the weight of outliers is reduced.
        progress: Called with the completed share, 0 to 1.

    Raises:
        TeleopError: The table does not match the robot, a name is wrong, the fit does not converge, or parameters
            cannot be distinguished.
    """
    from teleop_core.robots import load_robot_set
    from teleop_core.session.configuration import configure
    from teleop_core.slave.pair import ArmParameters

    given = [f"robot={robot}", "plant=hardware", "controller=source_pid"]
    made = configure(None, [Path(file) for file in files], [*given, *texts])
    slave = ArmParameters.of(made.of(SlaveParameters), made.of(SlaveSimParameters))
    arm = load_robot_set(slave.robot, slave.geometry)
    rests = read_rests(Path(table or PUBLISHED), arm)
    return fit(rests, slave, free, progress, loss=loss)
