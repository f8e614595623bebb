"""The composed session over real topics: what others send costs it no step."""

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from lifecycle_msgs.msg import Transition

from teleop_core.graph import topics

if TYPE_CHECKING:
    from ros.conftest import Listener, Peer

pytestmark = [pytest.mark.ros, pytest.mark.slow]


def rest_of(measured: "Listener") -> Any:
    """Joints of an arm that has not moved for 500 samples; nothing before."""
    measured.take()
    joints = np.array(measured.values)[-500:, :6]
    is_still = len(joints) == 500 and np.ptp(joints, axis=0).max() < 1e-4
    return joints[-1].tolist() if is_still else None


def test_a_flood_of_commands_is_not_followed_faster_and_drops_no_step(
    peer: "Peer", compose: Callable[..., object]
) -> None:
    scaling = {"reach_force": {"is_on": False}}
    compose(operator={"approach_time": 1.0, "patience": 0.0}, motion_scaling=scaling)
    assert peer.change("inverse_kinematics", Transition.TRANSITION_DEACTIVATE)
    peer.wait_state("inverse_kinematics", "inactive")
    measured = peer.listen(topics.SLAVE_MEASURED_JS)
    peer.wait(measured.take, "joints")
    home, clock = peer.wait(lambda: rest_of(measured), "the arm at rest"), 0
    status = peer.status("slave")
    known = [(status.number("received.slave/servo_jp"), status.number("dropped_time_ms"))]

    def flooded_without_loss() -> Any:
        """Send far more than the slave takes, until it has got a thousand and dropped no step.

        A machine that stood still for a moment costs a flood; one that the slave cannot bear costs every flood.
        """
        nonlocal clock
        for _ in range(500):
            clock = max(clock + 1, peer.node.get_clock().now().nanoseconds)
            peer.send(topics.SLAVE_SERVO_JP, clock, home)
        status = peer.status("slave")
        received, lost = (status.number("received.slave/servo_jp"), status.number("dropped_time_ms"))
        if lost != known[-1][1]:
            known.append((received, lost))
        return received > known[-1][0] + 1000

    peer.wait(flooded_without_loss, "a thousand commands at the slave, and no step dropped")
    measured.take()
    assert np.ptp(np.array(measured.values)[-500:, :6], axis=0).max() < 1e-3
