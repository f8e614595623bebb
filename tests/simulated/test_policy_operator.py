"""A policy moves the hand of a live session; if it fails, the session ends and says why."""

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np

from peers import at_rest
from teleop_core.graph.topics import SLAVE_MEASURED_CP
from teleop_core.hand.operators.policy import POLICIES, View

if TYPE_CHECKING:
    from peers import AnyPeer as Peer

GAIN = 0.5
PLACE = np.array([0.008, 0.0, 0.006])


def moves(seen: View) -> Any:
    """Rest for three seconds, then go to a place within one."""
    return min(max(seen.time - 3.0, 0.0), 1.0) * PLACE


def fails(seen: View) -> Any:
    """Be no number on half of the way."""
    return moves(seen) if seen.time < 3.5 else np.nan * PLACE


def session(compose: Callable[..., object], name: str) -> Any:
    return compose(
        operator={"kind": "policy", "policy": {"name": name}, "tremor_amplitude": 0.0},
        motion_scaling={"reach_force": {"is_on": False}, "coarse_gain": GAIN},
        slave={"starts_at_home": True},
    )


def test_a_policy_moves_the_arm_of_a_live_session(peer: "Peer", compose: Callable[..., object]) -> None:
    POLICIES.add("live_moves", moves)
    tips = peer.listen(SLAVE_MEASURED_CP)
    session(compose, "live_moves")
    peer.wait_value("operator", "has_begun", lambda n: n == 1)
    tips.take()
    begin = tips.values[-1][:3]
    peer.sleep(5.0)
    tips.forget()
    peer.wait(at_rest(tips), "rest at the place")
    np.testing.assert_allclose(tips.values[-1][:3] - begin, GAIN * np.array([-0.006, -0.008, 0.0]), atol=4e-4)


def test_a_session_ends_with_a_failed_policy_and_says_why(peer: "Peer", compose: Callable[..., Any]) -> None:
    POLICIES.add("live_fails", fails)
    tips = peer.listen(SLAVE_MEASURED_CP)
    made = session(compose, "live_fails")
    peer.wait(lambda: made.poll() is not None, "an end")
    assert made.poll() != 0
    tips.take()
    way = np.array(tips.values)[:, :3]
    assert np.abs(way - way[0]).max() < GAIN * 0.5 * PLACE.max() + 4e-4  # never beyond what was wanted last
    (line,) = (line for line in made.read_text().splitlines() if "live_fails" in line)
    assert "finite numbers" in line
