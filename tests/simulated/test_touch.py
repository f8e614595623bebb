"""Touch over topics: what the slave's tip feels reaches the hand, and the recording."""

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from teleop_core.graph.topics import MASTER_SERVO_CF, SLAVE_MEASURED_CF
from teleop_core.robots import load_robot

if TYPE_CHECKING:
    from peers import AnyPeer as Peer
    from peers import Listener


def test_the_hand_feels_the_block_that_the_slave_presses(peer: "Peer", compose: Callable[..., object]) -> None:
    compose(
        operator={
            "kind": "line",
            "center": [0.0, -0.02, 0.04],
            "size": [0.0, 0.04, 0.0],
            "period": 4.0,
            "rotation": 0.0,
        },
        motion_scaling={"reflection": {"architecture": "position_force"}, "reach_force": {"is_on": False}},
        slave={"start": load_robot("rcrt1").start.tolist()},
        slave_sim={"world": {"kind": "box", "place": [0.241, -0.236, -0.087]}},
    )
    felt, given = peer.listen(SLAVE_MEASURED_CF), peer.listen(MASTER_SERVO_CF)

    def largest(listener: "Listener", column: int) -> float:
        listener.take()
        return max((row[column] for row in listener.values), default=0.0)

    peer.wait(lambda: largest(felt, 2) > 0.5, "a push on the tip")
    peer.wait(lambda: largest(given, 1) > 0.3, "a push on the hand")
    assert np.isfinite(felt.values).all()
    # Where nothing changes it is sent 50 times a second, and no more.
    still = np.diff([stamp for stamp, row in zip(felt.stamps, felt.values, strict=True) if not np.any(row)])
    assert np.median(still) >= 19_000_000
