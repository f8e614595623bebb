"""Arm: the arm data that the kernels of server and simulator use, with scratch arrays."""

from typing import Any, NamedTuple

from teleop_core.kernels.geometry import Array


class ArmModel(NamedTuple):
    """The server's model of its arm: pointers, plain arrays, and scratch arrays for kernels."""

    fk: Any
    jacobian: Any
    geometry: Array
    setpoint: Array  # the next arrays are scratch arrays for joints (n,)
    joints: Array
    effort: Array
    T: Array
    is_free: Array  # scratch arrays for following a twist: (n,) and (6, n)
    J: Array


class ArmParts(NamedTuple):
    """Model, control law and motion of the arm: pointers and plain arrays, which kernels take."""

    tip_fk: Any  # forward kinematics of the links as built
    jacobian: Any  # Jacobian of the links as built
    distance: Any  # distance of the object that the tool can touch
    acceleration: Any
    gravity: Any
    control: Any
    tip_geometry: Array
    coupling: Array
    dynamics: Array
    model: Array  # the dynamics that the control law knows
    gains: Array
    memory: Array  # memory of the control law
    q: Array  # joint positions (n,) at the encoders, unrounded
    dq: Array
    effort: Array
    setpoint: Array
    measured: Array
    feedforward: Array  # (n,); (2 n + n²,) for control laws that use the model
    limit: Array
    joints: Array  # scratch array for joints
    tip: Array  # true joint positions (n,), behind the transmission
    T: Array
    shape: Array  # numbers of the object
    contacts: Any  # ContactState of each point of the tool (N,)
    offset: Array  # scratch arrays for the force on the tool: (3,), (3,) and (6, n)
    normal: Array
    J: Array
    noises: Array  # noise of the force sensor in the coming ticks (N, 6)
