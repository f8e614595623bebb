"""Button: a spring that snaps and a stop, its presses, and its energy."""

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import teleop_core as tc
from led_tip import PIECES, along_z, lead, wandering
from teleop_core.kernels.geometry import Array
from teleop_core.session import configuration, virtual
from teleop_core.slave.world.button import BUTTON, ButtonParameters, count_presses

STOP = 20_000.0  # stiffness of the stop [N/m]


def press(
    *heights: float,
    button: ButtonParameters | None = None,
    damping: float = 0.0,
    way: Array | None = None,
    **numbers: float,
) -> tuple[Array, Array, Array, Any]:
    """Depths (ticks,) [m] and pushes (ticks,) [N] of a tip led through heights over the button.

    The energy lost (ticks,) [J] and the state of the simulation come after them.
    """
    way = along_z(*heights) if way is None else way
    made_of = {"world_stiffness": STOP, "world_damping": damping, "puncture_force": 0.0} | numbers
    button = button or ButtonParameters()
    above = way + np.array((0.0, 0.0, 0.5 * button.length))
    push, lost, s = lead(above, "button", button, **made_of)
    return -way[:-1, 2], push[:, 2], lost, s


@pytest.mark.parametrize("damping", [0.0, 5.0])
def test_a_press_rises_to_the_click_force_falls_to_the_contact_force_and_meets_the_stop(damping: float) -> None:
    button = ButtonParameters(click_force=1.5, contact_force=0.5, click_travel=1e-3, stroke=4e-3)
    depth, push, _, _ = press(2e-3, -3.99e-3, button=button, damping=damping)
    wanted = np.interp(depth, (0.0, 1e-3, 4e-3), (0.0, 1.5, 0.5))
    np.testing.assert_allclose(push, wanted, rtol=1e-9, atol=0.02)
    is_slipping = depth > 2e-4
    np.testing.assert_allclose(push[is_slipping], wanted[is_slipping], rtol=1e-9)
    assert push.max() == pytest.approx(1.5, rel=0.02)  # a tick goes 20 µm
    depth, push, _, _ = press(2e-3, -4.1e-3, button=button)
    assert push[-1] == pytest.approx(0.5 + STOP * (depth[-1] - 4e-3), rel=1e-9)


def test_on_the_way_out_its_share_is_missing() -> None:
    depth, push, _, _ = press(2e-3, -2.9e-3, 2e-3)
    is_back = (np.arange(len(depth)) > depth.argmax() + 20) & (depth > 0.0)
    wanted = 0.7 * np.interp(depth, (0.0, 2e-3, 3e-3), (0.0, 1.0, 0.4))
    np.testing.assert_allclose(push[is_back], wanted[is_back], rtol=1e-9, atol=1e-12)


def test_a_cycle_loses_the_hysteresis_and_nothing_without_one() -> None:
    """The area between both ways: the share of the work on the way in."""
    for hysteresis in (0.0, 0.3, 1.0):
        _, _, lost, s = press(2e-3, -4e-3, 2e-3, button=ButtonParameters(hysteresis=hysteresis))
        work = 0.5 * 1.0 * 2e-3 + 0.7 * 1e-3 + 0.4 * 1e-3
        assert lost[-1] == pytest.approx(hysteresis * work, rel=0.05, abs=1e-9)
        assert s.presses == 1


def test_a_press_counts_at_the_stop_and_again_after_the_click_on_the_way_back() -> None:
    stop = -3.01e-3
    assert press(2e-3, -2.99e-3, 2e-3)[-1].presses == 0
    assert press(2e-3, stop, -2.01e-3, stop)[-1].presses == 1
    assert press(2e-3, stop, -1.99e-3, stop)[-1].presses == 2
    assert [press(2e-3, z)[-1].is_pressed for z in (-3.1e-3, -2.9e-3)] == [1, 0]


@pytest.mark.parametrize("turn", [-2.01e-3, -1.99e-3])
def test_the_score_counts_presses_along_a_way_as_the_button_does(turn: float) -> None:
    way = along_z(2e-3, -3.01e-3, turn, -3.01e-3, 2e-3)
    s, count, is_pressed = press(way=way)[-1], 0, False
    for depths in np.array_split(-way[:, 2], 7):
        new, is_pressed = count_presses(depths, ButtonParameters(), is_pressed=is_pressed)
        count += new
    assert count == s.presses
    assert not is_pressed


@pytest.mark.parametrize("damping", [0.0, 100.0])
def test_the_push_is_that_of_the_spring_at_least_and_with_the_stop_at_most(damping: float) -> None:
    """However fast the tip leaves the stop: its damper does not pull."""
    tall = ButtonParameters(length=0.2, radius=0.1)
    for seed in range(20):
        depth, push, _, _ = press(way=wandering(seed), button=tall, damping=damping)
        spring = np.interp(depth, (0.0, 2e-3, 3e-3), (0.0, 1.0, 0.4))
        assert (push >= 0.7 * spring - 1e-12).all()
        assert (push[depth < 3e-3] <= spring[depth < 3e-3] + 1e-12).all()
        if damping == 0.0:
            assert (push <= spring + STOP * np.maximum(depth - 3e-3, 0.0) + 1e-9).all()


@settings(max_examples=60, deadline=None, derandomize=True)
@given(
    seed=st.integers(0, 10_000),
    stiffness=st.floats(100.0, 50_000.0),
    damping=st.floats(0.0, 3.0),
    friction=st.sampled_from([0.0, 0.4]),
    click=st.floats(0.05, 10.0),
    contact=st.floats(0.0, 1.0),
    travel=st.floats(3e-4, 5e-3),
    more=st.floats(3e-4, 5e-3),
    hysteresis=st.floats(0.0, 1.0),
)
def test_no_motion_gets_energy_from_a_button(
    seed: int,
    stiffness: float,
    damping: float,
    friction: float,
    click: float,
    contact: float,
    travel: float,
    more: float,
    hysteresis: float,
) -> None:
    """In no tick: what it gave grows by what is stored, or more; friction may hold what slipped within a tick."""
    button = ButtonParameters(
        click_force=click,
        contact_force=contact * click,
        click_travel=travel,
        stroke=travel + more,
        hysteresis=hysteresis,
        radius=0.1,
        length=0.2,  # no way reaches its middle
    )
    way = wandering(seed)
    _, _, lost, _ = press(way=way, button=button, world_stiffness=stiffness, damping=damping, world_friction=friction)
    # Where the force has a corner, the sum over the pieces of a tick errs by as much.
    piece = np.abs(np.diff(way, axis=0)).max() / PIECES
    steepest = stiffness + 11.0 * click / min(travel, more)
    assert np.diff(lost).min() >= -(1e-4 if friction else 0.0) * lost[-1] - 0.25 * steepest * piece * piece


def test_a_session_counts_what_its_score_counts() -> None:
    texts = {"world": "button", "world.material": "silicone"}
    session = virtual.VirtualTime(configuration.configure("palpation", settings=[f"{k}={v}" for k, v in texts.items()]))
    session.run(24_000)
    stage: Any
    stage, score = session.stages["slave_sim"], tc.run("palpation", settings=texts).score()
    assert score.value("touch.presses") == stage.presses == 5
    stage.reset()
    assert stage.presses == 0


def test_its_outline_lies_on_the_post_and_on_the_stop() -> None:
    outline = BUTTON.outline(ButtonParameters())
    post, stop = outline[:-42], outline[-41:]
    post = post[np.isfinite(post).all(axis=1)]
    distances = [BUTTON.distance(p, BUTTON.numbers(ButtonParameters()), np.zeros(3)) for p in post]
    np.testing.assert_allclose(distances, 0.0, atol=1e-12)
    np.testing.assert_allclose(stop[:, 2], 0.015 - 3e-3)
