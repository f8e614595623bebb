"""Arm of a scene: the chain of hinge and slide joints of a MuJoCo model as a robot.

The base of the arm is the body that carries its first joint. The tip is a site or a body. Kinematics and inertias are
those of the model. Bodies that other joints move, such as fingers, count as fixed to their link. Limits, damping, dry
friction and armature of the joints become entries of the drive table, and so do the limits of their actuators.
"""

import math
from dataclasses import dataclass
from functools import lru_cache, partial
from pathlib import Path

import mujoco
import numpy as np

from teleop_core.base import UnknownNameError
from teleop_core.kernels import Array, length
from teleop_core.kernels.fields import Integers
from teleop_core.kinematics import DIRECTIONS
from teleop_core.kinematics.closed_form.decomposition import solution_of
from teleop_core.robots.arms import dh_chain, dh_drives
from teleop_core.robots.drives import Drives
from teleop_core.robots.dynamics.chain_dynamics import chain_dynamics, chain_row, inertia_matrix
from teleop_core.robots.freedom import start_of
from teleop_core.robots.rank import directions_of
from teleop_core.robots.robot import Robot
from teleop_core.robots.visual import Surrounding
from teleop_scene import actuators, chain, models
from teleop_scene.looks import surroundings_of

DRIVES = ("model", "effort")
"""What moves the joints of an arm, see :func:`load_scene`."""
_OF_CHAIN = (
    "name", "joint_names", "lower", "upper", "geometry", "row", "kernels", "drives", "task_mask", "solution",
)  # fmt: skip


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class SceneRobot(Robot):
    """An arm of a scene.

    Args:
        file: File of the scene.
        chain: Bodies and joints of the arm in the model.
        drive: What moves the joints, of :data:`DRIVES`.
        world_base: Pose (4, 4) of the base in the world of the scene.
        begin: Positions (nq,) of all joints of the model at which a session begins.
    """

    file: Path
    chain: chain.Chain
    drive: str
    world_base: Array
    begin: Array

    def surroundings(self) -> tuple[Surrounding, ...]:
        """Shapes of the whole scene."""
        return surroundings_of(models.model_of(self.file), self.begin)


def load_scene(file: Path, *, tip: str = "", base: str = "", task: str = "", drive: str = "model") -> SceneRobot:
    """Arm of a scene.

    Args:
        file: An MJCF file.
        tip: Site or body whose frame is the tip; empty for the site ``tip``, or else for the only site of an arm.
        base: Body that carries the arm; empty for the one that carries the first joint. Joints before it stay where
            the model holds them.
        task: Directions that the arm controls, separated by blanks or commas; empty for all in which it can move.
        drive: What moves the joints: "model" for the model's motors, or for its position servos if it has no motors;
            "effort" for the control law in place of servos.

    Returns:
        The robot. Home and start are those of the model's first keyframe; without one they are a posture with room in
        all directions. Limits and drives that the model does not state are assumed.

    Raises:
        RecordingError: The file cannot be read.
        ParameterError: The file is no model, or its arm cannot be used; the message names the element.
        UnknownNameError: There is no such site, body or direction.
    """
    if drive not in DRIVES:
        raise UnknownNameError("drive", drive, DRIVES)
    return arm_of(file, models.model_of(file), tip, base, task, drive)


@lru_cache(maxsize=32)
def arm_of(
    file: Path, model: mujoco.MjModel, tip: str = "", base: str = "", task: str = "", drive: str = "model"
) -> SceneRobot:
    """Arm of a compiled model; arguments and errors are those of :func:`load_scene`."""
    own = chain.chain_of(model, tip, base)
    chain.refuse_unusable(model, own)
    begin = np.array(model.key_qpos[0] if model.nkey else model.qpos0)
    fixed, kinds = chain.frames(model, own)
    world_base = chain.world_base(model, own, begin)
    row = chain_row(kinds, fixed, chain.bodies(model, own, begin), model.dof_armature[model.jnt_dofadr[own.joints]])
    at, n = len(kinds) + 7 + 12 * len(fixed), len(kinds)
    row[at : at + 3] = chain.gravity(model, own, world_base)
    ends = [chain.limits(model, j) for j in own.joints.tolist()]
    places = model.jnt_qposadr[own.joints]
    home = np.clip(begin[places], *np.array(ends).T)
    reach = sum(float(length(T[:3, 3])) for T in fixed)
    reach += sum(max(map(abs, end)) for end, kind in zip(ends, kinds, strict=True) if abs(kind) > 1.5)
    make = partial(
        dh_chain.chain_robot,
        name=file.stem,
        joints=[
            dh_chain.DhJoint(name=chain.joint_name(model, j), symbol="", sign=1.0, lower=low, upper=high, home=q)
            for j, (low, high), q in zip(own.joints.tolist(), ends, home.tolist(), strict=True)
        ],
        kinds=kinds,
        fixed=fixed,
        reach=reach,
        drives=_drives(model, own.joints, home, row, n),
    )
    controlled = _directions(task) or directions_of(make(task=DIRECTIONS), reach / math.pi).best
    robot = make(task=controlled, solution=solution_of(kinds, fixed, reach, controlled))
    start = home if model.nkey else start_of(robot)
    begin[places] = start
    begin.setflags(write=False)
    of_chain = {name: getattr(robot, name) for name in _OF_CHAIN}
    return SceneRobot(
        **of_chain,
        home=start,
        start=start,
        dynamics=chain_dynamics(row),
        notes=chain.touching(model, own, begin),
        file=file,
        chain=own,
        drive=drive,
        world_base=world_base,
        begin=begin,
    )


def _directions(task: str) -> tuple[str, ...]:
    names = tuple(str(task).replace(",", " ").split())
    for name in names:
        if name not in DIRECTIONS:
            raise UnknownNameError("task", name, DIRECTIONS)
    return names


def _drives(model: mujoco.MjModel, joints: Integers, home: Array, row: Array, n: int) -> Drives:
    """Drive table: what the model states; the inertia is that of the links at home with the armature."""
    M, stated, kinds = np.zeros((n, n)), list[dict[str, float]](), list[str]()
    inertia_matrix(home, row, M)
    for i, j in enumerate(joints.tolist()):
        dof = int(model.jnt_dofadr[j])
        own = {"viscous": float(model.dof_damping[dof]), "coulomb": float(model.dof_frictionloss[dof])}
        own["inertia"] = max(float(M[i, i]), 1e-9)
        most = actuators.drive_of(model, j).effort_limit
        if 0.0 < most < math.inf:
            own["effort_limit"] = most
        stated.append(own)
        kinds.append("turn" if model.jnt_type[j] == chain.HINGE else "slide")
    return dh_drives.drives_of(kinds, stated)
