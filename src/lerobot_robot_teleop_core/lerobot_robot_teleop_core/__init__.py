"""Slave of teleop_core as LeRobot's robot, ``--robot.type=teleop_core``.

LeRobot imports this package by its name; teleoperator, camera and environment of the same distribution come with it.
"""

from dataclasses import dataclass, field
from typing import Any

from lerobot.robots import Robot, RobotConfig

import lerobot_camera_teleop_core  # noqa: F401 registers the camera
import lerobot_env_teleop_core  # noqa: F401 registers the environment
import lerobot_teleoperator_teleop_core  # noqa: F401 registers the teleoperator
from teleop_core_lerobot import Connection, SessionFields, SlaveSide

__all__ = ["TeleopCoreRobot", "TeleopCoreRobotConfig"]


@RobotConfig.register_subclass("teleop_core")
@dataclass(kw_only=True)
class TeleopCoreRobotConfig(SessionFields, RobotConfig):
    """What runs; the fields are arguments of :class:`teleop_core_lerobot.SlaveSide`, and whether force is observed."""

    views: list[str] = field(default_factory=list)
    force: bool = True


class TeleopCoreRobot(Connection, Robot):
    """The simulated slave; a call of ``send_action`` lets ``1 / fps`` of virtual time pass."""

    config_class = TeleopCoreRobotConfig
    name = "teleop_core"
    _side: SlaveSide

    def __init__(self, config: TeleopCoreRobotConfig) -> None:
        super().__init__(config)
        self.config = config
        self._side = SlaveSide(*config.arguments(), config.views)
        self.cameras: dict[str, Any] = dict.fromkeys(self._side.pictures)  # LeRobot counts them

    @property
    def observation_features(self) -> dict[str, type | tuple[int, int, int]]:
        """Joints [rad or m] and force on the tip [N], all float; pictures by height, width and 3."""
        keys = self._side.observed_keys if self.config.force else self._side.joint_keys
        return {**dict.fromkeys(keys, float), **self._side.pictures}

    def get_observation(self) -> dict[str, Any]:
        """See :meth:`teleop_core_lerobot.SlaveSide.observe`."""
        found = self._side.observe()
        return {key: found[key] for key in self.observation_features}

    def send_action(self, action: dict[str, Any]) -> dict[str, Any]:
        """See :meth:`teleop_core_lerobot.SlaveSide.send`."""
        return self._side.send(action)
