"""Arms as nodes: namespaces keep parameters apart; two arms make one recording."""

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np
import pytest
from rcl_interfaces.srv import GetParameters

from live_process import CALM
from teleop_core.bags.reader import Bag
from teleop_core.evaluation import scores
from teleop_core.graph import topics
from teleop_core.nodes.crews import Processes
from teleop_core.robots import load_robot
from teleop_core.session.configuration import configure

if TYPE_CHECKING:
    from ros.conftest import Listener, Peer

pytestmark = pytest.mark.ros


def test_a_node_in_a_namespace_keeps_the_parameters_that_a_file_gives_its_bare_name(peer: "Peer") -> None:
    peer.start("slave", arm="left", robot="puma560", command_timeout=0.25)
    request = GetParameters.Request(names=["robot", "command_timeout"])
    robot, timeout = peer.call(GetParameters, "/left/slave/get_parameters", request).values
    assert robot.string_value == "puma560"
    assert timeout.double_value == 0.25


def test_a_refused_parameter_of_a_node_in_a_namespace_is_named_with_it(peer: "Peer") -> None:
    node = peer.start("slave", wait="", arm="left", command_timeout=50.0)
    assert node.wait() == 2
    assert "left/slave.command_timeout is 50.0" in node.stderr.read_text()


@pytest.mark.slow
@pytest.mark.parametrize(
    "processes",
    # Fourteen processes need more than two processors.
    [Processes.SIDES, pytest.param(Processes.NODES, marks=pytest.mark.soak)],
)
def test_two_arms_are_recorded_together_and_scored_one_by_one(
    peer: "Peer", session_until: Callable[..., tuple[Bag, str]], processes: Processes
) -> None:
    robots = {"": "rcrt1", "left": "puma560"}
    # In processes of their own, on two processors, an arm that hears too seldom of its hand holds.
    is_slow = processes is Processes.NODES
    moving = topics.MASTER_MEASURED_CP if is_slow else topics.SLAVE_MEASURED_JS
    listeners = {arm: peer.listen(moving.of_arm(arm)) for arm in robots}
    settings = ["teleop.arms=[right, left]", "left/robot=puma560", "operator.approach_time=1.0", CALM]
    configuration = configure("coarse_box", settings=[*settings, "teleop.duration=600.0"])
    enough = {topic.of_arm(arm).name: 100 for arm in robots for topic in topics.STREAMS}

    def has_moved(listener: "Listener") -> bool:
        values = listener.values
        return listener.take() > 300 and np.abs(values[-1] - values[0])[:3].max() > 1e-3

    def is_under_way() -> bool:
        moved = [has_moved(listener) for listener in listeners.values()]
        return all(moved) and peer.has_recorded(enough)

    bag, text = session_until(configuration, is_under_way, processes=processes)
    assert all(f"{arm}slave is ready" in text for arm in ("", "left/"))
    for arm, robot in robots.items():
        assert all(bag.topics[t.of_arm(arm).name].count > 100 for t in topics.STREAMS), arm
        measured = bag.read(topics.SLAVE_MEASURED_JS.of_arm(arm))
        assert measured.names == load_robot(robot).joint_names
        np.testing.assert_allclose(measured.values[0][:6], load_robot(robot).home, atol=1e-3)
    right, left = scores(bag)
    assert (right.session.arm, right.session.robot) == ("right", "rcrt1")
    assert (left.session.arm, left.session.robot) == ("left", "puma560")
