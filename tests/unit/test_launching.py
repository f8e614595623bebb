"""What the launch files start: processes, namespaces, parameter files and arguments."""

import runpy
import sys
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

import pytest
import yaml

from teleop_core.nodes.launching import COMMON, ONE_ARM, TWO_ARMS, LaunchedProcess, processes
from teleop_core.nodes.start import taken_names

LAUNCH = Path(__file__).resolve().parents[2] / "src" / "teleop_core" / "launch"
STAGES = {"operator", "haptic_master", "motion_scaling", "inverse_kinematics", "slave", "slave_sim"}
NODES = STAGES | {"frames"}


def given(own: dict[str, tuple[str, str]] = ONE_ARM, **values: str) -> dict[str, str]:
    return {name: default for name, (default, _) in (COMMON | own).items()} | values


def parameters(process: LaunchedProcess) -> dict[str, dict[str, str | float | bool | list[str | float]]]:
    content = yaml.safe_load(Path(process.parameters).read_text())
    return {name: node["ros__parameters"] for name, node in content.items()}


def test_a_session_has_a_process_for_each_side_with_the_recorder_first() -> None:
    recorder, slave, hand = processes(given())
    assert recorder.name == "recorder"
    assert {slave.executable, hand.executable} == {"teleop_session"}
    assert set(slave.arguments) == {"slave", "slave_sim", "frames"}
    assert {*slave.arguments, *hand.arguments} == NODES
    assert (hand.respawns, slave.respawns) == (True, False)


def test_a_session_may_have_a_process_for_each_node_with_the_recorder_first() -> None:
    found = processes(given(processes="nodes"))
    assert found[0].name == "recorder"
    assert {process.name for process in found} == NODES | {"recorder"}
    assert {process.namespace for process in found} == {"/"}


@pytest.mark.parametrize(
    ("outer", "own", "where"),
    [("", "", ""), ("", "lab", "/lab"), ("/left", "", "/left"), ("/left", "/lab/", "/left/lab")],
)
def test_every_node_finds_its_parameters_where_it_is(outer: str, own: str, where: str) -> None:
    for process in processes(given(namespace=own, processes="nodes"), outer):
        full = f"{process.namespace.rstrip('/')}/{process.name}"
        assert full == f"{where}/{process.name}"
        assert full in parameters(process)


def test_one_process_may_hold_all_nodes_but_the_recorder() -> None:
    _, process = processes(given(processes="one", namespace="lab"))
    assert (process.executable, process.name) == ("teleop_session", "")
    assert set(process.arguments) == NODES
    assert process.namespace == "/lab"
    assert {f"/lab/{name}" for name in NODES | {"recorder"}} <= set(parameters(process))


def test_nothing_records_where_it_is_not_wanted() -> None:
    assert "recorder" not in {process.name for process in processes(given(record="false"))}
    (process,) = processes(given(record="false", processes="one"))
    assert parameters(process)["/recorder"]["autostart"] is False


def test_a_robot_is_that_of_all_stages_of_its_arm() -> None:
    one = parameters(processes(given(robot="puma560"))[0])
    assert {one[f"/{name}"]["robot"] for name in ("slave", "slave_sim", "inverse_kinematics")} == {"puma560"}
    both = processes(given(TWO_ARMS, right_robot="puma560", processes="nodes"))
    two = parameters(both[0])
    assert two["/slave_sim"]["robot"] == "rcrt1"
    assert two["/right/slave_sim"]["robot"] == "puma560"
    assert sum(process.namespace == "/right" for process in both) == len(STAGES)


@pytest.mark.parametrize(("file", "own", "count"), [("teleop", ONE_ARM, 8), ("two_arms", TWO_ARMS, 14)])
def test_a_launch_file_declares_its_arguments_and_starts_its_nodes(
    monkeypatch: pytest.MonkeyPatch, file: str, own: dict[str, tuple[str, str]], count: int
) -> None:
    # Stand-ins for launch and launch_ros, which PyPI does not have, as far as they are used.
    declared, started = {}, []
    launch: Any
    actions: Any
    ros: Any
    launch, actions, ros = ModuleType("launch"), ModuleType("launch.actions"), ModuleType("ros")
    launch.LaunchDescription = list
    actions.DeclareLaunchArgument = lambda name, default_value, description: declared.update({name: default_value})
    actions.OpaqueFunction = lambda function: function
    ros.Node = lambda **arguments: started.append(arguments)
    modules = {
        "launch": launch,
        "launch.actions": actions,
        "launch_ros": ModuleType("launch_ros"),
        "launch_ros.actions": ros,
    }
    for name, module in modules.items():
        monkeypatch.setitem(sys.modules, name, module)
    made = runpy.run_path(str(LAUNCH / f"{file}.launch.py"))["generate_launch_description"]()
    assert set(declared) == set(COMMON) | set(own)
    values = declared | {"processes": "nodes", "ros_namespace": "/lab", "log_level": "warn"}
    made[-1](SimpleNamespace(launch_configurations=values))
    assert len(started) == count
    assert all(node["package"] == "teleop_core" for node in started)
    assert all(node["ros_arguments"] == ["--log-level", "warn"] for node in started)
    assert {node["namespace"] for node in started} <= {"/lab", "/lab/right"}
    assert all(node["exec_name"] == node["name"] for node in started)
    stays = {node["name"] for node in started if not node["respawn"]}
    assert stays == {"slave", "slave_sim", "recorder"}


def test_names_for_all_nodes_of_a_process_are_taken_out_and_others_are_kept() -> None:
    given = ["node", "-r", "__ns:=/x", "--ros-args", "-r", "__ns:=/lab", "--remap", "__node:=arm",
             "-r", "slave:__node:=other", "-r", "a:=b", "--", "-r", "__ns:=/y"]  # fmt: skip
    kept = ["node", "-r", "__ns:=/x", "--ros-args", "-r", "slave:__node:=other", "-r", "a:=b", "--", "-r", "__ns:=/y"]
    assert taken_names(given) == (kept, {"__ns": "/lab", "__node": "arm"})
    assert taken_names(kept) == (kept, {})
