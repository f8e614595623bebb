"""Model: robots and frames of a session, recorded so that other tools can draw them from the recording alone.

All frames are in ``world``: each slave's base, links and tip, and the base and stylus of its master. The master's base
is beside the slave and is turned so that stylus and tip move in the same direction. The positions of the bases
relative to each other are not measured; they are chosen for the drawing.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from teleop_core.bags.reader import Bag
from teleop_core.bags.transforms import ROBOT_DESCRIPTION, TF, WORLD, TransformMessages, text_message
from teleop_core.bags.writer import BagWriter
from teleop_core.graph.graph import RECORDER_NAME
from teleop_core.graph.topics import MASTER_MEASURED_CP, SLAVE_MEASURED_JS, Topic
from teleop_core.kernels.axes import axis_map
from teleop_core.kernels.geometry import Array, quaternion_from_rotation
from teleop_core.robots import load_robot_set
from teleop_core.robots.bodies import bodies_of, urdf_of
from teleop_core.robots.bodies.frames import pose_of
from teleop_core.robots.robot import Robot
from teleop_core.session.configuration import Configuration

SLAVE = "slave_"
"""Prefix of the names of a slave's frames."""
MASTER = "master_"
"""Prefix of the names of a master's frames."""
_HERE = np.array([0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0])
_ASIDE = 0.3  # distance from the end of a robot's reach to the middle of its master [m]
_APART = 2.0  # distance between two slaves, as a multiple of the robot's reach


@dataclass(frozen=True, eq=False)
class DrawnArm:
    """Robot, master and frames of one arm.

    Args:
        arm: Namespace of the arm; empty for the arm whose topics have no prefix.
        robot: Robot of the arm.
        base: Pose (7,) of slave_base in the world.
        master: Pose (7,) of master_base in the world.
    """

    arm: str
    robot: Robot
    base: Array
    master: Array

    def __post_init__(self) -> None:
        prefix = f"{self.arm}/" if self.arm else ""
        slave, master = prefix + SLAVE, prefix + MASTER
        names = bodies_of(self.robot).names
        frames = (
            (WORLD, f"{slave}{names[0]}"),
            *((f"{slave}{names[0]}", f"{slave}{name}") for name in names[1:]),
            (WORLD, f"{master}base"),
            (f"{master}base", f"{master}stylus"),
        )
        object.__setattr__(self, "_messages", TransformMessages(frames))

    @property
    def description(self) -> Topic:
        """Topic of the robot's URDF."""
        return ROBOT_DESCRIPTION.of_arm(self.arm)

    def urdf(self) -> bytes:
        """Message with the robot's URDF."""
        prefix = f"{self.arm}/" if self.arm else ""
        return text_message(urdf_of(self.robot, self.robot.name, prefix + SLAVE))

    def transforms(self, stamp_ns: NDArray[np.int64], joints: Array, stylus: Array) -> list[bytes]:
        """Messages with the poses of all frames of the arm.

        Args:
            stamp_ns: Stamps (N,) [ns].
            joints: Joint vectors (N, n) [rad, m].
            stylus: Poses (N, 7) in master_base; invalid poses are replaced by the origin of master_base.
        """
        count = len(stamp_ns)
        poses = np.empty((count, len(self._messages.frames), 7))  # type: ignore[attr-defined]
        poses[:, :-2] = bodies_of(self.robot).poses(joints)
        poses[:, 0], poses[:, -2], poses[:, -1] = self.base, self.master, stylus
        is_none = ~(np.abs((stylus[:, 3:] ** 2).sum(axis=1) - 1.0) < 1e-2)
        poses[is_none, -1] = _HERE
        return self._messages.encode(stamp_ns, poses)  # type: ignore[attr-defined,no-any-return]


class Model:
    """Robots of a session that other tools can draw.

    Args:
        configuration: Configuration of the session.
        rate: Messages of ``/tf`` per second; 0 for no model, None for the recorder's rate.
        namespace: Namespace of the whole session, without leading slash; the arms' namespaces are below it.

    Attributes:
        arms: Arms with a robot, the default arm first.
        period_ns: Time from one message of ``/tf`` to the next [ns].

    Raises:
        TeleopError: A robot cannot be loaded.
    """

    def __init__(self, configuration: Configuration, rate: float | None = None, namespace: str = "") -> None:
        if rate is None:
            rate = configuration.groups[RECORDER_NAME].tf_rate
        self.arms: tuple[DrawnArm, ...] = _arms(configuration, namespace) if rate else ()
        self.period_ns = round(1e9 / rate) if rate else 0

    @property
    def topics(self) -> tuple[Topic, ...]:
        """Topics that this model writes."""
        return (*(arm.description for arm in self.arms), TF) if self.arms else ()


def _arms(configuration: Configuration, namespace: str) -> tuple[DrawnArm, ...]:
    arms: list[DrawnArm] = []
    side = 0.0
    for name in configuration.graph.namespaces:
        robot = configuration.value("robot", name)
        if not isinstance(robot, str):
            continue
        loaded = load_robot_set(robot, configuration.value("geometry", name) or ())
        reach = bodies_of(loaded).size
        side -= _APART * reach if arms else 0.0
        base = _HERE.copy()
        base[1] = side
        if loaded.world_base is not None:  # arms of a scene stand where the scene has them
            base = pose_of(loaded.world_base)
        axes = configuration.value("axes", name)
        master = _master(base, reach, np.eye(3) if axes is None else axis_map("axes", axes))
        where = "/".join(filter(None, (namespace, name)))
        arms.append(DrawnArm(where, loaded, base, master))
        side -= _ASIDE
    return tuple(arms)


def _master(base: Array, reach: float, axes: Array) -> Array:
    """Pose (7,) of a master's base to the right of its slave."""
    pose = base.copy()
    pose[1] -= reach * 0.5 + _ASIDE
    quaternion_from_rotation(np.ascontiguousarray(axes), pose[3:])
    return pose


class ModelRecords:
    """Recorder of the model of a session in virtual time.

    Args:
        model: The model.
    """

    def __init__(self, model: Model) -> None:
        self._model, self._slot, self._is_new = model, -1, True

    def write(self, writer: Any, block: Any) -> None:
        """Record the model before the first block, and the frames of a block."""
        if not self._model.arms:
            return
        now_ns = block["now_ns"]
        if self._is_new:
            self._is_new = False
            for arm in self._model.arms:
                writer.write(arm.description, int(now_ns[0]), arm.urdf())
        slots = now_ns // self._model.period_ns
        rows = np.flatnonzero(np.diff(slots, prepend=self._slot))
        self._slot = int(slots[-1])
        messages = [self._of(arm, block, rows) for arm in self._model.arms]
        for at, row in enumerate(rows.tolist()):
            for found in messages:
                writer.write(TF, int(now_ns[row]), found[at])

    def _of(self, arm: DrawnArm, block: Any, rows: NDArray[np.int64]) -> list[bytes]:
        joints = block[SLAVE_MEASURED_JS.of_arm(arm.arm).field][rows, : arm.robot.n]
        stylus = block[MASTER_MEASURED_CP.of_arm(arm.arm).field][rows]
        return arm.transforms(block["now_ns"][rows], joints, stylus)


def write_model_of(bag: Bag, model: Model, writer: BagWriter) -> None:
    """Record the model of a session that was kept in memory, with the same messages as in a session recorded to disk.

    Args:
        bag: Streams of the session.
        model: Robots of the session.
        writer: Writer of the messages; the topics of the model must be announced to it.
    """
    found: list[tuple[int, bytes]] = []
    for arm in model.arms:
        names = [t.of_arm(arm.arm).name for t in (SLAVE_MEASURED_JS, MASTER_MEASURED_CP)]
        series = bag.read_many(names)
        joints, stylus = (series[name] for name in names)
        rows = np.flatnonzero(np.diff(joints.log_ns // model.period_ns, prepend=-1))
        log_ns = joints.log_ns[rows]
        at = np.searchsorted(stylus.log_ns, log_ns, side="right") - 1
        places = np.where(at[:, None] >= 0, stylus.values[at], 0.0)
        messages = arm.transforms(log_ns, joints.values[rows, : arm.robot.n], places)
        writer.write(arm.description, int(log_ns[0]), arm.urdf())
        found += zip(log_ns.tolist(), messages, strict=True)
    for when_ns, data in sorted(found, key=lambda message: message[0]):
        writer.write(TF, when_ns, data)
