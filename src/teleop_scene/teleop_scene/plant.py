"""Plant ``scene``: the arm of a MuJoCo model, moved by MuJoCo among the bodies of its scene.

Our control law gives efforts to motors, or to joints without an actuator. If all joints have position servos of the
model and no motor, these follow the setpoint. Brakes are dry friction that the model gets while they hold.
"""

from typing import Any

import numpy as np

from teleop_core.base import ParameterError
from teleop_core.graph import Row, topics
from teleop_core.kernels import Addressed, Array, Fields, addressed, inner, kernel, record
from teleop_core.kernels.fields import Integers
from teleop_core.robots.robot import Robot
from teleop_core.slave.arm import ArmParts
from teleop_scene import actuators
from teleop_scene.arm import SceneRobot
from teleop_scene.chain import ancestors, is_puppet
from teleop_scene.scene import SceneState, advance, leave, shared

_BRAKED = topics.OPERATION.index("is_braked")
_FIRM = 0.9999  # impedance of the friction of a brake, the largest that MuJoCo uses, so that it hardly creeps
_BRAKE = 2.0  # friction of a brake, divided by the effort limit of its drive


class ArmState(Fields):
    """State record of an arm in a scene."""

    ticks: int
    has_servos: int


@kernel
def see(
    s: SceneState,
    own: ArmState,
    scene: tuple[Array, Array, Array, Array],
    places: Integers,
    ratios: Array,
    bodies: Integers,
    forces: Array,
    center: Array,
    R: Array,
    arm: ArmParts,
    row: Row,
) -> None:
    """Write an arm's joints, and the force on its tip, at the beginning of a tick.

    The force is the sum of all contacts of the bodies behind the last joint in the last step. Its torque is about the
    tip.

    Args:
        s: State of the scene; written.
        own: State of the arm; written.
        scene: Positions, speeds and efforts of the scene.
        places: Rows (3, n): positions, speeds and actuators of the joints in the arrays of the scene.
        ratios: Rows (5, n), see :class:`Mover`.
        bodies: Bodies behind the last joint.
        forces: Forces of contacts (nbody, 6): torque, then force, about ``center`` in axes of the world.
        center: Centre of mass of the arm (3,) in the world.
        R: Pose (4, 4) of the arm's base in the world.
        arm: The arm; its ``q``, ``dq`` and, with servos, ``effort`` are written.
        row: Signals; ``slave_true_cf`` is written.
    """
    own.ticks += 1
    if own.ticks > s.ticks + 1:
        advance(s, scene[0], scene[1], scene[2], scene[3])
    for i in range(arm.q.shape[0]):
        if s.is_lost != 0:
            arm.dq[i] = 0.0
            continue
        arm.q[i], arm.dq[i] = scene[0][places[0, i]], scene[1][places[1, i]]
        if own.has_servos != 0:
            arm.effort[i] = scene[2][places[1, i]]
    _feel(bodies, forces, center, R, arm, row)


@inner
def _feel(bodies: Integers, forces: Array, center: Array, R: Array, arm: ArmParts, row: Row) -> None:
    """Write the force on the tip in axes of the base, and its torque about the tip."""
    F, M, tip = np.zeros(3), np.zeros(3), np.zeros(3)
    for k in range(bodies.shape[0]):
        for i in range(3):
            M[i] += forces[bodies[k], i]
            F[i] += forces[bodies[k], 3 + i]
    arm.tip_fk(arm.q, arm.tip_geometry, arm.T)
    for i in range(3):
        tip[i] = R[i, 3]
        for j in range(3):
            tip[i] += R[i, j] * arm.T[j, 3]
    for i in range(3):
        a, b = (i + 1) % 3, (i + 2) % 3
        M[i] += (center[a] - tip[a]) * F[b] - (center[b] - tip[b]) * F[a]
    for i in range(3):
        row.slave_true_cf[i] = row.slave_true_cf[3 + i] = 0.0
        for j in range(3):
            row.slave_true_cf[i] += R[j, i] * F[j]
            row.slave_true_cf[3 + i] += R[j, i] * M[j]


@kernel
def move(
    own: ArmState,
    places: Integers,
    ratios: Array,
    control: Array,
    efforts: Array,
    friction: tuple[Array, Array],
    arm: ArmParts,
    row: Row,
) -> None:
    """Give the scene what moves an arm in the coming tick.

    Args:
        own: State of the arm.
        places: Rows (3, n), as in :func:`see`.
        ratios: Rows (5, n), see :class:`Mover`.
        control: Controls (nu,) of the scene's actuators; written.
        efforts: Efforts (nv,) on joints without an actuator; written.
        friction: Dry friction (nv,) of the scene's joints, and how firm it is (nv, 5); written.
        arm: The arm.
        row: Signals.
    """
    is_braked = row.slave_operation[_BRAKED] > 0.0
    for i in range(arm.q.shape[0]):
        dof, actuator = places[1, i], places[2, i]
        friction[0][dof] = ratios[1, i] + (ratios[2, i] if is_braked else 0.0)
        friction[1][dof, 0], friction[1][dof, 1] = ratios[3, i], ratios[4, i]
        if is_braked:
            friction[1][dof, 0] = friction[1][dof, 1] = _FIRM
        if own.has_servos != 0:
            control[actuator] = ratios[0, i] * (arm.q[i] if is_braked else arm.setpoint[i])
        elif actuator >= 0:
            control[actuator] = ratios[0, i] * arm.effort[i]
        else:
            efforts[dof] = arm.effort[i]


class Mover:
    """Arm in a scene.

    The rows of ``ratios`` (5, n) are: control divided by effort, or by position for servos; dry friction; friction that
    the brakes add; the least and the largest impedance of dry friction.
    """

    see: Addressed
    move: Addressed

    def __init__(self, robot: SceneRobot, arm: ArmParts, row: Any, dt: float) -> None:
        self.scene = scene = shared(robot.file, dt, robot.chain.tip)
        self._robot, self._arm, model = robot, arm, scene.model
        joints = robot.chain.joints
        drives = [actuators.drive_of(model, j) for j in joints.tolist()]
        self.has_servos = actuators.servos_of(drives) and robot.drive == "model"
        if not self.has_servos:
            drives = [d if not d.is_servo else actuators.JointDrive() for d in drives]
        self._free_from_others(drives)
        self._own = own = record(ArmState)
        own["has_servos"] = self.has_servos
        dofs = model.jnt_dofadr[joints]
        places = np.array([model.jnt_qposadr[joints], dofs, [d.index for d in drives]], np.int64)
        scale = [d.gear if d.is_servo else 1.0 / (d.gear * d.gain) for d in drives]
        firm = model.dof_solimp[dofs, :2].T
        ratios = np.array([scale, model.dof_frictionloss[dofs], _BRAKE * arm.limit, *firm], np.float64)
        last = int(model.jnt_bodyid[joints[-1]])
        bodies = np.array([b for b in range(model.nbody) if last in ancestors(model, b)], np.int64)
        center = scene.data.subtree_com[model.body_rootid[last]]
        self.see = addressed(
            see, scene.state, own, scene.arrays, places, ratios, bodies, scene.data.cfrc_ext, center,
            robot.world_base.copy(), arm, row,
        )  # fmt: skip
        data = scene.data
        self.move = addressed(
            move,
            own,
            places,
            ratios,
            data.ctrl,
            data.qfrc_applied,
            (model.dof_frictionloss, model.dof_solimp),
            arm,
            row,
        )
        self._slowness = scene.slowness()

    def _free_from_others(self, drives: list[actuators.JointDrive]) -> None:
        """Switch off actuators and pulling mocap bodies whose work the arm's drives do."""
        model = self.scene.model
        for joint, drive in zip(self._robot.chain.joints.tolist(), drives, strict=True):
            for i in actuators.replaced(model, joint, drive):
                model.actuator_gainprm[i] = model.actuator_biasprm[i] = 0.0
        for i in range(model.neq):
            if is_puppet(model, i):
                model.eq_active0[i] = 0

    def reset(self) -> None:
        """Return to the state before the first tick, with the arm where it is."""
        self._own["ticks"] = 0
        self.scene.place(self._robot.chain.joints, self._arm.q)
        self.scene.reset()

    def close(self) -> None:
        """Let no other stage share the scene of a trial."""
        leave(self.scene)

    def concerns(self) -> list[str]:
        """Report a scene that is unstable, or too slow for a live session."""
        return [text for text in (self.scene.problem(), self._slowness) if text]


def mover(robot: Robot, arm: ArmParts, row: Any, dt: float) -> Mover:
    """Mover of an arm in a scene.

    Raises:
        ParameterError: The robot is no arm of a scene.
    """
    if not isinstance(robot, SceneRobot):
        raise ParameterError("slave_sim.plant.kind", "scene", f"used with robot=SCENE.xml, not {robot.name}")
    return Mover(robot, arm, row, dt)
