"""Arm bridge: the stage between the slave stage, which is the arm's server, and the controller of a real arm.

The bridge replaces ``slave_sim``: it reads the same setpoints and writes the measured joints of the real arm. Invalid
samples are dropped. If they continue, the server stops the arm and reports the fault ``feedback``.
"""

from dataclasses import dataclass

import numpy as np

from teleop_core.base import Choice, ParameterError, Within, choice, fixed
from teleop_core.graph import DT, RunningStage, Stage, topics
from teleop_core.graph.operation import State
from teleop_core.kernels.geometry import Array
from teleop_core.robots import load_robot_set
from teleop_core.robots.joint_map import JointMap
from teleop_core.robots.selection import RobotParameters
from teleop_core.slave.bridges import BRIDGES, Command
from teleop_core.slave.bridges.hearing import Hearing, Sample
from teleop_core.slave.bridges.leading import Lead

RATES = (100, 125, 200, 250, 500, 1000)
"""Command rates [Hz] whose period is a whole number of milliseconds."""
_STATE, _BRAKED = topics.OPERATION.index("state"), topics.OPERATION.index("is_braked")


@dataclass(frozen=True, kw_only=True)
class BridgeParameters:
    """Parameters of every bridge to a controller."""

    kind: Choice = choice(BRIDGES, "joint_state", doc="kind of command that the arm's controller accepts", fixed=True)
    command_topic: str = fixed(
        "", doc="topic on which the controller receives commands; empty: the usual topic of its kind"
    )
    state_topic: str = fixed(
        "", doc="topic on which the arm publishes its JointState; empty: the usual topic of its kind"
    )
    rate: int = fixed(
        500,
        Within(100, 1000, "1/s"),
        "number of commands per second, one of " + ", ".join(map(str, RATES)),
        source="assumed",
    )
    stamps: str = fixed(
        "header",
        choices=("header", "sent"),
        doc="timestamp of a sample of the arm: header: the stamp of its header; sent: the time when "
        "it was sent, for arms with another clock",
    )
    oldest_stamp: float = fixed(
        0.1,
        Within(0.001, 1.0, "s"),
        "largest difference between the stamp of a sample and our clock; samples beyond it are refused",
        source="assumed",
    )
    jump_tolerance: float = fixed(
        0.02,
        Within(1e-4, 0.1, "rad or m"),
        "largest joint motion between two samples, added to the motion at twice the rated speed; "
        "samples beyond it are refused",
        source="assumed",
    )
    arm_timeout: float = fixed(
        0.3,
        Within(0.02, 5.0, "s"),
        "if no valid sample of the arm arrives for this time, the bridge sends no more commands; the "
        "slave holds earlier, after its command_timeout",
        source="assumed",
    )
    setpoint_timeout: float = fixed(
        0.1,
        Within(0.005, 5.0, "s"),
        "if no slave/setpoint_js arrives for this time, the bridge sends no more commands",
        source="assumed",
    )

    def __post_init__(self) -> None:
        """Refuse a rate whose period is not a whole number of milliseconds."""
        if self.rate not in RATES:
            raise ParameterError("rate", self.rate, f"one of {', '.join(map(str, RATES))}")


@dataclass(frozen=True, kw_only=True)
class ArmBridgeParameters(RobotParameters, BridgeParameters):
    """Parameters of :class:`ArmBridge`."""

    joints: tuple[str, ...] = fixed((), doc="ours=theirs for each joint that has another name in the arm's messages")
    signs: tuple[float, ...] = fixed(
        (),
        Within(-1.0, 1.0),
        "sign of each of our joints, 1.0 or -1.0: our position = sign * arm position + offset; empty: 1.0",
    )
    offsets: tuple[float, ...] = fixed(
        (),
        Within(unit="rad or m"),
        "offset of each of our joints: our position = sign * arm position + offset; empty: 0.0",
    )
    order: tuple[str, ...] = fixed(
        (),
        doc="names of the arm's joints in the order of its commands, because a forward command "
        "contains no names; empty: the robot's order",
    )
    start_tolerance: float = fixed(
        0.02,
        Within(1e-4, 0.1, "rad or m"),
        "the bridge starts to send commands when each joint is nearer to its setpoint than this",
        source="assumed",
    )


class ControllerBridge(RunningStage):
    """Base of stages that command a real controller and publish its measured joints.

    Its node calls ``hear`` for each message of the controller, and ``command`` when a command is due.

    Args:
        stage: Description of the stage: setpoints are its first input, measured joints its output.
        parameters: Parameters of the bridge.
        joints: Map between the robot's joints and those of the controller.
        lead: Computes the commands to the controller.
        speed_limit: Rated speeds (n,) [rad/s or m/s].
        dt: Length of a tick [s].
    """

    def __init__(
        self, stage: Stage, parameters: BridgeParameters, joints: JointMap, lead: Lead, speed_limit: Array, dt: float
    ) -> None:
        super().__init__(stage, len(joints.ours), dt)
        self.kernel = _nothing
        self.parameters, self.joints, self.lead_arm = parameters, joints, lead
        oldest = parameters.oldest_stamp if parameters.stamps == "header" else 0.0
        self.hearing = Hearing(joints, speed_limit, parameters.jump_tolerance, oldest)
        self._setpoint, self._measured = stage.reads[0], stage.writes[0]
        self._every, self._sent_ns = round(1e9 / parameters.rate), 0
        self._due_ns, self._left_ns = 0, 0

    def hear(self, sample: Sample, now_ns: int) -> bool:
        """Take a sample of the arm that came at ``now_ns`` [ns]; return whether ``slave/measured_js`` is new.

        After a jump, or after the server's setpoint moved without the arm, ``slave/measured_js`` is not updated until
        the server has left ENABLED. Then the arm restarts as after its first sample.
        """
        hearing, row = self.hearing, self.signals
        if row["slave_operation"][_STATE] != State.ENABLED:
            self._left_ns = 0
            if hearing.has_jumped:
                hearing.begin_anew()
                self.lead_arm.let_go("the arm jumped")
        if not hearing.hear(sample, now_ns) or self._is_left(now_ns):
            return False
        values = (hearing.position, hearing.velocity, hearing.effort)
        row[self._measured.field] = np.concatenate(values)
        return True

    def _is_left(self, now_ns: int) -> bool:
        """Whether the server's setpoint has moved without the arm for longer than the timeout of setpoints."""
        return 0 < self._left_ns < now_ns - round(1e9 * self.parameters.setpoint_timeout)

    def is_due(self, now_ns: int) -> bool:
        """Whether a command is due in the tick at time ``now_ns`` [ns]; missed commands are not made up for."""
        if now_ns < self._due_ns:
            return False
        late = now_ns - self._due_ns
        self._due_ns = now_ns + self._every - (late if late < self._every else 0)
        return True

    def command(self, now_ns: int, setpoint_age: float, is_led: bool) -> Command | None:
        """Return the command to send now; None if no command is to be sent.

        Args:
            now_ns: Time [ns].
            setpoint_age: Time since the last setpoint came [s]; infinite before the first.
            is_led: Whether the server has published its state in ``slave/operation``.
        """
        elapsed, self._sent_ns = 1e-9 * (now_ns - self._sent_ns), now_ns
        is_late = elapsed > self.parameters.setpoint_timeout
        if is_late and self.lead_arm.has_lost(self.hearing.position):
            self.lead_arm.let_go("the arm moved although the bridge sent no command")
        if not self._moves(now_ns, setpoint_age, is_led, elapsed):
            return None
        joints, lead = self.joints, self.lead_arm
        return Command(
            joints.order, joints.command(lead.position), joints.command_rate(lead.velocity), 1e-9 * self._every, now_ns
        )

    def _moves(self, now_ns: int, setpoint_age: float, is_led: bool, elapsed: float) -> bool:
        row, lead, hearing, p = self.signals, self.lead_arm, self.hearing, self.parameters
        silence = 1e-9 * (now_ns - hearing.heard_ns)
        strange = f"; its messages contain only {hearing.strange}" if hearing.strange else ""
        if not hearing.heard_ns:
            return lead.let_go(f"the arm has not sent its joint positions yet{strange}")
        if hearing.has_jumped or silence > p.arm_timeout:
            silent = f"no valid sample of the arm for {silence:.1f} s{strange}"
            return lead.let_go(hearing.wrong if hearing.has_jumped else silent)
        if not is_led:
            return lead.let_go("waits for slave/operation: no slave node commands the arm")
        if self._is_braked():
            return lead.brake(hearing.position, elapsed)
        if setpoint_age > p.setpoint_timeout:
            return lead.let_go(f"no {self._setpoint.name} for {setpoint_age:.1f} s")
        return self._leads(row[self._setpoint.field], now_ns, elapsed)

    def _is_braked(self) -> bool:
        """Whether brakes hold the joints."""
        return bool(self.signals["slave_operation"][_BRAKED] > 0.0)

    def _leads(self, setpoint: Array, now_ns: int, elapsed: float) -> bool:
        """Move towards the setpoint. If the setpoint has moved away without the arm, wait until it is at rest."""
        lead = self.lead_arm
        go = lead.rejoin if self._is_left(now_ns) else lead.step
        goes = go(setpoint, self.hearing.position, self.joints.ours, elapsed)
        self._left_ns = 0 if lead.is_leading else self._left_ns or now_ns
        return goes

    def trouble(self) -> str:
        """Reason in one line why the arm gets no commands, or why its samples are rejected; empty without a problem."""
        if self.hearing.wrong:
            return f"the arm's messages are refused: {self.hearing.wrong}: holds"
        return self.lead_arm.waits

    def concerns(self) -> list[str]:
        """Reasons why the arm gets no commands."""
        return [text] if (text := self.trouble()) else []


class ArmBridge(ControllerBridge):
    """Stage that commands a real arm's controller and publishes the arm's measured joints.

    Raises:
        TeleopError: The robot has no drives, or the joints do not fit.
    """

    def __init__(self, parameters: ArmBridgeParameters, dt: float = DT) -> None:
        robot, p = load_robot_set(parameters.robot, parameters.geometry), parameters
        if robot.drives is None:
            raise ParameterError("arm_bridge.robot", p.robot, "a robot with drives")
        speed = robot.drives.speed_limit
        joints = JointMap(robot.joint_names, p.joints, p.signs, p.offsets, p.order)
        lead = Lead(robot.lower, robot.upper, speed, p.start_tolerance, 1.0 / p.rate)
        super().__init__(ARM_BRIDGE, p, joints, lead, speed, dt)


def _nothing(row: object, dt: float) -> None:
    """Do nothing: placeholder for a kernel, because the node calls the stage directly."""


ARM_BRIDGE = Stage(
    "arm_bridge",
    ArmBridgeParameters,
    reads=(topics.SLAVE_SETPOINT_JS, topics.SLAVE_OPERATION),
    writes=(topics.SLAVE_MEASURED_JS,),
    make=ArmBridge,
    node="teleop_core.nodes.arm_bridge:ArmBridgeNode",
)
