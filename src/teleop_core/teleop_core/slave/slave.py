"""Slave: the arm's server. It writes the setpoints that drives, or their simulator, follow.

It contains states, emergency stop, limits, faults, motion commands and the reference filter of any arm. It receives
the arm's measured joints.
"""

import math

import numpy as np

from teleop_core.base import ParameterError, fill
from teleop_core.graph import DT, RunningStage, Stage, assign, topics
from teleop_core.graph.operation import State
from teleop_core.kernels import kernel, length, pointer, pose_from_transform, record, records
from teleop_core.kinematics import FK
from teleop_core.robots import load_robot_set
from teleop_core.robots.robot import Robot
from teleop_core.slave import arm, commands, motion_commands, simulation, step, trajectory
from teleop_core.slave.operation import Answer, Event, Fault, OperationParameters, command_event
from teleop_core.slave.operation.states import answer_text, change
from teleop_core.slave.operation.watch import fail
from teleop_core.slave.parameters import SlaveParameters

_TIMES = {
    "heartbeat": "heartbeat_ns",
    "oldest_command": "oldest_ns",
    "longest_outage": "outage_ns",
    "longest_silence": "silence_ns",
    "effort_time": "effort_ns",
    "pressing_time": "pressing_ns",
}
_STOP, _PRESSED = int(Event.STOP), int(Fault.STOP)
_NEAR = 1e-3  # an arm farther from home than this plus an encoder step is not at home [rad or m]


def derive(p: commands.SlaveRecord, parameters: SlaveParameters, robot: Robot) -> None:
    """Write what follows from the parameters and the robot; bounds that are not given come from the drives."""
    drives, given = robot.drives, parameters.operation
    assert drives is not None
    p.lower[:], p.upper[:] = robot.lower, robot.upper
    p.effort_limit[:], p.speed_limit[:] = drives.effort_limit, drives.speed_limit
    p.near[:] = _NEAR + drives.encoder_step
    p.rest_speed[:] = 0.01 * drives.speed_limit + drives.encoder_step / simulation.SPEED_LAG
    p.braking[:] = drives.effort_limit / drives.inertia
    p.acceleration[:] = p.braking * given.acceleration_share
    reach = length(robot.jacobian(robot.home)[:3].T)
    p.tool_speed = given.tool_speed or np.max(reach * drives.speed_limit)
    p.tool_acceleration = given.tool_acceleration or np.max(reach * p.acceleration)
    p.lag[:] = drives.speed_limit * given.longest_lag
    p.tip_error = given.tip_error or p.tool_speed * given.longest_lag
    p.timeout_ns = round(parameters.command_timeout * 1e9)
    for name, field_ns in _TIMES.items():
        p[field_ns] = round(getattr(given, name) * 1e9)
    p.brakes = given.standstill == "brake"
    p.reported[:] = [fault.word in given.reported for fault in Fault]


class Slave(RunningStage):
    """Stage of an arm's server: from references and commands to setpoints, within states and limits.

    It assumes that the arm is at home until the first measured position comes. Once enabled it moves the arm smoothly
    to the start position, and then follows commands.

    Raises:
        ParameterError: The robot has no drives, or its start position is not valid.
    """

    def __init__(self, parameters: SlaveParameters, dt: float = DT) -> None:
        self.robot = load_robot_set(parameters.robot, parameters.geometry)
        if self.robot.drives is None:
            raise ParameterError("slave.robot", parameters.robot, "a robot with drives")
        n = self.robot.n
        super().__init__(SLAVE, n, dt)
        self.parameters = record(commands.SlaveRecord, n)
        self.state = record(commands.SlaveState, n)
        self.arm = arm.ArmModel(
            fk=self.robot.fk_pointer,
            jacobian=pointer(self.robot.kernels.jacobian, FK),
            geometry=self.robot.geometry_row.copy(),
            setpoint=np.zeros(n), joints=np.zeros(n), effort=np.zeros(n), T=np.zeros((4, 4)),
            is_free=np.zeros(n), J=np.zeros((6, n)),
        )  # fmt: skip
        self.kernel, self.arguments = step.slave_step, (self.parameters, self.state, self.arm)
        self.motion = motion_commands.MotionCommands(self)
        self._take_start(parameters)
        self._take_script(parameters.operation)
        self.retune(parameters)
        self.reset()
        self._load_commands()

    def reset(self) -> None:
        """Return to home, without any command."""
        s, home = self.state, self.robot.home
        assign(s, 0)
        for name in ("command", "filtered", "setpoint", "target", "move_from", "measured"):
            s[name] = home
        self._begin_operation()
        row, transform = self.signals, np.empty((4, 4))
        row["slave_setpoint_js"] = home
        row["slave_setpoint_js_ns"] = row["slave_setpoint_cp_ns"] = s["command_stamp_ns"]
        self.robot.kernels.fk(home.copy(), self.arm.geometry, transform)
        pose_from_transform(transform, row["slave_setpoint_cp"])

    def retune(self, parameters: SlaveParameters) -> None:
        """Take new parameters from the next tick on."""
        fill(self.parameters, parameters)
        derive(self.parameters, parameters, self.robot)

    def _take_start(self, parameters: SlaveParameters) -> None:
        """Plan the move from home to the slave's start.

        Raises:
            ParameterError: The start does not fit the robot's joints, or is outside their limits.
        """
        robot, p = self.robot, self.parameters
        assert robot.drives is not None
        start = parameters.start_of(robot)
        if start.shape != robot.home.shape:
            raise ParameterError("slave.start", parameters.start, f"{robot.n} joints, or empty")
        if not ((robot.lower <= start) & (start <= robot.upper)).all():
            limits = f"{robot.lower.tolist()} to {robot.upper.tolist()}"
            needed = f"inside the limits, {limits}"
            raise ParameterError("slave.start", parameters.start, needed)
        speed = robot.drives.speed_limit * parameters.start_speed
        time = trajectory.shortest_move_time(robot.home, start, speed)
        p.start_jp[:], self._start_ticks = start, math.ceil(time / self.dt)

    @property
    def lead(self) -> int:
        """Ticks of the move from home to the slave's start; the slave follows no command before its end."""
        return self._start_ticks

    # -- operation -------------------------------------------------------------------------------

    def _load_commands(self) -> None:
        """Compile the functions of commands and faults, so that no stop is delayed by the compiler."""
        spare = records(self.state.dtype)[0]
        _request(self.parameters, spare, int(Event.STOP))
        _fail(self.parameters, spare, int(Fault.STALL), 0.0, 0.0)

    def _begin_operation(self) -> None:
        """Begin enabled and moving to the start, or disabled and not homed."""
        s = self.state
        s["command_stamp_ns"], s["fault_joint"] = topics.NO_COMMAND_NS, -1
        s["move_to"], s["move_ticks"] = self.parameters.start_jp, self._start_ticks
        if self._starts_enabled:
            s["state"] = State.ENABLED
            s["is_homed"] = self._start_ticks == 0
            s["is_busy"] = s["is_homing"] = self._start_ticks > 0

    def _take_script(self, given: OperationParameters) -> None:
        """Write the scripted commands into the record."""
        self._starts_enabled, script = given.starts_enabled, given.script()
        p = self.parameters
        p.event_count = len(script)
        for index, (seconds, event) in enumerate(script):
            p.event[index], p.event_ns[index] = event, round(seconds * 1e9)

    def request(self, event: Event | str) -> tuple[Answer, str]:
        """Take a command such as ``"enable"`` between two ticks.

        Args:
            event: The command, one of :data:`~teleop_core.slave.operation.states.COMMANDS`.

        Returns:
            The answer to the command, and a text with the same content.

        Raises:
            UnknownNameError: There is no such command.
        """
        asked = command_event(event) if isinstance(event, str) else event
        before = State(int(self.state["state"]))
        answer = Answer(_request(self.parameters, self.state, int(asked)))
        text = answer_text(asked, answer, before)
        if asked is Event.ENABLE and answer is Answer.DONE and not self.state["is_homed"]:
            text += "; it is not homed: home next"
        return answer, text

    def press(self, *, is_pressed: bool, heard_ns: int) -> None:
        """Take the state of the stop buttons.

        Args:
            is_pressed: Whether any button holds the stop pressed.
            heard_ns: Time of the last message of the button that has been silent longest [ns]; the heartbeat timeout
                starts then.
        """
        self.state["is_pressed"], self.state["heard_ns"] = is_pressed, heard_ns
        if is_pressed:
            self.request(Event.STOP)

    def fail(self, fault: Fault, value: float = 0.0, bound: float = 0.0) -> None:
        """Record a fault that was found outside this stage, such as two publishers of commands.

        Args:
            fault: The fault; :data:`~teleop_core.slave.operation.FAULTS` gives its reaction.
            value: The value that was found, in the fault's unit.
            bound: The bound of that value.
        """
        _fail(self.parameters, self.state, int(fault), value, bound)

    def answer_measured(self) -> None:
        """Write the tip pose of the measured joints into the signals, for a session that does not call the step."""
        row, transform = self.signals, np.empty((4, 4))
        joints = row["slave_measured_js"][: self.robot.n].copy()
        self.robot.kernels.fk(joints, self.arm.geometry, transform)
        pose_from_transform(transform, row["slave_measured_cp"])

    @property
    def operation(self) -> dict[str, float]:
        """Numbers of ``slave/operation`` of the last tick, by name."""
        return dict(zip(topics.OPERATION, self.signals["slave_operation"].tolist(), strict=True))

    def described(self) -> dict[str, str]:
        """Joint names that the report of the operation uses."""
        return {"joints": " ".join(self.robot.joint_names)}

    @property
    def refused(self) -> int:
        """Number of commands refused so far because they were jumps."""
        return int(self.state["refused"])


@kernel
def _request(p: commands.SlaveRecord, s: commands.SlaveState, event: int) -> int:
    """Take a command; a stop also records the stop fault."""
    if event == _STOP:
        was = s.is_stopped
        fail(p, s, _PRESSED, -1, 0.0, 0.0)
        return 1 if was else 0
    return change(s, event)


@kernel
def _fail(p: commands.SlaveRecord, s: commands.SlaveState, fault: int, value: float, bound: float) -> None:
    fail(p, s, fault, -1, value, bound)


SLAVE = Stage(
    "slave",
    SlaveParameters,
    reads=(topics.SLAVE_SERVO_JP, topics.SLAVE_MEASURED_JS),
    writes=(topics.SLAVE_SETPOINT_JS, topics.SLAVE_SETPOINT_CP, topics.SLAVE_MEASURED_CP, topics.SLAVE_OPERATION),
    late=(topics.SLAVE_MEASURED_JS,),
    notes=(("command_status", "i8"),),
    make=Slave,
    node="teleop_core.nodes.slave:SlaveNode",
)
