"""State commands in any order, beside ticks and faults: flags agree, and nothing moves unasked."""

from functools import cache
from typing import Any

import numpy as np
import pytest
from hypothesis import strategies as st

from fuzzing import fuzz
from present import present
from teleop_core.graph.operation import State
from teleop_core.slave.operation import Fault, OperationParameters
from teleop_core.slave.operation.states import COMMANDS
from teleop_core.slave.pair import ArmParameters, SimulatedArm

WORDS = st.one_of(
    st.sampled_from(COMMANDS),
    st.text(max_size=20),
    st.sampled_from([f for f in Fault if f]),
    st.booleans(),
    st.integers(1, 30),
    st.floats(-1e9, 1e9),
)
"""A command, or what is none; a fault; the stop button; ticks; a place for all joints."""


@cache
def arm(standstill: str) -> SimulatedArm:
    return SimulatedArm(
        ArmParameters(starts_at_home=True, operation=OperationParameters(standstill=standstill, longest_outage=0.15))
    )


def play(slave: SimulatedArm, words: Any) -> None:
    """Send words one by one; after each the flags must agree and the setpoint keep its limits."""
    row, ns = slave.signals, 10**9
    reach = present(slave.robot.drives).speed_limit * 1e-3
    for word in words:
        ticks = word if isinstance(word, int) and not isinstance(word, bool | Fault) else 1
        if isinstance(word, str):
            slave.server.request(word)
        elif isinstance(word, Fault):
            slave.server.fail(word, 1.0, 0.5)
        elif isinstance(word, bool):
            slave.server.press(is_pressed=word, heard_ns=ns)
        for _ in range(ticks):
            ns += 10**6
            before = np.array(row["slave_setpoint_js"])
            row["now_ns"] = ns
            if isinstance(word, float):
                row["slave_servo_jp"], row["slave_servo_jp_ns"] = slave.robot.home + word, ns
            slave.step()
            values = slave.server.operation
            state = State(int(values["state"]))
            assert not values["is_stopped"] or state is State.FAULT
            assert not values["is_busy"] or state is State.ENABLED
            step = np.abs(row["slave_setpoint_js"] - before)
            assert (step <= reach * (1 + 1e-9)).all()


@pytest.mark.slow
@fuzz("state commands", words=st.lists(WORDS, max_size=12), standstill=st.sampled_from(("hold", "brake")))
def test_any_words_leave_flags_that_agree_and_a_setpoint_within_its_limits(words: Any, standstill: Any) -> None:
    slave = arm(standstill)
    slave.reset()
    play(slave, words)
