"""Fit result: fitted numbers as tables for the terminal, and as parameters of a session."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from teleop_core.base.errors import UnknownNameError
from teleop_core.base.plain_yaml import written
from teleop_core.kernels import Array
from teleop_core.robots import load_robot
from teleop_core.slave.plants.hardware import faults_of


@dataclass(frozen=True)
class Fitted:
    """One number with its 95 % confidence interval, in SI units."""

    name: str
    unit: str
    value: float
    low: float
    high: float


@dataclass(frozen=True, eq=False)
class FitResult:
    """Result of a fit.

    Attributes:
        robot: Name of the robot.
        joint_names: Names of the robot's joints.
        table: Name of the table.
        numbers: Fitted numbers in their order.
        measured: Mean of rest position minus target in the table (k, n) [rad or m].
        predicted: Mean of rest position minus target (k, n), simulated with the fitted numbers [rad or m].
        measured_spread: Standard deviation (n,) of the runs in the table [rad or m].
        predicted_spread: Standard deviation (n,) of the simulated runs [rad or m].
        encoder_step: Smallest difference (n,) that the encoders measure [rad or m].
        one_sided: Axes (n,) whose targets are all approached from one side. For these axes only the distance to the
            target is fitted, not the sign, because friction and bias cannot be distinguished.
    """

    robot: str
    joint_names: tuple[str, ...]
    table: str
    numbers: tuple[Fitted, ...]
    measured: Array
    predicted: Array
    measured_spread: Array
    predicted_spread: Array
    encoder_step: Array
    one_sided: NDArray[np.bool_]

    def value(self, name: str) -> float:
        """Return a fitted number by its name.

        Raises:
            UnknownNameError: The number was not fitted; the message lists the fitted numbers.
        """
        found = {number.name: number.value for number in self.numbers}
        if name not in found:
            raise UnknownNameError("fitted number", name, found)
        return found[name]

    def __str__(self) -> str:
        """Table of the numbers with their intervals, and table of measured and simulated rest positions."""
        width = max(len(number.name) for number in self.numbers)
        lines = [f"{self.robot} from {self.table}, 95 % intervals", ""]
        for n in self.numbers:
            lines.append(f"  {n.name:{width}}  {n.value:10.4g}  [{n.low:9.4g}, {n.high:9.4g}] {n.unit}".rstrip())
        lines += ["", "rest position minus target, mean of the runs in encoder counts: measured / simulated"]
        lines.append("  point  " + "".join(f"{name:>16}" for name in self.joint_names))
        pairs = zip(self.measured / self.encoder_step, self.predicted / self.encoder_step, strict=True)
        for k, (measured, predicted) in enumerate(pairs):
            cells = (f"{m:7.1f} /{p:7.1f}" for m, p in zip(measured, predicted, strict=True))
            lines.append(f"  {k + 1:5}  " + "".join(f"{cell:>16}" for cell in cells))
        spreads = zip(self.measured_spread / self.encoder_step, self.predicted_spread / self.encoder_step, strict=True)
        cells = (f"{m:7.1f} /{p:7.1f}" for m, p in spreads)
        lines.append("  S.D.   " + "".join(f"{cell:>16}" for cell in cells))
        if self.one_sided.any():
            names = ", ".join(np.array(self.joint_names)[self.one_sided])
            lines += [
                "",
                f"every move comes from the same side on {names}: there friction and bias cannot",
                "be told apart, and the distance is fitted, not its side",
            ]
        return "\n".join(lines)

    def to_json(self) -> dict[str, object]:
        """The whole result as plain values in SI units; numbers are not rounded."""
        return {
            "robot": self.robot,
            "table": self.table,
            "joints": list(self.joint_names),
            "numbers": [vars(number) for number in self.numbers],
            "measured": self.measured.tolist(),
            "predicted": self.predicted.tolist(),
            "measured_spread": self.measured_spread.tolist(),
            "predicted_spread": self.predicted_spread.tolist(),
            "one_sided": self.one_sided.tolist(),
        }

    def parameter_file(self) -> str:
        """ROS 2 parameter file of the plant ``hardware``, in which the fitted numbers replace those of the robot."""
        values = {number.name: float(f"{number.value:.4g}") for number in self.numbers}
        own = faults_of(load_robot(self.robot))
        given: dict[str, object] = {
            f"plant.hardware.{kind}": [
                values.get(f"{kind}.{name}", number)
                for name, number in zip(self.joint_names, getattr(own, kind).tolist(), strict=True)
            ]
            for kind in ("coulomb", "bias", "wander")
        }
        weights = [f"{name.partition('.')[2]}={value}" for name, value in values.items() if name.startswith("weight.")]
        if weights:
            given["plant.hardware.weights"] = weights
        slave = {"robot": self.robot, "plant.kind": "hardware", "controller.kind": "source_pid"}
        content = {"slave_sim": slave | given, "slave": {"robot": self.robot}}
        named = {name: {"ros__parameters": values} for name, values in content.items()}
        return written(named)
