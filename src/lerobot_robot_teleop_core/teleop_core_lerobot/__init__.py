"""Sides of a session for loops of another program: a slave that follows joints, a master.

Each side is a session in virtual time, which a call of the loop advances by one period. Nothing here needs LeRobot;
``lerobot_robot_teleop_core`` and ``lerobot_teleoperator_teleop_core`` give both to it.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

import teleop_core as tc
from teleop_core.commands.progress import shown_progress
from teleop_core.graph import TICK_NS, topics
from teleop_core.kernels.fields import PerJoint, Wrench
from teleop_core.robots.parts import file_of, is_scene
from teleop_core.session.runner import record_blocks
from teleop_core.slave.parameters import SlaveParameters

__all__ = ["Connection", "MasterSide", "SessionFields", "Side", "SlaveSide"]

_SECOND_NS = 1_000_000_000
_FORCE = ("force.x", "force.y", "force.z")
GIVEN_JP = tc.Topic("given/servo_jp", tc.Kind.JOINTS, topics.in_force("slave/servo_jp"), "slave_base")
"""Joint references that the loop gave last, under the time at which they came."""
GIVEN_CF = tc.Topic("given/measured_cf", tc.Kind.WRENCH, frame_id="slave_base", is_seldom=True)
"""Force on the tip that the loop gave last; before: the force on the simulated slave's tip."""


class GivenJoints(tc.Fields):
    """What the loop gave last: joints (n,) [rad or m] and when they came [ns]; 0: nothing yet."""

    joints: PerJoint
    stamp_ns: int


class GivenForce(tc.Fields):
    """What the loop gave last: force [N] and torque [N·m] (6,), and whether it gave any."""

    wrench: Wrench
    is_given: int


class GivenJointsRow(tc.Row):
    """Ports of the stage ``given_joints``."""

    given_servo_jp: NDArray[np.float64]
    given_servo_jp_ns: int


class GivenForceRow(tc.Row):
    """Ports of the stage ``given_force``."""

    given_measured_cf: NDArray[np.float64]


@tc.kernel
def _give_joints(p: Any, s: GivenJoints, row: GivenJointsRow, dt: float) -> None:
    """Tell what was given, under the time of its coming: the slave takes it once."""
    for i in range(s.joints.shape[0]):
        row.given_servo_jp[i] = s.joints[i]
    row.given_servo_jp_ns = s.stamp_ns


@tc.kernel
def _give_force(p: Any, s: GivenForce, row: GivenForceRow, dt: float) -> None:
    """Tell the force that was given, or the simulated one before."""
    for i in range(6):
        row.given_measured_cf[i] = s.wrench[i] if s.is_given else row.slave_measured_cf[i]


GIVEN_JOINTS = tc.Stage(
    "given_joints",
    tc.RobotParameters,
    reads=(topics.SLAVE_SERVO_JP,),
    writes=(GIVEN_JP,),
    step=_give_joints,
    state=GivenJoints,
    replaces=topics.SLAVE_SERVO_JP,
)
GIVEN_FORCE = tc.Stage(
    "given_force",
    tc.NoParameters,
    reads=(topics.SLAVE_MEASURED_CF,),
    writes=(GIVEN_CF,),
    step=_give_force,
    state=GivenForce,
    replaces=topics.SLAVE_MEASURED_CF,
)
for _stage in (GIVEN_JOINTS, GIVEN_FORCE):
    tc.register_stage(_stage, replace=True)


class Side:
    """One side of a session, which a loop advances period by period.

    Args:
        stage: Stage by which the loop gives.
        robot: Name of a robot, its URDF or table; empty for the one of the scenario.
        scenario: One of ``teleop scenarios``; empty for the defaults.
        settings: Parameters as ``key=value``, as ``teleop sim --set`` takes them.
        fps: Calls of the loop in a second, 1 to 1000.
        bag: Directory of a recording that :meth:`end` makes; empty for none.

    Attributes:
        joint_names: Names of the robot's joints.

    Raises:
        TeleopError: A value is wrong; the text names it.
    """

    def __init__(
        self, stage: tc.Stage, robot: str, scenario: str, settings: Sequence[str], fps: int, bag: str = ""
    ) -> None:
        if not 1 <= fps <= 1000:
            raise tc.ParameterError("fps", fps, "1 to 1000 calls in a second")
        self._configuration = tc.configuration(scenario or None, robot=robot or None, stages=stage, texts=settings)
        arms, stages = self._configuration.graph.arms, self._configuration.graph.stages
        if stage not in stages or len(arms) > 1:
            needed = f"one arm, with {stage.name} among teleop.stages"
            raise tc.ParameterError("settings", tuple(settings), needed)
        self._stage, self._fps, self._bag = stage.name, fps, bag
        self.joint_names: tuple[str, ...] = self._configuration.of(SlaveParameters).joint_names
        self._session: tc.VirtualTime | None = None

    @property
    def joint_keys(self) -> tuple[str, ...]:
        """Keys of the joints in actions and observations, [rad or m]."""
        return tuple(f"{name}.pos" for name in self.joint_names)

    @property
    def is_running(self) -> bool:
        """Whether it has begun and not ended."""
        return self._session is not None

    def begin(self) -> None:
        """Begin a session, and wait until the slave is where it starts.

        Raises:
            SessionError: It runs already.
        """
        if self._session is not None:
            raise tc.SessionError("the session runs already; end it first")
        with shown_progress("starting"):  # the first start on a machine compiles kernels, for half a minute or more
            self._session, self._periods = tc.VirtualTime(self._configuration), 0
            self._blocks: list[NDArray[np.void]] = []
            self._advance(max(1, self._session.lead))
        self._begin_ns = self._session.now_ns

    def end(self) -> None:
        """End the session, and make its recording if one is wanted.

        Raises:
            SessionError: It does not run.
            RecordingError: The directory exists, or cannot be written.
        """
        session, self._session = self._running, None
        if self._bag:
            ticks = session.now_ns // TICK_NS
            record_blocks(session, self._configuration, Path(self._bag), self._blocks, ticks)

    @property
    def _running(self) -> tc.VirtualTime:
        if self._session is None:
            raise tc.SessionError("no session runs; begin one first")
        return self._session

    @property
    def _given(self) -> Any:
        return self._running.stages[self._stage].arguments[1]

    def _advance(self, ticks: int) -> None:
        block = self._running.run(ticks)
        self._row = block[-1].copy()
        if self._bag:
            self._blocks.append(block)

    def _advance_period(self) -> None:
        """Go on to the next call of the loop; periods are whole ticks and drift from none."""
        self._periods += 1
        until_ns = self._begin_ns + self._periods * _SECOND_NS // self._fps
        self._advance((until_ns - self._running.now_ns) // TICK_NS)

    def _named(self, joints: NDArray[np.float64]) -> dict[str, float]:
        return dict(zip(self.joint_keys, joints.tolist(), strict=True))


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
        from teleop_scene.camera import View as OfScene
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
        super().__init__(GIVEN_JOINTS, robot, scenario, (*settings, *fresh), fps, bag)
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
        return (*self.joint_keys, *_FORCE)

    def observe(self) -> dict[str, Any]:
        """Measured joints, force on the tip and pictures (height, width, 3), of the last tick; no time passes."""
        self._running  # noqa: B018 raises without a session
        joints = self._row["slave_measured_js"][: len(self.joint_names)]
        force = self._row["slave_measured_cf"][:3]
        found: dict[str, Any] = self._named(joints) | dict(zip(_FORCE, force.tolist(), strict=True))
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
        given, session = self._given, self._running
        if set(action) != set(self.joint_keys) or not np.isfinite(list(action.values())).all():
            needed = f"a finite number for each of {', '.join(self.joint_keys)}, and no other"
            raise tc.ParameterError("action", dict(action), needed)
        given["joints"] = [action[key] for key in self.joint_keys]
        given["stamp_ns"] = session.now_ns + TICK_NS
        self._advance_period()
        slave: Any = session.stages["slave"]
        return self._named(slave.motion.goal)


class MasterSide(Side):
    """The master, from the hand to the joint references that it asks of a slave.

    The session has a simulated slave of its own, which the hand sees and feels until a force is given.
    """

    feedback_keys = _FORCE

    def __init__(
        self, robot: str = "", scenario: str = "", settings: Sequence[str] = (), fps: int = 30, bag: str = ""
    ) -> None:
        super().__init__(GIVEN_FORCE, robot, scenario, settings, fps, bag)

    def next_action(self) -> dict[str, float]:
        """Let one period pass, and tell the joint references at its end [rad or m].

        Raises:
            SessionError: No session runs.
        """
        self._advance_period()
        return self._named(self._row["slave_servo_jp"])

    def feel(self, feedback: Mapping[str, float]) -> None:
        """Give the force on the slave's tip, along slave_base [N], from the next tick on.

        Args:
            feedback: Has ``force.x``, ``force.y`` and ``force.z``; other keys are left alone, so
                that a whole observation will do.

        Raises:
            ParameterError: One of them is missing or not finite.
            SessionError: No session runs.
        """
        given, force = self._given, [feedback.get(key, np.nan) for key in _FORCE]
        if not np.isfinite(force).all():
            raise tc.ParameterError("feedback", dict(feedback), f"finite {', '.join(_FORCE)}")
        given["wrench"][:3], given["is_given"] = force, True


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
