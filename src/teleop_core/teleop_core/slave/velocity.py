"""Velocity: the setpoint of a slave that is driven at a speed of its joints or of its tip."""

from enum import IntEnum

from teleop_core.graph import copy
from teleop_core.kernels import Array, inner
from teleop_core.kernels.room import room
from teleop_core.kinematics.damped import eliminate, gram, weigh
from teleop_core.slave import commands
from teleop_core.slave.arm import ArmModel
from teleop_core.slave.commands import SlaveRecord, SlaveState


class MotionSource(IntEnum):
    """Source of the setpoint's motion while an enabled slave does not move to a goal."""

    FOLLOWING = 0  # the setpoint follows joint references
    JOINTS = 1  # the setpoint moves with a joint velocity
    TIP = 2  # the setpoint moves with a twist of the tip


_FOLLOWING, _TIP = int(MotionSource.FOLLOWING), int(MotionSource.TIP)
# Length [m] that relates rotation to translation: 1 rad/s of the tip counts as much as this length per second.
_LENGTH = 0.1
# Damping added to the squares of the weighted singular values; assumed. With singular values of 1, it reduces speeds by
# a ten-thousandth. Near a singularity, joints are at most 50 times as fast as the weighted tip speed.
_DAMPING = 1e-4


@inner
def joint_speeds(arm: ArmModel, q: Array, twist: Array, speed: Array) -> None:
    """Write the joint speeds (n,) that follow a twist best in the damped least-squares sense.

    ``dq = Jᵀ (J Jᵀ + damping I)⁻¹ v``, with the linear rows of J and v divided by a length. Near a singularity the tip
    lags, and the joints stay slow. Components of the twist in directions that the robot does not control are left out.

    Args:
        arm: Arm with ``jacobian`` and ``geometry``; its scratch arrays ``J`` and ``is_free`` are written.
        q: Joints (n,) [rad or m].
        twist: Twist of the tip (6,) in base axes [m/s, rad/s].
        speed: Joint speeds (n,) [rad/s or m/s]; written.

    Source:
        Nakamura and Hanafusa 1986, eq. 15.
    """
    A, b = room(6, 6), room(6)
    arm.jacobian(q, arm.geometry, arm.J)
    weigh(arm.J, _LENGTH)
    for r in range(6):
        b[r] = twist[r] / _LENGTH if r < 3 else twist[r]
    for i in range(q.shape[0]):
        arm.is_free[i] = 1.0
    gram(arm.J, arm.is_free, _DAMPING, A)
    eliminate(A, b)
    for i in range(q.shape[0]):
        speed[i] = 0.0
        for r in range(6):
            speed[i] += arm.J[r, i] * b[r]


@inner
def _share_of_limits(p: SlaveRecord, s: SlaveState, dt: float) -> float:
    """Largest factor, at most 1, by which the wanted speeds stay within speed limits and, for a twist, joint limits."""
    share = 1.0
    for i in range(s.drive.shape[0]):
        fast = abs(s.drive[i])
        most = p.speed_limit[i]
        if s.motion == _TIP:
            up = s.drive[i] > 0.0
            left = p.upper[i] - s.setpoint[i] if up else s.setpoint[i] - p.lower[i]
            most = min(most, commands.stoppable(left, p.braking[i] * dt * dt) / dt)
        if fast > most:
            share = min(share, most / fast)
    return share


@inner
def advance_velocity(p: SlaveRecord, s: SlaveState, arm: ArmModel, now_ns: int, dt: float) -> None:
    """Move the setpoint at the wanted speed; without a fresh command the setpoint brakes to rest.

    All joints stay within their speed limits, change their speed no faster than their drives can brake, and stop at
    their joint limits. If the joints are too slow for the wanted twist, the tip moves more slowly in the same
    direction.

    Args:
        p: Parameters.
        s: State; the setpoint is written.
        arm: As in :func:`joint_speeds`.
        now_ns: Time of the tick [ns].
        dt: Tick [s].
    """
    n = s.setpoint.shape[0]
    is_stale = now_ns - s.driven_ns > p.timeout_ns
    if is_stale:
        for i in range(n):
            s.drive[i] = 0.0
    elif s.motion == _TIP:
        copy(s.setpoint, arm.joints)
        joint_speeds(arm, arm.joints, s.twist, s.drive)
    share, change = _share_of_limits(p, s, dt), 1.0
    for i in range(n):
        most = p.braking[i] * dt * dt
        off = abs(share * s.drive[i] * dt - s.step[i])
        if off > most:
            change = min(change, most / off)
    is_still = True
    for i in range(n):
        most = p.braking[i] * dt * dt
        step = s.step[i] + change * (share * s.drive[i] * dt - s.step[i])
        step = min(step, commands.stoppable(p.upper[i] - s.setpoint[i], most))
        step = max(step, -commands.stoppable(s.setpoint[i] - p.lower[i], most))
        commands.move_joint(p, s, i, step, dt)
        is_still = is_still and s.step[i] == 0.0
    commands.forget_way(s)
    if is_stale and is_still:
        s.motion = _FOLLOWING
