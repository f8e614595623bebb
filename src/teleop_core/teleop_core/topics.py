"""Topics: the single list of what travels between the stages, with its message and its meaning."""

from dataclasses import dataclass
from enum import Enum


class Quality(Enum):
    """How a topic is transported."""

    STREAM = "best effort, keep last 1: only the newest sample matters"
    LATCHED = "reliable, transient local, keep last 1: late joiners get the last value"
    REPORT = "reliable, keep last 10: rare reports"


class Kind(Enum):
    """What the values of a topic are; the value is the message's ROS type.

    Columns of a value row, in the order used inside the package:

    ======== ==================================================================
    POSE     x, y, z [m], quaternion w, x, y, z
    TWIST    linear x, y, z [m/s], angular x, y, z [rad/s]
    WRENCH   force x, y, z [N], torque x, y, z [N·m]
    BUTTONS  clutch, fixture, mode: 1 pressed, 0 released
    JOINTS   position of each joint [rad or m]
    STATE    position, velocity, effort of all joints: 3 n columns
    REPORT   no fixed columns: key-value pairs
    ======== ==================================================================
    """

    POSE = "geometry_msgs/msg/PoseStamped"
    TWIST = "geometry_msgs/msg/TwistStamped"
    WRENCH = "geometry_msgs/msg/WrenchStamped"
    BUTTONS = "sensor_msgs/msg/Joy"
    JOINTS = "sensor_msgs/msg/JointState"
    STATE = "sensor_msgs/msg/JointState "  # the blank keeps it apart from JOINTS; see ros_type
    REPORT = "diagnostic_msgs/msg/DiagnosticArray"

    @property
    def ros_type(self) -> str:
        """Name of the ROS message type."""
        return self.value.strip()

    def width(self, joints: int) -> int:
        """Number of columns for a robot with this many joints."""
        fixed = {Kind.POSE: 7, Kind.TWIST: 6, Kind.WRENCH: 6, Kind.BUTTONS: 3, Kind.REPORT: 0}
        return {Kind.JOINTS: joints, Kind.STATE: 3 * joints, **fixed}[self]


@dataclass(frozen=True)
class Topic:
    """One topic; ``stamp`` says in words what the header's stamp means."""

    name: str
    kind: Kind
    stamp: str
    frame_id: str = ""
    quality: Quality = Quality.STREAM

    @property
    def field(self) -> str:
        """Name of the topic's column in the signals of a session."""
        return self.name.replace("/", "_")


MASTER_MEASURED_CP = Topic("master/measured_cp", Kind.POSE, "sampling time", "master_base")
MASTER_MEASURED_CV = Topic("master/measured_cv", Kind.TWIST, "as measured_cp", "master_base")
MASTER_MEASURED_CF = Topic(
    "master/measured_cf", Kind.WRENCH, "force really applied at this sample", "master_base"
)
MASTER_BUTTONS = Topic("master/buttons", Kind.BUTTONS, "time of the sample", "master_base")
MASTER_SERVO_CF = Topic("master/servo_cf", Kind.WRENCH, "the measured_cp it answers", "master_base")
SLAVE_SERVO_CP = Topic("slave/servo_cp", Kind.POSE, "the measured_cp used", "slave_base")
SLAVE_SERVO_JP = Topic("slave/servo_jp", Kind.JOINTS, "passed on from servo_cp", "slave_base")
SLAVE_SETPOINT_JS = Topic(
    "slave/setpoint_js", Kind.JOINTS, "passed on from the servo_jp in force", "slave_base"
)
SLAVE_SETPOINT_CP = Topic("slave/setpoint_cp", Kind.POSE, "as setpoint_js", "slave_base")
SLAVE_MEASURED_JS = Topic("slave/measured_js", Kind.STATE, "sampling time", "slave_base")
SLAVE_MEASURED_CP = Topic("slave/measured_cp", Kind.POSE, "as measured_js", "slave_base")
TELEOP_STATE = Topic(
    "teleop/state", Kind.REPORT, "the sample that changed it", quality=Quality.LATCHED
)
DIAGNOSTICS = Topic("diagnostics", Kind.REPORT, "time of the report", quality=Quality.REPORT)

STREAMS = (
    MASTER_MEASURED_CP, MASTER_MEASURED_CV, MASTER_MEASURED_CF, MASTER_BUTTONS, MASTER_SERVO_CF,
    SLAVE_SERVO_CP, SLAVE_SERVO_JP, SLAVE_SETPOINT_JS, SLAVE_SETPOINT_CP, SLAVE_MEASURED_JS,
    SLAVE_MEASURED_CP,
)  # fmt: skip
ALL = (*STREAMS, TELEOP_STATE, DIAGNOSTICS)
BY_NAME = {topic.name: topic for topic in ALL}
