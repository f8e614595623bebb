"""Xacro files: the arm of the URDF that the package xacro writes, and every mistake by its file."""

import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest

from present import present
from teleop_core.base.errors import ParameterError
from teleop_core.robots import load_robot, load_robot_set
from teleop_core.robots.files import xacro_files
from teleop_core.robots.robot import Robot

EXAMPLE = Path(__file__).parents[2] / "examples" / "any_arm.urdf"
XMLNS = 'xmlns:xacro="http://www.ros.org/wiki/xacro"'
SHOULDER = '<child link="upper_arm"/><origin xyz="0 0 0.1"/>'
PARTS = f"""<robot {XMLNS}>
  <xacro:arg name="height" default="0.1"/>
  <xacro:macro name="place" params="x"><origin xyz="${{x}} 0 $(arg height)"/></xacro:macro>
</robot>"""


def arm(
    folder: Path, include: str = "$(find some_arm)/urdf/parts.xacro", place: str = '<xacro:place x="${0.03 - 0.03}"/>'
) -> Path:
    """The example as a macro file of a package, with its shoulder from an included file."""
    (folder / "some_arm" / "urdf").mkdir(parents=True)
    text = EXAMPLE.read_text()
    assert SHOULDER in text
    head, body = text.replace(SHOULDER, f'<child link="upper_arm"/>{place}').partition("<robot")[2].split(">", 1)
    name = f'<xacro:arg name="prefix" default=""/><xacro:include filename="{include}"/>'
    body = body.replace('"shoulder"', '"$(arg prefix)shoulder"')
    path = folder / "some_arm" / "urdf" / "arm.urdf.xacro"
    path.write_text(f"<robot{head} {XMLNS}>{name}{body}")
    (path.parent / "parts.xacro").write_text(PARTS)
    return path


def same(one: Robot, other: Robot) -> None:
    q = np.random.default_rng(1).uniform(one.lower, one.upper)
    np.testing.assert_array_equal(one.fk(q), other.fk(q))
    np.testing.assert_array_equal(present(one.drives).inertia, present(other.drives).inertia)


@pytest.mark.parametrize("include", ["$(find some_arm)/urdf/parts.xacro", "parts.xacro"])
def test_a_xacro_is_the_arm_of_its_urdf(include: str, tmp_path: Path) -> None:
    robot = load_robot(str(arm(tmp_path, include)), tip="tool0")
    same(robot, load_robot(str(EXAMPLE), tip="tool0"))


def test_arguments_of_a_xacro_stand_in_the_geometry_and_stay_texts(tmp_path: Path) -> None:
    path = arm(tmp_path)
    robot = load_robot_set(str(path), ["tip=tool0", "xacro.prefix=007", "xacro.height=0.5"])
    assert "007shoulder" in robot.joint_names
    urdf = tmp_path / "arm.urdf"
    urdf.write_text(EXAMPLE.read_text().replace(SHOULDER, SHOULDER.replace("0.1", "0.5")))
    same(robot, load_robot(str(urdf), tip="tool0"))
    same(robot, load_robot(str(path), tip="tool0", **{"xacro.height": "0.5"}))


def test_packages_are_found_where_meshes_are(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = arm(tmp_path, "$(find far_parts)/parts.xacro")
    with pytest.raises(ParameterError, match="far_parts"):
        load_robot(str(path), tip="tool0")
    far = tmp_path / "install" / "share" / "far_parts"
    far.mkdir(parents=True)
    (path.parent / "parts.xacro").rename(far / "parts.xacro")
    monkeypatch.setenv("AMENT_PREFIX_PATH", str(tmp_path / "install"))
    same(load_robot(str(path), tip="tool0"), load_robot(str(EXAMPLE), tip="tool0"))


def test_entities_of_a_xacro_and_of_what_it_includes_are_refused(tmp_path: Path) -> None:
    path = arm(tmp_path)
    parts = path.parent / "parts.xacro"
    bomb = '<!DOCTYPE robot [<!ENTITY a "0.18">]>'
    for file in (parts, path):
        text = file.read_text()
        file.write_text(bomb + text)
        with pytest.raises(ParameterError, match="DOCTYPE"):
            load_robot(str(path), tip="tool0")
        file.write_text(text)


def test_without_the_package_one_line_says_how_to_get_it(tmp_path: Path) -> None:
    code = (
        "import sys; sys.modules['xacro'] = None\n"
        "from teleop_core.robots import load_robot\n"
        f"try: load_robot({str(arm(tmp_path))!r}, tip='tool0')\n"
        "except Exception as error: print(type(error).__name__, error)"
    )
    told = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert told.stdout.startswith("TeleopError")
    assert "pip install 'teleop_core[urdf]'" in told.stdout


@pytest.mark.parametrize(
    ("expression", "reason"), [("9**9**9", "expanded within 0.5 s"), ("len('a' * 2**33)", "can be expanded")]
)
def test_xacro_without_end_is_refused_while_other_threads_go_on(
    expression: str, reason: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    if "**9" in expression:  # longer than the start of its process, shorter than the expression by centuries
        monkeypatch.setattr(xacro_files, "PATIENCE", 0.5)
    path, turns = arm(tmp_path, place=f'<x a="${{{expression}}}"/>'), 0
    with ThreadPoolExecutor(1) as pool:
        loading = pool.submit(load_robot, str(path), tip="tool0")
        while not loading.done():
            turns += 1
    with pytest.raises(ParameterError, match=reason):
        loading.result()
    assert turns > 10
