"""The command ``map-device``: it asks for three motions of a device, and writes what they tell."""

import os
import select
import subprocess
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest
import yaml

from foreign_hand import AXES, ROWS, Device
from present import present
from teleop_core.nodes.children import environment

if TYPE_CHECKING:
    from ros.conftest import Peer

pytestmark = pytest.mark.ros


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
