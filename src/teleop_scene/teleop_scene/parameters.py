"""Parameters of the stage ``scene``, and what a camera of it sees."""

from dataclasses import dataclass

from teleop_core.base import ParameterError, Within, fixed
from teleop_core.robots.selection import RobotParameters

LARGEST = 4096
"""Largest width and height of a picture [px]."""


@dataclass(frozen=True)
class View:
    """What a camera sees.

    Attributes:
        name: Name of a camera of the model, or a name of its own with a place.
        width: Width of a picture [px].
        height: Height of a picture [px].
        place: Position of a camera of its own in the world [m], then the point at which it looks [m]; empty for a
            camera of the model.
        is_marked: Whether each picture carries the number of its tick in a corner, see :func:`read_marker`.
    """

    name: str
    width: int = 640
    height: int = 480
    place: tuple[float, ...] = ()
    is_marked: bool = False

    @classmethod
    def parse(cls, text: str, *, is_marked: bool = False) -> "View":
        """A view from ``front``, ``front:320x240``, or ``mine:640x480:1,0,0.5,0,0,0.1``.

        Raises:
            ParameterError: The text is none of these.
        """
        name, _, rest = text.partition(":")
        size, _, place = rest.partition(":")
        try:
            width, height = (int(part) for part in (size or "640x480").split("x"))
            numbers = tuple(float(part) for part in place.split(",")) if place else ()
        except ValueError as error:
            raise ParameterError(
                "camera", text, "NAME, NAME:WIDTHxHEIGHT, or NAME:WIDTHxHEIGHT:X,Y,Z,TO_X,TO_Y,TO_Z"
            ) from error
        if not (16 <= width <= LARGEST and 16 <= height <= LARGEST) or len(numbers) not in {0, 6} or not name:
            needed = f"a name, sizes of 16 to {LARGEST} pixels, and six numbers or none"
            raise ParameterError("camera", text, needed)
        return cls(name, width, height, numbers, is_marked)

    @property
    def topic(self) -> str:
        """Name of the topic of its pictures."""
        return f"camera/{self.name}/image_raw/compressed"

    @property
    def info_topic(self) -> str:
        """Name of the topic of its calibration."""
        return f"camera/{self.name}/camera_info"


@dataclass(frozen=True, kw_only=True)
class SceneParameters(RobotParameters):
    """Parameters of the stage ``scene``."""

    rate: int = fixed(50, Within(1, 1000, "Hz"), "messages of scene/poses per second")
    jaw: tuple[str, ...] = fixed(
        (),
        doc="joints of the gripper that the jaw moves; empty: joints with an actuator behind the last joint of the arm",
    )
    jaw_open: tuple[float, ...] = fixed(
        (), Within(None, None, "rad or m"), "position of each of these joints when the jaw is open; empty: found"
    )
    jaw_upper: float = fixed(0.8, Within(0.05, 3.0, "rad"), "angle of the jaw at which the gripper is open")
    cameras: tuple[str, ...] = fixed(
        (),
        doc="cameras that a live session starts and records, and that a film takes: NAME, NAME:WIDTHxHEIGHT, or with "
        "its own place",
    )
    camera_rate: int = fixed(30, Within(1, 1000, "Hz"), "pictures per second of each camera, not above scene.rate")

    def __post_init__(self) -> None:
        """Refuse a camera that cannot be read."""
        for camera in self.cameras:
            View.parse(camera)
