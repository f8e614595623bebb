"""Robots as parts: what one caller writes no other sees, and names lead to robots."""

from collections.abc import Callable
from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from present import present
from teleop_core.base import errors
from teleop_core.kernels.geometry import Array
from teleop_core.robots import (
    ROBOTS,
    IkStatus,
    Kernels,
    Robot,
    list_robots,
    load_robot,
    load_robot_set,
    parse_table,
    register_robot,
    robot_from_table,
)
from teleop_core.robots.drives import ENTRIES, Drives
from teleop_machines.drives import geared_motors

robots = pytest.mark.parametrize("name", list_robots())


def arrays_of(robot: Robot) -> dict[str, Array]:
    """Every public array of a robot, by name."""
    found = {name: getattr(robot, name) for name in ("lower", "upper", "home", "geometry_row")}
    found |= {"limits()": robot.limits(), "limits(dt)": robot.limits(1e-3)}
    for part in (present(robot.drives), present(robot.dynamics)):
        values = {entry.name: getattr(part, entry.name) for entry in fields(part)}
        found |= {k: value for k, value in values.items() if isinstance(value, np.ndarray)}
    return found


# What is shared is read-only, what is writable is the caller's.


@robots
def test_two_loads_share_no_array_that_can_be_written(name: str) -> None:
    one, two = arrays_of(load_robot(name)), arrays_of(load_robot(name))
    for entry, array in one.items():
        if array.flags.writeable:
            assert not any(np.shares_memory(array, other) for other in two.values()), entry


@robots
def test_tables_of_a_robot_are_read_only(name: str) -> None:
    arrays = arrays_of(load_robot(name))
    for entry in set(arrays) - {"geometry_row", "limits()", "limits(dt)"}:
        assert not arrays[entry].flags.writeable, entry
    with pytest.raises(TypeError):
        load_robot(name).geometry["L6"] = 1.0  # type: ignore[index]


def test_a_table_of_drives_keeps_what_it_was_made_with() -> None:
    values: dict[str, Any] = {name: np.ones(2) for name in ENTRIES}
    drives = Drives(**values)
    values["inertia"][:] = 7.0
    assert np.array_equal(drives.inertia, [1.0, 1.0])
    assert values["inertia"].flags.writeable


@robots
def test_no_kernel_is_compiled_a_second_time_for_arrays_that_cannot_be_written(name: str) -> None:
    robot = load_robot(name)
    kernels = [one for one in vars(robot.kernels).values() if hasattr(one, "codes")]
    before = {one: set(one.codes) for one in kernels}  # of what a test handed to kernels
    pose = robot.fk(robot.home)
    robot.ik(pose)
    robot.ik(pose, robot.home)
    robot.jacobian(robot.home)
    robot.ik_all(pose)
    robot.follow(pose[None], robot.home)
    for compiled in kernels:
        for kinds in set(compiled.codes) - before[compiled]:
            assert not any("readonly" in kind for kind in kinds), compiled


# Robots by name, by file, by hand.

TABLE: Any = {
    "name": "my_arm",
    "convention": "modified",
    "angles": "degrees",
    "rows": [
        {"theta": "q", "lower": -150, "upper": 150},
        {"a": 0.4, "theta": "q", "lower": -120, "upper": 120, "home": 60},
        {"a": 0.3, "d": "q", "lower": -0.1, "upper": 0.1, "name": "slide"},
    ],
    "task": ["x", "y", "z"],
}


@pytest.fixture
def registered(monkeypatch: pytest.MonkeyPatch) -> Callable[..., object]:
    """Register robots that are forgotten after the test."""
    for store in ("_parts", "_own"):
        monkeypatch.setattr(ROBOTS, store, getattr(ROBOTS, store).copy())
    return register_robot


def test_a_registered_robot_or_table_loads_by_its_name_takes_no_geometry_and_is_listed(
    registered: Callable[..., object],
) -> None:
    arm = registered(robot_from_table(TABLE))
    assert load_robot("my_arm") is arm
    registered(parse_table(TABLE), "arm_of_mine")
    assert load_robot("arm_of_mine").joint_names == ("q1", "q2", "slide")
    assert {"my_arm", "arm_of_mine"} <= set(list_robots())
    with pytest.raises(errors.ParameterError) as caught:
        load_robot("my_arm", a2=1.0)
    assert caught.value.name == "geometry"


def test_a_registered_function_gets_the_geometry(registered: Callable[..., object]) -> None:
    @registered
    def long_arm(reach: float = 0.4) -> Robot:
        rows = [{**TABLE["rows"][0]}, {**TABLE["rows"][1], "a": reach}, TABLE["rows"][2]]
        return robot_from_table({**TABLE, "rows": rows})

    assert load_robot("long_arm").fk(np.zeros(3))[0, 3] == pytest.approx(0.7)
    assert load_robot_set("long_arm", ["reach=1.0"]).fk(np.zeros(3))[0, 3] == pytest.approx(1.3)
    with pytest.raises(errors.UnknownNameError) as caught:
        load_robot("long_arm", width=1.0)
    assert caught.value.alternatives == ("reach",)


def test_a_name_is_used_once_unless_a_cell_is_run_again(registered: Callable[..., object]) -> None:
    registered(robot_from_table(TABLE))
    with pytest.raises(errors.PartError, match="my_arm"):
        registered(robot_from_table(TABLE))
    with pytest.raises(errors.PartError, match="scara"):
        registered(robot_from_table(TABLE), "scara", replace=True)
    second = registered(robot_from_table(TABLE), replace=True)
    assert load_robot("my_arm") is second


def needs_a_length(length: Any) -> Robot:
    return robot_from_table(TABLE)


@pytest.mark.parametrize("part", [3, "rcrt1", Robot, needs_a_length, lambda: 3])
def test_what_is_no_robot_is_refused_by_name(
    registered: Callable[..., object], part: str | int | Callable[..., object] | type[Robot]
) -> None:
    with pytest.raises(errors.PartError) as caught:
        registered(part, "mine")
    assert (caught.value.kind, "mine" not in list_robots()) == ("robot", True)


def crank_fk(q: Array, geometry: Array, T: Array) -> None:
    c, s = np.cos(q[0]), np.sin(q[0])
    T[:] = np.eye(4)
    T[:2, :2], T[:2, 3] = [[c, -s], [s, c]], (geometry[0] * c, geometry[0] * s)


def crank_jacobian(q: Array, geometry: Array, J: Array) -> None:
    J[:] = 0.0
    J[:2, 0], J[5, 0] = (-geometry[0] * np.sin(q[0]), geometry[0] * np.cos(q[0])), 1.0


def crank_ik(T: Array, seed: Array, limits: Array, geometry: Array, q: Array, residual: Array) -> IkStatus:
    wanted = np.arctan2(T[1, 3], T[0, 3])
    q[0] = np.clip(wanted, limits[0, 0], limits[1, 0])
    residual[:] = 0.0
    return IkStatus.FOLLOWED


def crank_ik_all(T: Array, geometry: Array, solutions: Array) -> int:
    solutions[0, 0] = np.arctan2(T[1, 3], T[0, 3])
    return 1


def crank(reach: float = 0.3, **kernels: Callable[..., object]) -> Robot:
    plain: dict[str, Any] = {"fk": crank_fk, "jacobian": crank_jacobian, "ik": crank_ik, "ik_all": crank_ik_all}
    return Robot(
        name="crank",
        joint_names=("q",),
        lower=np.array([-1.0]),
        upper=np.array([1.0]),
        home=np.array([0.0]),
        geometry={"reach": reach},
        kernels=Kernels(**(plain | kernels)),
        drives=geared_motors(1),
    )


def test_a_robot_of_plain_python_functions_answers_like_any_other(registered: Callable[..., object]) -> None:
    registered(crank)
    robot = load_robot("crank", reach=0.5)
    angles = np.linspace(-0.5, 0.5, 9)[:, None]
    assert np.allclose(robot.ik_batch(robot.fk(angles)).q, angles)
    assert robot.ik(robot.fk([0.3])).status is IkStatus.FOLLOWED
    assert present(robot.dynamics).parameters == present(robot.drives).inertia


def test_an_error_in_a_plain_function_reaches_the_caller_of_a_batch() -> None:
    def fk(q: Array, geometry: Array, T: Array) -> None:
        raise ZeroDivisionError(q[0])

    with pytest.raises(ZeroDivisionError):
        crank(fk=fk).fk(np.zeros((3, 1)))


def test_a_robot_with_a_wrong_kernel_is_refused_before_anything_runs(registered: Callable[..., object]) -> None:
    def ik(T: Array, seed: Array, q: Any) -> int:
        return 0

    with pytest.raises(errors.PartError, match="crank"):
        registered(crank(ik=ik))


def test_the_path_of_a_table_is_a_robot(tmp_path: Path) -> None:
    path = tmp_path / "my_arm.yaml"
    path.write_text(yaml.safe_dump(TABLE), encoding="utf-8")
    robot = load_robot_set(str(path), ())
    assert robot.name == "my_arm"
    assert robot.n == 3
    with pytest.raises(errors.RecordingError, match=r"other.yml: cannot be read: No such file"):
        load_robot(str(tmp_path / "other.yml"))


def test_unknown_names_list_the_alternatives() -> None:
    with pytest.raises(errors.UnknownNameError) as caught:
        load_robot("r2d2")
    files = ("FILE.urdf", "FILE.xacro", "FILE.yaml", "SCENE.xml")
    assert caught.value.alternatives == (*list_robots(), *files)


# What a robot says of itself.


def test_a_robot_is_one_line_at_the_prompt_and_a_table_in_a_notebook() -> None:
    arm = robot_from_table(TABLE)
    assert repr(arm) == ("Robot 'my_arm', 3 joints [rad, m]: q1 -2.618…2.618, q2 -2.094…2.094, slide -0.1…0.1")
    html = arm._repr_html_()
    assert html.count("<tr>") == 4
    assert "slide" in html
    assert "<script>" not in robot_from_table({**TABLE, "name": "<script>"})._repr_html_()


@pytest.mark.parametrize("name", ["rcrt1", "puma560"])
def test_a_robot_says_which_of_its_drives_are_assumed(name: str) -> None:
    robot = load_robot(name)
    assert robot.drives_are_assumed
    assert ("speed_limit" in present(robot.drives).assumed) == (name == "puma560")
