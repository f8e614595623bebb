"""Robots of the sources through the ROS nodes: slaves and the MMA as master."""

import io

import numpy as np
import pytest
from rich.console import Console

from teleop_core.bags import topics
from teleop_core.bags.reader import Bag
from teleop_core.nodes.live import live
from teleop_core.robots import load_robot
from teleop_core.session.configuration import configure

pytestmark = [pytest.mark.ros, pytest.mark.slow]
SHORT = ("teleop.duration=2.0", "path.approach_time=0.5", "path.size=[0.02, 0.02, 0.02]")
SLAVES = [
    (f"robot={name}",) for name in ("puma560", "scara_stewart", "scara", "planar_3r", "five_axis")
]


@pytest.mark.parametrize("setting", [*SLAVES, ("device.handle=mma",)])
def test_robot_moves_in_a_live_session(setting, tmp_path):
    configuration = configure("free_motion", settings=[*SHORT, *setting])
    live(configuration, tmp_path / "bag", Console(file=io.StringIO()), is_composed=True)
    bag = Bag(tmp_path / "bag")
    measured = bag.read(topics.SLAVE_MEASURED_JS)
    robot = load_robot(configuration.groups["slave_sim"].robot)
    assert measured.names == robot.joint_names
    assert np.ptp(measured.values[:, : robot.n], axis=0).max() > 1e-3
