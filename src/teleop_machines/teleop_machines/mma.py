"""MMA: the hybrid handle with seven joints that a surgeon moves, an open chain plus one parallelogram.

Joint readings q = (θ1, θ2, θ3, θ3', θ6, θ8, θ10). Links 3, 3a, 3b and 4 form the parallelogram: θ3 and θ3' are both
measured from link 2, and link 4 stays parallel to link 3a. There are three models:

- ``model="C"``, the default, has the loop; ``model="B"`` is a serial arm with dummy frames. The two models give the
  same results for joint readings.
- ``model="A"``: the conventional table, kept for comparison. It loses four offsets (the error of the tool at home is
  127 mm) and rotates the tool frame by 90°.

The source states no joint limits, sensors, drives or rates: limits of one turn about home and the drive table are
*assumed*. An MMA as a master needs only :meth:`Robot.fk`; :func:`holding_torques` is for force feedback.

Source:
    Singh 2014, Kinematic study of a spatial hybrid manipulator for robot-assisted surgery.
"""

import math

import numpy as np

from teleop_core.base import ParameterError, UnknownNameError
from teleop_core.kernels import Array, product
from teleop_core.kinematics import Kernels
from teleop_core.robots.drives import ENTRIES, Drives
from teleop_core.robots.robot import Robot, geometry_of
from teleop_machines import mma_balance, mma_forward, mma_ik, mma_models
from teleop_machines.bodies.mma_bodies import mma_bodies

JOINTS = ("theta1", "theta2", "theta3", "theta3_prime", "theta6", "theta8", "theta10")
HOME = np.radians([0.0, -90.0, 0.0, 90.0, 90.0, 0.0, 0.0])
# Result of :func:`teleop_core.robots.freedom.start_posture` for the published lengths, rounded.
START = np.array([1.2611, -0.5588, -1.012, 1.6884, 0.3097, 0.0, 0.0])

# All numbers are assumed. The inertia is that of 0.3 kg spread over the arm's 0.2 m, and of small motors at the wrist.
DRIVES = Drives(
    inertia=np.array([0.02, 0.02, 0.01, 0.01, 2e-3, 2e-3, 1e-3]),
    viscous=np.array([0.1, 0.1, 0.05, 0.05, 0.004, 0.004, 0.002]),
    coulomb=np.array([0.05, 0.05, 0.02, 0.02, 0.005, 0.005, 0.005]),
    friction_speed=np.array([2e-3, 2e-3, 2e-3, 2e-3, 2e-2, 2e-2, 2e-2]),
    effort_limit=np.array([5.0, 5.0, 3.0, 3.0, 0.5, 0.5, 0.3]),
    speed_limit=np.array([3.0, 3.0, 3.0, 3.0, 8.0, 8.0, 8.0]),
    encoder_step=np.full(7, 2.0 * math.pi / (90 * 4000)),
    bandwidth=np.array([60.0, 60.0, 60.0, 60.0, 80.0, 80.0, 80.0]),
    assumed=ENTRIES,
)


def make(model: str = "C", **geometry: float) -> Robot:
    """MMA with published lengths.

    Args:
        model: "C" or "B", the whole handle, or "A", the conventional description.
        **geometry: Symbols of table 4.4 [m]; ``theta12`` turns the tool about its z axis [rad].

    Returns:
        The robot; its tip is the end of link 7.

    Raises:
        UnknownNameError: There is no such model or symbol.
        ParameterError: A length is impossible.
    """
    if model not in mma_models.MODELS:
        raise UnknownNameError("model", model, mma_models.MODELS)
    row = geometry_of(mma_forward.GEOMETRY, (mma_forward.MODEL_A if model == "A" else {}) | geometry)
    for symbol, value in row.items():
        smallest = 1e-3 if symbol in {"a2", "a3"} else 0.0
        if symbol != "theta12" and not smallest <= value <= 1.0:
            raise ParameterError(symbol, value, f"between {smallest} and 1 m")
    return Robot(
        name="mma",
        joint_names=JOINTS,
        lower=HOME - math.pi,
        upper=HOME + math.pi,
        home=HOME,
        start=START if row == mma_forward.GEOMETRY else None,
        geometry=row,
        kernels=Kernels(fk=mma_forward.fk, jacobian=mma_forward.jacobian, ik=mma_ik.ik, ik_all=mma_ik.ik_all),
        drives=DRIVES,
        describe=mma_bodies,
    )


def holding_torques(robot: Robot, q: object, wrench: object, spring: mma_balance.ShoulderSpring | None = None) -> Array:
    """Joint torques with which the handle is at rest and applies a wrench to the hand.

    The source gives masses of the links but no mass centres. So the gravity torque is known only for joint 2, and only
    in poses in which the links after the shoulder have their orientation of home. All other joints count as balanced.

    Args:
        robot: The MMA.
        q: Joint readings (7,) [rad].
        wrench: Force on the hand [N], then moment about the tip [N·m], (6,) in base axes.
        spring: Spring at joint 2; None for the published spring.

    Returns:
        Torques (7,) [N·m].

    Raises:
        ShapeError: ``q`` is not (7,), or ``wrench`` is not (6,).
        ParameterError: ``q`` or ``wrench`` contains NaN or infinity.
    """
    push, joints = mma_models.vector("wrench", wrench, 6), mma_models.vector("q", q, 7)
    torques = product(robot.jacobian(joints).T, push)
    torques[1] -= mma_balance.shoulder_load(joints[1], spring).residual
    return torques
