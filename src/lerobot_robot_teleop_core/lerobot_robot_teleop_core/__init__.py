"""Slave of teleop_core as LeRobot's robot, ``--robot.type=teleop_core``.

LeRobot imports this package by its name; the teleoperator of the same distribution comes with it.
"""

from dataclasses import dataclass, field
from typing import Any

from lerobot.robots import Robot, RobotConfig

import lerobot_teleoperator_teleop_core  # noqa: F401 registers the teleoperator
from teleop_core_lerobot import SlaveSide

__all__ = ["TeleopCoreRobot", "TeleopCoreRobotConfig"]


@RobotConfig.register_subclass("teleop_core")
@dataclass(kw_only=True)
class TeleopCoreRobotConfig(RobotConfig):
    """What runs; the fields are arguments of :class:`teleop_core_lerobot.SlaveSide`."""

    robot: str = ""
    scenario: str = ""
    settings: list[str] = field(default_factory=list)
    fps: int = 30
    bag: str = ""


class TeleopCoreRobot(Robot):
    """The simulated slave; a call of ``send_action`` lets ``1 / fps`` of virtual time pass."""

    config_class = TeleopCoreRobotConfig
    name = "teleop_core"

    def __init__(self, config: TeleopCoreRobotConfig) -> None:
        super().__init__(config)
        self.config = config
        self.cameras: dict[str, Any] = {}  # LeRobot asks each robot for its cameras
        self._side = SlaveSide(
            config.robot, config.scenario, config.settings, config.fps, config.bag
        )

    @property
    def observation_features(self) -> dict[str, type]:
        """Joints [rad or m] and force on the tip [N], all float."""
        return dict.fromkeys(self._side.observed_keys, float)

    @property
    def action_features(self) -> dict[str, type]:
        """Joints [rad or m], all float."""
        return dict.fromkeys(self._side.joint_keys, float)

    @property
    def is_connected(self) -> bool:
        """Whether its session runs."""
        return self._side.is_running

    @property
    def is_calibrated(self) -> bool:
        """Always: a simulated arm knows its joints."""
        return True

    def connect(self, calibrate: bool = True) -> None:
        """Begin the session, with the slave where it starts."""
        self._side.begin()

    def calibrate(self) -> None:
        """Nothing to do."""

    def configure(self) -> None:
        """Nothing to do: the configuration is that of the session."""

    def get_observation(self) -> dict[str, Any]:
        """See :meth:`teleop_core_lerobot.SlaveSide.observe`."""
        return self._side.observe()

    def send_action(self, action: dict[str, Any]) -> dict[str, Any]:
        """See :meth:`teleop_core_lerobot.SlaveSide.send`."""
        return self._side.send(action)

    def disconnect(self) -> None:
        """End the session; makes the recording if one is wanted."""
        self._side.end()
