"""Actuators: what a model's drives do at the joints of an arm."""

from dataclasses import dataclass

import mujoco

_OF_JOINTS = (int(mujoco.mjtTrn.mjTRN_JOINT), int(mujoco.mjtTrn.mjTRN_JOINTINPARENT))
_FIXED, _AFFINE = int(mujoco.mjtGain.mjGAIN_FIXED), int(mujoco.mjtBias.mjBIAS_AFFINE)
_NO_BIAS, _NO_DYNAMICS = int(mujoco.mjtBias.mjBIAS_NONE), int(mujoco.mjtDyn.mjDYN_NONE)


@dataclass(frozen=True, kw_only=True)
class JointDrive:
    """Actuator of a joint.

    Attributes:
        index: The model's actuator; -1 for a joint without one, or with one that our effort replaces.
        is_servo: Whether it follows a position; otherwise it is a motor, whose effort is ``gear * gain * ctrl``.
        gear: Length of the actuator divided by the position of the joint.
        gain: Force for each unit of its control.
        effort_limit: Largest effort at the joint [N·m or N]; infinite if the model states none.
    """

    index: int = -1
    is_servo: bool = False
    gear: float = 1.0
    gain: float = 1.0
    effort_limit: float = float("inf")


def drive_of(model: mujoco.MjModel, joint: int) -> JointDrive:
    """Drive of a joint: its motor, or its position servo if it has no motor."""
    found = [drive for i in range(model.nu) if (drive := _drive(model, i, joint)) is not None]
    most = float("inf")
    if model.jnt_actfrclimited[joint]:
        most = float(abs(model.jnt_actfrcrange[joint]).max())
    found.sort(key=lambda drive: drive.is_servo)
    return found[0] if found else JointDrive(effort_limit=most)


def servos_of(drives: list[JointDrive]) -> bool:
    """Whether an arm is driven by its model's position servos: all of its joints have one, and none has a motor."""
    return all(drive.is_servo for drive in drives)


def replaced(model: mujoco.MjModel, joint: int, kept: JointDrive) -> list[int]:
    """Actuators of a joint that another drive replaces."""
    return [i for i in range(model.nu) if _acts_on(model, i, joint) and i != kept.index]


def _acts_on(model: mujoco.MjModel, actuator: int, joint: int) -> bool:
    return model.actuator_trntype[actuator] in _OF_JOINTS and model.actuator_trnid[actuator, 0] == joint


def _drive(model: mujoco.MjModel, i: int, joint: int) -> JointDrive | None:
    """The actuator as a drive of the joint; None if it is no motor or servo of this joint."""
    if not _acts_on(model, i, joint) or model.actuator_gaintype[i] != _FIXED:
        return None
    gain, gear, bias = float(model.actuator_gainprm[i, 0]), float(model.actuator_gear[i, 0]), model.actuator_biasprm[i]
    is_motor = model.actuator_biastype[i] == _NO_BIAS and model.actuator_dyntype[i] == _NO_DYNAMICS
    is_servo = model.actuator_biastype[i] == _AFFINE and gain > 0.0 and abs(gain + bias[1]) < 1e-6 * gain
    if not (is_motor or is_servo) or gain == 0.0 or gear == 0.0:
        return None
    limits = [float("inf")]
    if model.actuator_forcelimited[i]:
        limits.append(float(abs(model.actuator_forcerange[i]).max() * abs(gear)))
    if model.actuator_ctrllimited[i] and is_motor:
        limits.append(float(abs(model.actuator_ctrlrange[i]).max() * abs(gear * gain)))
    if model.jnt_actfrclimited[joint]:
        limits.append(float(abs(model.jnt_actfrcrange[joint]).max()))
    return JointDrive(index=i, is_servo=bool(is_servo), gear=gear, gain=gain, effort_limit=min(limits))
