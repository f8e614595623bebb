"""Master bridge: the stage that connects a real device, in place of ``haptic_master``.

It publishes the pose of the device's stylus in ``master_base``, and sends the commanded force to the device. It drops
samples that cannot be true; without samples the slave stops.
"""

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from teleop_core.base import ParameterError, Within, fixed, parameter
from teleop_core.graph import DT, RunningStage, Stage, topics
from teleop_core.graph.stamps import wrong_stamp
from teleop_core.hand.master.joy_rates import JoyParameters, JoyRates
from teleop_core.kernels import dot, geometry
from teleop_core.kernels.axes import AXES, axis_map
from teleop_core.robots import load_robot_set
from teleop_core.robots.joint_map import JointMap

POSE_MESSAGES = (
    "geometry_msgs/msg/PoseStamped",
    "geometry_msgs/msg/TransformStamped",
    "geometry_msgs/msg/Pose",
    "sensor_msgs/msg/JointState",
)
"""Message types with the pose of a stylus; the last type contains joint positions instead."""
RATE_MESSAGE = "sensor_msgs/msg/Joy"
"""Message type in which gamepads and 3-D mice send the speed of the stylus."""
_OFF_UNIT = 1e-2  # tolerance of a quaternion's length
_THREE = ("+x", "+y", "+z")


@dataclass(frozen=True, kw_only=True)
class MasterBridgeParameters:
    """Parameters of :class:`MasterBridge`."""

    pose_topic: str = fixed("device/measured_cp", doc="topic on which the device publishes the pose of its stylus")
    pose_message: str = fixed(
        POSE_MESSAGES[0], choices=(*POSE_MESSAGES, RATE_MESSAGE), doc="message type of pose_topic"
    )
    joy: JoyParameters = field(default_factory=JoyParameters)
    device_axes: tuple[str, ...] = fixed(
        _THREE,
        choices=AXES,
        length=3,
        doc="axes of the device along x (right), y (up) and z (towards the person) of master_base",
    )
    stylus_axes: tuple[str, ...] = fixed(
        _THREE, choices=AXES, length=3, doc="axes of the device's stylus along x, y, z of our stylus frame"
    )
    unit: float = fixed(1.0, Within(1e-6, 10.0, "m"), "length unit of the device; 0.001 for millimetres")
    handle: str = fixed(
        "", doc="robot whose tip is the stylus, by name or file, for devices that publish joint positions"
    )
    handle_geometry: tuple[str, ...] = fixed(
        (), doc="symbol=value for each length or option of the handle that differs from its default [m, rad]"
    )
    handle_joints: tuple[str, ...] = fixed(
        (), doc="ours=theirs for each joint that has another name in the device's messages"
    )
    handle_signs: tuple[float, ...] = fixed(
        (),
        Within(-1.0, 1.0),
        "sign of each of our joints, 1.0 or -1.0: our position = sign * device position + offset; empty: 1.0",
    )
    handle_offsets: tuple[float, ...] = fixed(
        (),
        Within(unit="rad or m"),
        "offset of each of our joints: our position = sign * device position + offset; empty: 0.0",
    )
    buttons_topic: str = fixed(
        "", doc="topic on which the device publishes its buttons, as sensor_msgs/Joy; empty: no buttons"
    )
    button_places: tuple[int, ...] = fixed(
        (0, 1, 2),
        Within(-1, 63),
        "indices of the clutch, fixture and mode buttons in the device's Joy, from 0; -1: no such button",
        length=3,
    )
    pose_stamps: str = fixed(
        "header",
        choices=("header", "sent"),
        doc="timestamp of a pose: header: the stamp of its header; sent: the time when it was sent, "
        "for devices with another clock and for Pose, which has no header",
    )
    oldest_pose: float = fixed(
        0.1,
        Within(0.001, 1.0, "s"),
        "largest difference between the stamp of a pose and our clock; poses beyond it are refused",
        source="assumed",
    )
    force_topic: str = fixed(
        "", doc="topic on which the device receives forces, as geometry_msgs/WrenchStamped; empty: it gives no force"
    )
    force_gain: float = parameter(1.0, Within(0.0, 10.0), "force sent to the device, divided by master/servo_cf")
    largest_force: float = parameter(
        3.3,
        Within(0.0, 100.0, "N"),
        "largest force that is sent to the device",
        source="published: peak force of the Phantom Omni",
    )
    force_timeout: float = parameter(
        0.1,
        Within(0.002, 5.0, "s"),
        "if no master/servo_cf or no pose of the device arrives for this time, the device gets zero force",
        source="assumed",
    )

    def __post_init__(self) -> None:
        """Refuse axes that form a mirrored frame, and joints without a robot."""
        for name in ("device_axes", "stylus_axes"):
            axis_map(f"master_bridge.{name}", getattr(self, name))
        if self.says_joints != bool(self.handle):
            text = f"a robot with {POSE_MESSAGES[-1]}, and none with other messages"
            raise ParameterError("master_bridge.handle", self.handle, text)

    @property
    def says_joints(self) -> bool:
        """Whether the device sends joint positions."""
        return self.pose_message == POSE_MESSAGES[-1]


class MasterBridge(RunningStage):
    """Stage that publishes the stylus pose of a real device, and computes the force that the device applies.

    Its node calls ``hear``, ``hear_joints`` or ``hear_joy`` for each message of the device, ``press`` for its buttons,
    and ``force`` for the force to send.

    Attributes:
        wrong: Text about the fault of the newest pose; empty if the pose is valid.
        heard_ns: Arrival time of the newest valid pose [ns]; 0 before the first.
        refused: Number of rejected poses, by reason.

    Raises:
        TeleopError: There is no such robot, or its joints do not fit.
    """

    def __init__(self, parameters: MasterBridgeParameters, dt: float = DT) -> None:
        super().__init__(MASTER_BRIDGE, 0, dt)
        self.kernel, self.parameters, p = _nothing, parameters, parameters
        self._rows = axis_map("device_axes", p.device_axes)
        self._base, self._stylus = np.empty(4), np.empty(4)
        geometry.quaternion_from_rotation(self._rows, self._base)
        columns = np.ascontiguousarray(axis_map("stylus_axes", p.stylus_axes).T)
        geometry.quaternion_from_rotation(columns, self._stylus)
        self.refused: Counter[str] = Counter()
        self.wrong, self.heard_ns, self._stamp_ns = "", 0, 0
        self._rates = JoyRates(p.joy)
        if p.says_joints:
            self._robot = load_robot_set(p.handle, p.handle_geometry)
            self._joints = JointMap(
                self._robot.joint_names,
                p.handle_joints,
                p.handle_signs,
                p.handle_offsets,
                owner="master_bridge.handle_",
            )

    def retune(self, parameters: MasterBridgeParameters) -> None:
        """Take new parameters: gain, bound or timeout of the force."""
        self.parameters = parameters

    def hear(self, pose: geometry.Array, stamp_ns: int, now_ns: int) -> bool:
        """Take a pose of the stylus; return whether ``master/measured_cp`` is new.

        Args:
            pose: Position in the device's unit and quaternion w, x, y, z, (7,), in the device's frame.
            stamp_ns: Time of the measurement [ns].
            now_ns: Time [ns].
        """
        reason, self.wrong = self._doubt(pose, stamp_ns, now_ns)
        if reason:
            self.refused[reason] += 1
            return False
        out = self.signals["master_measured_cp"]
        out[:3] = self.parameters.unit * dot(self._rows, pose[:3])
        turned = pose[3:7] / math.sqrt(float((pose[3:7] ** 2).sum()))
        geometry.multiply_quaternions(self._base, turned, turned)
        geometry.multiply_quaternions(turned, self._stylus, turned)
        out[3:7] = turned
        self._stamp_ns, self.heard_ns = stamp_ns, now_ns
        return True

    def hear_joints(self, names: Sequence[str], position: Sequence[float], stamp_ns: int, now_ns: int) -> bool:
        """Take the joint positions of a jointed device [rad or m]; other arguments and result as in :meth:`hear`."""
        places = self._joints.places(names)
        if isinstance(places, str) or len(position) != len(names):
            self.wrong = places if isinstance(places, str) else "not one position for each name"
            self.refused["names"] += 1
            return False
        theirs = np.array([position[place] for place in places], np.float64)
        pose = np.full(7, np.nan)
        if np.isfinite(theirs).all():
            geometry.pose_from_transform(self._robot.fk(self._joints.position(theirs)), pose)
        return self.hear(pose, stamp_ns, now_ns)

    def hear_joy(self, axes: Sequence[float], buttons: Sequence[int], stamp_ns: int, now_ns: int) -> bool:
        """Take the axes of a Joy message as rates of the stylus; other arguments and result as in :meth:`hear`."""
        if text := self._rates.step(axes, buttons, stamp_ns):
            self.wrong = text
            self.refused["form"] += 1
            return False
        return self.hear(self._rates.pose, stamp_ns, now_ns)

    def press(self, buttons: Sequence[int]) -> bool:
        """Take the buttons of the device; return False if it has fewer buttons than the parameters name."""
        places = self.parameters.button_places
        if max(places) >= len(buttons):
            self.refused["buttons"] += 1
            return False
        pressed = [float(bool(buttons[place])) if place >= 0 else 0.0 for place in places]
        self.signals["master_buttons"] = pressed
        return True

    def is_heard(self, now_ns: int) -> bool:
        """Whether a valid pose of the device arrived recently; ``now_ns`` is the present time [ns]."""
        silence = 1e-9 * (now_ns - self.heard_ns)
        return self.heard_ns > 0 and silence <= self.parameters.force_timeout

    def force(self, age: float, now_ns: int) -> geometry.Array:
        """Force (3,) that the device must apply, along its own axes [N].

        Zero if no force was commanded recently, or if the pose of the device is unknown.

        Args:
            age: Time since the last ``master/servo_cf`` arrived [s]; infinite before the first.
            now_ns: Time [ns].
        """
        p = self.parameters
        asked = p.force_gain * np.array(self.signals["master_servo_cf"][:3])
        is_asked = age <= p.force_timeout and self.is_heard(now_ns)
        if not (is_asked and np.isfinite(asked).all()):
            return np.zeros(3)
        size = math.sqrt(float((asked**2).sum()))
        share = p.largest_force / size if size > p.largest_force else 1.0
        return share * dot(self._rows.T, asked)

    def concerns(self) -> list[str]:
        """Reason why the pose of the stylus is not published."""
        if self.wrong:
            return [f"the device's messages are refused: {self.wrong}"]
        if not self.heard_ns:
            return [f"waits for the device on {self.parameters.pose_topic}"]
        return []

    def _doubt(self, pose: geometry.Array, stamp_ns: int, now_ns: int) -> tuple[str, str]:
        """Reason to reject a pose, as one word and as a line of text; empty for a valid pose."""
        size = float((pose[3:7] ** 2).sum()) if np.isfinite(pose).all() else math.nan
        if not abs(size - 1.0) <= _OFF_UNIT:
            return "form", f"its pose is not seven finite numbers with a unit quaternion: {pose}"
        oldest = self.parameters.oldest_pose
        text = wrong_stamp(stamp_ns, self._stamp_ns, now_ns, oldest, "pose_stamps")
        return ("stamp", text) if text else ("", "")


def _nothing(row: object, dt: float) -> None:
    """Do nothing: placeholder for a kernel, because the node calls the stage directly."""


MASTER_BRIDGE = Stage(
    "master_bridge",
    MasterBridgeParameters,
    reads=(topics.MASTER_SERVO_CF,),
    writes=(topics.MASTER_MEASURED_CP, topics.MASTER_BUTTONS),
    make=MasterBridge,
    node="teleop_core.nodes.master_bridge:MasterBridgeNode",
)
