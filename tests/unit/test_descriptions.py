"""Robot descriptions: what is in the cache is loaded, and nothing is ever downloaded."""

import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import teleop_core as tc
from present import present
from teleop_core.bags.kept_files import KeptFiles, recorded_files
from teleop_core.base.errors import ParameterError, UnknownNameError
from teleop_core.robots import load_robot, register_robot

EXAMPLE = Path(__file__).parents[2] / "examples" / "any_arm.urdf"
PANDA, UR5E = "panda_description", "ur5e_description"


@pytest.fixture
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A cache in which the files of two descriptions are the example: a URDF, and a xacro."""
    monkeypatch.setenv("ROBOT_DESCRIPTIONS_CACHE", str(tmp_path))
    urdf = tmp_path / "example-robot-data" / "robots" / PANDA / "urdf" / "panda.urdf"
    xacro = tmp_path / "ur_description" / "urdf" / "ur.urdf.xacro"
    for path in (urdf, xacro):
        path.parent.mkdir(parents=True)
    shutil.copy(EXAMPLE, urdf)
    xmlns = 'xmlns:xacro="http://www.ros.org/wiki/xacro"'
    declared = "".join(f'<xacro:arg name="{name}" default="ur3"/>' for name in ("ur_type", "name"))
    head = f'<robot name="$(arg ur_type)" {xmlns}>{declared}'
    xacro.write_text(EXAMPLE.read_text().replace('<robot name="any_arm">', head))
    return tmp_path


def test_a_description_in_the_cache_is_the_arm_of_its_file_with_the_arguments_of_its_package(cache: Path) -> None:
    plain, panda, ur5e = (load_robot(n, tip="tool0") for n in (str(EXAMPLE), PANDA, UR5E))
    assert (panda.name, ur5e.name) == ("any_arm", "ur5e")
    for robot in (panda, ur5e):
        np.testing.assert_array_equal(robot.fk(plain.start), plain.fk(plain.start))
    assert load_robot(UR5E, tip="tool0", **{"xacro.ur_type": "mine"}).name == "mine"


def test_a_commit_that_the_user_names_is_looked_for_where_the_package_puts_it(
    cache: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("ROBOT_DESCRIPTION_COMMIT", "abc")
    with pytest.raises(ParameterError, match="pull panda_description"):
        load_robot(PANDA, tip="tool0")
    target = cache / "example-robot-data-abc" / "example-robot-data"
    shutil.copytree(cache / "example-robot-data", target)
    assert load_robot(PANDA, tip="tool0").n == 6


@pytest.mark.parametrize("is_half", [False, True])
def test_what_is_not_in_the_cache_is_refused_with_the_command_that_fetches_it(is_half: bool, cache: Path) -> None:
    panda = cache / "example-robot-data"
    shutil.rmtree(panda / "robots" if is_half else panda)
    with pytest.raises(ParameterError, match="`robot_descriptions pull panda_description`") as told:
        load_robot(PANDA, tip="tool0")
    assert "\n" not in str(told.value)
    with pytest.raises(UnknownNameError, match="ur5_descripton_description"):
        load_robot("ur5_descripton_description")


def test_nothing_is_downloaded_and_the_package_clones_for_others_as_before(cache: Path) -> None:
    code = f"""
import subprocess, socket
def refuse(*a, **k): raise SystemExit("started something")
from robot_descriptions import _cache
before = _cache.clone_to_cache
subprocess.Popen.__init__ = socket.socket.connect = refuse
from teleop_core.robots import load_robot
load_robot({PANDA!r}, tip="tool0")
try: load_robot("iiwa14_description")
except Exception as error: print(type(error).__name__)
import sys
assert _cache.clone_to_cache is before and "robot_descriptions.{PANDA}" not in sys.modules
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert (done.stdout, done.returncode) == ("ParameterError\n", 0), done.stderr


def test_a_robot_that_was_registered_keeps_its_name_whatever_its_end(cache: Path) -> None:
    register_robot(load_robot("planar_3r"), "my_description", replace=True)
    assert load_robot("my_description").n == 3


@pytest.mark.parametrize("name", [PANDA, UR5E])
def test_a_recording_keeps_the_text_of_a_description(name: str, cache: Path) -> None:
    given = ["tip=tool0"] + ["xacro.ur_type=mine"] * (name == UR5E)
    files = KeptFiles()
    files.add_robot(name, given)
    kept = {"robot": name} | files.texts()
    shutil.rmtree(cache)
    copy = recorded_files(kept)[name]
    options = dict(text.split("=") for text in given)
    robot = load_robot(copy, **options)
    assert robot.name == ("mine" if name == UR5E else "any_arm")


def test_a_session_of_a_description_is_replayed_without_the_cache(cache: Path) -> None:
    recording = tc.run("coarse_box", duration=0.5, out=cache / "bag", robot=PANDA, geometry=["tip=tool0"])
    before = tc.replay(present(recording.path))["slave/setpoint_js"].values
    shutil.rmtree(cache / "example-robot-data")
    after = tc.replay(present(recording.path))["slave/setpoint_js"].values
    np.testing.assert_array_equal(before, after)
