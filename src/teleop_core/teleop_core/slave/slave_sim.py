"""Slave simulator: the 1 kHz arm that follows joint references under a control law."""

import math
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from teleop_core.controllers import CONTROLLERS, per_joint
from teleop_core.errors import ParameterError
from teleop_core.geometry import Array, pose_from_transform
from teleop_core.kernels import kernel, pointer, records
from teleop_core.operation import (
    Answer,
    Event,
    Fault,
    OperationParameters,
    State,
    command_event,
)
from teleop_core.operation.states import answer_text, change
from teleop_core.operation.watch import fail
from teleop_core.parameters import Choice, choice, parameter
from teleop_core.plants import PER_JOINT, PLANTS, Physics
from teleop_core.portable import length
from teleop_core.robots import dh_kernels, load_robot_set
from teleop_core.robots.drives import ACCELERATION, GRAVITY
from teleop_core.robots.kinematics import FK
from teleop_core.robots.parameters import RobotParameters
from teleop_core.robots.robot import Robot
from teleop_core.signals import DT, assign
from teleop_core.slave.elastic import gear_damping
from teleop_core.slave.friction import bristle_damping
from teleop_core.slave.handover import missing_effort
from teleop_core.slave.motion import MotionCommands
from teleop_core.slave.stability import check_friction, check_stable, loop_key
from teleop_core.slave.step import SPEED_LAG, Arm, slave_records, slave_step
from teleop_core.slave.trajectory import shortest_move_time
from teleop_core.slave.transmission import LONGEST_DELAY
from teleop_core.stage import RunningStage, Stage
from teleop_core.topics import (
    NO_COMMAND_NS,
    OPERATION,
    SLAVE_MEASURED_CP,
    SLAVE_MEASURED_JS,
    SLAVE_OPERATION,
    SLAVE_SERVO_JP,
    SLAVE_SETPOINT_CP,
    SLAVE_SETPOINT_JS,
    SLAVE_TRUE_CP,
)

_TIMES = {
    "heartbeat": "heartbeat_ns", "longest_outage": "outage_ns", "pressing_time": "pressing_ns"
}  # fmt: skip
_STOP, _PRESSED = int(Event.STOP), int(Fault.STOP)
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
    operation: OperationParameters = field(default_factory=OperationParameters)

    def start_of(self, robot: Robot) -> Array:
        """Joints (n,) from which a robot follows [rad or m]."""
        if self.start:
            return np.array(self.start, dtype=np.float64)
        return robot.home.copy() if self.starts_at_home else robot.start.copy()


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
        self.parameters, self.state = slave_records(n)
        self._law = CONTROLLERS.find(parameters.controller.kind.kind)
        self._seed, physics = parameters.seed, self._physics(parameters)
        gains = self._gains(parameters, physics.viscous)
        is_as_drawn = len(physics.tip_geometry) == 0
        self.arm = Arm(
            fk=self.robot.fk_pointer,
            tip_fk=self.robot.fk_pointer if is_as_drawn else pointer(dh_kernels.fk, FK),
            jacobian=pointer(self.robot.kernels.jacobian, FK),
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
            speeds=np.zeros(n), is_free=np.zeros(n), twist=np.zeros(6), J=np.zeros((6, n)),
            A=np.zeros((6, 6)), b=np.zeros(6),
        )  # fmt: skip
        self.kernel, self.arguments = slave_step, (self.parameters, self.state, self.arm)
        self.motion = MotionCommands(self)
        self._take_start(parameters)
        self._take_script(parameters.operation)
        self._take(parameters)
        self.reset()
        self._check_loop()
        self._examined, self._gains_in_force = parameters, self.arm.gains.copy()
        self._load_commands()

    def reset(self) -> None:
        """Back to home, at rest, with no command in force."""
        self._rest_at(self.robot.home)

    def _rest_at(self, home: Array) -> None:
        """Stand at joints (n,), at rest and in balance, with no command in force."""
        s, arm = self.state, self.arm
        assign(s, 0)
        for name in ("command", "filtered", "setpoint", "target", "move_from"):
            s[name] = home
        self._begin_operation()
        step = self.parameters["encoder_step"]
        s["measured"], s["speed"] = np.round(home / step) * step, 0.0
        arm.q[:], arm.dq[:], arm.effort[:], arm.memory[:] = home, 0.0, 0.0, 0.0
        s["grip"], s["carried"] = 1.0, home
        s["noise"] = (
            np.random.SeedSequence(self._seed).generate_state(self.robot.n) % 2147483646 + 1
        )
        relieved = self._gravity(arm.model) * self.parameters["compensated"]
        held = self._gravity(arm.dynamics) - relieved - self.parameters["bias"]
        self._law.begin(arm.memory, np.array(s["measured"]), held)
        stiffness = self.parameters["gear_stiffness"]
        bent = np.divide(
            self._gravity(arm.dynamics), stiffness, out=np.zeros_like(home), where=stiffness > 0.0
        )
        s["link"] = home - bent
        row, transform = self.signals, np.empty((4, 4))
        row["slave_setpoint_js"] = home
        row["slave_setpoint_js_ns"] = row["slave_setpoint_cp_ns"] = s["command_stamp_ns"]
        self.robot.kernels.fk(arm.q, arm.geometry, transform)
        pose_from_transform(transform, row["slave_setpoint_cp"])

    def examine(self, parameters: SlaveSimParameters) -> None:
        """Try parameters on an arm of their own, at home and where this one is.

        This takes tenths of a second where the loop changes: in a running session it is done beside
        the ticks, before :meth:`retune`.

        Raises:
            ParameterError: A list has another length than the robot has joints; friction is more
                than drives or integrator can take; or an error would grow, or not come back.
        """
        trial = SlaveSim(parameters, self.dt)
        if loop_key(trial.parameters, trial.arm) != loop_key(self.parameters, self.arm):
            trial._rest_at(self.arm.q.clip(self.robot.lower, self.robot.upper))
            trial._check_loop()
        self._examined = parameters

    def retune(self, parameters: SlaveSimParameters) -> None:
        """Take new parameters from the next tick on; a law that can shift takes over what it gave.

        Raises:
            ParameterError: What :meth:`examine` refuses, unless these were examined; nothing
                has changed then.
        """
        if parameters is not self._examined:
            self.examine(parameters)
        self._take(parameters)
        self._hand_over()

    def _take(self, parameters: SlaveSimParameters) -> None:
        """Write parameters where the step reads them."""
        robot, p, drives = self.robot, self.parameters, self.robot.drives
        assert drives is not None
        assert robot.dynamics is not None
        physics = self._physics(parameters)
        self.arm.gains[:] = self._gains(parameters, physics.viscous)
        for name in PER_JOINT:
            p[name] = getattr(physics, name)
        p["bristle_damping"] = bristle_damping(physics.bristle, drives.inertia)
        p["gear_damping"] = gear_damping(physics.gear_stiffness, physics.motor_inertia)
        p["has_gears"] = np.any(physics.gear_stiffness)
        p["delay_ticks"] = min(round(physics.effort_delay / self.dt), LONGEST_DELAY)
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
        p["start_speed"] = parameters.start_speed
        self._take_operation(parameters.operation)

    def _check_loop(self) -> None:
        """Try the loop as it is set, where the arm is; see :mod:`teleop_core.slave.stability`."""
        assert self.robot.drives is not None
        check_friction(self.parameters, self.robot.drives.inertia, self.dt)
        check_stable(
            self._law, self.robot, self.parameters, self.state, self.arm, self.signals, self.dt
        )

    def _hand_over(self) -> None:
        """Let the integrators take over what new gains give less, once these are in force."""
        if np.array_equal(self.arm.gains, self._gains_in_force):
            return
        if self.state["first_ns"] > 0:  # before the first tick nothing moves, or is compensated
            speed = np.array(self.state["speed"])
            missing = missing_effort(self.arm, speed, self._gains_in_force, self.dt)
            self._law.shift(self.arm.memory, missing)
        self._gains_in_force = self.arm.gains.copy()

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
        p["start"], self._start_ticks = start, math.ceil(time / self.dt)

    @property
    def lead(self) -> int:
        """Ticks of the move from home to where the slave starts; nothing is followed before."""
        return self._start_ticks

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

    # -- operation -------------------------------------------------------------------------------

    def _load_commands(self) -> None:
        """Compile what commands, faults and new gains call: no stop waits for a compiler."""
        spare = records(self.state.dtype)[0]
        missing_effort(self.arm, np.zeros(self.robot.n), self.arm.gains, self.dt, ticks=0)
        _request(self.parameters, spare, int(Event.STOP))
        _fail(self.parameters, spare, int(Fault.STALL), 0.0, 0.0)

    def _begin_operation(self) -> None:
        """Enabled and on the way to where it starts, or disabled and not homed."""
        s = self.state
        s["command_stamp_ns"], s["fault_joint"] = NO_COMMAND_NS, -1
        s["move_to"], s["move_ticks"] = self.parameters["start"], self._start_ticks
        if self._starts_enabled:
            s["state"] = State.ENABLED
            s["is_homed"] = self._start_ticks == 0
            s["is_busy"] = s["is_homing"] = self._start_ticks > 0

    def _take_script(self, given: OperationParameters) -> None:
        """Write the commands that come by themselves."""
        self._starts_enabled, script = given.starts_enabled, given.script()
        self.parameters["event_count"] = len(script)
        for index, (seconds, event) in enumerate(script):
            self.parameters["event"][index] = event
            self.parameters["event_ns"][index] = round(seconds * 1e9)

    def _take_operation(self, given: OperationParameters) -> None:
        """Write bounds of motion and of faults; those that nobody gave follow from the drives."""
        robot, p, drives = self.robot, self.parameters, self.robot.drives
        assert drives is not None
        p["braking"] = drives.effort_limit / drives.inertia
        p["acceleration"] = p["braking"] * given.acceleration_share
        reach = length(robot.jacobian(robot.home)[:3].T)
        p["tool_speed"] = given.tool_speed or np.max(reach * drives.speed_limit)
        p["tool_acceleration"] = given.tool_acceleration or np.max(reach * p["acceleration"])
        p["lag"] = drives.speed_limit * given.longest_lag
        p["tip_error"] = given.tip_error or p["tool_speed"] * given.longest_lag
        p["overspeed"] = given.overspeed
        p["rest_speed"] = 0.01 * drives.speed_limit + p["encoder_step"] / SPEED_LAG
        p["effort_ticks"] = round(given.effort_time / self.dt)
        for name in ("heartbeat", "longest_outage", "pressing_time"):
            p[_TIMES[name]] = round(getattr(given, name) * 1e9)
        p["brakes"] = given.standstill == "brake"
        p["reported"] = [fault.word in given.reported for fault in Fault]

    def request(self, event: Event | str) -> tuple[Answer, str]:
        """Take a command such as ``"enable"`` between two ticks.

        Args:
            event: The command, one of :data:`~teleop_core.operation.states.COMMANDS`.

        Returns:
            What became of it, and the same in words.

        Raises:
            UnknownNameError: There is no such command.
        """
        asked = command_event(event) if isinstance(event, str) else event
        before = State(int(self.state["state"]))
        answer = Answer(_request(self.parameters, self.state, int(asked)))
        return answer, answer_text(asked, answer, before)

    def press(self, *, is_pressed: bool, now_ns: int) -> None:
        """Take a message of the stop button: pressed, or not; either way it is alive.

        Args:
            is_pressed: Whether it is.
            now_ns: Time [ns].
        """
        self.state["is_pressed"], self.state["heard_ns"] = is_pressed, now_ns
        if is_pressed:
            self.request(Event.STOP)

    def fail(self, fault: Fault, value: float = 0.0, bound: float = 0.0) -> None:
        """Take note of a fault that was found outside, as two publishers of commands.

        Args:
            fault: What was found; it does what :data:`~teleop_core.operation.FAULTS` says.
            value: What was found, in the fault's unit.
            bound: What it must not exceed.
        """
        _fail(self.parameters, self.state, int(fault), value, bound)

    @property
    def operation(self) -> dict[str, float]:
        """Numbers of ``slave/operation`` by name, of the last tick."""
        return dict(zip(OPERATION, self.signals["slave_operation"].tolist(), strict=True))

    def described(self) -> dict[str, str]:
        """Names of the joints, by which the report of the operation calls them."""
        return {"joints": " ".join(self.robot.joint_names)}

    @property
    def refused(self) -> int:
        """Commands refused so far because they were jumps."""
        return int(self.state["refused"])


@kernel
def _request(p: Any, s: Any, event: int) -> int:
    """Take a command; of a stop the fault is told."""
    if event == _STOP:
        was = s.is_stopped
        fail(p, s, _PRESSED, -1, 0.0, 0.0)
        return 1 if was else 0
    return change(s, event)


@kernel
def _fail(p: Any, s: Any, fault: int, value: float, bound: float) -> None:
    """Take note of a fault."""
    fail(p, s, fault, -1, value, bound)


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
        SLAVE_OPERATION,
    ),
    notes=(("command_status", "i8"),),
    make=SlaveSim,
    node="teleop_core.nodes.slave_sim:SlaveSimNode",
)
