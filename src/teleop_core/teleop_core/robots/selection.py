"""Selection of a robot: the arm of a stage, for every stage whose topics contain joint values."""

from collections.abc import Mapping
from dataclasses import dataclass

from teleop_core.base.parameters import fixed
from teleop_core.robots import load_robot_set

PUBLISHED: Mapping[str, Mapping[str, Mapping[str, tuple[str, ...]]]] = {
    "rcrt1": {
        "motion_scaling": {"tool_axes": ("+x", "-y", "-z")},
        "operator": {"observer.tool_axes": ("-y", "-x", "-z")},
    }
}
"""Parameters that a robot's source publishes, by robot and stage; they replace the defaults of a session.

Source:
    Vongbunyong 2008, section 6.2: stylus and tool of the RCRT-1 are aligned.
"""


@dataclass(frozen=True, kw_only=True)
class RobotParameters:
    """The arm; all stages of one arm must name the same robot."""

    robot: str = fixed("rcrt1", doc="slave robot, one of `teleop robot`")
    geometry: tuple[str, ...] = fixed(
        (), doc="symbol=value for each length or option of the robot that differs from its default [m, rad]"
    )

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Names of the robot's joints.

        Raises:
            TeleopError: No robot has this name, or the robot does not have such a length.
        """
        return load_robot_set(self.robot, self.geometry).joint_names
