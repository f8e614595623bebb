"""Camera: pictures of a scene from the poses of its bodies, without the scene's own state.

A picture needs the poses of ``scene/poses`` alone, so a camera can run in another process than the arm, or after the
session from its recording. Equal poses give equal pixels on one machine with one version of MuJoCo and of its OpenGL.
Pictures have no shadows, no reflections and one sample for each pixel: Mesa without a graphics card draws them several
times as fast.
"""

from pathlib import Path
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from teleop_core.base import TeleopError, UnknownNameError
from teleop_core.kernels import Array
from teleop_scene import models
from teleop_scene.parameters import View

Pixels = NDArray[np.uint8]
_BITS, _BLOCK = 48, 8  # of a marker: ticks that last for 8900 years; pixels of a bit's side, as in a block of JPEG
_ROWS = 4
_MOST_SHAPES = 10_000


class Camera:
    """A camera of a scene.

    Args:
        file: File of the scene.
        view: What the camera sees.

    Attributes:
        focal: Focal length [px]; the centre of the picture is its middle.

    Raises:
        UnknownNameError: The model has no such camera.
        TeleopError: This machine cannot draw: OpenGL without a screen (EGL) is missing.
    """

    def __init__(self, file: Path, view: View) -> None:
        self.view = view
        self._model = model = mujoco.MjModel.from_xml_path(str(file))
        model.vis.global_.offwidth, model.vis.global_.offheight = view.width, view.height
        model.vis.quality.offsamples = model.vis.quality.shadowsize = 0
        self._data = mujoco.MjData(model)
        if model.nkey:
            mujoco.mj_resetDataKeyframe(model, self._data, 0)
        mujoco.mj_forward(model, self._data)
        self._moving = models.moving_bodies(model)
        self._fixed = [b for b in range(1, model.nbody) if model.body_jntnum[b] == 0]
        self._camera, field = self._seen()
        self.focal = 0.5 * view.height / np.tan(np.radians(field) / 2.0)
        self._scene, self._option = mujoco.MjvScene(model, maxgeom=_MOST_SHAPES), mujoco.MjvOption()
        self._rectangle = mujoco.MjrRect(0, 0, view.width, view.height)
        try:
            from mujoco import egl  # loads OpenGL, which a machine may lack

            self._screen: Any = egl.GLContext(view.width, view.height)
            self._screen.make_current()
            self._context: Any = mujoco.MjrContext(model, mujoco.mjtFontScale.mjFONTSCALE_100.value)
        except Exception as error:  # a missing OpenGL is told in many ways
            needed = "OpenGL without a screen (EGL); Debian's packages libegl1 and libgl1-mesa-dri bring it"
            raise TeleopError(f"cameras cannot draw, as this machine lacks {needed}") from error
        mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN.value, self._context)
        for flag in (mujoco.mjtRndFlag.mjRND_SHADOW, mujoco.mjtRndFlag.mjRND_REFLECTION):
            self._scene.flags[flag] = False

    def _seen(self) -> tuple[Any, float]:
        """The camera as MuJoCo knows it, and its vertical field of view [°]."""
        model, place = self._model, np.array(self.view.place)
        if not len(place):
            names = [model.camera(i).name for i in range(model.ncam)]
            if self.view.name not in names:
                raise UnknownNameError("camera", self.view.name, names or ["NAME:WIDTHxHEIGHT:X,Y,Z,TO_X,TO_Y,TO_Z"])
            own = mujoco.MjvCamera()
            own.type, own.fixedcamid = mujoco.mjtCamera.mjCAMERA_FIXED, names.index(self.view.name)
            return own, float(model.cam_fovy[own.fixedcamid])
        free, way = mujoco.MjvCamera(), place[3:] - place[:3]
        free.type, free.lookat[:] = mujoco.mjtCamera.mjCAMERA_FREE, place[3:]
        free.distance = float(np.linalg.norm(way))
        free.azimuth = float(np.degrees(np.arctan2(way[1], way[0])))
        free.elevation = float(np.degrees(np.arctan2(way[2], np.hypot(way[0], way[1]))))
        return free, float(model.vis.global_.fovy)

    @property
    def bodies(self) -> int:
        """Number of moving bodies, whose poses a picture needs."""
        return len(self._moving)

    def take(self, poses: Array, tick: int = 0) -> Pixels:
        """Picture of the scene.

        Args:
            poses: Poses of the moving bodies (n, 7) in the world: position [m], quaternion w, x, y, z.
            tick: Number of the tick, for a marked camera.

        Returns:
            Colours (height, width, 3), red, green and blue.
        """
        self._place(poses)
        every = mujoco.mjtCatBit.mjCAT_ALL.value
        mujoco.mjv_updateScene(self._model, self._data, self._option, None, self._camera, every, self._scene)
        self._screen.make_current()  # cameras of a process take turns
        mujoco.mjr_render(self._rectangle, self._scene, self._context)
        drawn = np.empty((self.view.height, self.view.width, 3), np.uint8)
        mujoco.mjr_readPixels(drawn, None, self._rectangle, self._context)
        pixels = np.ascontiguousarray(drawn[::-1])  # OpenGL begins at the bottom
        if self.view.is_marked:
            write_marker(pixels, tick)
        return pixels

    def _place(self, poses: Array) -> None:
        """Move all bodies and what they carry; cameras and lights follow."""
        model, data = self._model, self._data
        data.xpos[self._moving], data.xquat[self._moving] = poses[:, :3], poses[:, 3:]
        for b in self._moving:
            mujoco.mju_quat2Mat(data.xmat[b], data.xquat[b])
        for b in self._fixed:
            parent, turn = int(model.body_parentid[b]), np.zeros(4)
            data.xpos[b] = data.xpos[parent] + data.xmat[parent].reshape(3, 3) @ model.body_pos[b]
            mujoco.mju_mulQuat(turn, data.xquat[parent], model.body_quat[b])
            data.xquat[b] = turn
            mujoco.mju_quat2Mat(data.xmat[b], turn)
        for bodies, at, quat, xpos, xmat in (
            (model.geom_bodyid, model.geom_pos, model.geom_quat, data.geom_xpos, data.geom_xmat),
            (model.site_bodyid, model.site_pos, model.site_quat, data.site_xpos, data.site_xmat),
        ):
            if len(bodies):
                R = data.xmat[bodies].reshape(-1, 3, 3)
                xpos[:] = data.xpos[bodies] + np.einsum("nij,nj->ni", R, at)
                xmat[:] = (R @ _matrices(quat)).reshape(-1, 9)
        mujoco.mj_camlight(model, data)

    def close(self) -> None:
        """Free the memory of the graphics."""
        self._screen.make_current()
        self._context.free()
        self._screen.free()


def _matrices(quaternions: Array) -> Array:
    """Rotations (n, 3, 3) of quaternions (n, 4)."""
    out = np.empty((len(quaternions), 9))
    for row, quaternion in zip(out, quaternions, strict=True):
        mujoco.mju_quat2Mat(row, quaternion)
    return out.reshape(-1, 3, 3)


def write_marker(pixels: Pixels, tick: int) -> None:
    """Draw the number of a tick into the upper left corner: a black or white square for each bit, the lowest first."""
    width = _BITS // _ROWS
    bits = (tick >> np.arange(_BITS) & 1).reshape(_ROWS, width).astype(np.uint8) * 255
    drawn = np.kron(bits, np.ones((_BLOCK, _BLOCK), np.uint8))
    pixels[: _ROWS * _BLOCK, : width * _BLOCK] = drawn[: pixels.shape[0], : pixels.shape[1], None]


def read_marker(pixels: Pixels) -> int:
    """Number of the tick in the corner of a picture (height, width, 3) of at least 96 x 32 pixels."""
    width = _BITS // _ROWS
    corner = pixels[: _ROWS * _BLOCK, : width * _BLOCK].mean(axis=2)
    blocks = corner.reshape(_ROWS, _BLOCK, width, _BLOCK)[:, 2:-2, :, 2:-2].mean(axis=(1, 3))
    return int((1 << np.flatnonzero(blocks.ravel() > 127.5)).sum())
