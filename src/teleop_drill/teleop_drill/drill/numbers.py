"""Numbers of a session from which all bounds of a drill follow."""

import math
from dataclasses import dataclass

import numpy as np

from teleop_core.coupling.mapping.gains import MotionScalingParameters
from teleop_core.graph.signals import DT
from teleop_core.hand.master.haptic_master import HapticMasterParameters
from teleop_core.kernels.geometry import Array
from teleop_core.robots.robot import Robot
from teleop_core.session.configuration import Configuration
from teleop_core.slave.parameters import SlaveParameters
from teleop_core.slave.slave import Slave
from teleop_drill.drill import hand

OVERSHOOT = 1.5
"""Largest speed of the tip divided by the speed of its setpoint. Three equal poles with a zero at a third of their
value overshoot a step by a quarter (:func:`~teleop_core.slave.controllers.pid.critically_damped_gains`). A setpoint
that reverses at full speed causes a step of twice its speed."""
_STEP = 0.8
"""Largest speed of a step response, divided by bandwidth and step: the maximum of (3 x - x²) exp(-x), at x = 0.70."""
_COAST = 0.84
"""Distance that a control loop with three equal poles moves beyond a setpoint that stops suddenly, in units of speed
divided by pole. It is the maximum of :math:`(x + x^2) e^{-x}`, the response to a ramp that ends."""
WARNED = 2.0
"""Time of two reports in ``diagnostics`` [s]. Two are needed, because the first may describe the time before the fault.
"""


@dataclass(frozen=True)
class Scheduling:
    """Wake-up delays of this machine, measured with a thread of the drill.

    Attributes:
        usual: Median of the delays [s].
        worst: Largest delay [s].
    """

    usual: float = 0.0
    worst: float = 0.0

    def beside(self, other: "Scheduling") -> "Scheduling":
        """The larger values of two measurements."""
        return Scheduling(max(self.usual, other.usual), max(self.worst, other.worst))


@dataclass(frozen=True, eq=False)
class Numbers:
    """Numbers from a session's parameters and drives.

    Attributes:
        robot: The slave.
        gain: Motion of the tip divided by the motion of the hand.
        speed_limit: Speed limit of each joint's drive, shape (n,) [rad/s or m/s].
        braking: Deceleration of each drive, shape (n,) [rad/s² or m/s²].
        tool_speed: Largest speed of the tip's setpoint [m/s].
        command_timeout: Silence of commands after which the setpoint brakes [s].
        longest_outage: Silence after which the arm is PAUSED [s].
        longest_silence: Silence of the arm itself that is a fault [s].
        longest_pause: Silence of the hand after which hand and slave are aligned again [s].
        hand_timeout: Silence of the hand after which the stylus counts as released [s].
        button_silence: Silence of the buttons that counts as a pressed clutch [s].
        effort_time: Time at the effort limit that is a fault [s].
        pressing_time: Time beyond a joint's limit after which the slave reports it [s].
        filter_time: Time constant of the reference filter [s]; 0 without a filter.
        coast: Time for which the arm continues at its speed after its setpoint has stopped [s].
        bandwidth: Bandwidth of the fastest drive [rad/s].
    """

    robot: Robot
    gain: float
    speed_limit: Array
    braking: Array
    tool_speed: float
    command_timeout: float
    longest_outage: float
    longest_silence: float
    longest_pause: float
    hand_timeout: float
    button_silence: float
    effort_time: float
    pressing_time: float
    filter_time: float
    coast: float
    bandwidth: float
    tick: float = DT

    @property
    def tip_speed(self) -> float:
        """Speed of the tip that follows the hand [m/s]."""
        return hand.SPEED * self.gain

    def catching_up(self, gap: float, *, by_drives: bool = False) -> float:
        """Speed at which the arm catches up after a gap [s], as a multiple of the hand's speed.

        The hand's motion during the gap arrives as one step. The reference filter follows the step with an initial
        speed of step divided by time constant. After a longer pause hand and slave are aligned again. If the drives
        themselves stood still, the setpoint moved without them, and the drives follow the difference as a step. With a
        triple pole w and no derivative of the setpoint, the speed of the drives is at most 0.8 w times the step.
        """
        rate = 1.0 / max(self.filter_time, self.tick)
        if by_drives:
            rate = max(rate, _STEP * self.bandwidth)
        return 1.0 + min(gap, self.longest_pause) * rate

    @staticmethod
    def of(configuration: Configuration) -> "Numbers":
        """Compute the numbers of a session from its configuration."""
        given, scaling = configuration.of(SlaveParameters), configuration.of(MotionScalingParameters)
        slave, lag = Slave(given), given.reference_filter
        drives = slave.robot.drives
        assert drives is not None
        is_coarse = scaling.mode == "coarse"
        return Numbers(
            robot=slave.robot,
            gain=scaling.coarse_gain if is_coarse else scaling.fine_gain,
            speed_limit=np.array(drives.speed_limit),
            braking=np.array(drives.effort_limit / drives.inertia),
            tool_speed=float(slave.parameters["tool_speed"]),
            command_timeout=given.command_timeout,
            longest_outage=given.operation.longest_outage or math.inf,
            longest_silence=given.operation.longest_silence,
            longest_pause=scaling.longest_pause,
            hand_timeout=configuration.of(HapticMasterParameters).hand_timeout,
            button_silence=scaling.plausible.button_silence,
            effort_time=given.operation.effort_time,
            pressing_time=given.operation.pressing_time,
            filter_time=1.0 / lag.pole if lag.is_on else 0.0,
            coast=_COAST / float(np.min(drives.bandwidth)),
            bandwidth=float(np.max(drives.bandwidth)),
        )
