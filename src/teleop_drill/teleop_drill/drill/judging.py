"""Judging: measurements of a fault, and their bounds, which follow from the parameters of the session."""

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from teleop_core.graph.operation import State
from teleop_drill.drill import measure
from teleop_drill.drill.exercise import AllowedMotion, Exercise
from teleop_drill.drill.hand import RADIUS
from teleop_drill.drill.measure import Trace
from teleop_drill.drill.numbers import OVERSHOOT, WARNED, Numbers, Scheduling

_ROUNDING = 1e-9
_HOPS = 4
"""Number of topics from the hand to the setpoint."""
_FULL = 0.9
"""Share of the possible deceleration with which a setpoint must brake."""
_LEAST = 0.8
"""Share of the hand's path that an arm must travel if it is expected to keep moving."""
_SLOW = 0.05
"""Share of the hand's speed below which the tip is at rest."""
_NOW_NS = 15_000_000  # time over which the present speed is measured [ns]
_CALM = 10.0
"""Time after which the control loop's speed is below the share `_SLOW`, as a multiple of :attr:`Numbers.coast`. When
the setpoint stops, the speed is :math:`(1 + x - x^2) e^{-x}`, which is below the share from x = 6.6 on."""
_SETTLED = 5.0  # time after which a filter has settled, as a multiple of its time constant


@dataclass(frozen=True)
class Measured:
    """One measured number with its bounds.

    Attributes:
        name: Name in files, with the unit at the end: ``"travel_m"``.
        text: Error text if the value is outside of its bounds: ``"the tip moved {0:.1f} mm, at most {1:.1f}"``.
        value: The number in SI units; NaN if it could not be measured, which is not an error.
        most: Largest allowed value.
        least: Smallest allowed value.
        scale: Factor from SI units to the unit of the text.
    """

    name: str
    text: str
    value: float
    most: float = math.inf
    least: float = -math.inf
    scale: float = 1e3

    @property
    def failure(self) -> str:
        """Error text; empty if the value is within its bounds."""
        if not (self.value > self.most or self.value < self.least):
            return ""
        bound = self.most if self.value > self.most else self.least
        return self.text.format(self.scale * self.value, self.scale * bound)

    def to_json(self) -> dict[str, float | None]:
        """Value and bounds, in SI units; None for a missing value or bound."""
        numbers = {"value": self.value, "most": self.most, "least": self.least}
        return {k: round(v, 9) if math.isfinite(v) else None for k, v in numbers.items()}


@dataclass(frozen=True, eq=False)
class Tapped:
    """Messages that an independent tap received during one fault.

    Attributes:
        begin_ns: Begin of the fault [ns].
        end_ns: End of the fault [ns].
        setpoint_js: Joint setpoints.
        measured_js: Joints that the slave measures: position, speed, effort.
        true_cp: True pose of the tip, from the plant.
        told_ns: Time at which ``slave/operation`` first reported the state or the fault [ns]; None without a report.
        warned_ns: Time of the first new warning of a node [ns]; None without a warning.
        scheduling: Lateness of the drill's wake-ups during the fault.
        deaf: Time for which the slave's process was stopped [s].
    """

    begin_ns: int
    end_ns: int
    setpoint_js: Trace
    measured_js: Trace
    true_cp: Trace
    told_ns: int | None
    warned_ns: int | None
    scheduling: Scheduling
    deaf: float = 0.0

    def since(self, time_ns: int | None) -> float:
        """Time from the begin of the fault to an event [s]; infinite if the event never happened."""
        return math.inf if time_ns is None else 1e-9 * (time_ns - self.begin_ns)


def judge(exercise: Exercise, seen: Tapped, numbers: Numbers) -> Iterator[Measured]:
    """All measurements of one fault, each with its bounds."""
    yield from _always(exercise, seen, numbers)
    yield from _told(exercise, seen, numbers)
    if exercise.brakes:
        yield _unpowered(seen, numbers)
    if exercise.motion in {AllowedMotion.RESTS, AllowedMotion.HOLDS}:
        yield from _stops(exercise, seen, numbers)
    elif exercise.motion is AllowedMotion.GOES_ON:
        yield from _goes_on(exercise, seen, numbers)
    else:
        yield _speed(exercise, seen, numbers)


def late(seen: Tapped, numbers: Numbers) -> float:
    """Delay that transport and machine may add to any time [s].

    The delay is a tick for each topic from hand to setpoint, plus twice the wake-up delay of the drill's own thread:
    once for sending a message, and once for receiving it.
    """
    return _HOPS * numbers.tick + 2.0 * seen.scheduling.worst


def _always(exercise: Exercise, seen: Tapped, numbers: Numbers) -> Iterator[Measured]:
    """Check the limits that are valid for every fault."""
    robot, setpoints = numbers.robot, seen.setpoint_js
    ratio = measure.step_ratio(setpoints, numbers.speed_limit, numbers.tick)
    text = "a joint step of {0:.3f} times the drive's limit"
    yield Measured("step_ratio", text, ratio, 1.0 + _ROUNDING, scale=1.0)
    yield _tool(exercise, seen, numbers)
    outside = measure.beyond(setpoints.values, robot.lower, robot.upper)
    text = "a setpoint {0:.2g} rad or m beyond its joint's limit"
    yield Measured("beyond_limit", text, outside, _ROUNDING, scale=1.0)
    measured = measure.tips(robot.fk, seen.measured_js, robot.n)
    text = "the paths by measured_js and of the true tip differ by {0:.2f} mm, at most {1:.2f}"
    way = measure.travel(seen.true_cp, seen.begin_ns, seen.end_ns)
    most = measure.RESOLUTION + 0.1 * (0.0 if math.isnan(way) else way)
    yield Measured("apart_m", text, measure.apart(measured, seen.true_cp), most)
    # While the arm is silent, its motion is unknown. The slave stops an arm that is silent for longer than this.
    text = "messages of the tip or the joints ended {0:.0f} ms before the setpoints, at most {1:.0f}"
    silence = max(measure.silence(one, setpoints) for one in (seen.true_cp, seen.measured_js))
    yield Measured("silent_s", text, silence, numbers.command_timeout + late(seen, numbers))


def _tool(exercise: Exercise, seen: Tapped, numbers: Numbers) -> Measured:
    """Compare steps of the tip's setpoint with the speed limit of the tool.

    The slave slows all joints by one factor. For the tip this is exact, except for an error of the order of a joint
    step [rad].
    """
    since_ns = seen.begin_ns + round(1e9 * late(seen, numbers))
    chosen = seen.setpoint_js.within(since_ns, seen.end_ns)
    places = measure.tips(numbers.robot.fk, chosen, numbers.robot.n)
    limit = min(exercise.tool_speed, numbers.tool_speed)
    ratio = measure.way_ratio(places, limit, numbers.tick)
    text = "a step of the tip's setpoint of {0:.3f} times the tool speed"
    most = 1.0 + float(np.max(numbers.speed_limit)) * numbers.tick
    return Measured("tool_ratio", text, ratio, most, scale=1.0)


def _told(exercise: Exercise, seen: Tapped, numbers: Numbers) -> Iterator[Measured]:
    """Check the times of the slave's report of the fault and of the warning in ``diagnostics``."""
    if exercise.told is not None:
        most = seen.deaf + exercise.told(numbers) + late(seen, numbers)
        text = "slave/operation reported after {0:.0f} ms, at most {1:.0f}"
        yield Measured("told_s", text, seen.since(seen.told_ns), most)
    if exercise.warns:
        most = exercise.allowed(numbers) + WARNED + late(seen, numbers)
        text = "diagnostics warned after {0:.0f} ms, at most {1:.0f}"
        yield Measured("warned_s", text, seen.since(seen.warned_ns), most)


def _unpowered(seen: Tapped, numbers: Numbers) -> Measured:
    """Check that drives which are off give no effort in the last samples of the fault."""
    last = seen.measured_js.within(seen.end_ns - _NOW_NS, seen.end_ns).values[:, -numbers.robot.n :]
    effort = float(np.max(np.abs(last), initial=0.0)) if last.size else math.nan
    text = "the drives gave {0:.3g} N m or N, must be off"
    return Measured("effort_n", text, effort, _ROUNDING, scale=1.0)


def _stops(exercise: Exercise, seen: Tapped, numbers: Numbers) -> Iterator[Measured]:
    """Check the stopping distance, the speed until rest, and that the tip then stays at rest."""
    going = exercise.allowed(numbers) + late(seen, numbers)
    yield _travel_to_rest(exercise, seen, numbers, going)
    yield _speed(exercise, seen, numbers)
    if exercise.motion is AllowedMotion.HOLDS:
        yield _held(exercise, seen, numbers)
        return
    if None not in exercise.states:  # a slave that has ended sends nothing
        yield from _rests(exercise, seen, numbers, going)
    text = "a joint braked with {0:.2f} of its drive's deceleration, at least {1:.2f}"
    stopping = seen.setpoint_js.within(0, seen.end_ns)
    share = measure.ramp(stopping, numbers.braking, numbers.tick)
    yield Measured("braking_share", text, share, least=_FULL, scale=1.0)


def _travel_to_rest(exercise: Exercise, seen: Tapped, numbers: Numbers, going: float) -> Measured:
    """Check the distance to rest.

    The tip may continue for the time ``going`` [s], brake, and catch up with its setpoint.
    """
    begin_ns, setpoints, robot = seen.begin_ns, seen.setpoint_js, numbers.robot
    speed = min(measure.speed_before(seen.true_cp, begin_ns), OVERSHOOT * numbers.tip_speed)
    wanted = measure.tips(robot.fk, setpoints, robot.n)
    joints = setpoints.within(0, begin_ns).values
    jacobian = robot.jacobian(joints[-1] if len(joints) else robot.home)
    bound = measure.RESOLUTION + measure.lag(wanted, seen.true_cp, begin_ns)
    bound += measure.braking_way(setpoints, begin_ns, jacobian, numbers.braking)
    settling = numbers.filter_time if exercise.motion is AllowedMotion.HOLDS else 0.0
    bound += speed * (going + numbers.coast + settling)
    went = measure.travel(seen.true_cp, begin_ns, seen.end_ns)
    return Measured("travel_m", "the tip moved {0:.1f} mm, at most {1:.1f}", went, bound)


def _rests(exercise: Exercise, seen: Tapped, numbers: Numbers, going: float) -> Iterator[Measured]:
    """Check the times at which the setpoints stop and the tip is at rest.

    Setpoints do not brake if an arm is in FAULT, but its drives must.
    """
    begin_ns, setpoints = seen.begin_ns, seen.setpoint_js
    until = seen.deaf + going
    since_ns, until_ns = begin_ns - measure.JUST_BEFORE_NS, begin_ns + round(1e9 * until)
    fastest = measure.joint_speeds(setpoints, since_ns, until_ns)
    braking = float(np.max(fastest / numbers.braking, initial=0.0))
    still = measure.stop_delay(setpoints.within(0, seen.end_ns), begin_ns)
    most = until + (0.0 if State.FAULT in exercise.states else braking)
    text = "setpoints stood still after {0:.0f} ms, at most {1:.0f}"
    yield Measured("still_s", text, _or_never(still), most)
    moving = seen.true_cp.within(0, seen.end_ns)
    rest = measure.rest_delay(moving, begin_ns, _SLOW * numbers.tip_speed, seen.end_ns)
    text = "the tip was at rest after {0:.0f} ms, at most {1:.0f}"
    yield Measured("rest_s", text, _or_never(rest), until + braking + _CALM * numbers.coast)


def _or_never(time: float) -> float:
    """The given time [s], or infinity if it is NaN."""
    return math.inf if math.isnan(time) else time


def _held(exercise: Exercise, seen: Tapped, numbers: Numbers) -> Measured:
    """Check the speed of a tip that must not move, after the filter has settled."""
    settling = exercise.allowed(numbers) + _SETTLED * (numbers.filter_time + numbers.coast)
    since_ns = seen.begin_ns + round(1e9 * (settling + late(seen, numbers)))
    left = math.exp(-_SETTLED) * OVERSHOOT * numbers.tip_speed
    held = measure.tip_speed(seen.true_cp.within(since_ns, seen.end_ns))
    return Measured(
        "held_speed_m_s", "the tip held still moves at {0:.1f} mm/s, at most {1:.1f}", held, left + measure.RESOLUTION
    )


def _speed(exercise: Exercise, seen: Tapped, numbers: Numbers) -> Measured:
    """Check the speed of the tip, which must never exceed the speed that the hand commands."""
    moving = seen.true_cp.within(seen.begin_ns, seen.end_ns)
    gap = exercise.gap(numbers) + late(seen, numbers)
    times = numbers.catching_up(gap, by_drives=exercise.by_drives)
    asked = numbers.gain * exercise.hand_speed * times
    most = OVERSHOOT * min(asked, exercise.tool_speed)
    text = "the tip moved at {0:.0f} mm/s, at most {1:.0f}"
    return Measured("tip_speed_m_s", text, measure.tip_speed(moving), most)


def _goes_on(exercise: Exercise, seen: Tapped, numbers: Numbers) -> Iterator[Measured]:
    """Check that a moving arm follows the hand: at most as far and as fast as the hand, and nearly as far."""
    begin_ns, end_ns = seen.begin_ns, seen.end_ns
    yield _speed(exercise, seen, numbers)
    elapsed, stands = 1e-9 * (end_ns - begin_ns), exercise.stands(numbers)
    speed = numbers.tip_speed
    lag = measure.lag(measure.tips(numbers.robot.fk, seen.setpoint_js, numbers.robot.n), seen.true_cp, begin_ns)
    # On its circle the hand moves no farther than the diameter. The circle of the arm is shifted by the hand's motion
    # while the arm stands. Behind a first-order filter the setpoint lags behind the command by its speed times the
    # time constant, and by less while it starts from rest.
    now = measure.tip_speed(seen.true_cp.within(begin_ns - _NOW_NS, begin_ns))
    coming = max(0.0, speed - now)
    far = 2.0 * RADIUS * numbers.gain + speed * min(stands, elapsed) + coming * numbers.filter_time
    text = "the tip moved {0:.1f} mm, at most {1:.1f}"
    bound = lag + measure.RESOLUTION + min(OVERSHOOT * speed * elapsed, far)
    yield Measured("travel_m", text, measure.travel(seen.true_cp, begin_ns, end_ns), bound)
    went = measure.path(seen.true_cp, begin_ns, end_ns)
    least = _LEAST * speed * max(0.0, elapsed - stands - numbers.filter_time - late(seen, numbers))
    text = "the tip moved {0:.0f} mm, at least {1:.0f}: the arm did not follow"
    yield Measured("path_m", text, went, least=least)
