"""Link to a live session: what the page sees is what is recorded, what it asks for happens."""

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from live_process import CALM, wait_until
from teleop_console.console_link import LiveLink
from teleop_console.console_session import ConsoleSession
from teleop_console.link import box_of
from teleop_core.bags.reader import Bag
from teleop_core.base.errors import ParameterError, SessionError
from teleop_core.graph import topics
from teleop_core.graph.signals import PHASES
from teleop_core.graph.topics import JAW_TOPICS, PASSIVITY_TOPICS, SCENE_TOPICS, TASK_TOPICS
from teleop_core.nodes.children import free_domain
from teleop_core.nodes.display import SEEN
from teleop_core.session import api

if TYPE_CHECKING:
    from ros.conftest import Peer

pytestmark = [pytest.mark.ros, pytest.mark.slow]


@pytest.fixture(scope="module")
def live(tmp_path_factory: pytest.TempPathFactory) -> Any:
    """A session behind a page, its link, and where it is recorded."""
    out = tmp_path_factory.mktemp("console") / "bag"
    texts = ["operator=remote", "teleop.duration=3600.0", "operator.patience=0.0", CALM]
    said: list[Any] = []
    with ConsoleSession(api.configuration(None, texts=texts), out, said.append) as session:
        link = session.link()
        with link:
            wait_until(lambda: any("operator is ready" in line for line in said), "nodes")
            view = link.view()
            wait_until(lambda: link.view().arms[""].state and view.recording, "reports")
            without = {*JAW_TOPICS, *PASSIVITY_TOPICS, *SCENE_TOPICS, *TASK_TOPICS}  # this arm has none of them
            count = len(set(SEEN) - without)
            wait_until(lambda: len(link.view().arms[""].streams) == count, "streams")
            yield session, link, out


def state(link: LiveLink) -> Any:
    """State of the arm as the page sees it."""
    return link.view().arms[""].operation_text.split(",")[0].split(":")[0]


def test_the_view_has_fresh_streams_of_the_arm_and_says_where_it_is_recorded(live: Any) -> None:
    _, link, out = live
    first = dict(link.view().arms[""].stamp_ns)
    name = topics.SLAVE_MEASURED_JS.name

    def fresh() -> Any:
        """View of an arm at rest, of which joints and tip are of one place."""
        view = link.view()
        arm = view.arms[""]
        is_newer = arm.stamp_ns[name] > first[name]
        return view if view.is_fresh and is_newer and "homed" in arm.operation_text else None

    view = wait_until(fresh, "newer samples of an arm at rest")
    assert view.recording == out
    phases = wait_until(lambda: link.view().phases, "report of the phases of a tick")
    assert tuple(phases) == PHASES
    assert all(0.0 < time < 0.1 for time in phases.values())
    assert view.arms[""].get(topics.SLAVE_MEASURED_JS).shape == (18,)
    q = view.arms[""].get(topics.SLAVE_MEASURED_JS)[:6]
    tip = view.arms[""].get(topics.SLAVE_MEASURED_CP)[:3]
    np.testing.assert_allclose(link.arms[0].robot.fk(q)[:3, 3], tip, atol=1e-3)


def test_commands_are_obeyed_and_answered(live: Any) -> None:
    _, link, _ = live
    wait_until(lambda: state(link) == "ENABLED", "enabled")
    assert link.command("pause")[0]
    wait_until(lambda: state(link) == "PAUSED", "paused")
    is_taken, text = link.command("home")
    assert not is_taken
    assert "PAUSED" in text
    wait_until(lambda: link.command("resume")[0], "resumed, at rest")
    wait_until(lambda: state(link) == "ENABLED", "enabled again")


def test_the_emergency_stop_is_latched_until_it_is_released_reset_and_enabled(live: Any) -> None:
    _, link, _ = live
    link.press(is_pressed=True)
    wait_until(lambda: state(link) == "FAULT", "stopped")
    assert not link.command("enable")[0]
    link.press(is_pressed=False)
    wait_until(lambda: link.command("reset")[0], "reset")
    wait_until(lambda: link.command("enable")[0], "enabled")


def test_mode_that_the_button_of_the_stylus_changes_is_told_as_a_changed_parameter(live: Any) -> None:
    _, link, _ = live
    wait_until(lambda: state(link) == "ENABLED", "enabled")
    for mode in ("fine", "coarse"):
        link.changes()
        link.press_button("", "mode")
        wait_until(lambda: link.changes().get(("motion_scaling", "mode")) == mode, mode)


def test_parameters_come_with_bounds_and_meaning_and_a_refusal_with_its_reason(live: Any) -> None:
    _, link, _ = live
    known = link.parameters()
    gain = known["motion_scaling", "fine_gain"]
    assert (gain.lower, gain.upper) == (0.001, 10.0)
    assert gain.doc
    assert known["slave", "robot"].is_fixed
    assert "box" in known["motion_scaling", "fixture.kind"].choices
    assert link.change("motion_scaling", "fine_gain", 0.3) == ""
    assert link.parameters()["motion_scaling", "fine_gain"].value == 0.3
    assert "10" in link.change("motion_scaling", "fine_gain", 20.0)
    assert link.change("nobody", "fine_gain", 0.3)


def test_the_buttons_of_the_stylus_switch_mode_and_box(live: Any) -> None:
    _, link, _ = live
    before = link.view().arms[""].state["is_fine"]
    link.press_button("", "mode")
    wait_until(lambda: link.view().arms[""].state["is_fine"] != before, "the other mode")
    link.press_button("", "mode")
    wait_until(lambda: link.view().arms[""].state["is_fine"] == before, "the mode of before")
    link.press_button("", "fixture")
    found = wait_until(lambda: box_of(link.view().arms[""].state), "box")
    assert (found[1] > 0.0).all()


def test_a_saved_recording_is_there_under_its_name_and_the_next_one_goes_on(live: Any) -> None:
    session, link, out = live
    for name in ("", "a/b", "..", "a b"):
        with pytest.raises(ParameterError):
            link.save(name)
    saved = link.save("first")
    assert saved == out.with_name("first")
    assert Bag(saved).topics[topics.SLAVE_MEASURED_JS.name].count > 100
    with pytest.raises(ParameterError, match="exists already"):
        link.save("first")
    wait_until(lambda: link.view().recording not in {None, out}, "the next recording")
    assert link.view().run == 1
    assert not session.is_over


def test_without_a_session_there_is_one_clear_error() -> None:
    domain = free_domain()
    with pytest.raises(SessionError, match=f"no arm answers on ROS domain {domain};"):
        LiveLink(int(domain), patience=0.1)


def test_of_a_session_in_a_namespace_the_link_knows_arm_and_recorder(
    compose: Callable[..., object], peer: "Peer", tmp_path: Path
) -> None:
    compose("left")
    with LiveLink(int(peer.domain)) as link:
        assert [arm.name for arm in link.arms] == ["left"]
        wait_until(lambda: link.view().recording == tmp_path / "bag", "its recorder's report")
        assert link.save("kept") == tmp_path / "kept"
        assert Bag(tmp_path / "kept").topics["left/slave/measured_cp"].count


def test_a_second_session_of_the_process_is_alone_and_its_energies_are_seen(live: Any, tmp_path: Path) -> None:
    first, *_ = live
    stages = ["teleop.stages=[network,passivity]", "reflection.passivity=tdpa"]
    texts = ["operator=remote", "teleop.duration=3600.0", "operator.patience=0.0", CALM, *stages]
    configured = api.configuration(None, texts=texts)
    with ConsoleSession(configured, tmp_path / "bag", lambda _: None) as session:
        assert session.domain != first.domain
        link, energies = session.link(), {topics.MASTER_ENERGY.name, topics.SLAVE_ENERGY.name}
        with link:
            wait_until(lambda: energies <= link.view().arms[""].streams.keys(), "energies")
