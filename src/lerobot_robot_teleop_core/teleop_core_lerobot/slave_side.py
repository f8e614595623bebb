"""Side of the slave: an arm that follows the joints that a loop gives, with pictures of a scene."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

import teleop_core as tc
from teleop_core.graph import TICK_NS, topics
from teleop_core.kernels.fields import PerJoint
from teleop_core.robots import load_robot_set
from teleop_core.robots.parts import file_of, is_scene
from teleop_core.slave.parameters import SlaveParameters
from teleop_core_lerobot.side import FORCE, Side

GIVEN_JP = tc.Topic("given/servo_jp", tc.Kind.JOINTS, topics.in_force("slave/servo_jp"), "slave_base")
"""Joint references that the loop gave last, under the time at which they came."""


class GivenJoints(tc.Fields):
    """What the loop gave last: joints (n,) [rad or m] and when they came [ns]; 0: nothing yet."""

    joints: PerJoint
    stamp_ns: int


class GivenJointsRow(tc.Row):
    """Ports of the stage ``given_joints``."""

    given_servo_jp: NDArray[np.float64]
    given_servo_jp_ns: int


@tc.kernel
def _give_joints(p: Any, s: GivenJoints, row: GivenJointsRow, dt: float) -> None:
    """Tell what was given, under the time of its coming: the slave takes it once."""
    for i in range(s.joints.shape[0]):
        row.given_servo_jp[i] = s.joints[i]
    row.given_servo_jp_ns = s.stamp_ns


GIVEN_JOINTS = tc.Stage(
    "given_joints",
    tc.RobotParameters,
    reads=(topics.SLAVE_SERVO_JP,),
    writes=(GIVEN_JP,),
    step=_give_joints,
    state=GivenJoints,
    replaces=topics.SLAVE_SERVO_JP,
)
tc.register_stage(GIVEN_JOINTS, replace=True)


class Lens(Protocol):
    """A camera of a scene; :class:`teleop_scene.camera.Camera`."""

    view: Any

    @property
    def bodies(self) -> int:
        """Number of moving bodies."""

    def take(self, poses: NDArray[np.float64], tick: int = 0) -> NDArray[np.uint8]:
        """Picture (height, width, 3) for poses of the bodies (n, 7)."""

    def close(self) -> None:
        """Free the memory of the graphics."""


def _views(cameras: Sequence[str]) -> list[Any]:
    if not cameras:
        return []
    try:
        from teleop_scene.parameters import View as OfScene
    except ImportError as error:
        raise tc.ParameterError("cameras", tuple(cameras), "left out, or teleop_scene installed") from error
    return [OfScene.parse(text) for text in cameras]


class SlaveSide(Side):
    """The slave, led by joint references that a loop gives; its session's operator leads nothing.

    References pass the stage ``slave``: its states, stop, limits, faults and interpolation.

    Args:
        robot: As in :class:`Side`; for pictures, a scene.
        scenario: As in :class:`Side`.
        settings: As in :class:`Side`.
        fps: As in :class:`Side`.
        bag: As in :class:`Side`.
        cameras: Cameras of the scene: ``front``, ``front:320x240``; see :class:`teleop_scene.camera.View`.

    Attributes:
        pictures: Height, width and 3 of each camera's pictures, by its name; known before :meth:`Side.begin`.
    """

    def __init__(
        self,
        robot: str = "",
        scenario: str = "",
        settings: Sequence[str] = (),
        fps: int = 30,
        bag: str = "",
        cameras: Sequence[str] = (),
    ) -> None:
        fresh = ("scene.rate=1000",) * (bool(cameras) and is_scene(robot))  # pictures show the poses of the last tick
        super().__init__([GIVEN_JOINTS], robot, scenario, (*settings, *fresh), fps, bag)
        self.pictures: dict[str, tuple[int, int, int]] = {}
        self._lenses: list[Lens] = []
        self._seen = _views(cameras)
        for view in self._seen:
            self.pictures[view.name] = (view.height, view.width, 3)
        if self._seen and not self._file:
            raise tc.ParameterError("cameras", tuple(cameras), "left out, or robot=SCENE.xml: only a scene has cameras")

    @property
    def _file(self) -> Path | None:
        name = str(self._configuration.value("robot"))
        found = file_of(name) if is_scene(name) else None
        return None if found is None else found[0]

    def begin(self) -> None:
        """Begin a session, and wait until the slave is where it starts.

        Raises:
            SessionError: It runs already.
            TeleopError: This machine cannot draw pictures.
        """
        super().begin()
        if self._seen and self._file is not None:
            from teleop_scene.camera import Camera

            self._lenses = [Camera(self._file, view) for view in self._seen]

    def end(self) -> None:
        """End the session, and make its recording if one is wanted; see :meth:`Side.end`."""
        for lens in self._lenses:
            lens.close()
        self._lenses = []
        super().end()

    @property
    def observed_keys(self) -> tuple[str, ...]:
        """Keys of the numbers of an observation: joints [rad or m], then force on the tip along slave_base [N]."""
        return (*self.joint_keys, *FORCE)

    @property
    def limits(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Lower and upper limits (n,) of the joints [rad or m]."""
        chosen = self._configuration.of(SlaveParameters)
        robot = load_robot_set(chosen.robot, chosen.geometry)
        return robot.lower, robot.upper

    @property
    def tip(self) -> NDArray[np.float64]:
        """Measured pose of the tip in slave_base: position [m], quaternion w, x, y, z."""
        return self.values(topics.SLAVE_MEASURED_CP)

    def observe_joints(self) -> dict[str, float]:
        """Measured joints of the last tick [rad or m]; no time passes."""
        return self._named(self.values(topics.SLAVE_MEASURED_JS)[: len(self.joint_names)])

    def observe(self) -> dict[str, Any]:
        """Measured joints, force on the tip and pictures (height, width, 3), of the last tick; no time passes."""
        force = self.values(topics.SLAVE_MEASURED_CF)[:3]
        found: dict[str, Any] = self.observe_joints() | dict(zip(FORCE, force.tolist(), strict=True))
        for lens in self._lenses:
            poses = np.reshape(self._row["scene_poses"], (-1, 7))[: lens.bodies]
            found[lens.view.name] = lens.take(poses)
        return found

    def send(self, action: Mapping[str, float]) -> dict[str, float]:
        """Give joint references, and let one period pass.

        Args:
            action: A number for each of ``joint_keys`` [rad or m].

        Returns:
            The references in force at the end of the period: within the limits of the joints, the
            ones before if these were refused, where the arm holds if it may not move.

        Raises:
            ParameterError: Its keys are others, or a number is not finite; no time passes.
            SessionError: No session runs.
        """
        given, session = self._given(GIVEN_JOINTS), self._running
        if set(action) != set(self.joint_keys) or not np.isfinite(list(action.values())).all():
            needed = f"a finite number for each of {', '.join(self.joint_keys)}, and no other"
            raise tc.ParameterError("action", dict(action), needed)
        given["joints"] = [action[key] for key in self.joint_keys]
        given["stamp_ns"] = session.now_ns + TICK_NS
        self._advance_period()
        return self._named(self._slave.motion.goal)
