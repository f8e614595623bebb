"""Operators: the motion that the hand wants, one file per kind.

The motion of an operator is requested for a block of ticks. It returns positions and rotations of the hand relative to
the rest pose of the stylus. The simulated hand then follows them, against its mass, its tremor and the device's force.
"""

from collections.abc import Callable
from dataclasses import dataclass, is_dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from teleop_core.base import NoParameters, PartError, Registry
from teleop_core.kernels.geometry import Array

if TYPE_CHECKING:
    from teleop_core.hand.input_device import Device

__all__ = ["OPERATORS", "Motion", "Operator", "Seen", "Setting", "following", "register_operator"]

Motion = Callable[[Array], Array]
"""Function from times (N,) since the start [s] to rows (N, 3), (N, 6), (N, 9), (N, 12) or (N, 13).

Columns: position x, y, z [m] and rotation vector [rad] relative to the start, in the master's base; then the buttons
clutch, fixture, mode (1 pressed); then tremor x, y, z [m], an offset of the tip that friction does not reduce; then the
closing of the jaw, from 0 to 1. Missing columns count as zero.
"""


class Seen(NamedTuple):
    """Data that an operator sees and feels, at the operator's last step.

    The attributes are views of the signals: read them when the motion is requested. An operator that reacts to them
    should have ``ahead=1``, so that its motion is requested as late as possible. The slave's values have the declared
    delay, such as ``delays=["slave/measured_cp@operator=0.3"]``.

    Attributes:
        slave: Pose (7,) of the slave's tip in the slave's base; zero before the first value arrives.
        stylus: Pose (7,) of the stylus in the master's base.
        force: Force and torque (6,) of the device on the hand.
        state: Numbers of ``teleop/state``, as :data:`~teleop_core.graph.topics.TELEOP_STATE` names them.
        task: Numbers of ``task/state``, as :data:`~teleop_core.graph.topics.TASK_STATE` names them;
            zero without a task, and before it begins.
        age: Function that returns the time since ``slave`` was measured [s]; infinite before the first value arrives.
    """

    slave: Array
    stylus: Array
    force: Array
    state: Array
    task: Array
    age: Callable[[], float] = float


class Setting(NamedTuple):
    """Data with which an operator is made, in addition to its own parameters.

    Attributes:
        common: The whole parameter group ``operator``.
        phases: Random phases (6, 4) [rad] from the session's seed; they do not depend on the operator.
        seed: Seed of the session, for other random numbers.
        seen: Data that the operator sees and feels; None if only the length of a motion is requested.
    """

    common: Any
    phases: Array
    seed: int
    seen: Seen | None = None


@dataclass(frozen=True)
class Operator:
    """A kind of operator.

    Attributes:
        name: Name of the operator in ``--set operator=``.
        make: ``make(parameters, setting)`` returns the :data:`Motion` of one session.
        parameters: Parameter group of the operator, in addition to the parameters that all operators share.
        ahead: Largest number of ticks per request of the motion; 1 for an operator that reacts to measurements.
        trembles: Whether the motion contains its own tremor, so that ``operator.tremor_amplitude`` is not added.
        approaches: Whether the motion begins with a smooth move to ``operator.center`` that takes
            ``operator.approach_time``.
        length: ``length(parameters, setting)`` returns the duration of the motion [s]. It is the duration of a session
            without a given duration. None for a motion without end.
        needs: Names of the stages that the operator needs; without them it does nothing.
        is_here: False if another node sends ``hand/servo_cp`` in place of this operator.
        opens: ``opens(parameters)`` opens a device of this machine that moves the hand, in live sessions only. The
            hand is then a :class:`~teleop_core.hand.operators.remote.RemoteHand`.
    """

    name: str
    make: Callable[[Any, Setting], Motion]
    parameters: type = NoParameters
    ahead: int = 1000
    trembles: bool = False
    approaches: bool = False
    length: Callable[[Any, Setting], float] | None = None
    opens: "Callable[[Any], Device] | None" = None
    needs: tuple[str, ...] = ()
    is_here: bool = True


def following(name: str, times: object, rows: object) -> Operator:
    """Return an operator that follows given samples, linear in between, and rests before and after them.

    Args:
        name: Name of the operator.
        times: Times (N,) since the start [s], increasing.
        rows: Rows as of :data:`Motion`; buttons are held, not interpolated.

    Raises:
        PartError: Shapes do not fit, times do not increase, or a number is not finite.
    """
    motion = sampled_motion(name, times, rows)
    return Operator(name, lambda parameters, setting: motion)


def sampled_motion(name: str, times: object, rows: object) -> Motion:
    """Motion through samples; see :func:`following`."""
    at, wanted = np.array(times, np.float64), np.array(rows, np.float64)
    if at.ndim != 1 or wanted.ndim != 2 or len(at) != len(wanted) or not len(at):
        text = f"given as times (N,) and rows (N, 3), (N, 6) or (N, 9), not {at.shape}, {wanted.shape}"
        raise PartError("operator", name, text)
    if wanted.shape[1] not in {3, 6, 9}:
        raise PartError("operator", name, f"one whose motion has 3, 6 or 9 columns; it has {wanted.shape[1]}")
    if not (np.isfinite(at).all() and np.isfinite(wanted).all()):
        bad = int(np.flatnonzero(~(np.isfinite(wanted).all(axis=1) & np.isfinite(at)))[0])
        raise PartError("operator", name, f"one whose motion is finite; row {bad} is not")
    if (np.diff(at) <= 0.0).any():
        bad = int(np.flatnonzero(np.diff(at) <= 0.0)[0]) + 1
        raise PartError("operator", name, f"one whose times rise; row {bad} is not later than the row before")

    def motion(times: Array) -> Array:
        smooth = [np.interp(times, at, column) for column in wanted[:, :6].T]
        held = wanted[np.maximum(np.searchsorted(at, times, side="right") - 1, 0), 6:]
        return np.column_stack((*smooth, held))

    return motion


def _checked(name: str, part: object) -> Operator:
    if isinstance(part, Operator):
        if not callable(part.make) or part.ahead < 1:
            raise PartError("operator", name, "one with a callable make and with ahead >= 1 tick")
        if part.length is not None and not callable(part.length):
            raise PartError("operator", name, "one whose length is length(parameters, setting)")
        if part.opens is not None and not callable(part.opens):
            raise PartError("operator", name, "one whose opens is opens(parameters)")
        if not (isinstance(part.parameters, type) and is_dataclass(part.parameters)):
            text = "one whose parameters are a dataclass, not an instance of one"
            raise PartError("operator", name, text)
        return part
    if callable(part):  # a plain motion function: the shortest form of a user's operator
        motion: Motion = part
        return Operator(name, lambda parameters, setting: motion)
    raise PartError("operator", name, f"an Operator or motion(times), not a {type(part).__name__}")


OPERATORS: Registry[Operator] = Registry(
    "operator",
    "operators",
    {
        **{
            kind: f"teleop_core.hand.operators.shapes:{kind.upper()}"
            for kind in ("random", "line", "circle", "points", "hold", "elsewhere")
        },
        "tour": "teleop_core.hand.operators.tour:TOUR",
        "human": "teleop_core.hand.operators.human:HUMAN",
        "observer": "teleop_core.hand.operators.observer:OBSERVER",
        "policy": "teleop_core.hand.operators.policy:POLICY",
        "remote": "teleop_core.hand.operators.remote:REMOTE",
        "gamepad": "teleop_core.hand.devices.gamepad:GAMEPAD",
        "spacemouse": "teleop_core.hand.devices.spacemouse:SPACEMOUSE",
        "bag": "teleop_core.session.recorded_hand:BAG",
        "file": "teleop_core.session.recorded_hand:FILE",
    },
    _checked,
)
"""All operators by name."""


def register_operator(name: str, operator: Operator | Motion, *, replace: bool = False) -> Operator:
    """Add an operator, or a plain motion function, for the rest of the program; see :meth:`Registry.add`."""
    return OPERATORS.add(name, operator, replace=replace)
