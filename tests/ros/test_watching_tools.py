"""What RViz and Foxglove get of a running session, and what its recording holds of it."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from rclpy.qos import DurabilityPolicy, QoSProfile
from std_msgs.msg import String
from visualization_msgs.msg import Marker, MarkerArray

from teleop_core.bags import layouts, reader, ros_types, transforms
from teleop_core.graph.topics import MASTER_MEASURED_CP, SLAVE_MEASURED_CP, SLAVE_MEASURED_JS
from teleop_core.robots import load_robot
from teleop_core.robots.bodies import bodies_of, urdf

if TYPE_CHECKING:
    from ros.conftest import Peer

pytestmark = pytest.mark.ros

MS = 1_000_000
REST = [0.0, -0.06, -0.08, 1.0, 0.0, 0.0, 0.0]
LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)


@pytest.mark.soak
def test_a_session_shows_and_records_the_robot_that_it_hears(peer: "Peer", tmp_path: Path) -> None:
    robot = load_robot("rcrt1")
    recorder = peer.start("recorder", out=str(tmp_path / "bag"))
    peer.start("frames")
    described: list[Any]
    drawn: list[Any]
    described, drawn = [], []
    joints = np.concatenate((robot.start, np.zeros(2 * robot.n)))
    tip = bodies_of(robot).poses(robot.start)[-1]
    peer.node.create_subscription(MarkerArray, "/teleop/markers", drawn.append, 10)
    stamps = iter(range(MS, 10**6 * MS, MS))

    def sent() -> bool:
        stamp_ns = next(stamps)
        peer.send(SLAVE_MEASURED_JS, stamp_ns, joints)
        peer.send(SLAVE_MEASURED_CP, stamp_ns, tip)
        peer.send(MASTER_MEASURED_CP, stamp_ns, np.array(REST))
        peer.spin()
        return len(drawn) > 2 and bool(paths())

    def paths() -> list[Any]:
        return [one for array in drawn for one in array.markers if one.ns == "measured" and one.points]

    peer.wait(sent, "markers")
    # Somebody who comes late gets the description all the same.
    peer.node.create_subscription(String, "/robot_description", described.append, LATCHED)

    def told() -> list[Any]:
        sent()  # the robot is described once its joints are heard
        return described

    peer.wait(told, "the robot's description")
    assert described[0].data == urdf.urdf_of(robot, prefix="slave_")
    path = paths()[-1]
    assert (path.header.frame_id, path.type) == ("slave_base", Marker.LINE_STRIP)
    assert [path.points[-1].x, path.points[-1].y] == pytest.approx(tip[:2])
    assert recorder.end() == 0
    bag = reader.Bag(tmp_path / "bag")
    assert bag.topics[transforms.ROBOT_DESCRIPTION.name].count == 1
    for _, kind, _, data in bag.raw([transforms.TF]):
        (found,) = (t for t in ros_types.deserialise(data, kind).transforms if "tip" in t.child_frame_id)
        place = found.transform.translation
        assert [place.x, place.y, place.z] == pytest.approx(tip[:3])


def test_a_robot_that_is_not_the_recorders_is_not_drawn_as_this_one(peer: "Peer", tmp_path: Path) -> None:
    robot = load_robot("puma560")
    recorder = peer.start("recorder", out=str(tmp_path / "bag"))
    joints = np.concatenate((robot.start, np.zeros(2 * robot.n)))
    stamps = iter(range(MS, 10**6 * MS, MS))
    form = layouts.layout(SLAVE_MEASURED_JS, robot.joint_names)
    publisher = peer.publisher(SLAVE_MEASURED_JS)
    key = f"received.{MASTER_MEASURED_CP.name}"

    def heard() -> Any:
        stamp_ns = next(stamps)
        publisher.publish(form.encode_one(stamp_ns, joints))
        peer.send(MASTER_MEASURED_CP, stamp_ns, np.array(REST))
        return peer.status("recorder").number(key) > 300

    peer.wait(heard, "samples at the recorder")
    assert recorder.end() == 0
    assert reader.Bag(tmp_path / "bag").topics[transforms.ROBOT_DESCRIPTION.name].count == 0
