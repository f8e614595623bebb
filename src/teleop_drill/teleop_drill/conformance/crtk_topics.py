"""CRTK topics: the topics of the Collaborative Robotics Toolkit that an arm may have.

Source:
    Su, Munawar, Deguet et al. 2020 (Collaborative Robotics Toolkit); its pages "Robot operating
    state" and "Robot motion".
"""

from dataclasses import dataclass
from enum import Enum


class Group(Enum):
    """Purpose of a topic."""

    STATE = "state"
    QUERY = "query"
    COMMAND = "command"


class RowResult(Enum):
    """Result of a row."""

    OK = "ok"
    ABSENT = "absent"  # absent and not required
    SKIPPED = "not tried"
    NOTED = "noted"  # works, but with a weakness
    FAILED = "FAILED"


_JOINTS, _POSE = "sensor_msgs/msg/JointState", "geometry_msgs/msg/PoseStamped"
_TWIST, _WRENCH = "geometry_msgs/msg/TwistStamped", "geometry_msgs/msg/WrenchStamped"


@dataclass(frozen=True)
class CrtkTopic:
    """One topic of CRTK.

    Attributes:
        name: Name below the arm's namespace.
        group: Purpose of the topic.
        ros_type: Type of its messages.
        is_required: Whether every CRTK arm must have the topic. This is true for the operating state and for one of
            ``measured_js`` and ``measured_cp``. CRTK allows an arm to leave out commands that it cannot do.
    """

    name: str
    group: Group
    ros_type: str
    is_required: bool = False


def _typed(names: str, group: Group, ros_type: str) -> tuple[CrtkTopic, ...]:
    return tuple(CrtkTopic(name, group, ros_type) for name in names.split())


CRTK_TOPICS = (
    CrtkTopic("operating_state", Group.STATE, "crtk_msgs/msg/OperatingState", is_required=True),
    CrtkTopic("state_command", Group.STATE, "crtk_msgs/msg/StringStamped", is_required=True),
    *_typed("measured_js setpoint_js goal_js", Group.QUERY, _JOINTS),
    *_typed("measured_cp setpoint_cp goal_cp", Group.QUERY, _POSE),
    *_typed("measured_cv setpoint_cv", Group.QUERY, _TWIST),
    *_typed("measured_cf setpoint_cf", Group.QUERY, _WRENCH),
    *_typed("jacobian", Group.QUERY, "std_msgs/msg/Float64MultiArray"),
    *_typed("move_jp move_jr", Group.COMMAND, _JOINTS),
    *_typed("move_cp move_cr", Group.COMMAND, _POSE),
    *_typed("interpolate_jp", Group.COMMAND, _JOINTS),
    *_typed("interpolate_cp", Group.COMMAND, _POSE),
    *_typed("servo_jp servo_jr servo_jv servo_jf", Group.COMMAND, _JOINTS),
    *_typed("servo_cp servo_cr", Group.COMMAND, _POSE),
    *_typed("servo_cv", Group.COMMAND, _TWIST),
    *_typed("servo_cf", Group.COMMAND, _WRENCH),
    *_typed("hold free", Group.COMMAND, "std_msgs/msg/Empty"),
)
"""All topics that the test examines, in the order of the table."""
STATES = ("DISABLED", "ENABLED", "PAUSED", "FAULT")
"""Names of the operating states."""


@dataclass(frozen=True)
class Finding:
    """Result of one row.

    Attributes:
        row: The row, or the trial that concerns several rows.
        verdict: Result of the row.
        found: Short description of the arm's topic.
        note: Error, or the reason why the row was not tested.
    """

    row: CrtkTopic
    verdict: RowResult
    found: str = ""
    note: str = ""
