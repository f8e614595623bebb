"""Console's link in simulated time: what the page sees, and what it asks for."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

from teleop_console.console_link import LiveLink
from teleop_core.bags.reader import Bag
from teleop_core.graph import topics

if TYPE_CHECKING:
    from collections.abc import Callable

    from peers import AnyPeer as Peer


@pytest.mark.slow
def test_a_page_sees_the_arm_stops_it_changes_a_parameter_and_names_the_recording(
    peer: "Peer", compose: "Callable[..., Any]", tmp_path: Path
) -> None:
    compose()
    with LiveLink(0, world=peer.world) as link:

        def arm() -> Any:
            return link.view().arms[""]

        def is_told(name: str, value: float) -> bool:
            return arm().operation.get(name) == value

        peer.wait(lambda: is_told("is_homed", 1.0) and link.view().recording, "an arm at work")
        assert topics.SLAVE_MEASURED_JS.name in arm().streams
        link.press(is_pressed=True)
        peer.wait(lambda: is_told("is_stopped", 1.0), "a stop")
        assert not link.command("enable")[0]
        link.press(is_pressed=False)
        peer.wait(lambda: link.command("reset")[0], "a reset")
        peer.wait(lambda: link.command("enable")[0], "an arm at rest")
        wrong = link.change("motion_scaling", "coarse_gain", -1.0)
        assert "coarse_gain" in wrong
        assert link.change("motion_scaling", "coarse_gain", 0.25) == ""
        assert link.parameters()["motion_scaling", "coarse_gain"].value == 0.25
        kept = link.save("a_name")
        assert Bag(kept).topics[topics.SLAVE_SETPOINT_JS.name].count > 1000
