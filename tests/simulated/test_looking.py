"""Looking in simulated time: topics, rates and parameters of nodes, and what is refused."""

from itertools import islice
from typing import TYPE_CHECKING

import numpy as np
import pytest

from teleop_core.base.errors import ParameterError, SessionError, UnknownNameError
from teleop_core.commands.look import text_of
from teleop_core.nodes.looking import LookingNode
from teleop_core.robots import load_robot

if TYPE_CHECKING:
    from peers import AnyPeer as Peer

ROBOT = load_robot("rcrt1")


def test_topics_are_listed_with_type_and_ends_and_their_rate_is_that_of_the_slave(peer: "Peer") -> None:
    peer.start("slave")
    peer.start("slave_sim")
    with LookingNode(0, platform=peer.platform) as look:
        seen = look.topics()["/slave/measured_js"]
        assert seen.ros_type == "sensor_msgs/msg/JointState"
        assert seen.publishers == 1
        for rate in islice(look.rates("slave/measured_js"), 2):
            assert 1.0 / rate.mean == pytest.approx(1000.0, rel=0.02)
        (message,) = islice(look.messages("/slave/measured_js"), 1)
        assert tuple(message.name) == ROBOT.joint_names
        np.testing.assert_allclose(message.position, ROBOT.home, atol=0.02)
        assert f"- {ROBOT.joint_names[0]}\n" in text_of(message)
        with pytest.raises(UnknownNameError, match="measured_jss"):
            next(look.messages("/slave/measured_jss"))


def test_parameters_are_read_and_set_with_the_type_that_they_have(peer: "Peer") -> None:
    peer.start("motion_scaling")
    with LookingNode(0, platform=peer.platform) as look:
        assert "/motion_scaling" in look.nodes()
        assert look.parameters("motion_scaling")["coarse_gain"] == look.parameter("/motion_scaling", "coarse_gain")
        look.change("motion_scaling", "coarse_gain", 1)  # a whole number for a number
        assert look.parameter("motion_scaling", "coarse_gain") == 1.0
        with pytest.raises(ParameterError, match="coarse_gain"):
            look.change("motion_scaling", "coarse_gain", -3.0)
        assert look.parameter("motion_scaling", "coarse_gain") == 1.0
        for node, name in (("motion_scalin", "coarse_gain"), ("motion_scaling", "coarse_gian")):
            with pytest.raises(UnknownNameError, match=r"motion_scaling|coarse_gain"):
                look.parameter(node, name)


def test_services_are_listed_and_called_and_a_missing_one_is_told(peer: "Peer") -> None:
    peer.start("slave")
    with LookingNode(0, patience=1.0, platform=peer.platform) as look:
        assert "/slave/enable" in look.services()
        assert look.trigger("slave/pause") == (True, "pause: done")
        is_done, text = look.trigger("slave/home")
        assert not is_done
        assert "home" in text
        with pytest.raises(SessionError, match="/slave/fly"):
            look.trigger("slave/fly")
