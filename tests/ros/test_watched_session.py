"""A composed session as others see it, who subscribe, set parameters or never read: one for all."""

from collections.abc import Callable, Iterator
from typing import Any

import pytest

from teleop_core.graph.topics import STREAMS

pytestmark = [pytest.mark.ros, pytest.mark.slow]


@pytest.fixture(scope="module")
def watched(composed_session: Callable[..., Any]) -> Iterator[Any]:
    """Peer of a session that goes on while tests look at it."""
    operator = {"approach_time": 1.0, "patience": 0.0}
    scaling = {"reach_force": {"is_on": False}}
    with composed_session(operator=operator, motion_scaling=scaling) as (peer, _, _):
        yield peer


def test_outside_subscribers_see_every_topic(watched: Any) -> None:
    listeners = [watched.listen(topic) for topic in STREAMS]
    for listener in listeners:
        watched.wait(lambda listener=listener: listener.take() > 500, listener.topic.name)


def test_parameters_of_a_composed_node_change_at_run_time(watched: Any) -> None:
    (result,) = watched.set("motion_scaling", fine_gain=0.2)
    assert result.successful
    (refused,) = watched.set("motion_scaling", fine_gain=20.0)
    assert not refused.successful
    assert "fine_gain" in refused.reason


@pytest.mark.soak
def test_a_subscriber_that_never_reads_does_not_slow_the_session(watched: Any) -> None:
    deaf = [watched.listen(topic) for topic in STREAMS]
    spans = [_ticks_and_lost_time(watched)]

    def goes_on_without_loss() -> Any:
        """Whether 1500 ticks went by, one after another, of which none was dropped.

        A machine that stood still for a moment costs a stretch; a reader that holds up the slave costs every one.
        """
        ticks, lost = _ticks_and_lost_time(watched)
        if lost != spans[-1][1]:
            spans.append((ticks, lost))
        return ticks > spans[-1][0] + 1500

    watched.wait(goes_on_without_loss, "1500 ticks without loss beside readers that never read")
    assert len(deaf) == len(STREAMS)


def _ticks_and_lost_time(peer: Any) -> Any:
    """Ticks of the slave so far, and the milliseconds that it gave up."""
    peer.wait_value("slave", "ticks", lambda ticks: ticks > 0)
    status = peer.status("slave")
    return status.number("ticks"), status.number("dropped_time_ms")
