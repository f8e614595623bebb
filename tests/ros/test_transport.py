"""Transport: loopback alone by default, found and heard by plain ROS processes on the machine."""

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import psutil
import pytest

from present import present
from teleop_core.graph import topics
from teleop_core.nodes.discovery import LOOPBACK, NETWORK, RANGE, beyond_this_machine, choose_transport
from teleop_core.robots import load_robot

if TYPE_CHECKING:
    from ros.conftest import Peer

pytestmark = pytest.mark.ros

PROFILE = "FASTRTPS_DEFAULT_PROFILES_FILE"
BLOCKED_NS = 2_000_000_000
"""For so long shared memory blocked whoever wrote to a reader that was killed [ns]."""
HOME = load_robot("rcrt1").home.tolist()
MIDDLEWARE = ("FASTRTPS_", "FASTDDS_", "ROS_AUTOMATIC", "ROS_LOCALHOST", "ROS_STATIC", "RMW_")

STRANGER = """
import json, sys, rclpy
from rclpy.qos import qos_profile_sensor_data
from sensor_msgs.msg import JointState
rclpy.init()
node = rclpy.create_node("stranger")
heard = []
node.create_subscription(
    JointState, "slave/measured_js", lambda m: heard.append(m.name), qos_profile_sensor_data
)
commands = node.create_publisher(JointState, "slave/servo_jp", qos_profile_sensor_data)
command = JointState(name=json.loads(sys.argv[1]), position=json.loads(sys.argv[2]))
while True:
    rclpy.spin_once(node, timeout_sec=0.02)
    command.header.stamp = node.get_clock().now().to_msg()
    commands.publish(command)
    if len(heard) == 50:
        print("heard", flush=True)
"""


def plain(**said: object) -> dict[str | Any, str | Any]:
    """Environment of a user who has said nothing but this."""
    kept = {k: v for k, v in os.environ.items() if not k.startswith(MIDDLEWARE)}
    return kept | said


@pytest.mark.parametrize("said", [{}, {RANGE: "LOCALHOST"}])
def test_a_plain_ros_process_hears_and_commands_our_nodes(peer: "Peer", said: Any) -> None:
    """The stranger has the middleware's own defaults: shared memory and all interfaces."""
    peer.start("slave")
    names = json.dumps(load_robot("rcrt1").joint_names)
    with subprocess.Popen(
        [sys.executable, "-c", STRANGER, names, json.dumps(HOME)],
        env=plain(ROS_DOMAIN_ID=peer.domain, **said),
        stdout=subprocess.PIPE,
        text=True,
    ) as stranger:
        try:
            peer.wait_value("slave", "received.slave/servo_jp", lambda n: n > 50)
            assert present(stranger.stdout).readline() == "heard\n"
        finally:
            stranger.kill()


@pytest.mark.parametrize("said", [{}, {RANGE: "LOCALHOST"}, {"ROS_LOCALHOST_ONLY": "1"}])
def test_a_node_has_sockets_of_this_machine_alone(peer: "Peer", said: Any) -> None:
    """As `ros2 run` starts it, by a user who has set nothing, or said so in either way."""
    before = {name: os.environ.pop(name) for name in list(os.environ) if name.startswith(MIDDLEWARE)}
    os.environ.update(said)
    try:
        node = peer.start("slave")
    finally:
        for name in said:
            os.environ.pop(name, None)
        os.environ.update(before)
    sockets = psutil.Process(node.process.pid).net_connections("inet")
    assert sockets
    assert {one.laddr.ip for one in sockets} == {"127.0.0.1"}
    maps = psutil.Process(node.process.pid).memory_maps()
    assert not [one.path for one in maps if "/dev/shm/fastrtps" in one.path]
    assert "open to other machines" not in node.stderr.read_text()


def test_a_node_that_is_open_to_others_says_so_in_one_line(peer: "Peer") -> None:
    node = peer.start("slave", env={RANGE: "SUBNET", **dict.fromkeys(PROFILES, "")})
    lines = [line for line in node.stderr.read_text().splitlines() if "other machines" in line]
    assert len(lines) == 1
    assert f"{RANGE}=SUBNET" in lines[0]


PROFILES = (PROFILE, "FASTDDS_DEFAULT_PROFILES_FILE")


@pytest.mark.parametrize(
    ("said", "chosen"),
    [
        ({}, (LOOPBACK, "SYSTEM_DEFAULT")),
        ({RANGE: "localhost"}, (LOOPBACK, "SYSTEM_DEFAULT")),
        ({RANGE: "SUBNET", "ROS_LOCALHOST_ONLY": "1"}, (LOOPBACK, "SYSTEM_DEFAULT")),
        ({RANGE: "SUBNET"}, (NETWORK, "SUBNET")),
        ({RANGE: "OFF"}, (NETWORK, "OFF")),
        ({"ROS_STATIC_PEERS": "192.0.2.1"}, (NETWORK, None)),
        ({PROFILE: "own.xml"}, ("own.xml", None)),
        ({"RMW_IMPLEMENTATION": "rmw_cyclonedds_cpp"}, (None, "LOCALHOST")),
        ({"RMW_IMPLEMENTATION": "rmw_fastrtps_cpp"}, (LOOPBACK, "SYSTEM_DEFAULT")),
    ],
)
def test_what_the_user_says_of_the_range_holds(said: Any, chosen: Any) -> None:
    environment = dict(said)
    choose_transport(environment)
    again = dict(environment)
    choose_transport(again)
    assert again == environment
    assert (environment.get(PROFILE), environment.get(RANGE)) == chosen
    is_local = LOOPBACK in chosen or "LOCALHOST" in chosen
    assert bool(beyond_this_machine(environment)) != is_local


@pytest.mark.slow
def test_the_stream_of_a_slave_goes_on_while_one_who_reads_it_is_killed(peer: "Peer", tmp_path: Path) -> None:
    """A reader that was killed held its writer's thread up for two seconds at a time."""
    peer.start("slave", real_time__freeze_gc=True)
    listener = peer.listen(topics.SLAVE_MEASURED_CP)
    recorder = peer.start("recorder", out=str(tmp_path / "bag"))
    peer.wait_value("recorder", "received.slave/measured_js", lambda n: n > 500)
    listener.forget()
    recorder.process.kill()
    recorder.process.wait()
    peer.wait(lambda: listener.take() > 3000, "three seconds of samples")
    assert np.diff(listener.stamps).max() < BLOCKED_NS
