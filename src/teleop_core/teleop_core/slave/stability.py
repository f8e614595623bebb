"""Stability: whether a slave's control loop follows, comes to rest, and lets errors decay.

A loop is tried on copies of the arm before it is used. The result depends only on the loop and the arm, so a loop that
has passed is not tried again in this process.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from teleop_core.base import ParameterError
from teleop_core.graph import Row
from teleop_core.kernels import IS_COMPILED, Array, bound, records
from teleop_core.kernels.callables import raise_pending
from teleop_core.robots.drives import independent_acceleration
from teleop_core.robots.robot import Robot
from teleop_core.slave.arm import ArmParts
from teleop_core.slave.controllers import CONTROLLERS, Controller
from teleop_core.slave.plants import PER_JOINT
from teleop_core.slave.simulation import SimulationRecord, SimulationState, simulation_step

_TICKS = 400  # duration of a trial [ticks]
_LAST = 100  # number of ticks at the end of a trial in which the error is measured
# After _TICKS no error may exceed its initial value by this factor. Laws that learn may let errors grow for a while,
# within bounds; unstable loops exceed this factor by orders of magnitude.
_GROWTH = 100.0
_ERROR = 1e-2  # initial error [encoder steps]
_FINE = 1e-6  # factor on the encoder steps during the trial
# A dash consists of bursts at full speed with rests between them, then a run at full speed.
_BURSTS = 2  # number of bursts
_BURST = 50  # duration of a burst [ticks]
_RUN = 150  # duration of the run [ticks]
_SHORTEST = 300  # shortest rest after a dash [ticks]
_LONGEST = 2000  # longest rest after a dash [ticks]
_LEFT = 0.5  # the error must fall to this share of the largest error of the dash before the longest rest is over
# Share of a joint's free range that a dash may use.
_ROOM = 0.8
# Stability limit of classical Runge-Kutta: -h times a real pole.
_STABLE = 2.785
_STIFFEST = 0.5  # rate of viscous friction in a trial of an arm that others move, times the tick
_LOOP = (*PER_JOINT, "bristle_damping", "gear_damping", "effort_limit", "speed_limit",
         "compensated", "steps", "delay_ticks")  # fmt: skip
_ARM = ("gains", "dynamics", "model", "coupling")
_passed: set[tuple[object, ...]] = set()


def check_friction(p: SimulationRecord, inertia: Array, dt: float) -> None:
    """Refuse friction that the drives cannot overcome, or that the integration steps cannot follow.

    Args:
        p: Parameter record of the slave.
        inertia: Inertias (n,) of the drives [kg·m² or kg].
        dt: Tick [s].

    Raises:
        ParameterError: Dry friction and bias exceed a drive's effort, or a joint's friction is
            too stiff for the Runge-Kutta steps of a tick.
    """
    held = p["coulomb"] + np.abs(p["bias"])
    if (held >= p["effort_limit"]).any():
        i = int(np.argmax(held >= p["effort_limit"]))
        needed = f"below {p['effort_limit'][i] - abs(p['bias'][i]):.3g} for joint {i + 1}, "
        needed += "the effort of its drive minus its bias; otherwise the joint never moves"
        raise ParameterError("slave_sim.coulomb", p["coulomb"].tolist(), needed)
    smooth = p["coulomb"] / np.maximum(p["friction_speed"], 1e-300) / inertia
    sticking = np.sqrt(p["bristle"] / inertia)
    pole = np.where(p["bristle"] > 0.0, sticking, smooth) * (p["coulomb"] > 0.0)
    step = dt / int(p["steps"])
    if (pole * step > _STABLE).any():
        i = int(np.argmax(pole))
        needed = (
            f"small enough for steps of {1000.0 * step:g} ms: the friction of joint {i + 1} has a "
            f"time constant of {1000.0 / pole[i]:.2g} ms; lower it, or raise integration_steps"
        )
        raise ParameterError("slave_sim.coulomb", p["coulomb"].tolist(), needed)


class ClosedLoop(NamedTuple):
    """A simulated arm with its control law: the arguments of one tick."""

    p: SimulationRecord
    s: SimulationState
    arm: ArmParts
    row: Row
    dt: float

    def copied(self) -> "ClosedLoop":
        """Return a separate copy of the arm without objects to touch, because the loop is judged without contact.

        The copy moves by our own equations, also if another simulator moves the arm.
        """
        p, s, row = (_copy(record) for record in (self.p, self.s, self.row))
        p["has_world"] = 0
        if p["see"]:  # others integrate friction that our steps cannot resolve
            p["see"] = p["move"] = 0
            p["coulomb"], inertia = 0.0, self.arm.limit / p["braking"]
            p["viscous"] = np.minimum(p["viscous"], _STIFFEST * inertia / self.dt)
        p["is_ideal"], p["has_noise"], p["is_estimated"] = 1, 0, 0
        parts = (np.array(part) if isinstance(part, np.ndarray) else part for part in self.arm)
        arm = ArmParts(*parts)
        arm.contacts["is_near"] = 0
        return ClosedLoop(p, s, arm, row, self.dt)

    def step(self) -> Callable[[], None]:
        """Return the function that advances the arm by one tick."""
        tick = bound(simulation_step, *self)

        def made() -> None:
            self.row.now_ns += round(self.dt * 1e9)
            tick()
            raise_pending()

        return made


def loop_key(p: SimulationRecord, arm: ArmParts) -> tuple[bytes, ...]:
    """Numbers that define the control loop of an arm, independent of its position.

    Args:
        p: Parameter record of the slave.
        arm: Arrays of the arm.
    """
    fields = (*(p[name] for name in _LOOP), *(getattr(arm, name) for name in _ARM))
    return tuple(field.tobytes() for field in fields)


def check_stable(law: Controller, robot: Robot, loop: ClosedLoop, *, are_large_tried: bool = True) -> None:
    """Refuse a loop in which small errors grow, or that does not recover from large errors.

    Small errors: two copies of the arm are held at the present setpoint, one of them with a small error of all joints.
    Encoders have fine steps and there is no dry friction, so the difference of the two copies is that of a linear
    loop. After 0.4 s the difference must be less than a hundred times its initial value.

    Large errors: one joint after the other is tested. Its setpoint moves at the full speed of the drive, in bursts and
    in one run, and then stops suddenly, which saturates the drive. Within 2 s the error must fall below half of its
    largest value during the motion.

    Args:
        law: The control law.
        robot: The robot that it moves.
        loop: The arm in its present state.
        are_large_tried: Whether large errors are tried, too.

    Raises:
        ParameterError: An error grows, or does not decay.
        Exception: Any exception of a control law in plain Python.
    """
    place = (robot.geometry_row.tobytes(), loop.arm.q.tobytes())
    key = loop_key(loop.p, loop.arm)
    tried = (law.control, robot.kernels, loop.dt, *place, are_large_tried, *key)
    if tried in _passed:
        return
    _check_small(law, robot, loop)
    if IS_COMPILED and are_large_tried:  # dashes take seconds if the law is plain Python
        _check_large(law.name, robot, loop)
    _passed.add(tried)


def _check_small(law: Controller, robot: Robot, loop: ClosedLoop) -> None:
    error, dt = _ERROR * np.array(loop.p.encoder_step), loop.dt
    calm, shaken = (_held(loop, by) for by in (0.0 * error, error))
    with np.errstate(all="ignore"):
        growth = np.max(np.abs(shaken - calm) / error, axis=0)
    if not (growth <= _GROWTH).all():
        joint = int(np.flatnonzero(~(growth <= _GROWTH))[0])
        fold = f"{growth[joint]:.1g}-fold" if np.isfinite(growth[joint]) else "without bound"
        needed = (
            f"stable at {1.0 / dt:g} Hz: an error of joint {joint + 1} grows {fold} in "
            f"{_TICKS * dt:g} s; {_advice(law, robot)}lower its gains or friction, or raise integration_steps"
        )
        raise ParameterError("slave_sim.controller.kind", law.name, needed)


def _advice(law: Controller, robot: Robot) -> str:
    """Laws that know how the links of a robot act on each other, for a law that does not."""
    is_coupled = robot.dynamics is not None and robot.dynamics.acceleration is not independent_acceleration
    if law.uses_model or not is_coupled:
        return ""
    knowing = [name for name in CONTROLLERS if CONTROLLERS.find(name).uses_model]
    return f"the links act on each other: choose controller={' or '.join(knowing)}, which knows how; or "


def _held(loop: ClosedLoop, by: Array) -> Array:
    """Positions (N, n) in the last ticks of a trial that begins with a distance ``by`` (n,) from the setpoint."""
    loop = loop.copied()
    for field in ("encoder_step", "effort_step"):
        loop.p[field] *= _FINE
    loop.p["coulomb"], loop.p["wander"] = 0.0, 0.0
    loop.arm.q[:] += by
    found, step = np.empty((_LAST, len(loop.arm.q))), loop.step()
    for k in range(_TICKS):
        step()
        found[k % _LAST] = loop.arm.q
    return found


def _check_large(name: str, robot: Robot, loop: ClosedLoop) -> None:
    for joint in range(len(loop.arm.q)):
        left = _left(robot, loop, joint)
        if not left <= _LEFT:  # also for NaN
            needed = (
                f"one that settles: {_LONGEST * loop.dt:g} s after a stop from full speed, joint "
                f"{joint + 1} still has {left:.2g} of its largest error; raise its gains, or limit its "
                "integral"
            )
            raise ParameterError("slave_sim.controller.kind", name, needed)


def dash(lower: float, upper: float, start: float, speed: float, dt: float) -> Array:
    """Setpoints (N,) of a joint that moves in a dash from ``start`` towards its farther limit.

    Bursts at full speed alternate with rests; the dash ends with a long run at full speed.

    Args:
        lower: Lower limit [rad or m].
        upper: Upper limit [rad or m].
        start: Initial position [rad or m].
        speed: Full speed of its drive [rad/s or m/s]; reduced if the joint's free range is too short.
        dt: Tick [s].
    """
    burst = np.repeat([1.0, 0.0], _BURST)
    pace = np.concatenate((np.tile(burst, _BURSTS), np.ones(_RUN)))
    room, way = max(upper - start, start - lower), speed * dt * float(pace.sum())
    share = min(1.0, _ROOM * room / way) if np.isfinite(room) else 1.0
    side = 1.0 if upper - start >= start - lower else -1.0
    return start + side * share * speed * dt * np.cumsum(pace)


def _left(robot: Robot, loop: ClosedLoop, joint: int) -> float:
    """Error of a joint at rest after a dash of its setpoint, divided by the largest error of the dash."""
    loop = loop.copied()
    setpoint, arm, step = loop.row.slave_setpoint_js, loop.arm, loop.step()

    def largest(places: Array) -> float:
        found = 0.0
        for place in places:
            setpoint[joint] = place
            step()
            found = max(found, abs(float(arm.setpoint[joint] - arm.q[joint])))
        return found if np.isfinite(arm.q[joint]) else np.nan

    path = dash(robot.lower[joint], robot.upper[joint], setpoint[joint], loop.p.speed_limit[joint], loop.dt)
    most = largest(path)
    for rest in range(_LAST, _LONGEST + 1, _LAST):
        left = largest(np.full(_LAST, path[-1])) / most
        if rest >= _SHORTEST and left <= _LEFT:
            break
    return left


def _copy(record: Any) -> Any:
    copied = records(record.dtype)
    copied[0] = record
    return copied[0]
