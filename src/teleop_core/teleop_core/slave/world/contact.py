"""Contact: how an object pushes the tool, and how the push reaches the joints.

The tool touches with one point, its tip, or with several points along its axis. Each point has its own record with its
surface, its bristle, and the Jacobian at the point of contact.

The position of the points relative to the object is computed once per tick. Within the tick, the surface at each point
counts as flat, and the Jacobians count as constant. So the push is computed anew for the position and speed of every
Runge-Kutta stage. A contact too stiff for one step of a tick is therefore still smooth for the integrator.
"""

import math
from typing import Annotated, Any

import numpy as np

from teleop_core.kernels import Array, PerJoint, Vector3, inner
from teleop_core.kernels.room import room
from teleop_core.shapes.basis.directions import NEAR, make_unit
from teleop_core.slave.arm import ArmParts
from teleop_core.slave.world.button import ButtonRecord, ButtonState, follow_button, push_of_button
from teleop_core.slave.world.puncture import PunctureRecord, PunctureState, follow_channel, puncture, push_in_channel


class WorldRecord(PunctureRecord, ButtonRecord):
    """Fields of a parameter record with the object's material and position, and with the tool."""

    has_world: int
    world_stiffness: float
    world_damping: float
    world_friction: float
    world_center: Vector3
    tool_length: float  # distance from the tip to the last of several points [m]
    tool_radius: float  # [m]


class ContactState(PunctureState, ButtonState):
    """Fields of a record with the contact of one point of the tool, at the start of the tick."""

    is_near: int
    touch_q: PerJoint
    touch_J: Annotated[Array, 3, "joints"]  # noqa: N815


@inner
def _bend(p: WorldRecord, s: ContactState, moved: Array, out: float, force: Array) -> float:
    """Write the force (3,) [N] that the bristle would carry, across the normal; return its square."""
    square = 0.0
    for k in range(3):
        force[k] = -p.world_stiffness * (s.stuck[k] + moved[k] - out * s.normal[k])
        square += force[k] * force[k]
    return square


@inner
def _push(p: WorldRecord, s: ContactState, moved: Array, speed: Array, force: Array) -> float:
    """Write the force (3,) [N] on a tip that moved (3,) [m] since the tick began, at a speed (3,).

    Along the normal acts a spring with the damper of Hunt and Crossley. The spring never pulls, and its push is at most
    the puncture force; for a button the spring begins at the stop. Across the normal acts a bristle of the same
    stiffness. The bristle bends until its force equals the dry friction, and then slips. In a channel, the needle's
    push acts along the channel. Across the channel acts the bristle, without slip.

    Returns:
        The component of the force along the normal [N].

    Source:
        Hunt and Crossley 1975, with exponent 1: F = K x (1 + a dx/dt). Dry friction as that of the
        joints, see :mod:`teleop_core.slave.friction`.
    """
    out = rate = 0.0
    for k in range(3):
        out += s.normal[k] * moved[k]
        rate += s.normal[k] * speed[k]
    if s.is_open:
        normal_force = push_in_channel(p, s, p.world_stiffness, out)
        _bend(p, s, moved, out, force)
        share = 1.0 if s.gap < 0.0 else 0.0
    else:
        depth = -(s.gap + out)
        pressed = max(depth - p.stroke, 0.0) if p.click_force > 0.0 else depth
        normal_force = p.world_stiffness * pressed * (1.0 - p.world_damping * rate)
        if p.click_force > 0.0:
            normal_force = max(normal_force, 0.0) + push_of_button(p, s, depth)
        if depth <= 0.0 or normal_force <= 0.0:
            force[0] = force[1] = force[2] = 0.0
            return 0.0
        if p.puncture_force > 0.0:
            normal_force = min(normal_force, p.puncture_force)
        most = p.world_friction * normal_force
        asked = math.sqrt(_bend(p, s, moved, out, force))
        share = most / asked if asked > most else 1.0
    for k in range(3):
        force[k] = share * force[k] + normal_force * s.normal[k]
    return normal_force


@inner
def _add_push(p: WorldRecord, s: ContactState, q: Array, dq: Array, effort: Array) -> None:
    """Add the joint efforts of the push on one point; see :func:`add_push`."""
    moved, speed, force = np.zeros(3), np.zeros(3), room(3)
    for i in range(q.shape[0]):
        for k in range(3):
            moved[k] += s.touch_J[k, i] * (q[i] - s.touch_q[i])
            speed[k] += s.touch_J[k, i] * dq[i]
    _push(p, s, moved, speed, force)
    for i in range(q.shape[0]):
        for k in range(3):
            effort[i] += s.touch_J[k, i] * force[k]


@inner
def add_push(p: WorldRecord, contacts: Any, q: Array, dq: Array, effort: Array) -> None:
    """Add the joint efforts caused by the object: the transposed Jacobian of each point times its push.

    Args:
        p: Parameters.
        contacts: :class:`ContactState` of each point of the tool (N,).
        q: Joints of the links (n,) [rad or m].
        dq: Speeds of the joints (n,) [rad/s or m/s].
        effort: Joint efforts (n,) [N·m or N]; the push is added.
    """
    for point in range(contacts.shape[0]):
        if contacts[point].is_near:
            _add_push(p, contacts[point], q, dq, effort)


@inner
def _slide(s: ContactState, q: Array) -> None:
    """Move the bristle with the tip to joints ``q`` (n,), by the tip's motion since the last tick."""
    for k in range(3):
        for i in range(q.shape[0]):
            s.stuck[k] += s.touch_J[k, i] * (q[i] - s.touch_q[i])


@inner
def _lay_flat(s: ContactState) -> None:
    """Keep only the component of the bristle's bend in the surface."""
    out = 0.0
    for k in range(3):
        out += s.normal[k] * s.stuck[k]
    for k in range(3):
        s.stuck[k] -= out * s.normal[k]


@inner
def _begin_at(s: ContactState, arm: ArmParts, lever: Array, q: Array, dq: Array, speed: Array) -> None:
    """Store surface and Jacobian of the tick at the point of contact, which is ``lever`` (3,) off the tip.

    Writes the speed (3,) of that point.
    """
    for k in range(3):
        s.normal[k] = arm.normal[k]
        a, b = (k + 1) % 3, (k + 2) % 3
        for i in range(q.shape[0]):
            s.touch_J[k, i] = arm.J[k, i] + arm.J[3 + a, i] * lever[b] - arm.J[3 + b, i] * lever[a]
            speed[k] += s.touch_J[k, i] * dq[i]
    for i in range(q.shape[0]):
        s.touch_q[i] = q[i]


@inner
def _keep_bend(p: WorldRecord, s: ContactState, force: Array) -> None:
    """Limit the bend of the bristle to the dry friction for a push (3,) [N]; the rest of the motion is slip.

    Without contact the push is zero, and so the bend becomes zero.
    """
    push = 0.0
    for k in range(3):
        push += s.normal[k] * force[k]
    for k in range(3):
        s.stuck[k] = (push * s.normal[k] - force[k]) / p.world_stiffness


@inner
def _touch_at(
    p: WorldRecord, s: ContactState, arm: ArmParts, has_jacobian: bool, lever: Array, q: Array, dq: Array, force: Array
) -> bool:
    """Find the position of one point relative to the object, and write the push on it (3,) [N].

    Args:
        p: Parameters.
        s: State of the point; written.
        arm: As in :func:`touch`.
        has_jacobian: Whether ``arm.J`` already belongs to this tick.
        lever: Point relative to the tip (3,) [m]; overwritten with the point of contact.
        q: Joints of the links (n,).
        dq: Their speeds (n,).
        force: Resulting force; written.

    Returns:
        Whether ``arm.J`` now belongs to this tick.
    """
    speed = np.zeros(3)
    for k in range(3):
        force[k] = 0.0
        arm.offset[k] = arm.T[k, 3] + lever[k] - p.world_center[k]
    if s.is_near:
        _slide(s, q)
    before, s.gap = s.gap, arm.distance(arm.offset, arm.shape, arm.normal) - p.tool_radius
    make_unit(arm.normal)
    if s.punctures > 0:
        follow_channel(p, s, p.world_stiffness, before, arm.offset, arm.normal)
    if p.click_force > 0.0:
        follow_button(p, s, before)
    s.is_near = int(s.gap < NEAR)
    if s.is_near:
        for k in range(3):
            lever[k] -= p.tool_radius * arm.normal[k]
        if not has_jacobian:
            arm.jacobian(arm.tip, arm.tip_geometry, arm.J)
            has_jacobian = True
        _begin_at(s, arm, lever, q, dq, speed)
        _lay_flat(s)
        push = _push(p, s, np.zeros(3), speed, force)
        _keep_bend(p, s, force)
        if not s.is_open:
            puncture(p, s, p.world_stiffness, push, arm.offset)
    return has_jacobian


@inner
def touch(p: WorldRecord, contacts: Any, arm: ArmParts, q: Array, dq: Array, felt: Array) -> None:
    """Find the position of the tool relative to the object, and write the wrench on its tip (6,) [N, N·m].

    The points are balls of the tool's radius. They lie evenly along its axis, which is z of the
    tip: the first is the tip, the last is ``tool_length`` behind it.

    Args:
        p: Parameters.
        contacts: :class:`ContactState` of each point (N,); written.
        arm: With ``T`` of the true tip, its joints ``tip``, ``jacobian``, ``distance`` and ``shape``; its scratch
            arrays ``offset``, ``normal`` and ``J`` are written.
        q: Joints of the links (n,) [rad or m], which move the tip from here on.
        dq: Their speeds (n,).
        felt: Sum of the forces in axes of the slave's base, and of their torques about the tip; written.
    """
    lever, force, has_jacobian = room(3), room(3), False
    for k in range(6):
        felt[k] = 0.0
    for point in range(contacts.shape[0]):
        behind = p.tool_length * point / max(contacts.shape[0] - 1, 1)
        for k in range(3):
            lever[k] = -behind * arm.T[k, 2]
        has_jacobian = _touch_at(p, contacts[point], arm, has_jacobian, lever, q, dq, force)
        for k in range(3):
            a, b = (k + 1) % 3, (k + 2) % 3
            felt[k] = felt[k] + force[k] if point else force[k]
            felt[3 + k] += lever[a] * force[b] - lever[b] * force[a]
