"""Feedback: the arm's server leads an arm that tells it where it is, and no other."""

from typing import Any

import numpy as np
import pytest

from present import present
from teleop_core.base import build
from teleop_core.graph import DT, TICK_NS, topics
from teleop_core.graph.operation import State
from teleop_core.kernels.geometry import Array
from teleop_core.robots import load_robot
from teleop_core.slave.commands import CommandStatus
from teleop_core.slave.operation import Event, Fault
from teleop_core.slave.pair import ArmParameters, SimulatedArm
from teleop_core.slave.parameters import SlaveParameters
from teleop_core.slave.slave import Slave

ARM = load_robot("rcrt1")
N = ARM.n
LIMIT = present(ARM.drives).speed_limit
BRAKING = present(ARM.drives).effort_limit / present(ARM.drives).inertia
SLOW = 0.2 * LIMIT
"""Speed at which commands lead the joints away from their limits."""


class Led:
    """A server whose arm is wherever the test says, at rest where its setpoint is by default."""

    def __init__(self, **values: float | tuple[str, str, str]) -> None:
        given = {"starts_at_home": True, "reference_filter.is_on": False} | values
        self.slave = Slave(build(SlaveParameters, given))
        self.row, self.ns, self.commanded = self.slave.signals, 0, ARM.home.copy()

    def tick(
        self,
        measured: Array | None = None,
        *,
        speaks: bool = True,
        follows: bool = False,
        effort: Any = 0.0,
        ahead_ns: int = 0,
    ) -> Array:
        """One tick; the arm says before it where it is, and a command comes if it is to follow."""
        self.ns += TICK_NS
        row = self.row
        if speaks:
            at = row["slave_setpoint_js"] if measured is None else measured
            row["slave_measured_js"][:N] = at
            row["slave_measured_js"][2 * N :] = effort
            row["slave_measured_js_ns"] = self.ns
        if follows:
            self.commanded -= SLOW * DT
            row["slave_servo_jp"] = self.commanded
            row["slave_servo_jp_ns"] = self.ns + ahead_ns
        row["now_ns"] = self.ns
        self.slave.step()
        return row["slave_setpoint_js"].copy()

    @property
    def state(self) -> State:
        return State(int(self.slave.operation["state"]))

    @property
    def status(self) -> CommandStatus:
        return CommandStatus(int(self.row["command_status"]))


def following(**values: float | tuple[str, str, str]) -> Any:
    led = Led(**values)
    for _ in range(300):
        led.tick(follows=True)
    assert led.status is CommandStatus.FRESH
    return led


def test_an_arm_that_says_no_more_where_it_is_holds_after_the_command_timeout() -> None:
    led = following()
    setpoints = [led.tick(speaks=False, follows=True) for _ in range(300)]
    steps = np.abs(np.diff(setpoints, axis=0))
    assert (steps[:95] > 0.0).any(axis=1).all()  # a hiccup stops nothing
    needed = int(np.ceil((SLOW / BRAKING).max() / DT)) + 2
    assert not steps[100 + needed :].any()
    slower = np.diff(steps[100 : 100 + needed], axis=0)
    assert (slower >= -BRAKING * DT**2 * (1.0 + 1e-6)).all()
    assert (led.state, led.status) == (State.ENABLED, CommandStatus.BLIND)


def test_it_goes_on_by_itself_once_it_speaks_again_before_that_is_a_fault() -> None:
    led = following()
    held = [led.tick(speaks=False, follows=True) for _ in range(300)][-1]
    for _ in range(100):
        led.tick(held, follows=True)
    moved = [led.tick(follows=True) for _ in range(300)]
    assert led.state is State.ENABLED
    assert led.status is CommandStatus.FRESH
    assert (moved[-1] < held).all()
    assert (np.abs(np.diff(moved, axis=0)) <= LIMIT * DT * (1.0 + 1e-9)).all()


def test_a_longer_silence_of_the_arm_is_a_fault_whose_setpoint_stands_still() -> None:
    led: Any = following(**{"operation.longest_silence": 0.5})
    for _ in range(500):
        led.tick(speaks=False, follows=True)
    assert led.state is State.ENABLED
    still = led.tick(speaks=False, follows=True)
    now: State = led.state
    assert now is State.FAULT
    assert Fault(int(led.slave.operation["fault"])) is Fault.FEEDBACK
    assert led.slave.operation["fault_bound"] == 0.5
    assert np.array_equal(led.tick(follows=True), still)


def test_an_arm_that_was_lost_is_led_from_where_it_is_found_and_only_when_it_is_enabled_again() -> None:
    led = following(**{"operation.longest_silence": 0.5})
    for _ in range(600):
        held = led.tick(speaks=False, follows=True)
    there = np.clip(held + 0.1, ARM.lower, ARM.upper)  # a bridge that died let it stand while the server braked
    found = [held, *(led.tick(there, follows=True) for _ in range(3000))]
    near = led.slave.parameters["near"]
    assert (np.abs(found[-1] - there) <= near).all()
    steps = np.abs(np.diff(found, axis=0))
    assert (steps <= LIMIT * DT * (1.0 + 1e-9)).all()
    for _ in range(100):  # once: an arm that sags under its load is not followed down
        assert np.array_equal(led.tick(there - 2.0 * near, follows=True), found[-1])
    assert Fault(int(led.slave.operation["fault"])) is Fault.FEEDBACK
    for event in (Event.RESET, Event.ENABLE):
        led.slave.request(event.name.lower())
    led.commanded = found[-1].copy()
    goes_on = [found[-1], *(led.tick(follows=True) for _ in range(300))]
    assert led.state is State.ENABLED
    assert (np.abs(np.diff(goes_on, axis=0)) <= LIMIT * DT * (1.0 + 1e-9)).all()
    assert (goes_on[-1] < found[-1]).all()


def test_a_move_that_the_arm_did_not_see_goes_on_to_its_goal_once_it_speaks_again() -> None:
    led = Led()
    goal = ARM.home - 0.02
    led.tick()
    led.slave.motion.move(goal)
    for _ in range(20):
        led.tick()
    held = [led.tick(speaks=False) for _ in range(400)][-1]
    assert led.slave.operation["is_busy"] == 1.0
    assert not np.allclose(held, goal, atol=1e-4)
    for _ in range(3000):
        last = led.tick()
    assert led.slave.operation["is_busy"] == 0.0
    assert np.array_equal(last, goal)


def test_an_arm_that_stands_elsewhere_is_led_from_there_and_homes() -> None:
    led, there = Led(), ARM.home - np.array([0.3, 0.2, 0.05, 0.4, 0.3, 0.2])
    way = [led.tick(there)]
    assert np.allclose(way[0], there, rtol=0, atol=1e-6)  # a tick on its way already
    assert led.slave.operation["is_homed"] == 0.0
    while led.slave.operation["is_busy"]:
        way.append(led.tick())
    assert np.array_equal(way[-1], ARM.home)
    assert led.slave.operation["is_homed"] == 1.0
    steps = np.abs(np.diff(way, axis=0))
    assert (steps <= LIMIT * DT * (1.0 + 1e-9)).all()


def test_an_arm_that_is_at_home_but_for_its_encoders_begins_there() -> None:
    led = Led()
    led.tick(ARM.home + 0.5 * present(ARM.drives).encoder_step)
    assert np.array_equal(led.row["slave_setpoint_js"], ARM.home)
    assert led.slave.operation["is_homed"] == 1.0


@pytest.mark.parametrize("every", [1, 10])
def test_a_full_drive_is_a_fault_after_its_time_however_often_the_arm_speaks(every: int) -> None:
    led = Led(**{"operation.effort_time": 0.2})
    full = np.where(np.arange(N) == 1, present(ARM.drives).effort_limit, 0.0)
    led.tick()
    ticks = 0
    while led.state is State.ENABLED:
        ticks += 1
        led.tick(speaks=ticks % every == 0, effort=full)
        assert ticks < 400
    assert Fault(int(led.slave.operation["fault"])) is Fault.EFFORT
    assert ticks == pytest.approx(200, abs=2 * every + 2)


def test_a_full_drive_after_a_gap_is_no_fault_for_the_gap() -> None:
    led = Led()
    full = np.where(np.arange(N) == 1, present(ARM.drives).effort_limit, 0.0)
    led.tick()
    for _ in range(1500):
        led.tick(speaks=False)
    for _ in range(50):
        led.tick(effort=full)
    assert led.state is State.ENABLED
    assert led.slave.operation["is_braked"] == 0.0


def test_simulated_drives_are_off_while_the_server_lets_brakes_hold_the_arm() -> None:
    parameters = build(ArmParameters, {"starts_at_home": True, "operation.standstill": "brake"})
    arm = SimulatedArm(parameters)
    row = arm.signals

    def efforts() -> Array:
        row["now_ns"] += TICK_NS
        arm.step()
        return row["slave_measured_js"][2 * N :].copy()

    assert all(efforts().any() for _ in range(5))
    arm.server.request("stop")
    told = [efforts() for _ in range(5)]
    assert row["slave_operation"][topics.OPERATION.index("is_braked")] == 1.0
    assert not np.any(told)
    arm.simulated.arm.dq[:] = 0.5 * LIMIT
    before = arm.simulated.arm.q.copy()
    for _ in range(200):
        efforts()
    needed = 0.5 * (0.5 * LIMIT) ** 2 / BRAKING + LIMIT * DT
    assert (np.abs(arm.simulated.arm.q - before) <= needed).all()


def faulty(led: Led) -> Fault:
    return Fault(int(led.slave.operation["fault"]))


def others(*names: str) -> Any:
    """Faults that are told only, so that one alone can stop the arm."""
    watched = ("tracking", "tip", "overspeed", "effort")
    return tuple(name for name in watched if name not in names)


@pytest.mark.parametrize(("joint", "beyond"), [(0, 1.01), (2, np.nan), (5, 1.01)])
def test_a_joint_too_far_from_its_setpoint_or_without_a_number_is_the_fault_tracking(joint: int, beyond: float) -> None:
    led = following(**{"operation.reported": others("tracking")})
    bound = float(led.slave.parameters["lag"][joint])
    for share, fault in ((0.99, Fault.NONE), (-0.99, Fault.NONE), (beyond, Fault.TRACKING)):
        measured = led.row["slave_setpoint_js"].copy()
        measured[joint] += share * bound
        led.tick(measured)
        assert faulty(led) is fault
    told = led.slave.operation
    assert (told["state"], told["fault_joint"]) == (State.FAULT, joint)
    assert told["fault_value"] == pytest.approx(beyond * bound, nan_ok=True)
    assert told["fault_bound"] == bound


@pytest.mark.parametrize("joint", [0, 2, 5])
def test_a_joint_faster_than_half_as_much_again_as_rated_is_the_fault_overspeed(joint: int) -> None:
    led = following(**{"operation.reported": others("overspeed")})
    for share, fault in ((1.49, Fault.NONE), (-1.49, Fault.NONE), (-1.51, Fault.OVERSPEED)):
        led.row["slave_measured_js"][N + joint] = share * LIMIT[joint]
        led.tick()
        assert faulty(led) is fault
    assert led.slave.operation["fault_joint"] == joint


def test_a_tip_too_far_from_its_setpoint_is_the_fault_tip() -> None:
    led = following(**{"operation.reported": others("tip"), "operation.tip_error": 5e-3})
    setpoint = led.row["slave_setpoint_js"].copy()
    for way, fault in ((4.9e-3, Fault.NONE), (5.1e-3, Fault.TIP)):
        measured = setpoint.copy()
        measured[2] += way  # the prismatic joint moves the tip by as much
        led.tick(measured)
        assert faulty(led) is fault
    assert led.slave.operation["fault_value"] == pytest.approx(5.1e-3, rel=1e-6)


def test_a_command_that_presses_a_joint_into_its_end_is_the_fault_joint_limit_in_time() -> None:
    led = following(**{"operation.pressing_time": 0.2})
    led.commanded = led.row["slave_setpoint_js"].copy()
    for _ in range(20_000):
        room = ARM.upper[1] - led.commanded[1]
        led.commanded[1] += min(SLOW[1] * DT, room)
        led.commanded += SLOW * DT  # what `tick` takes away again
        led.tick(follows=True)
        if room <= 0.0:
            break
    assert faulty(led) is Fault.NONE
    ticks = 0
    while faulty(led) is Fault.NONE and ticks < 1000:
        led.commanded += SLOW * DT
        led.tick(follows=True)
        ticks += 1
    assert faulty(led) is Fault.JOINT_LIMIT
    assert ticks * DT == pytest.approx(0.2, abs=2.5e-3)


def test_a_command_of_more_than_a_second_ahead_is_refused_and_the_next_one_is_taken() -> None:
    led = following()
    for ahead_ns, status in ((900_000_000, CommandStatus.FRESH), (1_100_000_000, CommandStatus.REFUSED)):
        led.tick(follows=True, ahead_ns=ahead_ns)
        assert led.status is status
    led.tick(follows=True, ahead_ns=901_000_000)
    assert led.status is CommandStatus.FRESH
