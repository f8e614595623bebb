"""Console's link in simulated time: what the page sees, and what it asks for."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

from teleop_console.console_link import LiveLink
from teleop_core.bags.reader import Bag
from teleop_core.graph import topics
from teleop_core.session.api import configuration
from teleop_drill.simulation.session import parameters_of

if TYPE_CHECKING:
    from collections.abc import Callable

    from peers import AnyPeer as Peer


RATE = 10.0  # frames of a display in a second


@pytest.mark.slow
def test_a_page_sees_the_arm_stops_it_changes_a_parameter_and_names_the_recording(
    peer: "Peer", compose: "Callable[..., Any]", tmp_path: Path
) -> None:
    compose()
    with LiveLink(0, platform=peer.platform) as link:

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
        before = link.view().time
        assert link.mark()[0]
        peer.wait(lambda: link.view().marks, "the mark")
        assert [text for _, text in link.view().marks] == ["1"]
        assert before <= link.view().marks[0][0] <= link.view().time
        kept = link.save("a_name")
        assert Bag(kept).topics[topics.SLAVE_SETPOINT_JS.name].count > 1000


@pytest.mark.slow
def test_a_person_sees_the_slave_as_late_as_the_display_says_and_presses_at_the_goal(
    peer: "Peer", tmp_path: Path
) -> None:
    late, out = 0.4, str(tmp_path / "bag")
    made = configuration("point", settings={"operator.kind": "remote", "display.latency": late, "display.rate": RATE})
    peer._session("", made.graph, parameters_of(made, out, ""))  # type: ignore[attr-defined]
    with LiveLink(0, platform=peer.platform) as link:

        def ages() -> Any:
            arm, now_ns = link.view().arms[""], peer.platform.time_ns()
            names = topics.MASTER_MEASURED_CP.name, topics.SLAVE_MEASURED_CP.name
            return [1e-9 * (now_ns - arm.stamp_ns[name]) for name in names if name in arm.stamp_ns]

        def attempts() -> float:
            told = link.view().arms[""].get(topics.TASK_STATE)
            return 0.0 if told is None else float(told[topics.TASK_STATE.columns.index("attempts")])

        peer.wait(lambda: len(ages()) == 2 and ages()[1] > late, "the first frame")
        for _ in range(40):
            peer.sleep(0.05)
            master, slave = ages()
            assert master < 0.1
            assert late - 0.04 < slave < late + 0.1 + 1.0 / RATE
        frames, seen = link.view().display
        assert frames == pytest.approx(RATE, rel=0.1)
        assert late - 0.04 < seen < late + 0.1
        for number in (1, 2):
            link.close_jaw(1.0)
            peer.wait(lambda number=number: attempts() == number, "an attempt")  # type: ignore[misc]
            link.close_jaw(0.0)
            peer.sleep(0.2)
