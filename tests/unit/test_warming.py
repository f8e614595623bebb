"""Warming up: a stage makes its first step before the ticks begin, and is as new afterwards."""

from typing import Any

import numpy as np
import pytest

from teleop_core.graph.signals import DT, TICK_NS
from teleop_core.graph.warming import warm_up
from teleop_core.session.configuration import configure

STAGES = [
    (scenario, member.name)
    for scenario in ("coarse_box", "human", "pick", "wall")
    for member in configure(scenario).graph.members
]


def running(scenario: str, name: str) -> Any:
    configuration = configure(scenario)
    (member,) = (m for m in configuration.graph.members if m.name == name)
    return member.stage.run(configuration.groups[name], DT)


@pytest.mark.parametrize(("scenario", "name"), STAGES)
def test_a_stage_that_was_warmed_up_goes_on_as_a_fresh_one_to_the_bit(scenario: str, name: str) -> None:
    fresh, warm = running(scenario, name), running(scenario, name)
    warm_up(warm)
    assert warm.signals.tobytes() == fresh.signals.tobytes()
    for tick in range(30):
        for stage in (fresh, warm):
            stage.signals["now_ns"] = 10**18 + tick * TICK_NS
            stage.step()
        assert warm.signals.tobytes() == fresh.signals.tobytes()


def test_what_is_drawn_ahead_is_drawn_before_the_first_tick(monkeypatch: pytest.MonkeyPatch) -> None:
    operator = running("coarse_box", "operator")
    warm_up(operator)
    drawn: list[int] = []
    monkeypatch.setattr(operator, "_draw", lambda rows: drawn.append(len(rows)))
    operator.step()
    assert not drawn


def test_a_step_in_plain_python_is_not_made_for_practice() -> None:
    stage, made = running("coarse_box", "motion_scaling"), list[float]()
    stage.kernel, stage.arguments = lambda signals, dt: made.append(dt), ()
    warm_up(stage)
    assert not made
    stage.step()
    assert made == [DT]


def test_a_warmed_up_stage_keeps_unit_quaternions_where_nothing_has_come() -> None:
    stage = running("coarse_box", "slave")
    warm_up(stage)
    assert np.array_equal(stage.signals["slave_measured_cp"][3:], [1.0, 0.0, 0.0, 0.0])
