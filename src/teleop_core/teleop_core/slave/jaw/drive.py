"""Drive of the simulated jaw: its control law, and two fingers that close on an object.

Both fingers turn by the same angle, so the angle between them determines the opening of the jaw. The distance between
their pads is ``2 L sin(angle / 2)``.
"""

import math

from teleop_core.kernels import Fields, inner
from teleop_core.slave.jaw.parameters import JawSimParameters


class DriveRecord(JawSimParameters, Fields):
    """Parameter record with the jaw's drive and the object that it grips."""

    stiffness: float  # stiffness of the control law [N·m/rad]
    damping: float  # damping of the control law [N·m·s/rad]


class DriveState(Fields):
    """Fields of a state record with the position of the jaw."""

    setpoint: float  # [rad]
    angle: float  # [rad]
    velocity: float  # [rad/s]
    effort: float  # effort of the drive [N·m]
    force: float  # force of each finger on the object [N]
    is_between: int  # whether the object is between the fingers


@inner
def width(p: DriveRecord, angle: float) -> float:
    """Distance between the pads [m] at an angle [rad]."""
    return 2.0 * p.finger_length * math.sin(0.5 * angle)


@inner
def drive(p: DriveRecord, s: DriveState, setpoint_speed: float, dt: float) -> None:
    """Advance the jaw by a tick: by a PD law within the drive's limit, and by the push of an object between the pads.

    The law's effort is constant during the tick. The object's push is evaluated at the end of the tick (backward
    Euler). So a stiff object gives no energy to the jaw for any ``dt``.
    """
    asked = p.stiffness * (s.setpoint - s.angle) + p.damping * (setpoint_speed - s.velocity)
    s.effort = min(max(asked, -p.effort_limit), p.effort_limit)
    momentum = p.inertia * s.velocity + dt * s.effort
    resisted = p.inertia + dt * p.viscous
    velocity, s.force = momentum / resisted, 0.0
    if s.is_between:
        lever = p.finger_length * math.cos(0.5 * s.angle)
        depth = p.object.size - width(p, s.angle)
        pushed = momentum + dt * lever * p.object.stiffness * depth
        # The damper works only after the first touch: a tick that begins without contact has no damper.
        pad_damping = p.object.damping if depth > 0.0 else 0.0
        given = (dt * p.object.stiffness + pad_damping) * lever
        against = pushed / (resisted + dt * lever * given)
        force = p.object.stiffness * depth - given * against
        if force > 0.0:
            velocity, s.force = against, force
    angle = s.angle + dt * velocity
    s.angle = min(max(angle, 0.0), p.upper)
    s.velocity = velocity if s.angle == angle else 0.0
