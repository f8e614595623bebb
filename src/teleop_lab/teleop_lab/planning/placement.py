"""Placement: the start posture of a slave, and the rotation and scale of the hand's motion."""

from dataclasses import dataclass

from teleop_core.base.plain_yaml import written
from teleop_core.coupling.mapping.gains import MotionScalingParameters
from teleop_core.robots.selection import RobotParameters

Setting = float | str | list[float] | list[str]


@dataclass(frozen=True, kw_only=True)
class Placement:
    """Arrangement of a slave for a hand's motion.

    Attributes:
        robot: Name of the slave: ``robot`` of all stages with this parameter.
        geometry: Lengths and options of the slave that replace the published ones, as ``symbol=value``.
        start: Joints (n,) [rad, m] from which the slave follows: ``slave.start``.
        axes: The slave's x, y, z as axes of the master: ``motion_scaling.axes``.
        coarse_gain: Slave motion per hand motion in coarse mode.
        fine_gain: Slave motion per hand motion in fine mode.
        rotation_gain: Rotation of the tool divided by that of the stylus.
        tool_axes: The tool's x, y, z as axes of the stylus, ``motion_scaling.tool_axes``; empty: the tool turns about
            the axes of the hand's turn.
        tool_roll: Turn [rad] of the tool about its axis, applied after ``tool_axes``.
    """

    robot: str
    geometry: tuple[str, ...] = ()
    start: tuple[float, ...]
    axes: tuple[str, ...]
    coarse_gain: float
    fine_gain: float
    rotation_gain: float
    tool_axes: tuple[str, ...]
    tool_roll: float

    @staticmethod
    def of(parameters: MotionScalingParameters, slave: RobotParameters, start: tuple[float, ...]) -> "Placement":
        """Return the placement that corresponds to parameters of motion scaling, a slave and its start."""
        return Placement(
            robot=slave.robot,
            geometry=slave.geometry,
            start=start,
            axes=parameters.axes,
            coarse_gain=parameters.coarse_gain,
            fine_gain=parameters.fine_gain,
            rotation_gain=parameters.rotation_gain,
            tool_axes=parameters.tool_axes,
            tool_roll=parameters.tool_roll,
        )

    def settings(self, arm: str = "") -> dict[str, Setting]:
        """Parameters by name, for ``settings=`` of sessions; all numbers are plain Python numbers.

        Args:
            arm: Namespace of the arm; empty for the default arm.
        """
        prefix = f"{arm}/" if arm else ""
        robot: dict[str, Setting] = {}
        for stage in ("inverse_kinematics", "slave", "slave_sim"):
            robot[f"{prefix}{stage}.robot"] = self.robot
            if self.geometry:
                robot[f"{prefix}{stage}.geometry"] = list(self.geometry)
        return robot | {
            f"{prefix}slave.start": list(map(float, self.start)),
            f"{prefix}motion_scaling.axes": list(self.axes),
            f"{prefix}motion_scaling.coarse_gain": float(self.coarse_gain),
            f"{prefix}motion_scaling.fine_gain": float(self.fine_gain),
            f"{prefix}motion_scaling.rotation_gain": float(self.rotation_gain),
            f"{prefix}motion_scaling.tool_axes": list(self.tool_axes),
            f"{prefix}motion_scaling.tool_roll": float(self.tool_roll),
        }

    def texts(self, arm: str = "") -> list[str]:
        """Placement as ``key=value`` texts for ``--set``; no value contains blanks."""
        return [f"{name}={_text(value)}" for name, value in self.settings(arm).items()]

    def parameter_file(self, arm: str = "") -> str:
        """Placement as a ROS 2 parameter file for ``--config``."""
        stages: dict[str, dict[str, dict[str, Setting]]] = {}
        for name, value in self.settings(arm).items():
            stage, _, parameter = name.partition(".")
            stages.setdefault(stage, {"ros__parameters": {}})["ros__parameters"][parameter] = value
        return written(stages, default_flow_style=None)


def _text(value: Setting) -> str:
    if isinstance(value, str):
        return value
    if not isinstance(value, list):
        return repr(value)
    return "[" + ",".join(v if isinstance(v, str) else repr(v) for v in value) + "]"
