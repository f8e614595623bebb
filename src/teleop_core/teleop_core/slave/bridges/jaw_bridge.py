"""Jaw bridge: the stage that stands between the jaw's server and a real gripper.

It does for the jaw what ``arm_bridge`` does for the arm, but for two things: brakes of the arm do
not open the jaw, and fingers that press on something stand short of their setpoint.
"""

from dataclasses import dataclass

import numpy as np

from teleop_core.base import ParameterError, Within, parameter
from teleop_core.graph import DT, Stage
from teleop_core.graph.topics import JAW, NO_COMMAND_NS, SLAVE_JAW_MEASURED_JS, SLAVE_JAW_SETPOINT_JS, SLAVE_OPERATION
from teleop_core.slave.bridges import Command, arm_bridge, leading
from teleop_core.slave.bridges.names import JointMap

_UPPER = 3.0  # more than any jaw opens [rad]; its server has the limit
_SAME = 1e-3  # a setpoint that moved by less while the gripper was not led stayed [rad]


@dataclass(frozen=True, kw_only=True)
class JawBridgeParameters(arm_bridge.BridgeParameters):
    """Parameters of :class:`JawBridge`."""

    command_topic: str = parameter("/gripper_controller/commands", fixed=True, doc="where the gripper takes commands")
    state_topic: str = parameter("/joint_states", fixed=True, doc="where the gripper's JointState comes from")
    joint: str = parameter("jaw", fixed=True, doc="what the gripper calls its joint")
    scale: float = parameter(
        1.0,
        Within(-1e4, 1e4, "1 or rad/m"),
        "our angle = scale * theirs + offset; negative where theirs grows as it closes",
        fixed=True,
    )
    offset: float = parameter(0.0, Within(-10.0, 10.0, "rad"), "our angle where theirs is 0", fixed=True)
    speed_limit: float = parameter(
        4.0,
        Within(0.01, 100.0, "rad/s"),
        "rated speed, which commands exceed by a fifth at most",
        fixed=True,
        source="assumed",
    )

    def __post_init__(self) -> None:
        """Refuse a scale of zero too."""
        super().__post_init__()
        if self.scale == 0.0:
            raise ParameterError("jaw_bridge.scale", self.scale, "another number than 0")


class JawBridge(arm_bridge.ControllerBridge):
    """Stage that leads a real gripper, and says where its fingers are.

    The gripper is commanded nothing before the first command of the hand is followed. Where it was
    not led for a while, it goes on from the last command if the setpoint is still there, so that it
    keeps its grip; else from where its fingers are, no faster than rated.
    """

    def __init__(self, parameters: JawBridgeParameters, dt: float = DT) -> None:
        p, upper = parameters, np.array([_UPPER])
        speed = np.array([p.speed_limit])
        joints = JointMap(JAW, [f"{JAW[0]}={p.joint}"], [p.scale], [p.offset], owner="jaw_bridge.", is_scaled=True)
        lead = leading.Lead(-upper, upper, speed, _SAME, 1.0 / p.rate, presses=True)
        super().__init__(JAW_BRIDGE, p, joints, lead, speed, dt)

    def command(self, now_ns: int, setpoint_age: float, is_led: bool) -> Command | None:
        """As of every bridge; None too before the first command of the hand is followed."""
        if self.signals["slave_jaw_setpoint_js_ns"] <= NO_COMMAND_NS:
            self.lead_arm.let_go("waits for the hand: no command is in force")
            return None
        return super().command(now_ns, setpoint_age, is_led)

    def _is_braked(self) -> bool:
        """Brakes of the arm do not hold the jaw: its grip stays."""
        return False


JAW_BRIDGE = Stage(
    "jaw_bridge",
    JawBridgeParameters,
    reads=(SLAVE_JAW_SETPOINT_JS, SLAVE_OPERATION),
    writes=(SLAVE_JAW_MEASURED_JS,),
    make=JawBridge,
    node="teleop_core.nodes.arm_bridge:ArmBridgeNode",
)
