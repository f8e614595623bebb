"""Slave simulator: the 1 kHz arm that follows joint references under a control law."""

import math
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np

from teleop_core.controllers import CONTROLLERS, per_joint
from teleop_core.errors import ParameterError
from teleop_core.geometry import Array, pose_from_transform
from teleop_core.kernels import inner, kernel, pointer, records
from teleop_core.parameters import Choice, choice, parameter
from teleop_core.plants import PER_JOINT, PLANTS, Physics
from teleop_core.robots import dh_kernels, load_robot_set
from teleop_core.robots.drives import ACCELERATION, GRAVITY
from teleop_core.robots.kinematics import FK
from teleop_core.robots.parameters import RobotParameters
from teleop_core.robots.robot import Robot
from teleop_core.signals import DT, copy
from teleop_core.slave.commands import (
    advance_setpoint,
    move_to_start,
    take_command,
)
from teleop_core.slave.friction import bristle_damping, wander
from teleop_core.slave.interpolation import WAY_FIELDS, advance_on_way
from teleop_core.slave.joints import integrate
from teleop_core.slave.rigid_body import write_model
from teleop_core.slave.trajectory import shortest_move_time
from teleop_core.slave.transmission import follow_encoders
from teleop_core.stage import RunningStage, Stage
from teleop_core.topics import (
    SLAVE_MEASURED_CP,
    SLAVE_MEASURED_JS,
    SLAVE_SERVO_JP,
    SLAVE_SETPOINT_CP,
    SLAVE_SETPOINT_JS,
    SLAVE_TRUE_CP,
)

_FILTER_SOURCE = "published: Vongbunyong 2008, eq. 6.2.8"
INTERPOLATIONS = ("none", "linear", "minimum_jerk")


@dataclass(frozen=True, kw_only=True)
class ReferenceFilterParameters:
    """First-order lag on every joint reference; at rest its output is its input."""

    is_on: bool = parameter(True, doc="whether references pass the filter")
    gain: float = parameter(
        0.1, lower=0.0, upper=1.0, doc="gain for fast motion", source=_FILTER_SOURCE
    )
    zero: float = parameter(
        100.0, unit="rad/s", lower=0.0, upper=1000.0, doc="zero", source=_FILTER_SOURCE
    )
    pole: float = parameter(
        10.0, unit="rad/s", lower=0.01, upper=1000.0, doc="pole", source=_FILTER_SOURCE
    )

    def __post_init__(self) -> None:
        if not math.isclose(self.gain * self.zero, self.pole, rel_tol=1e-9):
            needed = f"such that gain ({self.gain}) * zero = pole ({self.pole})"
            raise ParameterError("reference_filter.zero", self.zero, needed)


@dataclass(frozen=True, kw_only=True)
class ControllerParameters:
    """The control law of all joints."""

    kind: Choice = choice(CONTROLLERS, "pid", fixed=True, doc="control law of the joints")


@dataclass(frozen=True, kw_only=True)
class PlantParameters:
    """What the simulator moves."""

    kind: Choice = choice(PLANTS, "ideal", fixed=True, doc="what the simulator moves")


@dataclass(frozen=True, kw_only=True)
class SlaveSimParameters(RobotParameters):
    """Parameters of :class:`SlaveSim`."""

    seed: int = parameter(1, lower=0, fixed=True, doc="seed of everything random in the session")

    command_timeout: float = parameter(
        0.1, unit="s", lower=0.002, upper=5.0,
        doc="the last reference is held when no command came for longer than this",
    )  # fmt: skip
    start: tuple[float, ...] = parameter(
        (), unit="rad or m", fixed=True,
        doc="joints to which the slave moves from home before it follows; empty: the robot's start",
    )  # fmt: skip
    starts_at_home: bool = parameter(
        False, fixed=True, doc="whether it starts where it is, at home, if no start is given"
    )
    start_speed: float = parameter(
        0.5, lower=0.01, upper=1.0, fixed=True, doc="share of the speed limits used on that move"
    )
    interpolation: str = parameter(
        "linear", choices=INTERPOLATIONS,
        doc="way between commands that come slower than the ticks, which takes one period of them",
    )  # fmt: skip
    gravity_compensation: str = parameter(
        "published", choices=("published", "all", "none"),
        doc="axes whose gravity is fed forward: those of the source (axis 2), all, none",
    )  # fmt: skip
    integration_steps: int = parameter(
        2, lower=1, upper=50, doc="Runge-Kutta steps in each control tick"
    )
    viscous: tuple[float, ...] = parameter(
        (), unit="N·m·s/rad or N·s/m", lower=0.0, doc="friction of each joint; empty: the plant's"
    )
    coulomb: tuple[float, ...] = parameter(
        (), unit="N·m or N", lower=0.0, doc="dry friction of each joint; empty: the plant's"
    )
    plant: PlantParameters = field(default_factory=PlantParameters)
    controller: ControllerParameters = field(default_factory=ControllerParameters)
    reference_filter: ReferenceFilterParameters = field(default_factory=ReferenceFilterParameters)

    def start_of(self, robot: Robot) -> Array:
        """Joints (n,) from which a robot follows [rad or m]."""
        if self.start:
            return np.array(self.start, dtype=np.float64)
        return robot.home.copy() if self.starts_at_home else robot.start.copy()


def _records(n: int) -> tuple[Any, Any]:
    """Parameter and state record of an arm with ``n`` joints."""
    joints = (*PER_JOINT, "bristle_damping", "lower", "upper", "effort_limit", "speed_limit",
              "compensated", "home", "start")  # fmt: skip
    scalars = ("filter_gain", "filter_zero", "filter_pole", "wander_rate")
    counts = ("is_filtered", "steps", "timeout_ns", "interpolation", "start_ticks")
    rows = [(name, "f8", (n,)) for name in joints]
    numbers = [(name, "f8") for name in scalars] + [(name, "i8") for name in counts]
    moved = ("command", "filtered", "setpoint", "target", *WAY_FIELDS)
    plant = ("measured", "speed", "bent", "grip", "astray", "carried")
    state = [(name, "f8", (n,)) for name in (*moved, *plant)] + [("noise", "i8", (n,))]
    stamps = (
        "command_stamp_ns", "arrival_ns", "seen_ns", "refused", "moved_ticks", "ticks", "span"
    )  # fmt: skip
    return records([*rows, *numbers])[0], records([*state, *((name, "i8") for name in stamps)])[0]


class Arm(NamedTuple):
    """Model, control law and motion of the arm: pointers and plain arrays, which kernels take."""

    fk: Any
    tip_fk: Any  # of the links as they were made
    acceleration: Any
    gravity: Any
    control: Any
    geometry: Array
    tip_geometry: Array
    coupling: Array
    dynamics: Array
    model: Array  # the dynamics that the control law knows
    gains: Array
    memory: Array  # of the control law
    q: Array  # joint positions (n,) at the encoders, unrounded
    dq: Array
    effort: Array
    setpoint: Array
    measured: Array
    feedforward: Array  # (n,); (2 n + n²,) for laws that take the model
    limit: Array
    joints: Array  # room for joints
    tip: Array  # true joint positions (n,), behind the transmission
    T: Array


@inner
def _measure(p: Any, s: Any, q: Array, dt: float) -> None:
    """Read the encoders."""
    for i in range(q.shape[0]):
        measured = round(q[i] / p.encoder_step[i]) * p.encoder_step[i]
        # Speed from encoder differences through a 5 ms low-pass: what a real drive reports.
        s.speed[i] += ((measured - s.measured[i]) / dt - s.speed[i]) * (dt / (dt + 5e-3))
        s.measured[i] = measured


@inner
def _control(p: Any, s: Any, arm: Any, dt: float) -> None:
    """Write the effort that the control law asks for."""
    n = arm.q.shape[0]
    copy(s.setpoint, arm.setpoint)
    copy(s.measured, arm.measured)
    arm.gravity(arm.measured, arm.model, arm.feedforward[:n])
    for i in range(n):
        arm.feedforward[i] *= p.compensated[i]
    if arm.feedforward.shape[0] > n:
        copy(s.speed, arm.joints)
        write_model(arm.acceleration, arm.model, arm.measured, arm.joints, arm.feedforward[n:])
    arm.control(
        arm.gains, arm.memory, arm.setpoint, arm.measured, arm.feedforward, arm.limit, dt,
        arm.effort,
    )  # fmt: skip


@inner
def _drive(p: Any, arm: Any) -> None:
    """Make of the effort asked for the one that the motors give."""
    for i in range(arm.q.shape[0]):
        asked, limit, step = arm.effort[i], arm.limit[i], p.effort_step[i]
        if step > 0.0:
            asked = round(asked / step) * step
        arm.effort[i] = min(max(asked + p.bias[i], -limit), limit)
        # The motor gives no drive beyond its rated speed, fading out over the next tenth.
        over = abs(arm.dq[i]) / p.speed_limit[i] - 1.0
        if over > 0.0 and arm.effort[i] * arm.dq[i] > 0.0:
            arm.effort[i] *= max(0.0, 1.0 - 10.0 * over)


@kernel
def slave_step(p: Any, s: Any, arm: Any, row: Any, dt: float) -> None:
    """One control tick: write the slave's setpoint, measured and true topics, and command_status.

    What is measured is sampled at the start of the tick, together with the setpoint it is held
    against; then the arm moves on under constant effort.

    Args:
        p: Parameter record.
        s: State record; written.
        arm: :class:`Arm`; its motion is written.
        row: Signals.
        dt: Tick [s].
    """
    joints, n = arm.joints, arm.q.shape[0]
    copy(s.command, joints)
    row.command_status = take_command(p, s, row, dt)
    if s.moved_ticks < p.start_ticks:
        move_to_start(p, s)
    else:
        advance_on_way(p, s)
        advance_setpoint(p, s, joints, dt)
    _measure(p, s, arm.q, dt)
    _control(p, s, arm, dt)
    _drive(p, arm)
    for i in range(n):
        row.slave_setpoint_js[i] = s.setpoint[i]
        row.slave_measured_js[i] = s.measured[i]
        row.slave_measured_js[n + i] = s.speed[i]
        row.slave_measured_js[2 * n + i] = arm.effort[i]
    arm.fk(arm.setpoint, arm.geometry, arm.T)
    pose_from_transform(arm.T, row.slave_setpoint_cp)
    arm.fk(arm.measured, arm.geometry, arm.T)
    pose_from_transform(arm.T, row.slave_measured_cp)
    follow_encoders(p, s, arm.q, arm.coupling, arm.tip)
    arm.tip_fk(arm.tip, arm.tip_geometry, arm.T)
    pose_from_transform(arm.T, row.slave_true_cp)
    row.slave_setpoint_js_ns = row.slave_setpoint_cp_ns = s.command_stamp_ns
    wander(p, s)
    integrate(arm.acceleration, arm.dynamics, p, s, p.steps, arm.effort, arm.q, arm.dq, dt)


class SlaveSim(RunningStage):
    """Stage that simulates the slave: control ticks of a continuous arm.

    It is at home first, at rest and in balance: the control law holds the gravity that is not
    compensated, if it can. From there it moves smoothly to where it starts, and follows then.

    Raises:
        ParameterError: The robot has no drives, or a list is not of its number of joints.
    """

    def __init__(self, parameters: SlaveSimParameters, dt: float = DT) -> None:
        self.robot = load_robot_set(parameters.robot, parameters.geometry)
        if self.robot.drives is None or self.robot.dynamics is None:
            raise ParameterError("slave_sim.robot", parameters.robot, "a robot with drives")
        n, model = self.robot.n, self.robot.dynamics
        super().__init__(SLAVE_SIM, n, dt)
        self.parameters, self.state = _records(n)
        self._law = CONTROLLERS.find(parameters.controller.kind.kind)
        self._seed, physics = parameters.seed, self._physics(parameters)
        gains = self._gains(parameters, physics.viscous)
        is_as_drawn = len(physics.tip_geometry) == 0
        self.arm = Arm(
            fk=self.robot.fk_pointer,
            tip_fk=self.robot.fk_pointer if is_as_drawn else pointer(dh_kernels.fk, FK),
            acceleration=pointer(model.acceleration, ACCELERATION),
            gravity=pointer(model.gravity, GRAVITY),
            control=self._law.control_pointer,
            geometry=self.robot.geometry_row.copy(),
            tip_geometry=(
                self.robot.geometry_row if is_as_drawn else physics.tip_geometry
            ).copy(),
            coupling=np.array(physics.coupling, dtype=np.float64, order="C"),
            dynamics=self._dynamics(physics).copy(),
            model=model.parameters.copy(),
            gains=gains,
            memory=np.zeros((n, max(self._law.memory, 1))),
            q=np.zeros(n), dq=np.zeros(n), effort=np.zeros(n), setpoint=np.zeros(n),
            measured=np.zeros(n), feedforward=np.zeros(self._law.feedforward(n)), limit=np.zeros(n),
            joints=np.zeros(n), tip=np.zeros(n), T=np.zeros((4, 4)),
        )  # fmt: skip
        self.kernel, self.arguments = slave_step, (self.parameters, self.state, self.arm)
        self._take_start(parameters)
        self.retune(parameters)
        self.reset()

    def reset(self) -> None:
        """Back to home, at rest, with no command in force."""
        s, home, arm = self.state, self.robot.home, self.arm
        for name in ("command", "filtered", "setpoint", "target", *WAY_FIELDS):
            s[name] = home if name not in WAY_FIELDS else 0.0
        s["moved_ticks"] = s["ticks"] = s["span"] = 0
        step = self.parameters["encoder_step"]
        s["measured"], s["speed"] = np.round(home / step) * step, 0.0
        s["command_stamp_ns"] = s["arrival_ns"] = s["seen_ns"] = s["refused"] = 0
        arm.q[:], arm.dq[:], arm.effort[:], arm.memory[:] = home, 0.0, 0.0, 0.0
        s["bent"], s["astray"], s["grip"], s["carried"] = 0.0, 0.0, 1.0, home
        s["noise"] = (
            np.random.SeedSequence(self._seed).generate_state(self.robot.n) % 2147483646 + 1
        )
        relieved = self._gravity(arm.model) * self.parameters["compensated"]
        held = self._gravity(arm.dynamics) - relieved - self.parameters["bias"]
        self._law.begin(arm.memory, np.array(s["measured"]), held)
        row, transform = self.signals, np.empty((4, 4))
        row["slave_setpoint_js"] = home
        row["slave_setpoint_js_ns"] = row["slave_setpoint_cp_ns"] = 0
        self.robot.kernels.fk(arm.q, arm.geometry, transform)
        pose_from_transform(transform, row["slave_setpoint_cp"])

    def retune(self, parameters: SlaveSimParameters) -> None:
        """Take new parameters from the next tick on; the control law keeps the arm in balance.

        Raises:
            ParameterError: A list has another length than the robot has joints; nothing changed.
        """
        robot, p, drives = self.robot, self.parameters, self.robot.drives
        assert drives is not None
        assert robot.dynamics is not None
        physics = self._physics(parameters)
        self.arm.gains[:] = self._gains(parameters, physics.viscous)
        for name in PER_JOINT:
            p[name] = getattr(physics, name)
        p["bristle_damping"] = bristle_damping(physics.bristle, drives.inertia)
        p["wander_rate"] = self.dt / physics.wander_time
        p["lower"], p["upper"] = robot.lower, robot.upper
        p["effort_limit"], p["speed_limit"] = drives.effort_limit, drives.speed_limit
        self.arm.limit[:] = drives.effort_limit
        compensated = {
            "published": robot.dynamics.compensated, "all": 1.0, "none": 0.0
        }[parameters.gravity_compensation]  # fmt: skip
        relieved = self._gravity(self.arm.model)
        self._law.shift(self.arm.memory, relieved * (p["compensated"] - compensated))
        p["compensated"] = compensated
        lag = parameters.reference_filter
        p["is_filtered"], p["filter_gain"] = lag.is_on, lag.gain
        p["filter_zero"], p["filter_pole"] = lag.zero, lag.pole
        p["steps"] = parameters.integration_steps
        p["timeout_ns"] = round(parameters.command_timeout * 1e9)
        p["interpolation"] = INTERPOLATIONS.index(parameters.interpolation)

    def _take_start(self, parameters: SlaveSimParameters) -> None:
        """Plan the move from home to where the slave starts.

        Raises:
            ParameterError: The start is not of the robot's joints, or outside their limits.
        """
        robot, p = self.robot, self.parameters
        assert robot.drives is not None
        start = parameters.start_of(robot)
        if start.shape != robot.home.shape:
            raise ParameterError("slave_sim.start", parameters.start, f"{robot.n} joints, or empty")
        if not ((robot.lower <= start) & (start <= robot.upper)).all():
            limits = f"{robot.lower.tolist()} to {robot.upper.tolist()}"
            needed = f"inside the limits, {limits}"
            raise ParameterError("slave_sim.start", parameters.start, needed)
        speed = robot.drives.speed_limit * parameters.start_speed
        time = shortest_move_time(robot.home, start, speed)
        p["home"], p["start"], p["start_ticks"] = robot.home, start, math.ceil(time / self.dt)

    @property
    def lead(self) -> int:
        """Ticks of the move from home to where the slave starts; nothing is followed before."""
        return int(self.parameters["start_ticks"])

    def _physics(self, parameters: SlaveSimParameters) -> Physics:
        """Numbers of the plant, with the friction that the slave's own parameters give."""
        chosen, robot = parameters.plant.kind, self.robot
        made = PLANTS.find(chosen.kind).physics(chosen.parameters, robot)
        viscous = per_joint(robot, "viscous", parameters.viscous, made.viscous)
        coulomb = per_joint(robot, "coulomb", parameters.coulomb, made.coulomb)
        return replace(made, viscous=viscous, coulomb=coulomb)

    def _dynamics(self, physics: Physics) -> Array:
        """Parameter row of the true dynamics."""
        model = self.robot.dynamics
        assert model is not None
        return physics.dynamics if len(physics.dynamics) else model.parameters

    def _gains(self, parameters: SlaveSimParameters, viscous: Array) -> Array:
        table = self._law.gains(parameters.controller.kind.parameters, self.robot, viscous)
        return np.array(table, dtype=np.float64, order="C")

    def _gravity(self, dynamics: Array) -> Array:
        """Effort (n,) that holds an arm of these dynamics where it is [N·m or N]."""
        assert self.robot.dynamics is not None
        effort = np.zeros(self.robot.n)
        self.robot.dynamics.gravity(self.arm.q, dynamics, effort)
        return effort

    @property
    def refused(self) -> int:
        """Commands refused so far because they were jumps."""
        return int(self.state["refused"])


SLAVE_SIM = Stage(
    "slave_sim",
    SlaveSimParameters,
    reads=(SLAVE_SERVO_JP,),
    writes=(
        SLAVE_SETPOINT_JS,
        SLAVE_SETPOINT_CP,
        SLAVE_MEASURED_JS,
        SLAVE_MEASURED_CP,
        SLAVE_TRUE_CP,
    ),
    notes=(("command_status", "i8"),),
    make=SlaveSim,
    node="teleop_core.nodes.slave_sim:SlaveSimNode",
)
