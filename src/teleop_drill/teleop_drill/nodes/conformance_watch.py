"""Watch of a conformance test: all measurements of an arm during a commanded motion."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from teleop_core.bags.messages import SECOND_NS
from teleop_core.kernels.geometry import rotations_from_quaternions
from teleop_core.robots.robot import Robot
from teleop_drill.conformance.agreement import Trail, adds_up, follows, obeys, rotation_vectors, turns, turns_add_up
from teleop_drill.nodes.conformance_arm import ArmClient, numbers_of, stamp_of

JOINTS, TIP = "measured_js", "measured_cp"
_JOINTS = ("setpoint_js", JOINTS)
_NAMES = ("setpoint_js", JOINTS, "setpoint_cp", TIP, "measured_cv")
_JOINT_WAY = 3e-3  # smallest displacement of a joint that is compared [rad or m]
_TIP_WAY = 1e-3  # smallest displacement of the tip that is compared [m]
_AFTERWARDS = 0.5  # time of observation after a motion, for delayed measurements [s]


class Watch:
    """All measurements of an arm, from the creation of this object to :meth:`lies`.

    Args:
        arm: The arm.
        robot: Model of the arm; None if unknown.
    """

    def __init__(self, arm: ArmClient, robot: Robot | None) -> None:
        self._arm, self._robot = arm, robot
        arm.keep([name for name in _NAMES if arm.publishers(name)])

    def lies(self) -> dict[str, str]:
        """End the watch, and return the disagreements by topic."""
        self._arm.pause(_AFTERWARDS)
        kept = self._arm.kept()
        order = self._order(kept)
        trails = {name: _trail(messages, order) for name, messages in kept.items()}
        none = _trail([])
        joints, tip = trails.get(JOINTS, none), trails.get(TIP, none)
        twist = trails.get("measured_cv", none)
        found = {
            JOINTS: follows(JOINTS, joints, trails.get("setpoint_js", none), _JOINT_WAY) or adds_up(joints, _JOINT_WAY),
            TIP: follows(TIP, tip, wanted := trails.get("setpoint_cp", none), _TIP_WAY) or turns(TIP, tip, wanted),
            "measured_cv": adds_up(both := _with_places(twist, tip), _TIP_WAY) or turns_add_up(both),
        }
        if self._robot is not None and not found[TIP]:
            found[TIP] = obeys(joints, tip, self._robot.fk, _TIP_WAY)
        return {name: text for name, text in found.items() if text}

    def _order(self, kept: dict[str, list[tuple[int, Any]]]) -> Sequence[str]:
        """Names of the joints in the order of the model, or else of the setpoint; empty without names."""
        named = [list(messages[0][1].name) for name in _JOINTS if (messages := kept.get(name))]
        if self._robot is not None and named and set(self._robot.joint_names) <= set(named[0]):
            return self._robot.joint_names
        return named[0] if named else ()


def _trail(messages: list[tuple[int, Any]], order: Sequence[str] = ()) -> Trail:
    """Trail of messages, each with the time at which it was sent [ns]; joints with names go into an order."""
    rows = [(sent_ns, stamp_of(one), _ordered(one, order)) for sent_ns, one in messages]
    places = [n["position"] if "position" in n else n["twist"][:3] for *_, n in rows]
    rates = [n["velocity"] if "velocity" in n else n.get("twist", np.empty(0))[:3] for *_, n in rows]
    quaternions = np.array([n["quaternion"] for *_, n in rows if "quaternion" in n])
    return Trail(
        np.array([sent_ns for sent_ns, *_ in rows]) / SECOND_NS,
        np.array([stamp_ns for _, stamp_ns, _ in rows]) / SECOND_NS,
        np.array(places) if rows else np.empty((0, 0)),
        np.array(rates) if rows and len(rates[0]) == len(places[0]) else np.empty((0, 0)),
        rotation_vectors(rotations_from_quaternions(quaternions)) if len(quaternions) else quaternions,
        np.array([n["twist"][3:] for *_, n in rows if "twist" in n]),
    )


def _ordered(message: Any, order: Sequence[str]) -> dict[str, np.ndarray]:
    """Vectors of a message by name; those of joints in the order of their names."""
    found, names = numbers_of(message), list(getattr(message, "name", ()))
    if not names or not set(order) <= set(names):
        return found
    at = [names.index(name) for name in order]
    return {part: values[at] if len(values) == len(names) else values for part, values in found.items()}


def _with_places(twist: Trail, tip: Trail) -> Trail:
    """Velocities of the tip, with the poses at the same stamps."""
    none = np.empty((0, 3))
    if not len(twist) or not len(tip):
        return Trail(twist.sent[:0], twist.stamp[:0], none, none)
    at = np.clip(np.searchsorted(tip.stamp, twist.stamp), 0, len(tip) - 1)
    turn = tip.turn[at] if len(tip.turn) else none
    return Trail(twist.sent, twist.stamp, tip.place[at], twist.rate, turn, twist.spin)
