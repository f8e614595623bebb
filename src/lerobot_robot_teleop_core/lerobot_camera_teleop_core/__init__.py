"""Cameras of live sessions as LeRobot's cameras, ``type: teleop_core``."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from lerobot.cameras import Camera, CameraConfig
from numpy.typing import NDArray

from teleop_core_lerobot import LiveCamera

__all__ = ["TeleopCoreCamera", "TeleopCoreCameraConfig"]


@CameraConfig.register_subclass("teleop_core")
@dataclass(kw_only=True)
class TeleopCoreCameraConfig(CameraConfig):
    """Which topic is read; width and height must be those of its pictures."""

    topic: str
    patience_s: float = 5.0


class TeleopCoreCamera(Camera):
    """A topic of ``CompressedImage``; see :class:`teleop_core_lerobot.LiveCamera`."""

    def __init__(self, config: TeleopCoreCameraConfig) -> None:
        super().__init__(config)
        self.config, self._live = config, LiveCamera(config.topic)

    @property
    def is_connected(self) -> bool:
        """Whether the topic is read."""
        return self._live.is_running

    @property
    def age(self) -> float:
        """Time since the capture of the newest picture [s]."""
        return self._live.age

    @staticmethod
    def find_cameras() -> list[dict[str, Any]]:
        """None: a camera is found by the name of its topic."""
        return []

    def connect(self, warmup: bool = True) -> None:
        """Begin to read; wait for the first picture and compare its size.

        Raises:
            ConnectionError: No picture comes, or it has another size than configured.
        """
        self._live.begin()
        try:
            height, width = self._live.next(self.config.patience_s).shape[:2]
            if (self.config.width or width, self.config.height or height) != (width, height):
                raise ConnectionError(f"{self._live.topic} has pictures of {width} x {height}; set width and height so")
        except TimeoutError as error:
            self._live.end()
            raise ConnectionError(str(error)) from error
        except ConnectionError:
            self._live.end()
            raise
        self.width, self.height = width, height

    def read(self) -> NDArray[Any]:
        """Wait for a new picture (height, width, 3)."""
        return self._live.next(self.config.patience_s)

    def async_read(self, timeout_ms: float = 200) -> NDArray[Any]:
        """See :meth:`teleop_core_lerobot.LiveCamera.next`."""
        return self._live.next(timeout_ms * 1e-3)

    def read_latest(self, max_age_ms: int = 500) -> NDArray[Any]:
        """See :meth:`teleop_core_lerobot.LiveCamera.newest`; the age begins with the capture."""
        return np.asarray(self._live.newest(max_age_ms * 1e-3))

    def disconnect(self) -> None:
        """Stop reading."""
        self._live.end()
