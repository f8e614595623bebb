"""Master of teleop_core as LeRobot's teleoperator, ``--teleop.type=teleop_core``."""

from dataclasses import dataclass, field
from typing import Any

from lerobot.teleoperators import Teleoperator, TeleoperatorConfig

from teleop_core_lerobot import MasterSide

__all__ = ["TeleopCoreTeleop", "TeleopCoreTeleopConfig"]


@TeleoperatorConfig.register_subclass("teleop_core")
@dataclass(kw_only=True)
class TeleopCoreTeleopConfig(TeleoperatorConfig):
    """What runs; the fields are arguments of :class:`teleop_core_lerobot.MasterSide`."""

    robot: str = ""
    scenario: str = ""
    settings: list[str] = field(default_factory=list)
    fps: int = 30
    bag: str = ""


class TeleopCoreTeleop(Teleoperator):
    """Hand, haptic master, scaling and inverse kinematics; a call of ``get_action`` is a period."""

    config_class = TeleopCoreTeleopConfig
    name = "teleop_core"

    def __init__(self, config: TeleopCoreTeleopConfig) -> None:
        super().__init__(config)
        self.config = config
        self._side = MasterSide(
            config.robot, config.scenario, config.settings, config.fps, config.bag
        )

    @property
    def action_features(self) -> dict[str, type]:
        """Joints [rad or m], all float."""
        return dict.fromkeys(self._side.joint_keys, float)

    @property
    def feedback_features(self) -> dict[str, type]:
        """Force on the slave's tip along its base [N]."""
        return dict.fromkeys(self._side.feedback_keys, float)

    @property
    def is_connected(self) -> bool:
        """Whether its session runs."""
        return self._side.is_running

    @property
    def is_calibrated(self) -> bool:
        """Always: a simulated device knows its axes."""
        return True

    def connect(self, calibrate: bool = True) -> None:
        """Begin the session; the hand begins to move with the first action."""
        self._side.begin()

    def calibrate(self) -> None:
        """Nothing to do."""

    def configure(self) -> None:
        """Nothing to do: the configuration is that of the session."""

    def get_action(self) -> dict[str, Any]:
        """See :meth:`teleop_core_lerobot.MasterSide.next_action`."""
        return self._side.next_action()

    def send_feedback(self, feedback: dict[str, Any]) -> None:
        """See :meth:`teleop_core_lerobot.MasterSide.feel`."""
        self._side.feel(feedback)

    def disconnect(self) -> None:
        """End the session; makes the recording if one is wanted."""
        self._side.end()
