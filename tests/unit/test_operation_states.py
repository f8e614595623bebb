"""Operating states: one table, every state with every event, and what only a reset ends."""

import itertools
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from led_slave import LedSlave
from present import present
from teleop_core.base import build
from teleop_core.graph import TICK_NS
from teleop_core.graph.operation import State
from teleop_core.kernels import Array, kernel, record
from teleop_core.slave.operation import Answer, Event, Fault, OperationParameters, command_event
from teleop_core.slave.operation.states import COMMANDS, TABLE, OperatingState, answer_text, change
from teleop_core.slave.pair import ArmParameters, SimulatedArm

D, E, P, F = State.DISABLED, State.ENABLED, State.PAUSED, State.FAULT
EXPECTED = {
    Event.ENABLE: (E, E, E, None),
    Event.DISABLE: (D, D, D, D),
    Event.PAUSE: (None, P, P, None),
    Event.RESUME: (None, E, E, None),
    Event.HOME: (None, E, None, None),
    Event.UNHOME: (D, E, P, F),
    Event.RESET: (D, E, P, D),
    Event.STOP: (F, F, F, F),
    Event.MOVE: (None, E, None, None),
    Event.ARRIVED: (None, E, None, None),
    Event.FAILED: (F, F, F, F),
    Event.LAPSED: (None, P, None, None),
}
"""State that follows DISABLED, ENABLED, PAUSED, FAULT; None where the event is refused."""


@kernel
def _change(s: OperatingState, event: int) -> int:
    return change(s, event)


def make(state: State, **fields: object) -> OperatingState:
    found = record(OperatingState)
    found["state"], found["is_homed"] = state, 1
    for name, value in fields.items():
        found[name] = value
    return found


@pytest.mark.parametrize(("state", "event"), list(itertools.product(State, Event)))
def test_every_state_takes_or_refuses_every_event_as_the_table_says(state: State, event: Event) -> None:
    s = make(state)
    answer = Answer(_change(s, int(event)))
    expected = EXPECTED[event][state]
    assert (answer is Answer.REFUSED) is (expected is None)
    assert s["state"] == (state if expected is None else expected)
    assert TABLE[state, event] == (-1 if expected is None else expected)
    if answer is Answer.REFUSED:
        text = answer_text(event, answer, state)
        assert state.name in text
        assert "allowed in" in text


def test_an_emergency_stop_is_ended_by_a_reset_and_an_enable_and_by_nothing_else() -> None:
    for words in itertools.product(set(COMMANDS) - {"reset", "stop"}, repeat=3):
        s = make(E)
        _change(s, int(Event.STOP))
        for word in words:
            _change(s, int(command_event(word)))
        assert s["state"] == F
        assert s["is_stopped"]
    _change(s, int(Event.RESET))
    assert s["state"] == D
    _change(s, int(Event.ENABLE))
    assert s["state"] == E


def test_a_stop_that_is_still_pressed_cannot_be_reset_nor_an_arm_that_moves_be_enabled() -> None:
    s = make(E, is_pressed=1)
    _change(s, int(Event.STOP))
    assert Answer(_change(s, int(Event.RESET))) is Answer.STOPPED
    s["is_pressed"] = 0
    assert Answer(_change(s, int(Event.RESET))) is Answer.DONE
    s = make(D, is_moving=1)
    assert Answer(_change(s, int(Event.ENABLE))) is Answer.BRAKING
    assert s["state"] == D


@settings(max_examples=300, deadline=None)
@given(st.lists(st.sampled_from(list(Event)), max_size=60))
def test_flags_agree_with_the_state_after_any_events(events: list[Event]) -> None:
    s = make(D, is_homed=0)
    for event in events:
        _change(s, int(event))
        if s["state"] != E:
            assert not s["is_busy"]
        assert not (s["is_homed"] and s["is_homing"])
        assert not s["is_stopped"] or s["state"] == F


class Arm(LedSlave):
    """A slave under a stream of commands that swing about home."""

    def __init__(
        self,
        *,
        seconds: float = 0.0,
        law: str = "pid",
        is_filtered: bool = True,
        **operation: str | float | bool | tuple[str, str, str],
    ) -> None:
        chosen = {"controller.kind": law, "reference_filter.is_on": is_filtered}
        given = {f"operation.{name}": value for name, value in operation.items()}
        start = {"robot": "rcrt1", "starts_at_home": True}
        super().__init__(SimulatedArm(build(ArmParameters, start | chosen | given)))
        self.now_ns = 10**9
        self.limit = present(self.slave.robot.drives).speed_limit
        self.home = self.slave.robot.home
        self.setpoints = [self.setpoint]
        self.run(seconds)

    def run(self, seconds: float, *, commanded: bool = True) -> None:
        for _ in range(round(seconds * 1000)):
            swing = 0.1 * np.sin(2.0 * np.pi * 1e-9 * (self.now_ns + TICK_NS - 10**9))
            self.tick(self.home + swing * self.limit / self.limit.max() if commanded else None)
            self.setpoints.append(self.setpoint)

    @property
    def steps(self) -> Array:
        return np.abs(np.diff(self.setpoints, axis=0)) / self.limit * 1e3

    @property
    def state(self) -> State:
        return State(int(self.slave.server.operation["state"]))


def test_a_slave_enables_and_homes_itself_unless_it_is_told_not_to() -> None:
    arm = Arm(seconds=0.01)
    assert (arm.state, arm.slave.server.operation["is_homed"]) == (E, 1.0)
    arm = Arm(seconds=1.0, starts_enabled=False)
    assert (arm.state, arm.slave.server.operation["is_homed"]) == (D, 0.0)
    assert not arm.steps.any()
    assert arm.slave.server.request("home")[0] is Answer.REFUSED
    assert arm.slave.server.request("enable")[0] is Answer.DONE
    arm.run(0.5)
    assert not arm.steps.any()
    arm.slave.server.request("home")
    arm.run(1.0)
    assert arm.slave.server.operation["is_homed"] == 1.0
    assert arm.steps[-1].any()


def test_homing_is_smooth_and_within_the_limits() -> None:
    slave = SimulatedArm(ArmParameters(robot="puma560", operation=OperationParameters(starts_enabled=False)))
    slave.server.request("enable")
    slave.server.request("home")
    found = LedSlave(slave).along([None] * 10_000)["slave_setpoint_js"]
    assert slave.server.operation["is_homed"] == 1.0
    start = slave.server.parameters["start_jp"]
    assert np.allclose(found[-1], start, rtol=0, atol=1e-12)
    drives = present(slave.robot.drives)
    speed = np.abs(np.diff(found, axis=0)) / 1e-3
    rise = np.abs(np.diff(found, n=2, axis=0)) / 1e-6
    assert (speed <= drives.speed_limit * (1 + 1e-9)).all()
    assert (rise <= 1.01 * drives.effort_limit / drives.inertia + 1e-6).all()


@pytest.mark.parametrize("word", ["stop", "pause", "disable"])
def test_nothing_moves_outside_enabled_however_one_got_there(word: str) -> None:
    arm = Arm(seconds=1.13)
    assert arm.steps[-1].any()
    arm.slave.server.request(word)
    arm.run(0.5)
    before = len(arm.setpoints)
    arm.run(1.0)
    assert not arm.steps[before:].any()
    assert abs(arm.slave.simulated.arm.dq).max() < 1e-3 * arm.limit.max()


def test_from_an_emergency_stop_the_setpoint_stands_still_in_the_next_tick() -> None:
    arm = Arm(seconds=1.13)
    before = len(arm.setpoints)
    arm.slave.server.press(is_pressed=True, heard_ns=arm.now_ns)
    arm.run(1.0)
    assert not arm.steps[before - 1 :].any()
    values = arm.slave.server.operation
    assert values["is_stopped"] == 1.0
    drives = present(arm.slave.robot.drives)
    braking = (0.1 * 2 * np.pi * arm.limit / arm.limit.max()) / (drives.effort_limit / drives.inertia)
    assert 0.0 < values["rest_time"] <= braking.max() + 0.1  # and the loop comes to rest


def test_brakes_stop_an_arm_no_farther_than_its_speed_needs() -> None:
    arm = Arm(seconds=1.13, standstill="brake")
    q, dq = arm.slave.simulated.arm.q.copy(), arm.slave.simulated.arm.dq.copy()
    arm.slave.server.request("stop")
    arm.run(0.5)
    drives = present(arm.slave.robot.drives)
    needed = 0.5 * dq**2 / (drives.effort_limit / drives.inertia) + np.abs(dq) * 1e-3
    assert (np.abs(arm.slave.simulated.arm.q - q) <= needed + 1e-6).all()
    assert not arm.row["slave_measured_js"][12:].any()


def test_after_a_stop_the_arm_follows_again_without_a_jump() -> None:
    arm = Arm(seconds=1.13)
    arm.slave.server.request("stop")
    arm.run(0.5)
    for word in ("reset", "enable"):
        assert arm.slave.server.request(word)[0] is Answer.DONE
    arm.run(0.5)
    assert arm.state is E
    assert arm.steps[-100:].any()
    assert arm.steps.max() <= 1.0 + 1e-9


def test_a_broken_stream_brakes_at_the_limits_of_the_drives() -> None:
    arm = Arm(seconds=1.13)
    before = len(arm.setpoints)
    arm.run(0.3, commanded=False)
    drives = present(arm.slave.robot.drives)
    speed = np.abs(np.diff(arm.setpoints, axis=0))[before + 98] / 1e-3
    ticks = np.ceil(speed / (drives.effort_limit / drives.inertia) * 1e3).max()
    assert not arm.steps[before + 100 + int(ticks) :].any()
    assert arm.state is E


@pytest.mark.parametrize("gap", [0.0, 0.2])
def test_after_a_long_outage_motion_is_resumed_on_purpose_only(gap: float) -> None:
    arm = Arm(seconds=1.13, longest_outage=0.5)
    arm.run(gap, commanded=False)  # before the last command
    arm.run(0.001)
    arm.run(0.7, commanded=False)
    assert arm.state is P
    before = len(arm.setpoints)
    arm.run(1.0)
    assert not arm.steps[before:].any()
    assert arm.slave.server.request("resume")[0] is Answer.DONE
    arm.run(0.5)
    assert arm.steps[-100:].any()


def test_a_silent_heartbeat_is_a_stop() -> None:
    arm = Arm(seconds=0.05, heartbeat=0.1)
    arm.slave.server.press(is_pressed=False, heard_ns=arm.now_ns)
    arm.run(0.09)
    assert arm.state is E
    arm.run(0.03)
    assert arm.state is F
    assert arm.slave.server.request("reset")[0] is Answer.STOPPED
    arm.slave.server.press(is_pressed=False, heard_ns=arm.now_ns)
    assert arm.slave.server.request("reset")[0] is Answer.DONE


def test_a_script_commands_at_its_times() -> None:
    arm = Arm(seconds=0.5, events=("pause@0.2", "resume@0.4", "stop@0.45"))
    still: Any = ~arm.steps.any(axis=1)
    assert still[240:398].all()
    assert not still[100:195].any()
    assert arm.state is F


@pytest.mark.parametrize("seconds", [0.03, 0.41, 1.21])
@pytest.mark.parametrize("law", ["pid", "source_pid"])
def test_resume_is_refused_while_a_joint_swings_though_it_stands_still_at_each_turn(law: str, seconds: float) -> None:
    arm = Arm(law=law, is_filtered=False, seconds=seconds)
    arm.slave.server.request("pause")
    while arm.slave.server.request("resume")[0] is Answer.BRAKING:
        arm.run(0.001)
    assert arm.slave.server.state["state"] == E
    paused = Arm(law=law, is_filtered=False, seconds=seconds)
    paused.slave.server.request("pause")
    paused.run(1e-9 * (arm.now_ns - paused.now_ns))
    for _ in range(200):  # nothing of the swing is left to come
        assert (np.abs(paused.slave.simulated.arm.dq) <= paused.slave.server.parameters["rest_speed"]).all()
        paused.run(0.001)


def test_an_arm_that_was_paused_while_it_homed_homes_when_it_is_resumed() -> None:
    slave = SimulatedArm(ArmParameters(robot="puma560"))
    led = LedSlave(slave)
    led.along([None] * 200)
    assert slave.server.state["is_homing"]
    slave.server.fail(Fault.STALL, 3.0, 2.0)
    led.along([None] * 1000)
    assert (slave.server.operation["state"], slave.server.operation["is_homed"]) == (P, 0.0)
    assert slave.server.request("resume")[0] is Answer.DONE
    led.along([None] * 10_000)
    assert slave.server.operation["is_homed"] == 1.0
    assert np.allclose(led.setpoint, slave.server.parameters["start_jp"], rtol=0, atol=1e-12)


def test_unhome_and_disable_end_what_a_pause_left_of_homing() -> None:
    for ends in (Event.UNHOME, Event.DISABLE, Event.ENABLE):
        s = make(E, is_homed=0, is_homing=1, is_busy=1)
        for event in (Event.PAUSE, ends, Event.ENABLE, Event.PAUSE, Event.RESUME):
            _change(s, int(event))
        assert (s["state"], s["is_homing"]) == (E, 0), ends
