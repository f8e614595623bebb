"""What LeRobot asks of robot and teleoperator alike, without LeRobot."""

from dataclasses import dataclass, field

from teleop_core_lerobot.side import Side


@dataclass(kw_only=True)
class SessionFields:
    """Fields of a configuration for LeRobot: the arguments of a side, in LeRobot's types."""

    robot: str = ""
    scenario: str = ""
    settings: list[str] = field(default_factory=list)
    fps: int = 30
    bag: str = ""

    def arguments(self) -> tuple[str, str, list[str], int, str]:
        """Arguments of :class:`SlaveSide` and :class:`MasterSide`, in their order."""
        return self.robot, self.scenario, self.settings, self.fps, self.bag


class Connection:
    """What LeRobot asks of both devices alike: joints as actions, begin and end of the session.

    The class of a device sets ``_side``.
    """

    _side: Side

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
        """Always: a simulated arm or device knows its joints."""
        return True

    def connect(self, calibrate: bool = True) -> None:
        """Begin the session with the slave where it starts; a hand moves from the first action."""
        self._side.begin()

    def calibrate(self) -> None:
        """Nothing to do."""

    def configure(self) -> None:
        """Nothing to do: the configuration is that of the session."""

    def disconnect(self) -> None:
        """End the session; makes the recording if one is wanted."""
        self._side.end()
