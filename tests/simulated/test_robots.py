"""Every robot through the nodes of a session."""

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from teleop_core.graph import topics
from teleop_core.robots import list_robots
from teleop_core.session.configuration import configure
from teleop_core.session.virtual import VirtualTime

if TYPE_CHECKING:
    pass

SHORT = ("operator.approach_time=0.5", "operator.size=[0.02, 0.02, 0.02]")
KINDS = ("puma560", "scara_stewart", "three_finger_hand")
"""Robots of each kind; the others go by ``make soak``."""
SLAVES = [pytest.param(name, marks=() if name in KINDS else pytest.mark.soak) for name in list_robots()]
GRID = 55e-6  # m, reading step of the Phantom Omni


@pytest.fixture
def short_session(peer: Any, tmp_path: Path) -> Callable[..., Any]:
    """Recording of two seconds of a session, and joints (n,) that moved less than in virtual time.

    Half as far is enough: the hand waits until the slave follows.
    """

    def run(setting: Any) -> Any:
        configuration = configure("free_motion", settings=[*SHORT, setting])
        begin = None

        def has_led() -> bool:
            nonlocal begin
            operator, slave = peer.status("operator"), peer.status("slave")
            if begin is None and operator and slave and operator.number("has_begun"):
                begin = slave.number("ticks")
            return begin is not None and slave.number("ticks") > begin + 2000

        bag = peer.run(configuration, has_led, tmp_path / "bag")
        session = VirtualTime(configuration)
        measured = bag.read(topics.SLAVE_MEASURED_JS)
        wanted = session.run(2000)["slave_measured_js"]
        assert measured.names == session.joint_names[""]
        travel, wanted_travel = (np.ptp(rows[:, : len(measured.names)], axis=0) for rows in (measured.values, wanted))
        assert wanted_travel.max() > 1e-3
        return bag, travel < 0.5 * wanted_travel

    return run


def off_grid(bag: Any) -> Any:
    """Largest distance of a master reading from the Phantom's grid, in its steps."""
    steps = bag.read(topics.MASTER_MEASURED_CP).values[:, :3] / GRID
    return np.abs(steps - np.rint(steps)).max()


@pytest.mark.parametrize("name", SLAVES)
def test_every_slave_follows_the_hand_through_a_session_of_nodes(short_session: Callable[..., Any], name: str) -> None:
    bag, is_short = short_session(f"robot={name}")
    assert not is_short.any()
    assert off_grid(bag) < 1e-6


def test_the_mma_leads_a_session_of_nodes_with_its_own_encoders(short_session: Callable[..., Any]) -> None:
    bag, is_short = short_session("device.handle=mma")
    assert not is_short.any()
    assert off_grid(bag) > 0.1
