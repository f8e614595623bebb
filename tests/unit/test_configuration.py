"""Configuration: layers of files and settings over the defaults, and what a refusal says."""

import dataclasses
from pathlib import Path
from typing import Any

import pytest
import yaml

from teleop_core.base import TeleopWarning, UnknownNameError
from teleop_core.base.plain_yaml import parse
from teleop_core.graph import BUILT_IN, RECORDER_NAME, layers
from teleop_core.session.configuration import Configuration, configure

SCENARIOS = ("coarse_box", "fine_box", "free_motion", "mode_switching")


@pytest.mark.parametrize("name", SCENARIOS)
def test_scenario_builds_every_group_and_says_what_it_is(name: str) -> None:
    assert layers.list_scenarios()[name]
    assert set(configure(name).groups) == {layers.SESSION, *BUILT_IN, RECORDER_NAME}


def test_default_file_changes_no_default_of_the_code() -> None:
    defaults = Configuration.from_layers([])
    assert configure().groups == defaults.groups


@pytest.mark.parametrize("name", SCENARIOS)
def test_text_of_a_configuration_reads_back_the_same(name: str) -> None:
    configuration = configure(name, settings=["seed=7", "pid.bandwidth=[50,50,50,70,70,70]"])
    layer = layers.parse_layer(yaml.safe_load(configuration.text()), "text")
    assert Configuration.from_layers([layer], name) == configuration


def test_setting_with_its_stage_sets_that_parameter_alone() -> None:
    assert layers.parse_setting("haptic_master.hand.stiffness=250") == {"haptic_master": {"hand.stiffness": 250.0}}


def test_bare_key_sets_every_stage_that_has_it() -> None:
    layer = layers.parse_setting("robot=mma")
    layer.pop("given_joints", None)  # of teleop_core_lerobot, where a test has loaded it
    stages = ("inverse_kinematics", "slave", "slave_sim", "arm_bridge", "scene")
    assert layer == {name: {"robot": "mma"} for name in stages}
    assert layers.parse_setting("seed=5") == {
        name: {"seed": 5} for name in ("operator", "haptic_master", "display", "network", "slave_sim")
    }


@pytest.mark.parametrize(
    ("text", "stage", "name", "value"),
    [
        ("duration=3", "teleop", "duration", 3.0),
        ("duration=1e1", "teleop", "duration", 10.0),
        (" duration = 3 ", "teleop", "duration", 3.0),
        ("hand.mass=0.2", "haptic_master", "hand.mass", 0.2),
        ("haptic_master.seed=5", "haptic_master", "seed", 5),
        ("operator.kind=circle", "operator", "kind", "circle"),
        ("operator.bag=17", "operator", "bag", "17"),
        ("operator.center=[0, 0.01, 1e-3]", "operator", "center", (0.0, 0.01, 0.001)),
        ("buttons.clutch=[]", "operator", "buttons.clutch", ()),
        ("reference_filter.is_on=false", "slave", "reference_filter.is_on", False),
    ],
)
def test_setting_is_read_as_its_declaration_wants(
    text: str, stage: str, name: str, value: str | float | bool | tuple[float, ...]
) -> None:
    layer = layers.parse_setting(text)
    assert layer == {stage: {name: value}}
    assert type(layer[stage][name]) is type(value)


@pytest.mark.parametrize(
    ("key", "meant"),
    [
        ("duratoin", "duration"),
        ("motion_scaling.coarse_gian", "motion_scaling.coarse_gain"),
        ("hand.stifness", "hand.stiffness"),
    ],
)
def test_unknown_key_suggests_the_near_ones(key: str, meant: str) -> None:
    with pytest.raises(UnknownNameError) as error:
        layers.parse_setting(f"{key}=1")
    assert meant in error.value.alternatives
    assert len(error.value.alternatives) <= 3
    with pytest.raises(UnknownNameError) as error:  # like no other
        layers.parse_setting("zzzzzz=1")
    assert meant.rpartition(".")[2] in {name.rpartition(".")[2] for name in error.value.alternatives}


def write(path: Path, content: Any) -> Path:
    path.write_text(yaml.safe_dump(content, sort_keys=False))
    return path


def test_settings_win_over_files_and_files_over_the_scenario(tmp_path: Path) -> None:
    def file(name: str, **values: int | dict[str, float]) -> Path:
        return write(tmp_path / name, {"haptic_master": {"ros__parameters": values}})

    first = file("first.yaml", seed=11, operator={"period": 5.0, "rotation": 0.1})
    second = file("second.yaml", operator={"period": 6.0})
    groups = configure("coarse_box", [first, second], ["operator.rotation=0.3"]).groups
    operator = groups["operator"]
    assert (operator.seed, operator.period, operator.rotation) == (11, 6.0, 0.3)
    assert operator.tilt == (-0.5, 0.0, 0.0)


@pytest.mark.parametrize("stage", ["operator", "haptic_master"])
def test_what_operator_and_device_both_know_is_said_of_one_of_them(stage: str) -> None:
    room = (0.1, 0.1, 0.1)
    told = [f"{stage}.seed=7", f"{stage}.device.workspace={list(room)}"]
    groups = configure(settings=told).groups
    for name in ("operator", "haptic_master"):
        assert (groups[name].seed, groups[name].device.workspace) == (7, room), name


def test_a_key_that_is_merged_may_be_given_again() -> None:
    assert parse("b: &b {x: 1, y: 2}\na: &a\n  <<: *b\n  x: 2\nc: {<<: *a, y: 3}")["c"] == {"x": 2, "y": 3}


def test_what_stands_under_every_node_holds_for_those_that_have_it_and_say_nothing_else(tmp_path: Path) -> None:
    own = {"slave": {"ros__parameters": {"robot": "mma"}}}
    every = {"/**": {"ros__parameters": {"robot": "puma560", "command_timeout": 0.3}}}
    layer = layers.load_file(write(tmp_path / "mine.yaml", own | every))
    assert layer["slave"] == {"robot": "mma", "command_timeout": 0.3}
    assert layer["inverse_kinematics"]["robot"] == layer["slave_sim"]["robot"] == "puma560"


OF_OTHERS: dict[str, tuple[dict[str, Any], str]] = {
    "of a stage that the session leaves out": ({"force_gain": 2.0}, "no stage of this session has force_gain"),
    "of every node of ROS": ({"use_sim_time": True, "qos_overrides": {"/tf": {"depth": 5}}}, "without effect"),
    "of the nodes of others": ({"publish_every": 50.0}, "no stage has the parameter 'publish_every'"),
}


@pytest.mark.parametrize("case", OF_OTHERS)
def test_what_stands_under_every_node_and_concerns_none_of_the_session_is_told(case: str, tmp_path: Path) -> None:
    values, said = OF_OTHERS[case]
    path = write(tmp_path / "mine.yaml", {"/**": {"ros__parameters": {**values, "command_timeout": 0.3}}})
    with pytest.warns(TeleopWarning, match=said):
        made = configure(files=[path])
    assert made.group("slave").command_timeout == 0.3
    assert made.text() == configure(settings=["slave.command_timeout=0.3"]).text()


def test_sim_time_of_one_node_is_told_too(tmp_path: Path) -> None:
    path = write(tmp_path / "mine.yaml", {"slave": {"ros__parameters": {"use_sim_time": False}}})
    with pytest.warns(TeleopWarning, match="use_sim_time"):
        configure(files=[path])


def test_groups_of_a_configuration_cannot_be_changed_behind_its_back() -> None:
    scaling = configure().groups["motion_scaling"]
    with pytest.raises(dataclasses.FrozenInstanceError):
        scaling.coarse_gain = 2.0


# Former names.


@pytest.mark.parametrize(
    ("key", "value", "stage", "name", "meant"),
    [
        ("path.kind", "circle", "operator", "kind", "circle"),
        ("haptic_master.path.period", 5.0, "operator", "period", 5.0),
        ("haptic_master.operator.period", 5.0, "operator", "period", 5.0),
        ("hand.tremor_amplitude", 0.0, "operator", "tremor_amplitude", 0.0),
        ("fixture.size", "[0.1, 0.2, 0.3]", "motion_scaling", "fixture.box.size", (0.1, 0.2, 0.3)),
        ("pid.kp", "[1.0]", "slave_sim", "controller.pid.kp", (1.0,)),
        ("slave_sim.pid.bandwidth", "[1.0]", "slave_sim", "controller.pid.bandwidth", (1.0,)),
        ("slave_sim.command_timeout", 0.2, "slave", "command_timeout", 0.2),
        ("slave_sim.operation.heartbeat", 0.5, "slave", "operation.heartbeat", 0.5),
    ],
)
def test_former_name_sets_what_it_is_called_now(
    key: str, value: str | float, stage: str, name: str, meant: str | float | tuple[float, ...]
) -> None:
    assert layers.parse_setting(f"{key}={value}") == {stage: {name: meant}}


def test_file_with_former_names_gives_the_same_configuration(tmp_path: Path) -> None:
    old: dict[str, dict[str, Any]] = {
        "haptic_master": {"path": {"kind": "circle", "period": 5.0}, "seed": 3},
        "slave_sim": {"pid": {"kp": [1.0] * 6}, "start_speed": 0.2, "operation.tool_speed": 0.1},
        "teleop": {"delays": ["slave/servo_jp@slave_sim=0.02"]},
    }
    now: dict[str, dict[str, Any]] = {
        "operator": {"kind": "circle", "period": 5.0},
        "haptic_master": {"seed": 3},
        "slave": {"start_speed": 0.2, "operation": {"tool_speed": 0.1}},
        "slave_sim": {"controller.pid.kp": [1.0] * 6},
        "teleop": {"delays": ["slave/servo_jp@slave=0.02"]},
    }
    first, second = (
        write(tmp_path / name, {stage: {"ros__parameters": group} for stage, group in file.items()})
        for name, file in (("old.yaml", old), ("now.yaml", now))
    )
    assert configure(files=[first]) == configure(files=[second])
