"""Hybrid: the worked example of the SCARA with a Stewart platform."""

import math

import numpy as np

from teleop_core.evaluation.figure import FIRST, SECOND, THIRD, Figure, in_space, scene
from teleop_core.kernels.geometry import Array, rotation, transform
from teleop_core.robots import load_robot
from teleop_lab.experiments.bench import Bench
from teleop_lab.experiments.comparison import Comparison, Findings, absolute
from teleop_lab.experiments.experiment import Experiment

_PLACE_CM, _TILT = (93.3013, 20.0, 43.6603), math.radians(30.0)
_LEGS_CM = (22.3607, 26.7095, 26.7095, 22.3607, 19.1569, 19.1569)
_OFFSET_CM, _WRIST_CM = (0.0, -5.0, 28.6603), (93.3013, 25.0, 15.0)
# The source prints four decimals and rounds its inputs to four decimals. The error is up to 2e-4 degrees near the
# stretched posture of the arm.
_LENGTH, _ANGLE = absolute(1e-4), absolute(2e-4)
_BASE_CM, _PLATFORM_CM, _HEIGHT_CM, _TOOL_CM = 20.0, 10.0, 20.0, 10.0


def _measure(_: Bench) -> Findings:
    robot = load_robot("scara_stewart")
    turned = rotation("x", _TILT)
    pose = transform(turned, np.array(_PLACE_CM) * 1e-2)
    q = robot.ik_all(pose)[0]
    offset = np.array([0.0, 0.0, _HEIGHT_CM]) + _TOOL_CM * turned[:, 2]
    back = 1e2 * robot.fk(q)[:3, 3]
    rows = [
        Comparison(
            quantity=f"leg {k}",
            unit="cm",
            published=printed,
            predicted=1e2 * found,
            within=_LENGTH,
            group="inverse kinematics",
        )
        for k, (printed, found) in enumerate(zip(_LEGS_CM, q[3:], strict=True), start=1)
    ]
    rows += [
        Comparison(
            quantity=name, unit=unit, published=printed, predicted=found, within=within, group="inverse kinematics"
        )
        for name, unit, printed, found, within in (
            ("theta1", "°", 0.0, math.degrees(q[0]), _ANGLE),
            ("theta2", "°", 30.0, math.degrees(q[1]), _ANGLE),
            ("d3", "cm", 15.0, 1e2 * q[2], _LENGTH),
        )
    ]
    for name, printed, found in (
        ("tool from the SCARA's tip", _OFFSET_CM, offset),
        ("tip of the SCARA", _WRIST_CM, np.array(_PLACE_CM) - offset),
        ("tool, forward again", _PLACE_CM, back),
    ):
        rows += [
            Comparison(
                quantity=f"{name}, {letter}",
                unit="cm",
                published=printed[k],
                predicted=float(found[k]),
                within=_LENGTH,
                group="places",
            )
            for k, letter in enumerate("xyz")
        ]
    return Findings(tuple(rows), (_figure(q, turned),), _NOTES)


_NOTES = (
    "The numbers hold for a platform that keeps its heading; bolted to link 2 (heading=carried) "
    "the same joints bring the tool 2.6 cm away. The two hexagons are similar, so that leg "
    "lengths alone do not fix the platform: this is inverse kinematics only.",
)


def _figure(q: Array, turned: Array) -> Figure:
    angles = np.radians(60.0 * np.arange(6))
    circle = np.column_stack((np.cos(angles), np.sin(angles), np.zeros(6)))
    elbow = 50.0 * np.array([math.cos(q[0]), math.sin(q[0]), 0.0])
    reach = elbow + 50.0 * np.array([math.cos(q[0] + q[1]), math.sin(q[0] + q[1]), 0.0])
    up = np.array([0.0, 0.0, 1.0])
    tip = reach + 1e2 * q[2] * up
    base = tip + _BASE_CM * circle
    top = tip + _HEIGHT_CM * up + _PLATFORM_CM * circle @ turned.T
    arm = np.vstack((np.zeros(3), elbow, reach, tip))
    tool = np.vstack((tip + _HEIGHT_CM * up, _PLACE_CM))
    legs = np.vstack([np.vstack((b, t, np.full(3, np.nan))) for b, t in zip(base, top, strict=True)])
    rings = [np.vstack((ring, ring[:1])) for ring in (base, top)]
    traces = [
        in_space(arm, "SCARA", FIRST, 6),
        in_space(legs, "legs", SECOND, 4),
        *(in_space(ring, "platforms", "#495057", 3) for ring in rings),
        in_space(tool, "tool", THIRD, 6),
    ]
    traces[3]["showlegend"] = False
    sentence = "The worked example: position by the SCARA, attitude by the platform."
    return Figure("Worked example", sentence, traces, scene("cm"), 460)


HYBRID = Experiment(
    "hybrid",
    "worked example of the SCARA with a Stewart platform: legs, joints, places",
    "Kucuk and Gungor 2016, section 4",
    _measure,
)
