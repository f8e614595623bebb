"""Master of teleop_core as LeRobot's teleoperator, ``--teleop.type=teleop_core``."""

from dataclasses import dataclass
from typing import Any

from lerobot.teleoperators import Teleoperator, TeleoperatorConfig

from teleop_core_lerobot import Connection, MasterSide, SessionFields

__all__ = ["TeleopCoreTeleop", "TeleopCoreTeleopConfig"]


@TeleoperatorConfig.register_subclass("teleop_core")
@dataclass(kw_only=True)
class TeleopCoreTeleopConfig(SessionFields, TeleoperatorConfig):
    """What runs; the fields are arguments of :class:`teleop_core_lerobot.MasterSide`."""


class TeleopCoreTeleop(Connection, Teleoperator):
    """Hand, haptic master, scaling and inverse kinematics; a call of ``get_action`` is a period."""

    config_class = TeleopCoreTeleopConfig
    name = "teleop_core"
    _side: MasterSide

    def __init__(self, config: TeleopCoreTeleopConfig) -> None:
        super().__init__(config)
        self.config = config
        self._side = MasterSide(*config.arguments())

    @property
    def feedback_features(self) -> dict[str, type]:
        """Joints to move to while torque is enabled [rad or m], and force on the slave's tip along its base [N]."""
        return dict.fromkeys(self._side.feedback_keys, float)

    def get_action(self) -> dict[str, Any]:
        """See :meth:`teleop_core_lerobot.MasterSide.next_action`."""
        return self._side.next_action()

    def enable_torque(self) -> None:
        """Take the master from the hand; see :meth:`teleop_core_lerobot.MasterSide.hold`."""
        self._side.hold()

    def disable_torque(self) -> None:
        """Give the master back to the hand; see :meth:`teleop_core_lerobot.MasterSide.release`."""
        self._side.release()

    def send_feedback(self, feedback: dict[str, Any]) -> None:
        """See :meth:`teleop_core_lerobot.MasterSide.feel`."""
        self._side.feel(feedback)
