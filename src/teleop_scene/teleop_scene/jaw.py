"""Jaw of an arm in a scene: the joints of its gripper, which follow ``slave/jaw/setpoint_js``.

A model does not say which joints are a gripper, nor which end of their range is open. Here every joint counts that a
position actuator moves and that lies behind the last joint of the arm. Its open end is the one at which the shapes that
it moves are farther from the tip.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import mujoco
import numpy as np

from teleop_core.base import ParameterError, UnknownNameError
from teleop_core.kernels import Array
from teleop_core.kernels.fields import Integers
from teleop_scene import actuators, chain
from teleop_scene.arm import SceneRobot


@dataclass(frozen=True, eq=False)
class Jaw:
    """Joints of a gripper.

    Attributes:
        joints: The model's joints (m,).
        places: Rows (2, m): actuators, and places of the joints among the positions of the model.
        ends: Rows (2, m): positions of the closed and of the open joints [rad, m].
        gears: Control of the actuator divided by the position of the joint (m,).
    """

    joints: Integers
    places: Integers
    ends: Array
    gears: Array

    @staticmethod
    def none() -> "Jaw":
        """A jaw without joints."""
        nothing = np.zeros(0, np.int64)
        return Jaw(nothing, np.zeros((2, 0), np.int64), np.zeros((2, 0)), np.zeros(0))


def jaw_of(
    model: mujoco.MjModel, robot: SceneRobot, names: Sequence[str] = (), opened: Sequence[float] = ()
) -> Jaw | None:
    """Jaw of an arm; None if its model has none.

    Args:
        model: The model.
        robot: The arm.
        names: Joints of the gripper; empty for all that a position actuator moves behind the last joint of the arm.
        opened: Position of each joint when the jaw is open; empty to find it.

    Raises:
        UnknownNameError: There is no such joint.
        ParameterError: A joint has no position actuator, or the number of positions is not that of joints.
    """
    known = {chain.joint_name(model, j): j for j in range(model.njnt)}
    for name in names:
        if name not in known:
            raise UnknownNameError("scene.jaw", name, known)
        if not actuators.drive_of(model, known[name]).is_servo:
            raise ParameterError("scene.jaw", name, "a joint with a position actuator")
    joints = [known[name] for name in names] or _found(model, robot)
    if not joints:
        return None
    if opened and len(opened) != len(joints):
        raise ParameterError("scene.jaw_open", tuple(opened), f"{len(joints)} positions, one for each joint, or empty")
    drives = [actuators.drive_of(model, j) for j in joints]
    ends = np.array([_ends(model, robot, j, drive) for j, drive in zip(joints, drives, strict=True)]).T
    for i, value in enumerate(opened):
        ends[0, i] = ends[0, i] if abs(ends[0, i] - value) > abs(ends[1, i] - value) else ends[1, i]
        ends[1, i] = value
    own = np.array(joints, np.int64)
    places = np.array([[drive.index for drive in drives], model.jnt_qposadr[own]], np.int64)
    return Jaw(own, places, np.ascontiguousarray(ends), np.array([drive.gear for drive in drives]))


def _found(model: mujoco.MjModel, robot: SceneRobot) -> list[int]:
    last, own = robot.chain.bodies[-1], set(robot.chain.joints.tolist())
    found = []
    for j in range(model.njnt):
        is_behind = j not in own and last in chain.ancestors(model, int(model.jnt_bodyid[j]))
        if is_behind and model.jnt_type[j] in (chain.HINGE, chain.SLIDE) and model.jnt_limited[j]:
            found += [j] if actuators.drive_of(model, j).is_servo else []
    return found


def _ends(model: mujoco.MjModel, robot: SceneRobot, joint: int, drive: actuators.JointDrive) -> tuple[float, float]:
    """Positions of a closed and of an open joint, within its range and that of its control."""
    low, high = chain.limits(model, joint)
    if model.actuator_ctrllimited[drive.index]:
        asked = sorted(float(x) / drive.gear for x in model.actuator_ctrlrange[drive.index])
        low, high = max(low, asked[0]), min(high, asked[1])
    far = [_distance(model, robot, joint, value) for value in (low, high)]
    return (low, high) if far[1] >= far[0] else (high, low)


def _distance(model: mujoco.MjModel, robot: SceneRobot, joint: int, value: float) -> float:
    """Mean distance [m] of the shapes that a joint moves from the tip."""
    data = mujoco.MjData(model)
    data.qpos[:] = robot.begin
    data.qpos[model.jnt_qposadr[joint]] = value
    mujoco.mj_kinematics(model, data)
    body = int(model.jnt_bodyid[joint])
    moved = [g for g in range(model.ngeom) if body in chain.ancestors(model, int(model.geom_bodyid[g]))]
    tip = (robot.world_base @ robot.fk(robot.begin[model.jnt_qposadr[robot.chain.joints]]))[:3, 3]
    places = data.geom_xpos[moved] if moved else data.xipos[[body]]
    return float(np.linalg.norm(places - tip, axis=1).mean())
