"""Watch of a conformance test: all measurements of an arm during a commanded motion."""

from collections.abc import Callable

import numpy as np

from teleop_core.bags.messages import SECOND_NS
from teleop_core.kernels.geometry import Array
from teleop_drill.conformance.agreement import Trail, adds_up, follows, obeys
from teleop_drill.nodes.conformance_arm import Arm, numbers_of, stamp_of

JOINTS, TIP = "measured_js", "measured_cp"
_NAMES = ("setpoint_js", JOINTS, "setpoint_cp", TIP, "measured_cv")
_JOINT_WAY = 3e-3  # smallest displacement of a joint that is compared [rad or m]
_TIP_WAY = 1e-3  # smallest displacement of the tip that is compared [m]
_AFTERWARDS = 0.5  # time of observation after a motion, for delayed measurements [s]


class Watch:
    """All measurements of an arm, from the creation of this object to :meth:`lies`.

    Args:
        arm: The arm.
        fk: Forward kinematics of the arm: function from joints (n,) to the tip's pose (4, 4); None if unknown.
    """

    def __init__(self, arm: Arm, fk: Callable[[Array], Array] | None) -> None:
        self._arm, self._fk = arm, fk
        arm.keep([name for name in _NAMES if arm.publishers(name)])

    def lies(self) -> dict[str, str]:
        """End the watch, and return the disagreements by topic."""
        self._arm.pause(_AFTERWARDS)
        trails = {name: _trail(messages) for name, messages in self._arm.kept().items()}
        none = _trail([])
        joints, tip = trails.get(JOINTS, none), trails.get(TIP, none)
        twist = trails.get("measured_cv", none)
        found = {
            JOINTS: follows(JOINTS, joints, trails.get("setpoint_js", none), _JOINT_WAY) or adds_up(joints, _JOINT_WAY),
            TIP: follows(TIP, tip, trails.get("setpoint_cp", none), _TIP_WAY),
            "measured_cv": adds_up(_with_places(twist, tip), _TIP_WAY),
        }
        if self._fk is not None and not found[TIP]:
            found[TIP] = obeys(joints, tip, self._fk, _TIP_WAY)
        return {name: text for name, text in found.items() if text}


def _trail(messages: list[tuple[int, object]]) -> Trail:
    """Trail of messages, each with the time at which it was sent [ns]."""
    rows = [(sent_ns, stamp_of(one), numbers_of(one)) for sent_ns, one in messages]
    places = [n["position"] if "position" in n else n["twist"][:3] for *_, n in rows]
    rates = [n["velocity"] if "velocity" in n else n.get("twist", np.empty(0))[:3] for *_, n in rows]
    return Trail(
        np.array([sent_ns for sent_ns, *_ in rows]) / SECOND_NS,
        np.array([stamp_ns for _, stamp_ns, _ in rows]) / SECOND_NS,
        np.array(places) if rows else np.empty((0, 0)),
        np.array(rates) if rows and len(rates[0]) == len(places[0]) else np.empty((0, 0)),
    )


def _with_places(twist: Trail, tip: Trail) -> Trail:
    """Velocities of the tip, with the positions at the same stamps."""
    if not len(twist) or not len(tip):
        return Trail(twist.sent[:0], twist.stamp[:0], np.empty((0, 3)), np.empty((0, 3)))
    at = np.clip(np.searchsorted(tip.stamp, twist.stamp), 0, len(tip) - 1)
    return Trail(twist.sent, twist.stamp, tip.place[at], twist.rate)
