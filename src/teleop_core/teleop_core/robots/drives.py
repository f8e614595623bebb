"""Drives and dynamics of slaves: what their motors can do, and how their links move."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from teleop_core.base import ParameterError, ShapeError, UnknownNameError
from teleop_core.kernels import Array, kernel
from teleop_core.robots.inertias import LinkInertia, check_possible

_ROW = "float64[::1]"
# Kernel signatures, shared by all robots, so that one compiled slave can move any robot; the arguments: see Dynamics.
ACCELERATION = f"void({_ROW}, {_ROW}, {_ROW}, {_ROW}, {_ROW})"
GRAVITY = f"void({_ROW}, {_ROW}, {_ROW})"
AccelerationKernel: TypeAlias = Callable[[Array, Array, Array, Array, Array], None]
GravityKernel: TypeAlias = Callable[[Array, Array, Array], None]

ENTRIES = (
    "inertia",
    "viscous",
    "coulomb",
    "friction_speed",
    "effort_limit",
    "speed_limit",
    "encoder_step",
    "bandwidth",
)
MAY_BE_ZERO = ("viscous", "coulomb")


def read_only(name: str, values: object, shape: tuple[int, ...] | None = None) -> Array:
    """Read-only copy of finite numbers.

    Raises:
        ShapeError: ``values`` is not a vector, or does not have the wanted shape.
        ParameterError: A value is NaN or infinite.
    """
    array = np.array(values, dtype=np.float64)
    if array.ndim != 1 or (shape is not None and array.shape != shape):
        raise ShapeError(name, shape or "(n,)", array.shape)
    if not np.isfinite(array).all():
        raise ParameterError(name, array.tolist(), "finite")
    array.setflags(write=False)
    return array


@dataclass(frozen=True, kw_only=True, eq=False)
class Drives:
    """Drive table of a slave, one entry per joint, (n,) each; the arrays are read-only copies.

    Args:
        inertia: Reflected inertia of the motor plus the inertia of the links at home [kg·m² or kg], > 0.
        viscous: Viscous friction [N·m·s/rad or N·s/m], >= 0.
        coulomb: Dry friction [N·m or N], >= 0.
        friction_speed: Speed at which dry friction reaches 70 % of its value [rad/s or m/s], > 0.
        effort_limit: Largest torque or force of the motor at the joint [N·m or N], > 0.
        speed_limit: Largest speed [rad/s or m/s], > 0.
        encoder_step: Resolution of the encoder [rad or m], > 0.
        bandwidth: Triple closed-loop pole of the default PID gains [rad/s], > 0.
        assumed: Names of the entries above that no source states for at least one joint.

    Raises:
        ShapeError: Entries are not vectors of one length.
        ParameterError: A value is impossible.
        UnknownNameError: A name in ``assumed`` is not an entry.
    """

    inertia: Array
    viscous: Array
    coulomb: Array
    friction_speed: Array
    effort_limit: Array
    speed_limit: Array
    encoder_step: Array
    bandwidth: Array
    assumed: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        for name in ENTRIES:
            array = read_only(name, getattr(self, name), np.shape(self.inertia))
            needed = ">= 0" if name in MAY_BE_ZERO else "> 0"
            if not ((array >= 0.0) if name in MAY_BE_ZERO else (array > 0.0)).all():
                raise ParameterError(name, array.tolist(), f"{needed} for every joint")
            object.__setattr__(self, name, array)
        for name in self.assumed:
            if name not in ENTRIES:
                raise UnknownNameError("assumed", name, ENTRIES)

    def entries(self) -> dict[str, Array]:
        """Entries by name, (n,) each."""
        return {name: getattr(self, name) for name in ENTRIES}


@dataclass(frozen=True, kw_only=True, eq=False)
class Dynamics:
    """Rigid-body model of a slave over its ``parameters`` row; arrays are read-only copies.

    ``acceleration(q, dq, effort, parameters, ddq)`` and ``gravity(q, parameters, effort)`` write their result into
    their last argument (n,). Each is a kernel or a plain Python function. Kernels accept only writable arrays, so pass
    a copy of ``parameters``.

    Args:
        acceleration: Joint accelerations under the net effort.
        gravity: Effort [N·m or N] that holds the arm at rest.
        parameters: Numbers that ``acceleration`` and ``gravity`` read, in the model's own order.
        compensated: Whether the published controller compensates the gravity of each axis by feed-forward (n,).
        links: Inertias of the links from which these numbers were computed; () if the model has none.
        frames: Frames of these links in the base with all joints at home, (k, 4, 4). Joint k moves the k-th frame. ()
            if the frames are unknown, or if there are no links.
        unknown: Names of the parameters that the source does not state, with their indices in ``parameters``. Their
            values for the real arm may differ (:mod:`teleop_lab.fitting`).

    Raises:
        ShapeError: ``parameters`` is not a vector, or the number of frames differs from the number of links.
        ParameterError: ``parameters`` are not finite, or no body can have the inertia of a link.
    """

    acceleration: AccelerationKernel
    gravity: GravityKernel
    parameters: Array
    compensated: NDArray[np.bool_]
    links: tuple[LinkInertia, ...] = ()
    frames: tuple[Array, ...] = ()
    unknown: Mapping[str, int] = field(default_factory=dict)

    def __post_init__(self) -> None:
        check_possible(self.links)
        if self.frames and np.shape(self.frames) != (len(self.links), 4, 4):
            raise ShapeError("frames", (len(self.links), 4, 4), np.shape(self.frames))
        object.__setattr__(self, "frames", tuple(_frozen(frame) for frame in self.frames))
        object.__setattr__(self, "parameters", read_only("parameters", self.parameters))
        object.__setattr__(self, "compensated", _frozen(self.compensated, np.bool_))


def _frozen(values: object, dtype: type = np.float64) -> NDArray[Any]:
    array: NDArray[Any] = np.array(values, dtype=dtype)
    array.setflags(write=False)
    return array


@kernel
def independent_acceleration(q: Array, dq: Array, effort: Array, inertia: Array, ddq: Array) -> None:
    """Write accelerations of axes that are dominated by their motors."""
    for i in range(ddq.shape[0]):
        ddq[i] = effort[i] / inertia[i]


@kernel
def no_gravity(q: Array, inertia: Array, effort: Array) -> None:
    """Write an effort of zero into ``effort``: the gravity of the axes is balanced."""
    for i in range(effort.shape[0]):
        effort[i] = 0.0


def independent_axes(inertia: Array) -> Dynamics:
    """Model of axes without dynamic coupling, with these inertias (n,) [kg·m² or kg].

    Raises:
        ParameterError: An inertia is not positive and finite.
    """
    if not (np.isfinite(inertia) & (np.asarray(inertia) > 0.0)).all():
        raise ParameterError("inertia", np.asarray(inertia).tolist(), "> 0 for every joint")
    return Dynamics(
        acceleration=independent_acceleration,
        gravity=no_gravity,
        parameters=inertia,
        compensated=np.zeros(len(inertia), np.bool_),
    )
