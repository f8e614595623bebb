"""Report: a fit as tables for the terminal, and as parameters of a session."""

from typing import TYPE_CHECKING

import numpy as np

from teleop_core.base.plain_yaml import written
from teleop_core.robots import load_robot
from teleop_core.slave.plants.hardware import faults_of

if TYPE_CHECKING:
    from teleop_lab.fitting.fit import FitResult


def text(found: "FitResult") -> str:
    """Numbers with their intervals, and measured beside simulated rest positions of the joints."""
    width = max(len(number.name) for number in found.numbers)
    lines = [f"{found.robot} from {found.table}, 95 % intervals", ""]
    lines += [
        f"  {n.name:{width}}  {n.value:10.4g}  [{n.low:9.4g}, {n.high:9.4g}] {n.unit}".rstrip() for n in found.numbers
    ]
    lines += ["", "rest position minus target, mean of the runs in encoder counts: measured / simulated"]
    lines.append("  point  " + "".join(f"{name:>16}" for name in found.joint_names))
    pairs = zip(found.measured / found.encoder_step, found.predicted / found.encoder_step, strict=True)
    for k, (measured, predicted) in enumerate(pairs):
        cells = (f"{m:7.1f} /{p:7.1f}" for m, p in zip(measured, predicted, strict=True))
        lines.append(f"  {k + 1:5}  " + "".join(f"{cell:>16}" for cell in cells))
    spreads = zip(found.measured_spread / found.encoder_step, found.predicted_spread / found.encoder_step, strict=True)
    cells = (f"{m:7.1f} /{p:7.1f}" for m, p in spreads)
    lines.append("  S.D.   " + "".join(f"{cell:>16}" for cell in cells))
    if found.one_sided.any():
        names = ", ".join(np.array(found.joint_names)[found.one_sided])
        lines += [
            "",
            f"every move comes from the same side on {names}: there friction and bias cannot",
            "be told apart, and the distance is fitted, not its side",
        ]
    return "\n".join(lines)


def parameter_file(found: "FitResult") -> str:
    """ROS 2 parameter file: the plant ``hardware`` with fitted numbers over the robot's."""
    values = {number.name: float(f"{number.value:.4g}") for number in found.numbers}
    own = faults_of(load_robot(found.robot))
    given: dict[str, object] = {
        f"plant.hardware.{kind}": [
            values.get(f"{kind}.{name}", number)
            for name, number in zip(found.joint_names, getattr(own, kind).tolist(), strict=True)
        ]
        for kind in ("coulomb", "bias", "wander")
    }
    weights = [f"{name.partition('.')[2]}={value}" for name, value in values.items() if name.startswith("weight.")]
    if weights:
        given["plant.hardware.weights"] = weights
    slave = {"robot": found.robot, "plant.kind": "hardware", "controller.kind": "source_pid"}
    content = {"slave_sim": slave | given, "slave": {"robot": found.robot}}
    named = {name: {"ros__parameters": values} for name, values in content.items()}
    return written(named)
