"""Resolution: the encoders' resolution at the joints and at the tip (chapter 3, table 3.6)."""

import math

import numpy as np

from teleop_core.evaluation.figure import FIRST, SECOND, Figure, axis, joined, points
from teleop_core.kernels.geometry import Array
from teleop_core.robots import load_robot
from teleop_lab.experiments.bench import Bench
from teleop_lab.experiments.comparison import EXACT, Comparison, Findings, percent
from teleop_lab.experiments.experiment import Experiment

_DEGREE, _UM = math.pi / 180.0, 1e-6
# Printed steps of the joints [°] and of the screw [µm]. The screw's step is that of the source's appendix A.4; table
# 3.6 prints 13.161 µm.
_JOINTS = {"theta1": 1.0e-3, "theta2": 1.0e-3, "theta4": 1.247e-3, "theta5": 2.313e-3, "theta6": 2.313e-3}
_SPEEDS_RPM = {"theta1": 30.0, "theta2": 30.0, "theta4": 70.213, "theta5": 130.263, "theta6": 130.263}
_SCREW_UM = 0.1316
_SCREW_RPM = 3719.677
_LEAD_MM = 1.0
_REACH = 0.460  # rounded reach of prismatic link and tip in the source [m]
_TIP_UM = 8.029  # printed step of the tip by one joint [µm]
_TIP_ALL_UM = 11.355  # printed step of the tip by all axes [µm]


def link_step(reach: float, step: float) -> float:
    """Displacement of the tip [m] for one encoder step [rad] at a reach [m]: ΔS = L Δθ (chapter 3)."""
    return reach * step


def _measure(_: Bench) -> Findings:
    robot = load_robot("rcrt1")
    assert robot.drives is not None
    steps = dict(zip(robot.joint_names, robot.drives.encoder_step, strict=True))
    speeds = dict(zip(robot.joint_names, robot.drives.speed_limit, strict=True))
    rows = [
        Comparison(
            quantity=f"step of {name}",
            unit="°",
            published=printed,
            predicted=steps[name] / _DEGREE,
            within=percent(0.1),
            group="encoders, table 3.6",
        )
        for name, printed in _JOINTS.items()
    ]
    rows += [
        Comparison(quantity="step of d3", unit="µm", published=_SCREW_UM, predicted=steps["d3"] / _UM,
            within=percent(0.1), group=rows[0].group, note="table 3.6 misprints 13.161"),
    ]  # fmt: skip
    turning = [link_step(_REACH, steps[name]) / _UM for name in ("theta1", "theta2")]
    each = np.array([*turning, steps["d3"] / _UM])
    group = "tip at a reach of 460 mm, ΔS = L Δθ"
    rows += [
        Comparison(
            quantity="tip, theta1", unit="µm", published=_TIP_UM, predicted=each[0], within=percent(0.1), group=group
        ),
        Comparison(
            quantity="tip, theta2", unit="µm", published=_TIP_UM, predicted=each[1], within=percent(0.1), group=group
        ),
        Comparison(
            quantity="tip, d3", unit="µm", published=_SCREW_UM, predicted=each[2], within=percent(0.1), group=group
        ),
        Comparison(
            quantity="tip, all axes",
            unit="µm",
            published=_TIP_ALL_UM,
            predicted=float(np.linalg.norm(each)),
            within=percent(0.1),
            group=group,
            note="root of the sum of squares",
        ),
    ]
    group = "speeds of the drives, table 3.6"
    rows += [
        Comparison(
            quantity=f"speed of {name}",
            unit="rpm",
            published=printed,
            predicted=speeds[name] * 60.0 / (2.0 * math.pi),
            within=percent(0.1),
            group=group,
        )
        for name, printed in _SPEEDS_RPM.items()
    ]
    rows.append(
        Comparison(
            quantity="speed of the screw",
            unit="rpm",
            published=_SCREW_RPM,
            predicted=speeds["d3"] * 60.0 / (1e-3 * _LEAD_MM),
            within=EXACT,
            group=group,
        )
    )
    return Findings(tuple(rows), (_figure(steps),), _NOTES)


_NOTES = ("Of the model's drive table, which virtual sessions quantise the measured joints with.",)


def _figure(steps: dict[str, float]) -> Figure:
    reach: Array = np.linspace(0.037, 0.458, 60)
    each = {name: reach * steps[name] / _UM for name in ("theta1", "theta4", "theta5")}
    total = np.sqrt(2.0 * each["theta1"] ** 2 + (steps["d3"] / _UM) ** 2)
    traces = [
        joined(reach * 1e3, each["theta1"], "theta1 or theta2 alone", FIRST, "µm"),
        joined(reach * 1e3, total, "theta1, theta2 and d3", SECOND, "µm"),
        points(np.array([460.0, 460.0]), np.array([_TIP_UM, _TIP_ALL_UM]), "published", "#111", "µm", 0),
    ]
    for trace in traces[:2]:
        trace["mode"] = "lines"
    layout = {"xaxis": axis("reach", "mm"), "yaxis": axis("distance of one step", "µm", rangemode="tozero")}
    sentence = "Motion of the tip by one encoder step, against its distance from the shoulder."
    return Figure("Resolution of the tip", sentence, traces, layout, 340)


RESOLUTION = Experiment(
    "resolution",
    "steps of the encoders, at the joints and at the tip; speeds of the drives",
    "Vongbunyong 2008, chapter 3, table 3.6, appendix A.4",
    _measure,
)
