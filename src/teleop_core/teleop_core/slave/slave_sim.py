"""Slave simulator: the 1 kHz arm that follows joint references under PID."""

import math
from dataclasses import dataclass, field
from enum import IntEnum
from typing import Any

import numpy as np

from teleop_core.errors import ParameterError
from teleop_core.geometry import Array, pose_from_transform
from teleop_core.kernels import bound, inner, kernel, pointer
from teleop_core.mapping.filters import lag_step
from teleop_core.parameters import parameter
from teleop_core.robots import load_robot_set
from teleop_core.robots.drives import ACCELERATION, GRAVITY
from teleop_core.robots.robot import Robot
from teleop_core.signals import copy, make_signals
from teleop_core.slave.joints import integrate
from teleop_core.slave.pid import critically_damped_gains, pid_step


class CommandStatus(IntEnum):
    """How the slave took the command of this tick."""

    FRESH = 0  # followed
    STALE = 1  # none came for longer than the command timeout: the last one is held
    REFUSED = 2  # too far from the one in force to be the same motion: the last one is held


@dataclass(frozen=True, kw_only=True)
class ReferenceFilterParameters:
    """First-order lag on every joint reference; at rest its output is its input."""

    is_on: bool = parameter(True, doc="whether references pass the filter")
    gain: float = parameter(0.1, lower=0.0, upper=1.0, doc="gain for fast motion")
    zero: float = parameter(100.0, unit="rad/s", lower=0.0, upper=1000.0, doc="zero")
    pole: float = parameter(10.0, unit="rad/s", lower=0.01, upper=1000.0, doc="pole")

    def __post_init__(self) -> None:
        if not math.isclose(self.gain * self.zero, self.pole, rel_tol=1e-9):
            needed = f"such that gain ({self.gain}) * zero = pole ({self.pole})"
            raise ParameterError("reference_filter.zero", self.zero, needed)


@dataclass(frozen=True, kw_only=True)
class PidParameters:
    """Gains; empty lists mean: from the robot's drive table, critically damped."""

    bandwidth: tuple[float, ...] = parameter(
        (), unit="rad/s", lower=0.1, upper=500.0, doc="triple closed-loop pole of each joint"
    )
    kp: tuple[float, ...] = parameter((), lower=0.0, doc="N·m/rad or N/m of each joint")
    ki: tuple[float, ...] = parameter((), lower=0.0, doc="N·m/(rad·s) or N/(m·s) of each joint")
    kd: tuple[float, ...] = parameter((), lower=0.0, doc="N·m·s/rad or N·s/m of each joint")


@dataclass(frozen=True, kw_only=True)
class SlaveSimParameters:
    """Parameters of :class:`SlaveSim`."""

    robot: str = parameter("rcrt1", fixed=True, doc="slave robot, one of `teleop robot`")
    geometry: tuple[str, ...] = parameter(
        (), fixed=True, doc="symbol=value in place of the robot's lengths and options [m, rad]"
    )
    command_timeout: float = parameter(
        0.1, unit="s", lower=0.002, upper=5.0,
        doc="the last reference is held when no command came for longer than this",
    )  # fmt: skip
    gravity_compensation: str = parameter(
        "published", choices=("published", "all", "none"),
        doc="axes whose gravity is fed forward: those of the source (axis 2), all, none",
    )  # fmt: skip
    integration_steps: int = parameter(
        2, lower=1, upper=50, doc="Runge-Kutta steps in each control tick"
    )
    viscous: tuple[float, ...] = parameter(
        (), unit="N·m·s/rad or N·s/m", lower=0.0, doc="friction of each joint; empty: the robot's"
    )
    coulomb: tuple[float, ...] = parameter(
        (), unit="N·m or N", lower=0.0, doc="dry friction of each joint; empty: the robot's"
    )
    pid: PidParameters = field(default_factory=PidParameters)
    reference_filter: ReferenceFilterParameters = field(default_factory=ReferenceFilterParameters)


def _slave_dtypes(n: int) -> tuple[np.dtype[Any], np.dtype[Any]]:
    joints = ("lower", "upper", "effort_limit", "speed_limit", "encoder_step", "viscous", "coulomb",
              "friction_speed", "compensated")  # fmt: skip
    parameters = [(name, "f8", (n,)) for name in joints]
    scalars = [(name, "f8") for name in ("filter_gain", "filter_zero", "filter_pole")]
    counts = [(name, "i8") for name in ("is_filtered", "steps", "timeout_ns")]
    state = [
        (name, "f8", (n,)) for name in ("command", "filtered", "setpoint", "measured", "speed")
    ]
    stamps = [(name, "i8") for name in ("command_stamp_ns", "arrival_ns", "seen_ns", "refused")]
    return (
        np.dtype([*parameters, *scalars, ("gains", "f8", (n, 3)), *counts]),
        np.dtype([*state, *stamps]),
    )


# Stamps this far ahead of the slave's clock are an error, not a clock that is a little ahead.
_FUTURE_NS = 1_000_000_000


@inner
def _take_command(p: Any, s: Any, row: Any) -> int:
    """Accept a new servo_jp unless it is a jump; returns the :class:`CommandStatus`.

    A jump is farther from the command in force than full speed reaches in the command timeout;
    no stream within its timeout can be that far.
    """
    stamp, now_ns = row.servo_stamp_ns, row.now_ns
    if stamp > now_ns + _FUTURE_NS:  # taken, it would make every later command an old one
        s.refused += 1
        return 2
    if stamp > s.seen_ns:
        s.seen_ns = stamp
        far = p.timeout_ns * 1e-9
        for i in range(s.command.shape[0]):
            near = abs(row.slave_servo_jp[i] - s.command[i]) <= p.speed_limit[i] * far
            if not near:  # NaN is not near either
                s.refused += 1
                return 2
        for i in range(s.command.shape[0]):
            s.command[i] = min(max(row.slave_servo_jp[i], p.lower[i]), p.upper[i])
        s.command_stamp_ns, s.arrival_ns = stamp, now_ns
    return 1 if now_ns - s.arrival_ns > p.timeout_ns else 0


@inner
def _advance_setpoint(p: Any, s: Any, before: Array, dt: float) -> None:
    """Filter the command and move the setpoint there, never faster than the drive can."""
    for i in range(before.shape[0]):
        if p.is_filtered:
            s.filtered[i] = lag_step(
                s.command[i], before[i], s.filtered[i], p.filter_gain, p.filter_zero,
                p.filter_pole, dt,
            )  # fmt: skip
        else:
            s.filtered[i] = s.command[i]
        reach = p.speed_limit[i] * dt
        step = min(max(s.filtered[i] - s.setpoint[i], -reach), reach)
        s.setpoint[i] = min(max(s.setpoint[i] + step, p.lower[i]), p.upper[i])


@inner
def _control(p: Any, s: Any, work: Any, gravity: Any, dynamics: Array, dt: float) -> None:
    """Read the encoders and write the drive effort of this tick into the work arrays."""
    q, dq, effort, memory, scratch_row = work[0], work[1], work[2], work[3], work[4]
    for i in range(q.shape[0]):
        measured = round(q[i] / p.encoder_step[i]) * p.encoder_step[i]
        # Speed from encoder differences through a 5 ms low-pass: what a real drive reports.
        s.speed[i] += ((measured - s.measured[i]) / dt - s.speed[i]) * (dt / (dt + 5e-3))
        s.measured[i] = measured
    copy(s.measured, effort)
    gravity(effort, dynamics, scratch_row)
    for i in range(q.shape[0]):
        # The motor gives no drive beyond its rated speed, fading out over the next tenth.
        effort[i] = pid_step(
            s.setpoint[i], s.measured[i], p.gains[i], memory[i],
            scratch_row[i] * p.compensated[i], p.effort_limit[i], dt,
        )  # fmt: skip
        over = abs(dq[i]) / p.speed_limit[i] - 1.0
        if over > 0.0 and effort[i] * dq[i] > 0.0:
            effort[i] *= max(0.0, 1.0 - 10.0 * over)


@kernel
def slave_step(
    p: Any, s: Any, work: Any, robot: Any, geometry: Array, dynamics: Array, row: Any
) -> None:
    """One control tick of 1 ms: write the slave's setpoint and measured topics.

    ``robot`` holds the pointers fk, acceleration, gravity; ``work`` plain arrays for them. What
    is measured is sampled at the start of the tick, together with the setpoint it is held
    against; then the arm moves on under constant effort.
    """
    fk, acceleration, gravity = robot
    q, dq, effort, before, T = work[0], work[1], work[2], work[5], work[6]
    copy(s.command, before)
    row.command_status = _take_command(p, s, row)
    _advance_setpoint(p, s, before, 1e-3)
    _control(p, s, work, gravity, dynamics, 1e-3)
    n = q.shape[0]
    for i in range(n):
        row.slave_setpoint_js[i] = s.setpoint[i]
        row.slave_measured_js[i] = s.measured[i]
        row.slave_measured_js[n + i] = s.speed[i]
        row.slave_measured_js[2 * n + i] = effort[i]
    copy(s.setpoint, before)
    fk(before, geometry, T)
    pose_from_transform(T, row.slave_setpoint_cp)
    copy(s.measured, before)
    fk(before, geometry, T)
    pose_from_transform(T, row.slave_measured_cp)
    row.setpoint_stamp_ns = s.command_stamp_ns
    integrate(
        acceleration, dynamics, p.viscous, p.coulomb, p.friction_speed, p.steps, effort, q, dq
    )


class SlaveSim:
    """Stage that simulates the slave: 1 kHz control of a continuous arm.

    ``signals`` is the record it reads (``now_ns``, ``slave_servo_jp``, ``servo_stamp_ns``) and
    writes (``slave_setpoint_js``, ``slave_setpoint_cp``, ``setpoint_stamp_ns``,
    ``slave_measured_js``, ``slave_measured_cp``, ``command_status``). It starts at home, at rest
    and in balance: the integrators hold the gravity that is not compensated.
    """

    def __init__(self, parameters: SlaveSimParameters, signals: Any = None) -> None:
        self.robot = load_robot_set(parameters.robot, parameters.geometry)
        if self.robot.drives is None or self.robot.dynamics is None:
            raise ParameterError("slave_sim.robot", parameters.robot, "a robot with drives")
        self.signals = make_signals(self.robot.n)[0] if signals is None else signals
        n, model = self.robot.n, self.robot.dynamics
        parameters_type, state_type = _slave_dtypes(n)
        self.parameters = np.zeros(1, parameters_type)[0]
        self.state = np.zeros(1, state_type)[0]
        # q, dq, effort, PID memory, gravity, joints of a tick, transform of a tick
        self.work = (np.zeros(n), np.zeros(n), np.zeros(n), np.zeros((n, 3)), np.zeros(n),
                     np.zeros(n), np.zeros((4, 4)))  # fmt: skip
        self.dynamics = model.parameters.copy()
        self.pointers = (
            self.robot.fk_pointer,
            pointer(model.acceleration, ACCELERATION),
            pointer(model.gravity, GRAVITY),
        )
        self.retune(parameters)
        self.reset()
        self._step = bound(
            slave_step, self.parameters, self.state, self.work, self.pointers,
            self.robot.geometry_row, self.dynamics, self.signals,
        )  # fmt: skip

    def reset(self) -> None:
        """Back to home, at rest, with no command in force."""
        s, home = self.state, self.robot.home
        for name in ("command", "filtered", "setpoint"):
            s[name] = home
        step = self.parameters["encoder_step"]
        s["measured"], s["speed"] = np.round(home / step) * step, 0.0
        s["command_stamp_ns"] = s["arrival_ns"] = s["seen_ns"] = s["refused"] = 0
        q, dq, effort, memory, gravity, *_ = self.work
        q[:], dq[:], effort[:], memory[:] = home, 0.0, 0.0, 0.0
        assert self.robot.dynamics is not None
        self.robot.dynamics.gravity(q, self.dynamics, gravity)
        memory[:, 0] = gravity * (1.0 - self.parameters["compensated"])
        memory[:, 1] = s["measured"]
        row, transform = self.signals, np.empty((4, 4))
        row["slave_setpoint_js"], row["setpoint_stamp_ns"] = home, 0
        self.robot.kernels.fk(q, self.robot.geometry_row, transform)
        pose_from_transform(transform, row["slave_setpoint_cp"])

    def retune(self, parameters: SlaveSimParameters) -> None:
        """Take new parameters from the next tick on; the integrators keep the arm in balance.

        Raises:
            ParameterError: A list has another length than the robot has joints; nothing changed.
        """
        robot, p, drives = self.robot, self.parameters, self.robot.drives
        assert drives is not None
        assert robot.dynamics is not None
        viscous = _per_joint(robot, "viscous", parameters.viscous, drives.viscous)
        coulomb = _per_joint(robot, "coulomb", parameters.coulomb, drives.coulomb)
        p["gains"] = self._gains(parameters.pid, viscous)
        p["viscous"], p["coulomb"] = viscous, coulomb
        p["lower"], p["upper"] = robot.lower, robot.upper
        for name in ("effort_limit", "speed_limit", "encoder_step", "friction_speed"):
            p[name] = getattr(drives, name)
        compensated = {
            "published": robot.dynamics.compensated, "all": 1.0, "none": 0.0
        }[parameters.gravity_compensation]  # fmt: skip
        memory, gravity = self.work[3], self.work[4]
        robot.dynamics.gravity(self.work[0], self.dynamics, gravity)
        memory[:, 0] += gravity * (p["compensated"] - compensated)
        p["compensated"] = compensated
        lag = parameters.reference_filter
        p["is_filtered"], p["filter_gain"] = lag.is_on, lag.gain
        p["filter_zero"], p["filter_pole"] = lag.zero, lag.pole
        p["steps"] = parameters.integration_steps
        p["timeout_ns"] = round(parameters.command_timeout * 1e9)

    def _gains(self, pid: PidParameters, viscous: Array) -> Array:
        drives = self.robot.drives
        assert drives is not None
        bandwidth = _per_joint(self.robot, "pid.bandwidth", pid.bandwidth, drives.bandwidth)
        designed = critically_damped_gains(drives.inertia, viscous, bandwidth)
        given = (("pid.kp", pid.kp), ("pid.ki", pid.ki), ("pid.kd", pid.kd))
        columns = [
            _per_joint(self.robot, name, values, default)
            for (name, values), default in zip(given, designed, strict=True)
        ]
        return np.stack(columns, axis=1)

    @property
    def refused(self) -> int:
        """Commands refused so far because they were jumps."""
        return int(self.state["refused"])

    def step(self, now_ns: int) -> None:
        """One tick of 1 ms that starts at ``now_ns`` [ns]."""
        self.signals["now_ns"] = now_ns
        self._step()


def _per_joint(robot: Robot, name: str, values: tuple[float, ...], default: Array) -> Array:
    if not values:
        return default
    if len(values) != robot.n:
        raise ParameterError(f"slave_sim.{name}", values, f"empty or {robot.n} values")
    return np.array(values)
