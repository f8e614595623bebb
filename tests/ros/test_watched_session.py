"""A composed session as others see it, who subscribe, set parameters or never read: one for all."""

import pytest

from teleop_core.graph.topics import STREAMS

pytestmark = [pytest.mark.ros, pytest.mark.slow]


@pytest.fixture(scope="module")
def watched(composed_session):
    """Peer of a session that goes on while tests look at it."""
    operator = {"approach_time": 1.0, "patience": 0.0}
    scaling = {"reach_force": {"is_on": False}}
    with composed_session(operator=operator, motion_scaling=scaling) as (peer, _, _):
        yield peer


def test_outside_subscribers_see_every_topic(watched):
    listeners = [watched.listen(topic) for topic in STREAMS]
    for listener in listeners:
        watched.wait(lambda listener=listener: listener.take() > 500, listener.topic.name)


def test_parameters_of_a_composed_node_change_at_run_time(watched):
    (result,) = watched.set("motion_scaling", fine_gain=0.2)
    assert result.successful
    (refused,) = watched.set("motion_scaling", fine_gain=20.0)
    assert not refused.successful
    assert "fine_gain" in refused.reason


def test_a_subscriber_that_never_reads_does_not_slow_the_session(watched):
    deaf = [watched.listen(topic) for topic in STREAMS]
    before = watched.wait_value("slave", "ticks", lambda ticks: ticks > 0)
    after = watched.wait_value("slave", "ticks", lambda ticks: ticks > before + 3000)
    assert len(deaf) == len(STREAMS)
    assert after > before
    assert float(watched.status("slave").values["dropped_time_ms"]) == 0.0
