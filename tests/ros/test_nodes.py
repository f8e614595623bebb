"""Every node, as a real process, answers on its topics, takes parameters and ends cleanly."""

import resource
import subprocess
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

from teleop_core.bags.reader import Bag
from teleop_core.nodes.children import environment

if TYPE_CHECKING:
    from ros.conftest import Peer

pytestmark = pytest.mark.ros


@pytest.mark.slow
def test_a_full_disk_ends_the_recorder_with_one_line_and_a_readable_bag(peer: "Peer", tmp_path: Path) -> None:
    recorder = peer.start("recorder", out=str(tmp_path / "bag"))
    peer.start("haptic_master")
    # As on a full disk, no file of the recorder can grow beyond this.
    resource.prlimit(recorder.process.pid, resource.RLIMIT_FSIZE, (300_000, 300_000))
    assert recorder.wait(60) == 1
    told = recorder.stderr.read_text().strip().splitlines()
    (line,) = [one for one in told if "[INFO]" not in one]
    assert "cannot be written any more" in line
    assert "recover" in line or "are safe" in line
    bag = tmp_path / "bag"
    if "recover" in line:  # not even the end of the file found room
        subprocess.run([sys.executable, "-m", "teleop_core.commands.cli", "recover", str(bag)], check=True)
        bag = tmp_path / "bag_recovered"
    assert sum(topic.count for topic in Bag(bag).topics.values()) > 0


def test_parameters_are_accepted_or_refused_with_the_reason(peer: "Peer") -> None:
    peer.start("slave")
    accepted, refused, wrong_type, read_only, length, unknown = (
        peer.set(node, False, **{name: value})[0]
        for node, name, value in (
            ("slave", "command_timeout", 0.2),
            ("slave", "command_timeout", 50.0),
            ("slave", "command_timeout", 1),
            ("slave", "robot", "scara"),
            ("slave_sim", "controller__pid__kp", [1.0, 2.0]),
            ("slave", "no_such", 1.0),
        )
    )
    assert accepted.successful
    assert not refused.successful
    assert "command_timeout" in refused.reason
    assert "Type.DOUBLE" in wrong_type.reason
    assert "read-only" in read_only.reason
    assert "6 values" in length.reason
    assert not unknown.successful
    assert peer.set("slave_sim", viscous=[0.1] * 6)[0].successful
    assert peer.set("slave_sim", viscous=[])[0].successful


@pytest.mark.parametrize(
    ("name", "content", "needed"),
    [
        ("slave", "command_timout: 0.1", "command_timeout"),
        ("slave", "command_timeout: 50.0", "between 0.002 and 5 s"),
        ("slave_sim", "integration_steps: 1.5", "of type int"),
        ("slave", "robot: nobot", "rcrt1"),
        ("operator", "{kind: bag, bag: /no/such/bag}", "No such file"),
        ("recorder", "out: /tmp", "exists already"),
        ("slave", "bad: [1.0", "is not YAML"),
    ],
)
def test_wrong_parameter_files_end_with_one_line_and_2(tmp_path: Path, name: str, content: str, needed: str) -> None:
    file = tmp_path / "parameters.yaml"
    file.write_text(f"{name}:\n  ros__parameters:\n    {content}\n")
    command: Any = [sys.executable, "-m", "teleop_core.nodes", name, "--ros-args", "--params-file", file]
    done = subprocess.run(command, capture_output=True, text=True, timeout=90, env=environment(), check=False)
    assert done.returncode == 2
    assert len(done.stderr.strip().splitlines()) == 1, done.stderr
    assert needed in done.stderr
