"""Everything in a namespace: names, parameters, topics and recordings of real processes."""

import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest
import yaml
from rcl_interfaces.srv import GetParameters

from teleop_core.bags import reader, transforms
from teleop_core.evaluation import scores
from teleop_core.graph import topics
from teleop_core.nodes.children import environment
from teleop_core.robots import load_robot

if TYPE_CHECKING:
    from ros.conftest import Peer

pytestmark = pytest.mark.ros

PATIENCE = {"patience": 0.0, "approach_time": 1.0}
PUMA, RCRT1 = ({"start": load_robot(name).home.tolist()} for name in ("puma560", "rcrt1"))
"""Slaves that follow at once."""
MEASURED = topics.SLAVE_MEASURED_CP.name


@pytest.fixture
def start(peer: "Peer", tmp_path: Path) -> Iterator[Callable[..., Any]]:
    """Starter of a composed session with a parameter file; it ends with the test."""
    started = []

    def started_with(groups: Any, *arguments: Any) -> subprocess.Popen[bytes]:
        groups = {"recorder": {"out": str(tmp_path / "bag")}} | groups
        file = tmp_path / "session.yaml"
        content = {name: {"ros__parameters": values} for name, values in groups.items()}
        file.write_text(yaml.safe_dump(content))
        command = [sys.executable, "-m", "teleop_core.nodes", "teleop_session", "--ros-args"]
        env = environment() | {"ROS_DOMAIN_ID": peer.domain}
        started.append(subprocess.Popen([*command, "--params-file", str(file), *arguments], env=env))
        return started[0]

    yield started_with
    for process in started:
        if process.poll() is None:
            process.kill()
        process.wait()


def parameter(peer: "Peer", node: str, name: str) -> Any:
    request = GetParameters.Request(names=[name])
    return peer.call(GetParameters, f"{node}/get_parameters", request).values[0]


def recorded(peer: "Peer", process: Any, tmp_path: Any, *slaves: Any) -> reader.Bag:
    """Recording of a session, ended when these slaves have worked for two seconds."""
    for slave in slaves:
        peer.wait_value(slave, "ticks", lambda ticks: ticks > 2000)
    process.send_signal(signal.SIGINT)
    assert process.wait(90) == 0
    return reader.Bag(tmp_path / "bag")


@pytest.mark.soak
def test_arms_of_a_session_in_a_namespace_stay_apart_below_it_and_keep_the_names_of_their_nodes(
    peer: "Peer", start: Callable[..., Any], tmp_path: Path
) -> None:
    puma = {"robot": "puma560"}
    groups = {
        "teleop": {"arms": ["left", "right"]},
        "operator": PATIENCE,
        "slave": RCRT1 | {"command_timeout": 0.25},
        "right/slave": puma | PUMA,
        "right/slave_sim": puma,
        "right/inverse_kinematics": puma,
    }
    process = start(groups, "-r", "__ns:=/lab", "-r", "__node:=arm")
    peer.wait_state("lab/right/slave", "active")
    peer.wait_state("lab/slave", "active")
    assert parameter(peer, "/lab/right/slave", "robot").string_value == "puma560"
    assert parameter(peer, "/lab/slave", "robot").string_value == "rcrt1"
    assert parameter(peer, "/lab/slave", "command_timeout").double_value == 0.25

    def inside() -> set[str]:
        names = peer.node.get_node_names_and_namespaces()
        return {name for name, where in names if where == "/lab"}

    peer.wait(lambda: len(inside()) >= 7, "all nodes to be found")
    assert inside() == {
        "operator",
        "haptic_master",
        "motion_scaling",
        "inverse_kinematics",
        "slave",
        "slave_sim",
        "recorder",
    }
    bag = recorded(peer, process, tmp_path, "lab/slave", "lab/right/slave")
    shared = {topics.DIAGNOSTICS.name, transforms.TF.name}
    assert all(name.startswith("lab/") for name in {*bag.topics} - shared)
    assert bag.topics[f"lab/{MEASURED}"].count > 1000
    joints = bag.read(f"lab/right/{topics.SLAVE_MEASURED_JS.name}")
    assert joints.names == load_robot("puma560").joint_names
    left, right = scores(bag)
    assert (left.session.arm, left.session.robot) == ("left", "rcrt1")
    assert (right.session.arm, right.session.robot) == ("right", "puma560")
    assert min(left.session.duration_s, right.session.duration_s) > 1.0
