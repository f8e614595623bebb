"""The colcon workspace, built with the real tools, as a ROS user builds it."""

import os
import shutil
import signal
import subprocess
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any
from xml.etree import ElementTree

import pytest

from present import present
from teleop_core.graph import topics
from teleop_core.nodes.children import environment

if TYPE_CHECKING:
    from ros.conftest import Peer

pytestmark = [pytest.mark.ros, pytest.mark.slow]

ROOT = Path(__file__).resolve().parents[2]
CAN_COMPILE = all(map(shutil.which, ("cc", "c++", "cmake")))
COLCON = Path(sys.executable).with_name("colcon")
NODES = {
    "operator",
    "haptic_master",
    "master_bridge",
    "motion_scaling",
    "inverse_kinematics",
    "slave",
    "slave_sim",
    "arm_bridge",
    "recorder",
}


@pytest.fixture(scope="module")
def workspace(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Copy of the repository's workspace, links as links, built."""
    root = tmp_path_factory.mktemp("workspace")
    ignored = shutil.ignore_patterns("__pycache__", "*.egg-info", "build", "install", "log")
    for folder in ("src", "config", "ros_ws", "tests"):
        shutil.copytree(ROOT / folder, root / folder, symlinks=True, ignore=ignored)
    made = root / "ros_ws"
    assert "(ros.ament_python)" in colcon(made, "list")
    colcon(made, "build", *(() if CAN_COMPILE else ("--packages-skip", "crtk_msgs")))
    return made


def colcon(workspace: Path, *arguments: Any) -> Any:
    path = f"{COLCON.parent}:{os.environ['PATH']}"
    done = subprocess.run(
        [COLCON, *arguments],
        cwd=workspace,
        capture_output=True,
        text=True,
        timeout=900,
        env=environment() | {"PATH": path},
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def test_the_workspace_builds_and_a_built_node_answers(workspace: Path, peer: "Peer") -> None:
    if CAN_COMPILE:
        assert list(workspace.glob("install/crtk_msgs/lib/python*/site-packages/crtk_msgs/msg"))
    installed = workspace / "install" / "teleop_core"
    executables = installed / "lib" / "teleop_core"
    assert {file.name for file in executables.iterdir()} >= NODES
    share = installed / "share" / "teleop_core"
    assert (share / "config" / "coarse_box.yaml").exists()
    assert (share / "launch" / "teleop.launch.py").exists()
    assert (share / "hook").is_dir()  # the hooks that let `ros2 run` find the package

    listener = peer.listen(topics.SLAVE_MEASURED_JS)
    package = next(installed.glob("lib/python*/site-packages"))
    env = environment() | {"ROS_DOMAIN_ID": peer.domain, "PYTHONPATH": str(package)}
    node = subprocess.Popen([executables / "slave_sim"], env=env)
    try:
        peer.wait(lambda: listener.take() > 100, "slave/measured_js")
        node.send_signal(signal.SIGTERM)
        assert node.wait(60) == 0
    finally:
        node.kill()
        node.wait()


def test_teleop_of_the_workspace_finds_the_commands_of_the_other_packages(workspace: Path) -> None:
    packages = [
        workspace / "install" / name
        for name in (
            "teleop_core",
            "teleop_machines",
            "teleop_console",
            "teleop_exchange",
            "teleop_scene",
            "teleop_lab",
            "teleop_drill",
        )
    ]
    places = [str(next(package.glob("lib/python*/site-packages"))) for package in packages]
    assert all((package / "share" / package.name / "hook").is_dir() for package in packages)
    teleop = packages[0] / "lib" / "teleop_core" / "teleop"
    for words, text in ((["drill", "--list"], "kill_motion_scaling"), (["experiment"], "points24")):
        done = subprocess.run(
            [teleop, *words],
            env=environment() | {"PYTHONPATH": ":".join(places)},
            capture_output=True,
            text=True,
            check=False,
        )
        assert text in done.stdout, done.stderr


@pytest.mark.soak
def test_colcon_test_runs_the_quick_tests_and_keeps_their_results(workspace: Path) -> None:
    select = ("--packages-select", "teleop_core")
    colcon(workspace, "test", *select, "--return-code-on-test-failure")
    results = ElementTree.parse(workspace / "build" / "teleop_core" / "pytest.xml").getroot()
    (suite,) = results.iter("testsuite")
    assert int(present(suite.get("tests"))) > 300
    assert (suite.get("failures"), suite.get("errors")) == ("0", "0")
