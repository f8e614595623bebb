"""Tendons: pulley ratios of joints 5 and 6, and how a rotation of joint 5 moves motor 6."""

import math

import numpy as np

from teleop_core.evaluation.figure import FIRST, SECOND, Figure, axis, line
from teleop_core.kernels.geometry import Array
from teleop_core.robots.arms.rcrt1_hardware import tendon_joint_angles, tendon_motor_angles
from teleop_lab.experiments.bench import Bench
from teleop_lab.experiments.comparison import EXACT, Comparison, Findings, percent
from teleop_lab.experiments.experiment import Experiment

# Radii [mm]: 3.5, 2.5, 1.8 and 2.5 are printed, their stars are lost; most likely so.
_MOTOR5, _JOINT5, _MOTOR6, _JOINT6 = 3.5, 2.5, 1.8, 2.5
_RATIOS = {"ratio5": _JOINT5 / _MOTOR5, "ratio6": _JOINT6 / _MOTOR6, "coupling": _JOINT5 / _MOTOR6}


def _motors(joints: tuple[float, float]) -> Array:
    """Motor angles (2,) of joints 5 and 6, by the balance of tendon travel."""
    return tendon_motor_angles(np.array(joints), **_RATIOS)


def _measure(_: Bench) -> Findings:
    turn5, turn6 = _motors((1.0, 0.0)), _motors((0.0, 1.0))
    held = -turn5[1] / turn6[1]
    back = tendon_joint_angles(_motors((0.4, -0.3)), **_RATIOS)
    group = "turns of a motor for one turn of a joint, eqs. 3.5-3.7 and 4.5.7"
    rows = (
        Comparison(quantity="motor 5 for joint 5, r5/r5*", published=0.7143, predicted=turn5[0],
            within=percent(0.1), basis="law", group=group, note="of the printed radii"),
        Comparison(quantity="motor 6 for joint 6, r6/r6*", published=1.3889, predicted=turn6[1],
            within=percent(0.1), basis="law", group=group, note="of the printed radii"),
        Comparison(quantity="motor 6 for joint 5", published=_JOINT5 / _JOINT6, predicted=turn5[1],
            within=percent(0.1), group=group,
            note="eq. 3.7 lacks the ratio r6/r6*, without which joint 6 does not stand still"),
        Comparison(quantity="joint 6 for joint 5, if motor 6 rests", predicted=held, group=group),
        Comparison(quantity="motor 6 for joint 5 in chapter 7", published=0.0,
            predicted=float(tendon_motor_angles(np.array([1.0, 0.0]))[1]), within=EXACT,
            group=group, note="its results take motor 6 for joint 6, 'for convenience'"),
        Comparison(quantity="joints from their motors and back, largest error", unit="rad",
            predicted=float(np.abs(back - (0.4, -0.3)).max()), group="check"),
    )  # fmt: skip
    return Findings(rows, (_figure(),), _NOTES)


_NOTES = ("The stars on the printed radii are lost: which of them are the motors' is an inference.",)


def _figure() -> Figure:
    joint5 = np.radians(np.linspace(-80.0, 80.0, 81))
    motors = tendon_motor_angles(np.column_stack((joint5, np.zeros(81))), **_RATIOS)
    degrees = np.degrees(joint5)
    traces = [
        line(degrees, np.degrees(motors[:, 1]), "balance of tendon travel", FIRST, 2.0, "°"),
        line(degrees, degrees * _JOINT5 / _JOINT6, "eq. 3.7 as printed", SECOND, 2.0, "°"),
        line(degrees, np.zeros(81), "as chapter 7 computes", "#868e96", 1.5, "°"),
    ]
    layout = {"xaxis": axis("joint 5", "°"), "yaxis": axis("motor 6", "°")}
    sentence = (
        "What motor 6 must turn so that joint 6 stands still while joint 5 turns; the difference "
        f"of both lines would turn the tool by {math.degrees(abs(joint5[-1])) * 0.28:.0f}° at the "
        "end of joint 5."
    )
    return Figure("Coupling of the tendons", sentence, traces, layout, 320)


TENDONS = Experiment(
    "tendons",
    "pulley ratios of the wrist, and the coupling of joint 5 into joint 6",
    "Vongbunyong 2008, eqs. 3.5-3.7, 4.5.7",
    _measure,
)
