"""Cameras: views of a session for the browser of one person."""

from dataclasses import dataclass
from itertools import product

import numpy as np
import viser

from teleop_core.kernels.geometry import Array, quaternion_from_rotation, rotations_from_quaternions

FIELD = np.radians(45.0)
"""Vertical field of view of all cameras [rad]."""
_FROM = np.array([-0.80, -0.42, 0.48])
"""Direction from the scene to the first camera, which is behind the arm and above its right shoulder."""
_WIDE = 0.875  # largest share of the picture's width that the scene fills
_HIGH = 0.8  # largest share of the picture's height that the scene fills
ASPECT = 1.2
"""Width divided by height of the scene in a wide window with the panel beside the scene."""
_PHONE = 0.85  # width divided by height below which the panel may cover the lower part of the scene, as on phones
# Free part of such a picture: height of its middle above the picture's middle, and half of its own height. The unit is
# half the height of the picture.
_CLEAR = (0.4, 0.55)


@dataclass(frozen=True, eq=False)
class Camera:
    """Camera pose in the axes of the page.

    Attributes:
        position: Position of the camera (3,) [m].
        look_at: Point in the middle of its picture (3,) [m].
        up: Direction that points up on the screen (3,).
    """

    position: Array
    look_at: Array
    up: Array

    @property
    def quaternion(self) -> Array:
        """Orientation of the camera (4,): x to the right, y downwards, z into the picture."""
        z = self.look_at - self.position
        z = z / np.linalg.norm(z)
        x = np.cross(z, self.up)
        x = x / np.linalg.norm(x)
        out = np.empty(4)
        quaternion_from_rotation(np.stack((x, np.cross(z, x), z), axis=1), out)
        return out

    def is_elsewhere(self, other: "Camera", part: float) -> bool:
        """Whether the distance from another camera exceeds a part of that camera's viewing distance."""
        far = part * float(np.linalg.norm(other.position - other.look_at))
        away = max(np.linalg.norm(self.position - other.position), np.linalg.norm(self.look_at - other.look_at))
        return bool(away > far)

    def give(self, client: viser.ClientHandle) -> None:
        """Move the camera of a browser to this pose."""
        with client.atomic():
            client.camera.up_direction = self.up
            client.camera.position = self.position
            client.camera.look_at = self.look_at


def corners(low: Array, high: Array) -> Array:
    """Corners (8, 3) [m] of the box that is given by its lowest and its highest corner (3,)."""
    return np.array(list(product(*zip(low, high, strict=True))))


def around(points: Array, aspect: float = ASPECT) -> Camera:
    """Camera whose picture contains all given points, beside the panel or, on a phone, above the panel.

    Args:
        points: Points (N, 3) [m] that the camera must see, in the axes of the page.
        aspect: Width of the picture divided by its height.
    """
    up, direction = np.array([0.0, 0.0, 1.0]), _FROM / np.linalg.norm(_FROM)
    turn = rotations_from_quaternions(Camera(direction, np.zeros(3), up).quaternion[None])[0]
    seen = points @ turn
    centre = 0.5 * (seen.min(axis=0) + seen.max(axis=0))
    right, down, into = (seen - centre).T
    half = np.tan(0.5 * FIELD)
    shift, clear = _CLEAR if aspect < _PHONE else (0.0, 1.0)
    across, upwards = _WIDE * aspect * half, _HIGH * clear * half
    distance = float((np.maximum(np.abs(right) / across, np.abs(down) / upwards) - into).max())
    middle = turn @ centre + shift * half * distance * turn[:, 1]
    return Camera(middle + distance * direction, middle, up)


def from_tool(pose: Array, size: float) -> Camera:
    """Camera on the tool that looks along its z.

    Args:
        pose: Pose of the tip (7,), in the axes of the page.
        size: Reach of the robot [m].
    """
    turn = rotations_from_quaternions(pose[None, 3:])[0]
    beside = pose[:3] - size * (turn @ np.array([0.16, 0.0, 0.10]))
    return Camera(beside, pose[:3] + 0.04 * size * turn[:, 2], turn[:, 0])


def microscope(place: Array, size: float) -> Camera:
    """Fixed camera that looks steeply down on ``place`` (3,) [m], like a microscope above the task."""
    position = place + size * np.array([0.06, 0.0, 0.35])
    return Camera(position, place.copy(), np.array([1.0, 0.0, 0.0]))
