"""D-H robots: the lecture's tables as numbers: planar 3R, PUMA 560, SCARA, 3-RPS, finger."""

import math

import numpy as np

from teleop_core.kernels.geometry import Array
from teleop_core.robots import load_robot
from teleop_core.robots.hand_fingers import finger_point
from teleop_core.robots.rps3 import joint_points
from teleop_lab.experiments.bench import Bench
from teleop_lab.experiments.experiment import Experiment
from teleop_lab.experiments.outcome import Findings, Row, absolute

_SIX = absolute(1.05e-6)  # six decimals
_FOUR = absolute(1.05e-4)


def _place_rows(group: str, printed: tuple[float, ...], found: Array) -> list[Row]:
    return [
        Row(quantity=letter, unit="m", published=value, predicted=float(place), within=_SIX,
            group=group)
        for letter, value, place in zip("xyz", printed, found, strict=False)
    ]  # fmt: skip


def _heading(pose: Array) -> float:
    return math.degrees(math.atan2(pose[1, 0], pose[0, 0]))


def _planar() -> list[Row]:
    arm, q = load_robot("planar_3r", l1=1.0, l2=0.8, l3=0.5), np.radians([30.0, 45.0, -60.0])
    pose = arm.fk(q)
    group = "planar 3R, links 1, 0.8, 0.5, at 30°, 45°, -60°"
    other = np.degrees(arm.ik_all(pose)[1])
    wrist = load_robot("planar_3r", l1=1.0, l2=0.8, l3=0.0).fk(q)
    return [
        *_place_rows(f"{group}: joint 3", (1.073081, 1.272741), wrist[:3, 3]),
        *_place_rows(f"{group}: tool", (1.556044, 1.402150), pose[:3, 3]),
        Row(quantity="heading", unit="°", published=15.0, predicted=_heading(pose), within=_SIX,
            group=f"{group}: tool"),
        *(Row(quantity=name, unit="°", published=value, predicted=float(found), within=_FOUR,
              group=f"{group}: other elbow")
          for name, value, found in zip(
              ("theta1", "theta2", "theta3"), (69.7298, -45.0, -9.7298), other, strict=True)),
    ]  # fmt: skip


def _puma() -> list[Row]:
    arm = load_robot("puma560", a2=0.43, a3=0.02, d3=0.15, d4=0.43)
    pose = arm.fk(np.zeros(6))
    group = "PUMA 560, a2 0.43, a3 0.02, d3 0.15, d4 0.43, all joints 0"
    rows = _place_rows(group, (0.45, 0.15, -0.43), pose[:3, 3])
    rows += [
        Row(quantity=f"R{k}{k}", published=value, predicted=float(pose[k - 1, k - 1]), within=_SIX,
            group=group)
        for k, value in ((1, 1.0), (2, -1.0), (3, -1.0))
    ]  # fmt: skip
    return rows


def _scara() -> list[Row]:
    arm = load_robot("scara")
    q = np.array([math.radians(25.0), math.radians(50.0), 0.12, math.radians(-30.0)])
    pose, group = arm.fk(q), "SCARA, links 0.4, 0.3, at 25°, 50°, 0.12 m, -30°"
    other = arm.ik_all(pose)[1]
    return [
        *_place_rows(group, (0.440169, 0.458825, -0.12), pose[:3, 3]),
        Row(quantity="heading", unit="°", published=45.0, predicted=_heading(pose), within=_SIX,
            group=group),
        *(Row(quantity=f"{name}, other elbow", unit="°", published=value,
              predicted=math.degrees(other[k]), within=_SIX, group=group)
          for name, k, value in (
              ("theta1", 0, 67.377701), ("theta2", 1, -50.0), ("theta4", 3, 27.622299))),
    ]  # fmt: skip


def _legs() -> list[Row]:
    group = "3-RPS, base 1, legs 1.2, 1, 0.9 at 60°, 70°, 80°"
    found = joint_points([1.2, 1.0, 0.9], np.radians([60.0, 70.0, 80.0]), b=1.0)
    printed = (
        (0.4, 0.0, 1.039230), (-0.328990, 0.569827, 0.939693), (-0.421858, -0.730680, 0.886327)
    )  # fmt: skip
    return [
        row
        for k, (values, place) in enumerate(zip(printed, found, strict=True), start=1)
        for row in _place_rows(f"{group}: S{k}", values, place)
    ]


def _finger() -> list[Row]:
    theta, psi, phi = (math.radians(angle) for angle in (20.0, 35.0, -50.0))
    place = finger_point(theta, psi, phi, (1.0, 0.6, 0.4))
    group = "finger, links 1, 0.6, 0.4, at 20°, 35°, -50°"
    return _place_rows(group, (1.764613, 0.642266, 0.240618), np.array(place))


def _measure(_: Bench) -> Findings:
    return Findings((*_planar(), *_puma(), *_scara(), *_legs(), *_finger()), (), _NOTES)


_NOTES = (
    "The lecture has no numbers: 'published' are those computed from its tables beforehand, by "
    "other code, for lengths that were chosen for it.",
)

DH_ROBOTS = Experiment(
    "dh_robots",
    "poses of the planar 3R, PUMA 560, SCARA, 3-RPS legs and a finger",
    "Ghosal 2020, lecture 6; numbers computed from its tables",
    _measure,
)
