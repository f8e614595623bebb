"""Topics: the single list of all topics between the stages, with their messages and meanings.

A topic is described once, without the namespace of its arm: the default arm has the plain names, an arm called
``left`` has ``left/slave/servo_cp`` and so on.
"""

from dataclasses import dataclass, replace
from enum import Enum, IntEnum

STATE_COMMANDS = ("enable", "disable", "pause", "resume", "home", "unhome", "reset", "stop")
"""Commands that change the state of an arm, by name; see :mod:`teleop_core.slave.operation`."""
OPERATION = (
    "state", "is_homed", "is_busy", "is_stopped", "fault", "fault_joint", "fault_value",
    "fault_bound", "rest_time", "travel", "is_braked", "is_pressed",
)  # fmt: skip
"""Numbers of ``slave/operation``, in this order.

The state (:class:`~teleop_core.slave.operation.State`), and three flags. The fault
(:class:`~teleop_core.slave.operation.Fault`), the joint of the fault (-1: none), the value that caused the fault, and
the bound of this value. For the last stop, the time until the arm was at rest [s] and the distance that the tip moved
meanwhile [m]; both are 0 before the first stop. Whether drives must be off and brakes on. Whether a stop button is
still pressed or silent.
"""


class Quality(Enum):
    """How a topic is transported."""

    STREAM = "offered reliable, read best effort, keep last 1: only the newest sample matters"
    LATCHED = "reliable, transient local, keep last 1: late joiners get the last value"
    REPORT = "reliable, keep last 10: each message counts"


class Limit(IntEnum):
    """Limit that keeps the slave from following the hand completely."""

    NONE = 0  # the slave follows
    JOINT = 1  # a joint is at the end of its range
    WORKSPACE = 2  # no joint vector brings the tip to the commanded pose
    SINGULARITY = 3  # joints would have to turn faster than they can, because the arm is near a singularity
    SPEED = 4  # joints would have to move faster than they can


def limit_text(limit: int, joint: int, joint_names: tuple[str, ...] = ()) -> str:
    """Text that names the limit at which the slave is.

    Args:
        limit: Value of :class:`Limit`.
        joint: Index of the joint at its limit; negative if no joint is at its limit.
        joint_names: Names of the joints; without them they are counted from 1.
    """
    if limit == Limit.JOINT and joint >= 0:
        name = joint_names[joint] if joint < len(joint_names) else str(joint + 1)
        return f"joint {name} is at its limit"
    return {
        Limit.NONE: "nothing",
        Limit.JOINT: "a joint is at its limit",
        Limit.WORKSPACE: "out of reach",
        Limit.SINGULARITY: "a singularity",
        Limit.SPEED: "faster than its joints",
    }[Limit(limit)]


class Kind(Enum):
    """Meaning of the values of a topic, and the ROS message that carries them.

    Columns of a value row, in the order used inside the package:

    ======== ==================================================================
    POSE     x, y, z [m], quaternion w, x, y, z
    TWIST    linear x, y, z [m/s], angular x, y, z [rad/s]
    WRENCH   force x, y, z [N], torque x, y, z [N·m]
    BUTTONS  clutch, fixture, mode: 1 pressed, 0 released
    JOINTS   position of each joint [rad or m]
    STATE    position, velocity, effort of all joints: 3 n columns
    NUMBERS  the numbers that the topic names in ``columns``
    JAW      position [rad], velocity [rad/s], effort [N·m] of a jaw, a joint of its own
    POSES    :data:`POSES` poses, each as in POSE; those beyond the bodies of a scene are the identity
    REPORT   no fixed columns: key-value pairs
    ======== ==================================================================
    """

    POSE = "pose", "geometry_msgs/msg/PoseStamped"
    TWIST = "twist", "geometry_msgs/msg/TwistStamped"
    WRENCH = "wrench", "geometry_msgs/msg/WrenchStamped"
    BUTTONS = "buttons", "sensor_msgs/msg/Joy"
    JAW = "jaw", "sensor_msgs/msg/JointState"
    POSES = "poses", "geometry_msgs/msg/PoseArray"
    NUMBERS = "numbers", "sensor_msgs/msg/JointState"
    JOINTS = "joints", "sensor_msgs/msg/JointState"
    STATE = "state", "sensor_msgs/msg/JointState"  # unknown topics of this message type are read with this kind
    REPORT = "report", "diagnostic_msgs/msg/DiagnosticArray"

    def __init__(self, _: str, ros_type: str) -> None:
        self.ros_type = ros_type
        """Name of the ROS message type."""

    @property
    def has_joints(self) -> bool:
        """Whether the columns belong to a robot's joints."""
        return self in {Kind.JOINTS, Kind.STATE}

    @property
    def has_names(self) -> bool:
        """Whether the messages contain the names of their numbers."""
        return self.has_joints or self in {Kind.NUMBERS, Kind.JAW}

    @property
    def has_motion(self) -> bool:
        """Whether the messages contain velocity and effort in addition to position."""
        return self in {Kind.STATE, Kind.JAW}

    def columns(self, joint_names: tuple[str, ...]) -> tuple[str, ...]:
        """Names of the columns, for a robot with these joints; none for reports."""
        if self in {Kind.JOINTS, Kind.NUMBERS}:
            return joint_names
        if self is Kind.STATE:
            parts = ("position", "velocity", "effort")
            return tuple(f"{joint}.{part}" for part in parts for joint in joint_names)
        return _COLUMNS[self]

    def width(self, joints: int) -> int:
        """Number of columns for a robot with this many joints, or for a topic with this many names."""
        fixed = {Kind.POSE: 7, Kind.TWIST: 6, Kind.WRENCH: 6, Kind.BUTTONS: 3, Kind.REPORT: 0, Kind.JAW: 3}
        fixed[Kind.POSES] = 7 * POSES
        return {Kind.NUMBERS: joints, Kind.JOINTS: joints, Kind.STATE: 3 * joints, **fixed}[self]


POSES = 48
"""Number of poses in a message of :attr:`Kind.POSES`."""
JAW = ("jaw",)
"""Name of the only joint of a jaw."""
_COLUMNS = {
    Kind.POSE: ("x", "y", "z", "qw", "qx", "qy", "qz"),
    Kind.TWIST: ("vx", "vy", "vz", "wx", "wy", "wz"),
    Kind.WRENCH: ("fx", "fy", "fz", "tx", "ty", "tz"),
    Kind.BUTTONS: ("clutch", "fixture", "mode"),
    Kind.JAW: ("position", "velocity", "effort"),
    Kind.POSES: tuple(f"{name}{i}" for i in range(POSES) for name in ("x", "y", "z", "qw", "qx", "qy", "qz")),
    Kind.REPORT: (),
}


@dataclass(frozen=True)
class Stamp:
    """Rule that states which time the stamp in the header of a topic means.

    Attributes:
        text: The rule in words.
        of: Name of the topic whose stamp is passed on; empty if the stamp is the time of sampling.
        is_in_force: Whether the writer itself chooses the command whose stamp is passed on, because an older command
            may still be in force. Such a stamp may repeat, and is :data:`NO_COMMAND_NS` before the first command.
        may_skip: Whether stamps of ``of`` may be missing although nothing was lost here: a network loses packets, and
            packets that others have overtaken are not used.
    """

    text: str
    of: str = ""
    is_in_force: bool = False
    may_skip: bool = False


NO_COMMAND_NS = 1
"""Stamp before the first command [ns]. It is older than any command, but not 0, because CRTK treats 0 as invalid."""
SAMPLED = Stamp("sampling time")


def passed_on(topic: str) -> Stamp:
    """Rule: the stamp is copied from the message of ``topic`` that this message answers."""
    return Stamp(f"of the {topic} it answers", topic)


def in_force(topic: str) -> Stamp:
    """Rule: the stamp is copied from the message of ``topic`` that is in force."""
    return Stamp(f"of the {topic} in force", topic, is_in_force=True)


def arrived(topic: str) -> Stamp:
    """Rule: the stamp is copied from the newest message of ``topic`` that came through the network."""
    return Stamp(f"of the {topic} that arrived last", topic, is_in_force=True, may_skip=True)


SELDOM_NS = 20_000_000
"""Time after which an unchanged value is sent again [ns]."""


@dataclass(frozen=True, repr=False)
class Topic:
    """One topic of an arm.

    Attributes:
        name: Name below the arm's namespace, such as ``slave/servo_cp``.
        kind: Kind of the topic's values.
        stamp: Meaning of the stamp in the header of a message.
        frame_id: Frame of the header, below the arm's namespace.
        quality: QoS of the topic.
        columns: Names of the numbers in reports and in messages of :attr:`Kind.NUMBERS`; empty for other kinds.
        adds_to: Name of another topic, whose readers get the sum of both topics, such as ``master/servo_cf`` for a
            further source of force. Empty if the values are not added to another topic.
        arm: Namespace; empty for the default arm.
        is_seldom: Whether messages are sent only when the values change and every :data:`SELDOM_NS`.
        message: Name of the ROS message type of a topic without values, such as a robot's model; empty for the message
            type of the kind.
    """

    name: str
    kind: Kind
    stamp: Stamp = SAMPLED
    frame_id: str = ""
    quality: Quality = Quality.STREAM
    columns: tuple[str, ...] = ()
    adds_to: str = ""
    arm: str = ""
    is_seldom: bool = False
    message: str = ""

    @property
    def ros_type(self) -> str:
        """Name of the topic's ROS message type."""
        return self.message or self.kind.ros_type

    def of_arm(self, arm: str) -> "Topic":
        """The same topic of a named arm, in the namespace and with the frames of the arm."""
        if not arm or self.arm == arm:
            return self
        frame = f"{arm}/{self.frame_id}" if self.frame_id else ""
        return replace(self, name=f"{arm}/{self.name}", frame_id=frame, arm=arm)

    def __repr__(self) -> str:
        return f"Topic({self.name!r}, {self.kind.name})"

    @property
    def field(self) -> str:
        """Name of the topic's column in records; its stamp is in ``<field>_ns``."""
        return self.name.replace("/", "_")

    def width(self, joints: int) -> int:
        """Number of values in a message, for a robot with this many joints."""
        return len(self.columns) if self.columns else self.kind.width(joints)

    def names(self, joint_names: tuple[str, ...]) -> tuple[str, ...]:
        """Names in the topic's messages, for a robot with these joints; empty if the messages contain no names."""
        if self.kind is Kind.NUMBERS:
            return self.columns
        if self.kind is Kind.JAW:
            return JAW
        return joint_names if self.kind.has_joints else ()


MASTER_MEASURED_CP = Topic("master/measured_cp", Kind.POSE, SAMPLED, "master_base")
MASTER_FILTERED_CP = Topic("master/filtered_cp", Kind.POSE, passed_on("master/measured_cp"), "master_base")
"""Pose of the stylus without tremor, in a session with a tremor filter."""
MASTER_FILTERED_OUT = Topic(
    "master/filtered_out", Kind.NUMBERS, passed_on("master/measured_cp"), "master_base", columns=("x", "y", "z")
)
"""Motion that a tremor filter removed [m]: the position of the stylus minus the position of filtered_cp."""
MASTER_MEASURED_CV = Topic("master/measured_cv", Kind.TWIST, SAMPLED, "master_base")
MASTER_MEASURED_CF = Topic("master/measured_cf", Kind.WRENCH, SAMPLED, "master_base")
MASTER_BUTTONS = Topic("master/buttons", Kind.BUTTONS, SAMPLED, "master_base")
MASTER_CONTACT = Topic(
    "master/contact",
    Kind.NUMBERS,
    SAMPLED,
    "master_base",
    columns=("number", "taken", "returned", "friction", "largest_force"),
)
"""Energy of the present or last contact. In order: number of contacts so far; energy that the motors' force absorbed
from the hand [J]; energy that it returned to the hand [J]; energy that dry friction absorbed meanwhile [J]; and the
largest force that the heat of the motors allows [N]. Energies use the true motion, which only a simulator knows.
"""
MASTER_SERVO_CF = Topic("master/servo_cf", Kind.WRENCH, passed_on("master/measured_cp"), "master_base")
SLAVE_SERVO_CP = Topic("slave/servo_cp", Kind.POSE, passed_on("master/measured_cp"), "slave_base")
SLAVE_SERVO_CF = Topic("slave/servo_cf", Kind.WRENCH, passed_on("master/measured_cp"), "slave_base", is_seldom=True)
"""Force with which the hand moves the tip, in a session with a stage ``impedance``: the force with which the hand
resists the slave's push, times the gain of the architecture; no torque.
"""
SLAVE_SERVO_JP = Topic("slave/servo_jp", Kind.JOINTS, passed_on("slave/servo_cp"), "slave_base")
SLAVE_REACH = Topic(
    "slave/reach", Kind.NUMBERS, passed_on("slave/servo_cp"), "slave_base",
    columns=(
        "status", "limit", "joint", "position_residual", "rotation_residual",
        "cut_x", "cut_y", "cut_z", "cut_rx", "cut_ry", "cut_rz",
    ),
)  # fmt: skip
"""How far inverse kinematics can follow a command. In order: the status (:class:`~teleop_core.kinematics.IkStatus`),
the limit (:class:`Limit`), the joint at its limit (-1: none), the residual of the solution [m, rad], and the
correction in slave_base [m, rad] that would bring the command within the arm's reach, without a time limit.
"""
SLAVE_SETPOINT_JS = Topic("slave/setpoint_js", Kind.JOINTS, in_force("slave/servo_jp"), "slave_base")
SLAVE_SETPOINT_CP = Topic("slave/setpoint_cp", Kind.POSE, in_force("slave/servo_jp"), "slave_base")
SLAVE_MEASURED_JS = Topic("slave/measured_js", Kind.STATE, SAMPLED, "slave_base")
SLAVE_MEASURED_CP = Topic("slave/measured_cp", Kind.POSE, passed_on("slave/measured_js"), "slave_base")
SLAVE_MEASURED_CF = Topic("slave/measured_cf", Kind.WRENCH, SAMPLED, "slave_base", is_seldom=True)
"""Measured force on the tip, in axes of slave_base, and torque about the tip."""
SLAVE_ESTIMATED_CF = Topic("slave/estimated_cf", Kind.WRENCH, SAMPLED, "slave_base", is_seldom=True)
"""Force on the tip estimated from drive efforts and joint motion without a sensor, in axes of slave_base; zero if
``slave_sim.force_sensor.estimate`` is off, and while brakes hold the arm.
"""
SLAVE_TRUE_CP = Topic("slave/true_cp", Kind.POSE, SAMPLED, "slave_base")
"""True pose of the tip, which no encoder measures: only a simulator or a tracker knows it."""
SLAVE_TRUE_CF = Topic("slave/true_cf", Kind.WRENCH, SAMPLED, "slave_base", is_seldom=True)
"""Contact force on the tip, in axes of slave_base, without torque about the tip, as an ideal sensor would measure it.
Only a simulator knows it.
"""
SLAVE_OPERATION = Topic("slave/operation", Kind.REPORT, SAMPLED, quality=Quality.LATCHED, columns=OPERATION)
"""Whether the slave may move, what stopped it, and what is needed to go on; sent at each change.
See :mod:`teleop_core.slave.operation`."""
TELEOP_STATE = Topic(
    "teleop/state", Kind.REPORT, passed_on("master/measured_cp"), quality=Quality.LATCHED,
    columns=(
        "is_following", "is_clutched", "is_fine", "gain", "is_fixture_on",
        "fixture_center_x", "fixture_center_y", "fixture_center_z",
        "fixture_size_x", "fixture_size_y", "fixture_size_z", "limit", "limited_joint",
    ),
)  # fmt: skip
NETWORK_SERVO_CP = Topic("network/servo_cp", Kind.POSE, arrived("slave/servo_cp"), "slave_base")
"""slave/servo_cp as it arrived through the network; the next four topics contain the slave's values as they arrived."""
NETWORK_SETPOINT_CP = Topic("network/setpoint_cp", Kind.POSE, arrived("slave/setpoint_cp"), "slave_base")
NETWORK_MEASURED_CP = Topic("network/measured_cp", Kind.POSE, arrived("slave/measured_cp"), "slave_base")
NETWORK_MEASURED_CF = Topic("network/measured_cf", Kind.WRENCH, arrived("slave/measured_cf"), "slave_base")
NETWORK_REACH = Topic("network/reach", Kind.NUMBERS, arrived("slave/reach"), "slave_base", columns=SLAVE_REACH.columns)
NETWORK_STATE = Topic(
    "network/state",
    Kind.NUMBERS,
    SAMPLED,
    "slave_base",
    is_seldom=True,
    columns=("sent_there", "lost_there", "behind_there", "sent_back", "lost_back", "behind_back", "clock_ahead"),
)
"""For both directions: number of sent packets, number of lost packets, and number of packets by which the newest
arrived packet is behind. Then, the time by which the slave's clock is ahead of the master's clock [s].
"""
ENERGY = (
    "law", "round", "energy_in", "energy_out", "told", "heard", "margin", "withheld",
    "turn_in", "turn_out", "drift_x", "drift_y", "drift_z",
    "impedance", "wave_x", "wave_y", "wave_z",
)  # fmt: skip
"""Numbers of a port's energies since a round began, in the slave's scale [J]: index of the kind of passivity; start of
the round [s]; energy in and out; energy credited to the other side, and credited by it; remaining energy; energy
withheld; energy in and out by torques; drift, by which a command is held back [m]; for waves, their impedance [N s/m],
and the integral of the sent wave [√W s].
"""
MASTER_ENERGY = Topic(
    "master/energy", Kind.NUMBERS, passed_on("master/measured_cp"), "master_base", columns=ENERGY, is_seldom=True
)
"""Energies at the hand, in a session with a stage ``passivity``: push times displacement of the hand."""
SLAVE_ENERGY = Topic("slave/energy", Kind.NUMBERS, SAMPLED, "slave_base", columns=ENERGY, is_seldom=True)
"""Energies at the slave: force on the tip times displacement of the tip."""
PASSIVITY_SERVO_CP = Topic("passivity/servo_cp", Kind.POSE, passed_on("slave/servo_cp"), "slave_base")
"""The slave's command after the passivity stage."""
NETWORK_SERVO_CF = Topic("network/servo_cf", Kind.WRENCH, arrived("slave/servo_cf"), "slave_base")
IMPEDANCE_SERVO_CP = Topic("impedance/servo_cp", Kind.POSE, passed_on("slave/servo_cp"), "slave_base")
"""The slave's command after the impedance stage, which yields to the force on the tip."""
REMOTE_CENTRE_SERVO_CP = Topic("remote_centre/servo_cp", Kind.POSE, passed_on("slave/servo_cp"), "slave_base")
"""The slave's command, rotated so that the tool passes through its remote centre."""
REMOTE_CENTRE = Topic(
    "remote_centre/place",
    Kind.NUMBERS,
    passed_on("slave/servo_cp"),
    "slave_base",
    columns=("x", "y", "z", "shaft_x", "shaft_y", "shaft_z"),
    is_seldom=True,
)
"""The remote centre [m], and the shaft that passes through it, in the tip's frame."""
SLAVE_JAW_SERVO_JP = Topic(
    "slave/jaw/servo_jp", Kind.NUMBERS, passed_on("master/measured_cp"), "slave_base", columns=JAW
)
"""Commanded angle between the two fingers of the jaw, from the master's side [rad]."""
SLAVE_JAW_SETPOINT_JS = Topic(
    "slave/jaw/setpoint_js", Kind.NUMBERS, in_force("slave/jaw/servo_jp"), "slave_base", columns=JAW
)
SLAVE_JAW_MEASURED_JS = Topic("slave/jaw/measured_js", Kind.JAW, SAMPLED, "slave_base")
SLAVE_JAW_GRIP = Topic(
    "slave/jaw/grip",
    Kind.NUMBERS,
    SAMPLED,
    "slave_base",
    is_seldom=True,
    columns=("force", "is_gripped", "slid", "grips", "slips", "drops"),
)
"""Values that only a simulator knows: the push of each finger [N], whether the object is between the fingers, and how
far the object slid in the present or last grip [m]. Then, how often an object was gripped, slid by more than a
millimetre, and was lost above the table.
"""
SLAVE_JAW_OBJECT_CP = Topic("slave/jaw/object_cp", Kind.POSE, SAMPLED, "slave_base", is_seldom=True)
"""Pose of the object that the jaw can grip; only a simulator knows it."""
JAW_OBJECTS = 6
"""Largest number of objects on a board."""
SLAVE_JAW_BOARD = Topic(
    "slave/jaw/board",
    Kind.NUMBERS,
    SAMPLED,
    "slave_base",
    is_seldom=True,
    columns=("transferred", "dropped", "pull", *(f"{axis}{i}" for i in range(JAW_OBJECTS) for axis in "xyz")),
)
"""Values that only a simulator knows: how many objects came onto another peg, how many came to rest on no peg, and the
force of a peg on the gripped object, across the peg [N]. Then the middle of each object [m], zeros for a missing one.
"""
FIRST_JAW_BOARD = replace(SLAVE_JAW_BOARD, name=f"first/{SLAVE_JAW_BOARD.name}")
"""Port of the second arm at which the first arm's topic arrives; see :meth:`Graph.links`."""
FIRST_JAW_GRIP = replace(SLAVE_JAW_GRIP, name=f"first/{SLAVE_JAW_GRIP.name}")
SECOND_TRUE_CP = replace(SLAVE_TRUE_CP, name=f"second/{SLAVE_TRUE_CP.name}")
"""Port of the first arm at which the second arm's topic arrives. The next constant declares another such port."""
SECOND_JAW_GRIP = replace(SLAVE_JAW_GRIP, name=f"second/{SLAVE_JAW_GRIP.name}")
NETWORK_JAW_SERVO_JP = Topic(
    "network/jaw_servo_jp", Kind.NUMBERS, arrived("slave/jaw/servo_jp"), "slave_base", columns=JAW
)
NETWORK_MASTER_ENERGY = Topic(
    "network/master_energy", Kind.NUMBERS, arrived("master/energy"), "master_base", columns=ENERGY
)
NETWORK_SLAVE_ENERGY = Topic(
    "network/slave_energy", Kind.NUMBERS, arrived("slave/energy"), "slave_base", columns=ENERGY
)
SCENE_POSES = Topic("scene/poses", Kind.POSES, SAMPLED, "world", is_seldom=True)
"""Poses of the moving bodies of a scene in its world, in the order of the model; only a simulator knows them."""
SCENE_ENERGY = Topic(
    "scene/energy", Kind.NUMBERS, SAMPLED, "world", is_seldom=True, columns=("kinetic", "potential", "given")
)
"""Kinetic and potential energy of a scene, and the work that drives have done on it since the start [J]."""
HAND_SERVO_CP = Topic("hand/servo_cp", Kind.POSE, SAMPLED, "master_base")
"""Pose of the stylus that the operator wants; without messages the stylus is released."""
HAND_BUTTONS = Topic("hand/buttons", Kind.BUTTONS, SAMPLED, "master_base", is_seldom=True)
"""Buttons of the stylus that the operator presses."""
HAND_TREMOR = Topic("hand/tremor", Kind.NUMBERS, SAMPLED, "master_base", columns=("x", "y", "z"), is_seldom=True)
"""Offset of the tip by tremor [m], which the device's friction does not reduce."""
HAND_JAW = Topic("hand/jaw", Kind.NUMBERS, SAMPLED, "master_base", columns=("closing",), is_seldom=True)
"""How far the operator closes the jaw: 0 open, 1 closed."""
DISPLAY_MEASURED_CP = Topic("display/measured_cp", Kind.POSE, arrived("slave/measured_cp"), "slave_base")
"""Pose of the slave that the operator sees, in a session with a display: the newest frame."""
TASK_STATE = Topic(
    "task/state", Kind.NUMBERS, SAMPLED, "slave_base", is_seldom=True,
    columns=(
        "number", "act", "goal_x", "goal_y", "goal_z", "width", "attempts", "successes", "errors",
        "way", "off", "time", "miss", "step", "goal_qw", "goal_qx", "goal_qy", "goal_qz", "turn", "force", "clearance",
        "is_over",
    ),
)  # fmt: skip
"""Present goal of a task, and its results. First the number of goals so far, the action at the present goal
(:class:`~teleop_core.hand.tasks.Act`), its position and width [m]; attempts, successes and errors so far. Then, for
the last attempt: the distance to its goal [m], the overshoot of the tip along it [m], its duration [s], and its error
(:class:`~teleop_core.hand.tasks.Miss`); the step of the present attempt, if a task has several steps. Then the
required attitude of the tool, and its tolerance [rad]; the force to press with [N]; and the clearance beside the path
[m]. Zero means that the task does not require it. Last, whether no goal is left.
"""
OPERATOR_SERVO_CP = Topic("operator/servo_cp", Kind.POSE, SAMPLED, "master_base")
"""Pose of the stylus that a remote person wants, sent with any frequency; ``operator=remote`` moves the hand there.
Without messages the hand releases the stylus. Like ``operator/buttons``, this topic comes from outside: no stage
writes it, and it is not recorded.
"""
OPERATOR_BUTTONS = Topic("operator/buttons", Kind.BUTTONS, SAMPLED, "master_base", quality=Quality.REPORT)
"""Buttons that the remote person presses and releases: each message counts, so it is sent reliably."""
OPERATOR_JAW = Topic("operator/jaw", Kind.NUMBERS, SAMPLED, "master_base", quality=Quality.REPORT, columns=("closing",))
"""How far the remote person closes the jaw, 0 open to 1 closed; without messages it does not change."""
DIAGNOSTICS = Topic("diagnostics", Kind.REPORT, Stamp("time of the report"), quality=Quality.REPORT)

STREAMS = (
    HAND_SERVO_CP,
    MASTER_MEASURED_CP, MASTER_MEASURED_CV, MASTER_MEASURED_CF, MASTER_BUTTONS, MASTER_CONTACT,
    MASTER_SERVO_CF,
    SLAVE_SERVO_CP, SLAVE_SERVO_JP, SLAVE_REACH, SLAVE_SETPOINT_JS, SLAVE_SETPOINT_CP,
    SLAVE_MEASURED_JS, SLAVE_MEASURED_CP, SLAVE_TRUE_CP,
)  # fmt: skip
"""Topics of the built-in stages with one message per tick."""
REPORTS = (SLAVE_OPERATION, TELEOP_STATE)
"""Topics of the built-in stages that are sent only at a change."""
NETWORK_TOPICS = (
    NETWORK_SERVO_CP,
    NETWORK_SETPOINT_CP,
    NETWORK_MEASURED_CP,
    NETWORK_MEASURED_CF,
    NETWORK_REACH,
    NETWORK_STATE,
)
"""Topics of a session with a network between both sides."""
PASSIVITY_TOPICS = (MASTER_ENERGY, SLAVE_ENERGY, PASSIVITY_SERVO_CP, NETWORK_MASTER_ENERGY, NETWORK_SLAVE_ENERGY)
"""Topics of a session with a stage ``passivity``; the last two exist only if there is a network too."""
IMPEDANCE_TOPICS = (SLAVE_SERVO_CF, NETWORK_SERVO_CF, IMPEDANCE_SERVO_CP)
"""Topics of a session with a stage ``impedance``; the second exists only if there is a network too."""
JAW_TOPICS = (
    HAND_JAW,
    SLAVE_JAW_SERVO_JP,
    NETWORK_JAW_SERVO_JP,
    SLAVE_JAW_SETPOINT_JS,
    SLAVE_JAW_MEASURED_JS,
    SLAVE_JAW_GRIP,
    SLAVE_JAW_OBJECT_CP,
    SLAVE_JAW_BOARD,
)
"""Topics of a session with a jaw; the third exists only if there is a network too."""
PORTS_BETWEEN_ARMS = (FIRST_JAW_BOARD, FIRST_JAW_GRIP, SECOND_TRUE_CP, SECOND_JAW_GRIP)
"""Ports of one arm for topics of another arm; no stage writes topics with these names."""
SCENE_TOPICS = (SCENE_POSES, SCENE_ENERGY)
"""Topics of a session with a scene."""
TASK_TOPICS = (DISPLAY_MEASURED_CP, TASK_STATE)
"""Topic of a session with a display, and topic of a session with a task."""
ALL = (*STREAMS, HAND_BUTTONS, HAND_TREMOR, SLAVE_MEASURED_CF, SLAVE_ESTIMATED_CF, SLAVE_TRUE_CF, *REPORTS, DIAGNOSTICS)
BY_NAME = {
    topic.name: topic
    for topic in (
        *ALL, *NETWORK_TOPICS, *PASSIVITY_TOPICS, *IMPEDANCE_TOPICS, MASTER_FILTERED_CP,
        MASTER_FILTERED_OUT, REMOTE_CENTRE_SERVO_CP, REMOTE_CENTRE, *JAW_TOPICS, *SCENE_TOPICS, *TASK_TOPICS,
    )
}  # fmt: skip
