"""Master bridge: a device in plain rclpy leads the slave in the place of the simulated one."""

import math
import os
import select
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
import yaml
from geometry_msgs.msg import Pose, PoseStamped, TransformStamped, WrenchStamped
from rclpy.qos import qos_profile_sensor_data
from sensor_msgs.msg import Joy

from present import present
from teleop_core.graph.topics import (
    MASTER_BUTTONS,
    MASTER_MEASURED_CP,
    MASTER_SERVO_CF,
    SLAVE_SERVO_CP,
)
from teleop_core.nodes.children import environment

if TYPE_CHECKING:
    from ros.conftest import Peer

pytestmark = [pytest.mark.ros, pytest.mark.slow]

MASTERS = Path(__file__).parents[2] / "config" / "masters"
AXES = ["+y", "+z", "+x"]
ROWS = np.array([[0, 1, 0], [0, 0, 1], [1, 0, 0]])
TYPES = {"PoseStamped": PoseStamped, "TransformStamped": TransformStamped, "Pose": Pose}


class Device:
    """A stylus of the test, in millimetres: it says where it is 500 times a second."""

    def __init__(self, peer: "Peer", kind: str = "PoseStamped") -> None:
        self.node, self.place, self.buttons, self.force = (
            peer.node,
            np.zeros(3),
            [0, 0],
            np.zeros(3),
        )
        self._kind, quality = TYPES[kind], qos_profile_sensor_data
        self._poses = self.node.create_publisher(self._kind, "touch/pose", quality)
        self._joy = self.node.create_publisher(Joy, "touch/joy", quality)
        self.node.create_subscription(WrenchStamped, "touch/force", self._push, quality)
        self._timer = self.node.create_timer(0.002, self._tick)

    bridge: Any
    has_stamps = True

    def stop(self) -> None:
        self.node.destroy_timer(self._timer)

    def _push(self, message: Any) -> None:
        force = message.wrench.force
        self.force = np.array([force.x, force.y, force.z])

    def _tick(self) -> None:
        message, (x, y, z) = self._kind(), self.place.tolist()
        if self._kind is not Pose and self.has_stamps:
            message.header.stamp = self.node.get_clock().now().to_msg()
        if self._kind is TransformStamped:
            there, turn = message.transform.translation, message.transform.rotation
        else:
            pose = message if self._kind is Pose else message.pose
            there, turn = pose.position, pose.orientation
        there.x, there.y, there.z, turn.w = x, y, z, 1.0
        self._poses.publish(message)
        self._joy.publish(Joy(buttons=self.buttons))


def started(peer: "Peer", kind: str = "PoseStamped") -> Device:
    device = Device(peer, kind)
    device.bridge = peer.start(
        "master_bridge", pose_topic="/touch/pose", device_axes=AXES, unit=0.001,
        pose_message=f"geometry_msgs/msg/{kind}", buttons_topic="/touch/joy",
        button_places=[1, -1, 0], force_topic="/touch/force", largest_force=2.0,
    )  # fmt: skip
    return device


def turning(peer: "Peer", condition: Any) -> Callable[[], object]:
    """A condition, looked at once the test's own node had a turn."""
    return lambda: peer.spin() or condition()


@pytest.mark.parametrize("kind", TYPES)
def test_poses_of_each_type_arrive_in_the_axes_of_the_master_in_metres(
    peer: "Peer", kind: str
) -> None:
    measured, buttons = map(peer.listen, (MASTER_MEASURED_CP, MASTER_BUTTONS))
    device = started(peer, kind)
    device.place = np.array([10.0, 20.0, 30.0])
    expected = 1e-3 * ROWS @ device.place

    def is_there() -> int | bool:
        return measured.take() and np.allclose(measured.values[-1][:3], expected, atol=1e-9)

    peer.wait(turning(peer, is_there), "the place")
    device.buttons = [0, 1]
    pressed = [1.0, 0.0, 0.0]
    peer.wait(
        turning(peer, lambda: buttons.take() and list(buttons.values[-1]) == pressed), "clutch"
    )


def test_a_device_whose_poses_have_no_stamp_is_refused_with_a_line_in_the_log(peer: "Peer") -> None:
    device = started(peer)
    device.has_stamps = False
    peer.wait(turning(peer, lambda: "have no stamp" in device.bridge.stderr.read_text()), "a line")
    device.has_stamps = True
    peer.wait(
        turning(peer, lambda: "follows the device" in device.bridge.stderr.read_text()), "its end"
    )


def test_a_device_that_swings_leads_the_slave(peer: "Peer") -> None:
    commands = peer.listen(SLAVE_SERVO_CP)
    device = started(peer)
    for name in ("motion_scaling", "inverse_kinematics"):
        peer.start(name)
    peer.start("slave")
    begin = time.monotonic()

    def swings() -> int:
        turn = 2.0 * math.pi * 0.5 * (time.monotonic() - begin)
        device.place = np.array([0.0, 0.0, 10.0 * math.sin(turn)])  # mm; z is the master's y
        commands.take()
        return len(commands.values) and np.ptp(np.array(commands.values)[:, 2]) > 0.01

    peer.wait(turning(peer, swings), "a command that swings with the device")
    ways = np.ptp(np.array(commands.values)[:, :3], axis=0)
    assert np.argmax(ways) == 2  # the master's y is the slave's z
    assert ways[2] < 0.021
    device.stop()
    peer.wait(lambda: "no master/measured_cp" in peer.status("motion_scaling").message, "silence")


def test_a_device_is_given_forces_along_its_own_axes_and_none_once_it_is_silent(
    peer: "Peer",
) -> None:
    device, asked = started(peer), np.array([0.5, -1.0, 0.3])

    def is_pushed() -> bool:
        peer.send(MASTER_SERVO_CF, time.time_ns(), [*asked, 0.0, 0.0, 0.0])
        return np.allclose(device.force, ROWS.T @ asked, atol=1e-9)

    peer.wait(turning(peer, is_pushed), "the force")
    device.stop()

    def is_free() -> bool:
        peer.send(MASTER_SERVO_CF, time.time_ns(), [*asked, 0.0, 0.0, 0.0])
        return not device.force.any()

    peer.wait(turning(peer, is_free), "no force")


# -- map-device ------------------------------------------------------------------------------------


def command(peer: "Peer", *arguments: object) -> Any:
    words = [sys.executable, "-m", "teleop_core.cli", "map-device", *map(str, arguments)]
    env = environment() | {"ROS_DOMAIN_ID": peer.domain, "PYTHONUNBUFFERED": "1"}
    return subprocess.Popen(
        words, env=env, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
        text=True,
    )  # fmt: skip


def test_three_motions_write_what_the_bridge_needs(peer: "Peer", tmp_path: Path) -> None:
    device, file, said = Device(peer), tmp_path / "mine.yaml", ""
    with command(peer, "touch/pose", "--out", file) as asking:

        def asks(text: str, count: Any) -> Any:
            """Whether the command has asked so often; what it says comes without an end of line."""
            nonlocal said
            peer.spin()
            assert asking.poll() in {None, 0}, present(asking.stderr).read()
            if select.select([asking.stdout], [], [], 0.0)[0]:
                said += os.read(present(asking.stdout).fileno(), 4096).decode()
            return said.count(text) > count

        # To the right, up and towards the person: the device's y, z and x, a decimetre each.
        for k, way in enumerate(100.0 * ROWS + 3.0):
            peer.wait(lambda: asks("hold the stylus still", k), "the begin of a motion")
            present(asking.stdin).write("\n")
            present(asking.stdin).flush()
            peer.wait(lambda: asks("hold it there", k), "the end of a motion")
            device.place = device.place + way
            for _ in range(50):  # messages of the place before are on the way
                peer.spin()
            present(asking.stdin).write("\n")
            present(asking.stdin).flush()
        peer.wait(lambda: peer.spin() or asking.poll() is not None, "its end")
        assert asking.returncode == 0, present(asking.stderr).read()
    found = yaml.safe_load(file.read_text())["master_bridge"]["ros__parameters"]
    assert found == {
        "pose_topic": "/touch/pose", "pose_message": "geometry_msgs/msg/PoseStamped",
        "device_axes": AXES, "unit": 0.001,
    }  # fmt: skip


def test_a_topic_that_is_not_there_is_told_with_those_that_are(peer: "Peer") -> None:
    Device(peer)
    with command(peer, "nowhere/pose") as asking:
        peer.wait(lambda: peer.spin() or asking.poll() is not None, "its end")
        told = present(asking.stderr).read()
    assert asking.returncode == 2
    assert "/nowhere/pose is not there" in told
    assert "/touch/pose" in told


# -- files of devices whose axes are speeds --------------------------------------------------------


class Sticks:
    """What ``joy_node`` or ``spacenav`` says of a device, 50 times a second."""

    def __init__(self, peer: "Peer", topic: str) -> None:
        self.axes, self.buttons, self._node = [0.0] * 6, [0] * 11, peer.node
        self._joy = self._node.create_publisher(Joy, topic, 10)
        self._node.create_timer(0.02, self._tick)

    def _tick(self) -> None:
        message = Joy(axes=self.axes, buttons=self.buttons)
        message.header.stamp = self._node.get_clock().now().to_msg()
        self._joy.publish(message)


@pytest.mark.parametrize(
    ("name", "axis", "held", "way"), [("joy", 1, 4, (0, 0, -1)), ("spacenav", 0, None, (0, 0, -1))]
)
def test_the_file_of_a_device_with_sticks_moves_the_stylus_as_it_is_held(
    peer: "Peer", name: str, axis: int, held: int | None, way: tuple[int, int, int]
) -> None:
    file = MASTERS / f"{name}.yaml"
    topic = yaml.safe_load(file.read_text())["master_bridge"]["ros__parameters"]["pose_topic"]
    sticks, measured = Sticks(peer, topic), peer.listen(MASTER_MEASURED_CP)
    words = ["master_bridge", "--ros-args", "--params-file", str(file)]
    env = environment() | {"ROS_DOMAIN_ID": peer.domain}
    with subprocess.Popen([sys.executable, "-m", "teleop_core.nodes", *words], env=env) as bridge:
        try:

            def newest() -> Any:
                """The newest twenty places (20, 3)."""
                measured.take()
                return np.array(measured.values)[-20:, :3] if len(measured.values) > 20 else None

            def rests() -> bool:
                return (p := newest()) is not None and not np.ptp(p, axis=0).any()

            sticks.axes[axis] = 1.0
            if held is not None:  # the stick alone moves nothing
                peer.wait(turning(peer, rests), "poses at rest")
                assert not newest().any()
                sticks.buttons[held] = 1

            def is_far() -> bool:
                return (p := newest()) is not None and p[-1] @ np.array(way) > 0.01

            peer.wait(turning(peer, is_far), "a centimetre")
            assert np.allclose(np.cross(newest()[-1], way), 0.0, atol=1e-9)
            if held is None:
                sticks.axes[axis] = 0.0
            else:
                sticks.buttons[held] = 0
            peer.wait(turning(peer, rests), "rest")
        finally:
            bridge.terminate()
