"""Jaw bridge: the stage between the jaw's server and a real gripper.

It works for the jaw as ``arm_bridge`` works for the arm, with two differences. When the arm brakes, the jaw keeps its
grip. Fingers that press on an object may stop before their setpoint.
"""

from dataclasses import dataclass

import numpy as np

from teleop_core.base import ParameterError, Within, fixed
from teleop_core.graph import DT, Stage
from teleop_core.graph.topics import JAW, NO_COMMAND_NS, SLAVE_JAW_MEASURED_JS, SLAVE_JAW_SETPOINT_JS, SLAVE_OPERATION
from teleop_core.robots.joint_map import JointMap
from teleop_core.slave.bridges import Command, arm_bridge, leading

_UPPER = 3.0  # larger than the opening of any jaw [rad]; the jaw's server applies the real limit
_SAME = 1e-3  # a setpoint that moved by less while the gripper was not commanded counts as unchanged [rad]


@dataclass(frozen=True, kw_only=True)
class JawBridgeParameters(arm_bridge.BridgeParameters):
    """Parameters of :class:`JawBridge`."""

    command_topic: str = fixed("/gripper_controller/commands", doc="topic on which the gripper receives commands")
    state_topic: str = fixed("/joint_states", doc="topic on which the gripper publishes its JointState")
    joint: str = fixed("jaw", doc="name of the joint in the gripper's messages")
    scale: float = fixed(
        1.0,
        Within(-1e4, 1e4, "1 or rad/m"),
        "our angle = scale * gripper position + offset; negative if the gripper's position grows as it closes",
    )
    offset: float = fixed(0.0, Within(-10.0, 10.0, "rad"), "our angle at the gripper's position 0")
    speed_limit: float = fixed(
        4.0,
        Within(0.01, 100.0, "rad/s"),
        "rated speed of the gripper; commands exceed it by at most a fifth",
        source="assumed",
    )

    def __post_init__(self) -> None:
        """Refuse a scale of zero, which is within the bounds of the parameter."""
        super().__post_init__()
        if self.scale == 0.0:
            raise ParameterError("jaw_bridge.scale", self.scale, "another number than 0")


class JawBridge(arm_bridge.ControllerBridge):
    """Stage that commands a real gripper and publishes the measured angle of its fingers.

    The gripper gets no command until the server follows the first command of the hand. After a pause without commands,
    the gripper continues from the last command if the setpoint has not moved, so it keeps its grip. If the setpoint has
    moved, the gripper continues from the measured angle, no faster than the rated speed.
    """

    def __init__(self, parameters: JawBridgeParameters, dt: float = DT) -> None:
        p, upper = parameters, np.array([_UPPER])
        speed = np.array([p.speed_limit])
        joints = JointMap(JAW, [f"{JAW[0]}={p.joint}"], [p.scale], [p.offset], owner="jaw_bridge.", is_scaled=True)
        lead = leading.Lead(-upper, upper, speed, _SAME, 1.0 / p.rate, presses=True)
        super().__init__(JAW_BRIDGE, p, joints, lead, speed, dt)

    def command(self, now_ns: int, setpoint_age: float, is_led: bool) -> Command | None:
        """Return the command, as all bridges do; also None until the server follows the first command of the hand."""
        if self.signals["slave_jaw_setpoint_js_ns"] <= NO_COMMAND_NS:
            self.lead_arm.let_go("waits for the hand: no command is in force")
            return None
        return super().command(now_ns, setpoint_age, is_led)

    def _is_braked(self) -> bool:
        """Return False: brakes of the arm do not stop the jaw, so that it keeps its grip."""
        return False


JAW_BRIDGE = Stage(
    "jaw_bridge",
    JawBridgeParameters,
    reads=(SLAVE_JAW_SETPOINT_JS, SLAVE_OPERATION),
    writes=(SLAVE_JAW_MEASURED_JS,),
    make=JawBridge,
    node="teleop_core.nodes.arm_bridge:ArmBridgeNode",
)
