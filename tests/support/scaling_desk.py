"""Motion scaling by itself: a hand to move, and a slave that stands where it was told to."""

from typing import Any

import numpy as np

from teleop_core.coupling.mapping.gains import MotionScalingParameters
from teleop_core.coupling.mapping.motion_scaling import MotionScaling
from teleop_core.coupling.mapping.plausibility import PlausibilityParameters
from teleop_core.graph.signals import STATE, TICK_NS
from teleop_core.hand.operators.rest import REST_POSITION
from teleop_core.kernels import geometry
from teleop_core.robots import load_robot
from teleop_core.robots.selection import PUBLISHED

ANY_HAND = PlausibilityParameters(speed=1000.0, acceleration=1e6, turn=1e4, reach=100.0, button_silence=0.0)
"""A hand that may jump, as tests have it do."""

ALIGNED: Any = {"tool_axes": PUBLISHED["rcrt1"]["motion_scaling"]["tool_axes"]}
"""Stylus and tool are aligned, as published for the RCRT-1."""

MM = 1e-3
HOME = load_robot("rcrt1").fk(load_robot("rcrt1").home)


class Desk:
    """Motion scaling with a hand to move and a slave that stands where it was told to."""

    def __init__(self, **values: Any) -> None:
        self.scaling = MotionScaling(MotionScalingParameters(**{"plausible": ANY_HAND} | values))
        self.row = self.scaling.signals
        self.hand, self.turn = np.array(REST_POSITION), np.eye(3)
        self.pressed = np.zeros(3)
        self.row["master_measured_cp_ns"] = self.row["slave_setpoint_cp_ns"] = TICK_NS
        geometry.pose_from_transform(HOME, self.row["slave_setpoint_cp"])

    def step(
        self,
        move: tuple[float, float, float] | geometry.Array = (0, 0, 0),
        turn: Any = None,
        *,
        stamp_step_ns: int = TICK_NS,
        does_follow: bool = True,
    ) -> geometry.Array:
        """One sample after the hand's step [m]; returns the slave command's place."""
        row, self.hand = self.row, self.hand + np.asarray(move, dtype=float)
        self.turn = self.turn if turn is None else turn @ self.turn
        row["master_measured_cp_ns"] += stamp_step_ns
        geometry.pose_from_transform(geometry.transform(self.turn, self.hand), row["master_measured_cp"])
        row["master_buttons"] = self.pressed
        self.scaling.step()
        if does_follow:
            row["slave_setpoint_cp"] = row["slave_servo_cp"]
            row["slave_setpoint_cp_ns"] = row["master_measured_cp_ns"]
        return row["slave_servo_cp"][:3].copy()

    def press(self, button: str) -> geometry.Array:
        """Sample with a button pressed, then one with it released; the hand rests."""
        index = ("clutch", "fixture", "mode").index(button)
        self.pressed[index] = 1.0
        self.step()
        self.pressed[index] = 0.0
        return self.step()

    def hold(self, button: str, is_held: bool = True) -> None:
        self.pressed[("clutch", "fixture", "mode").index(button)] = float(is_held)

    def attitude(self) -> geometry.Array:
        out = np.empty((3, 3))
        geometry.rotation_from_quaternion(np.ascontiguousarray(self.row["slave_servo_cp"][3:]), out)
        return out

    def state(self, name: str) -> float:
        return self.row["teleop_state"][STATE[name]]

    def box(self) -> tuple[geometry.Array, geometry.Array]:
        start, size = STATE["fixture_center_x"], STATE["fixture_size_x"]
        state = self.row["teleop_state"]
        return state[start : start + 3].copy(), state[size : size + 3].copy()
