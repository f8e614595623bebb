"""Master bridge: a device of others leads the slave in the place of the simulated one."""

import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
import yaml
from sensor_msgs.msg import Joy

from foreign_hand import AXES, ROWS, TYPES, Device, stamp, turning
from teleop_core.graph.topics import MASTER_BUTTONS, MASTER_MEASURED_CP, MASTER_SERVO_CF, SLAVE_SERVO_CP
from teleop_core.middleware.platform import Qos

if TYPE_CHECKING:
    from peers import AnyPeer as Peer

MASTERS = Path(__file__).parents[2] / "config" / "masters"


def started(peer: "Peer", kind: str = "PoseStamped") -> Device:
    device = Device(peer, kind)
    device.bridge = peer.start(
        "master_bridge",
        pose_topic="/touch/pose",
        device_axes=AXES,
        unit=0.001,
        pose_message=f"geometry_msgs/msg/{kind}",
        buttons_topic="/touch/joy",
        button_places=[1, -1, 0],
        force_topic="/touch/force",
        largest_force=2.0,
    )
    return device


@pytest.mark.parametrize("kind", TYPES)
def test_poses_of_each_type_arrive_in_the_axes_of_the_master_in_metres(peer: "Peer", kind: str) -> None:
    measured, buttons = map(peer.listen, (MASTER_MEASURED_CP, MASTER_BUTTONS))
    device = started(peer, kind)
    device.place = np.array([10.0, 20.0, 30.0])
    expected = 1e-3 * ROWS @ device.place

    def is_there() -> int | bool:
        return measured.take() and np.allclose(measured.values[-1][:3], expected, atol=1e-9)

    peer.wait(turning(peer, is_there), "the place")
    device.buttons = [0, 1]
    pressed = [1.0, 0.0, 0.0]
    peer.wait(turning(peer, lambda: buttons.take() and list(buttons.values[-1]) == pressed), "clutch")


def test_a_device_whose_poses_have_no_stamp_is_refused_with_a_line_in_the_log(peer: "Peer") -> None:
    device = started(peer)
    device.has_stamps = False
    peer.wait(turning(peer, lambda: "have no stamp" in device.bridge.stderr.read_text()), "a line")
    device.has_stamps = True
    peer.wait(turning(peer, lambda: "follows the device" in device.bridge.stderr.read_text()), "its end")


def test_a_device_that_swings_leads_the_slave(peer: "Peer") -> None:
    commands = peer.listen(SLAVE_SERVO_CP)
    device = started(peer)
    for name in ("motion_scaling", "inverse_kinematics"):
        peer.start(name)
    peer.start("slave")
    begin = peer.now()

    def swings() -> int:
        turn = 2.0 * math.pi * 0.5 * (peer.now() - begin)
        device.place = np.array([0.0, 0.0, 10.0 * math.sin(turn)])  # mm; z is the master's y
        commands.take()
        return len(commands.values) and np.ptp(np.array(commands.values)[:, 2]) > 0.01

    peer.wait(turning(peer, swings), "a command that swings with the device")
    ways = np.ptp(np.array(commands.values)[:, :3], axis=0)
    assert np.argmax(ways) == 2  # the master's y is the slave's z
    assert ways[2] < 0.021
    device.stop()
    peer.wait(lambda: "no master/measured_cp" in peer.status("motion_scaling").message, "silence")


def test_a_device_is_given_forces_along_its_own_axes_and_none_once_it_is_silent(peer: "Peer") -> None:
    device, asked = started(peer), np.array([0.5, -1.0, 0.3])

    def is_pushed() -> bool:
        peer.send(MASTER_SERVO_CF, peer.time_ns(), [*asked, 0.0, 0.0, 0.0])
        return np.allclose(device.force, ROWS.T @ asked, atol=1e-9)

    peer.wait(turning(peer, is_pushed), "the force")
    device.stop()

    def is_free() -> bool:
        peer.send(MASTER_SERVO_CF, peer.time_ns(), [*asked, 0.0, 0.0, 0.0])
        return not device.force.any()

    peer.wait(turning(peer, is_free), "no force")


# -- files of devices whose axes are speeds --------------------------------------------------------


class Sticks:
    """What ``joy_node`` or ``spacenav`` says of a device, 50 times a second."""

    def __init__(self, peer: "Peer", topic: str) -> None:
        self.axes, self.buttons, self._peer = [0.0] * 6, [0] * 11, peer
        self._joy = peer.ros.create_publisher(Joy, topic, Qos())
        peer.ros.create_timer(0.02, self._tick)

    def _tick(self) -> None:
        message = Joy(axes=self.axes, buttons=self.buttons)
        stamp(message, self._peer.time_ns())
        self._joy.publish(message)


def test_the_file_of_a_device_with_sticks_moves_the_stylus_as_it_is_held(peer: "Peer") -> None:
    file = yaml.safe_load((MASTERS / "joy.yaml").read_text())
    way, parameters = (0, 0, -1), file["master_bridge"]["ros__parameters"]
    sticks, measured = Sticks(peer, parameters["pose_topic"]), peer.listen(MASTER_MEASURED_CP)
    peer.start("master_bridge", **parameters)

    def newest() -> Any:
        """The newest twenty places (20, 3)."""
        measured.take()
        return np.array(measured.values)[-20:, :3] if len(measured.values) > 20 else None

    def rests() -> bool:
        return (p := newest()) is not None and not np.ptp(p, axis=0).any()

    sticks.axes[1] = 1.0  # the stick alone moves nothing
    peer.wait(turning(peer, rests), "poses at rest")
    assert not newest().any()
    sticks.buttons[4] = 1

    def is_far() -> bool:
        return (p := newest()) is not None and p[-1] @ np.array(way) > 0.01

    peer.wait(turning(peer, is_far), "a centimetre")
    assert np.allclose(np.cross(newest()[-1], way), 0.0, atol=1e-9)
    sticks.buttons[4] = 0
    peer.wait(turning(peer, rests), "rest")
