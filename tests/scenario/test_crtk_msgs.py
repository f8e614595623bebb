"""CRTK's messages, as ``make crtk_msgs`` builds them where the package is not installed."""

import subprocess
import sys
from importlib import import_module
from importlib.metadata import packages_distributions, requires
from pathlib import Path
from typing import Any

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

from teleop_core.nodes.children import environment

SOURCE = Path(__file__).resolve().parents[2] / "src" / "crtk_msgs"
pytest.importorskip("crtk_msgs")
# Fields as github.com/collaborative-robotics/crtk_msgs 1.3.0 has them.
FIELDS = {
    "msg.OperatingState": "header:std_msgs/Header state:string is_homed:boolean is_busy:boolean",
    "msg.StringStamped": "header:std_msgs/Header string:string",
    "msg.CartesianState": "header:std_msgs/Header pose:geometry_msgs/Pose"
    " pose_is_valid:std_msgs/Bool twist:geometry_msgs/Twist twist_is_valid:std_msgs/Bool"
    " wrench:geometry_msgs/Wrench wrench_is_valid:std_msgs/Bool",
    "msg.SetpointMode": "value:uint8",
    "msg.CartesianServo": "header:std_msgs/Header task_frame:geometry_msgs/Transform"
    " pose:geometry_msgs/Pose twist:geometry_msgs/Twist wrench:geometry_msgs/Wrench"
    " axis_mode:crtk_msgs/SetpointMode[6]",
    "msg.JointServo": "header:std_msgs/Header name:sequence<string> position:sequence<double>"
    " velocity:sequence<double> effort:sequence<double> mode:sequence<crtk_msgs/SetpointMode>",
    "msg.CartesianImpedanceHalfPlaneGains": "p:geometry_msgs/Vector3 d:geometry_msgs/Vector3"
    " bias:geometry_msgs/Vector3 deadband:geometry_msgs/Vector3",
    "msg.CartesianImpedance": "header:std_msgs/Header force_orientation:geometry_msgs/Quaternion"
    " force_position:geometry_msgs/Vector3 torque_orientation:geometry_msgs/Quaternion"
    + "".join(
        f" {part}_{side}:crtk_msgs/CartesianImpedanceHalfPlaneGains"
        for part in ("position", "orientation")
        for side in ("positive", "negative")
    ),
    "srv.TriggerOperatingState.Request": "",
    "srv.TriggerOperatingState.Response": "operating_state:crtk_msgs/OperatingState",
    "srv.QueryForwardKinematics.Request": "jp:sequence<double> cp:geometry_msgs/Pose",
    "srv.QueryForwardKinematics.Response": "cp:geometry_msgs/Pose result:boolean message:string",
    "srv.QueryInverseKinematics.Request": "cp:geometry_msgs/Pose jp:sequence<double>",
    "srv.QueryInverseKinematics.Response": "jp:sequence<double> result:boolean message:string",
}


def test_every_field_has_the_name_type_and_place_that_crtk_gives_it() -> None:
    """Of the package that was built from here, or of CRTK's own."""
    for name, fields in FIELDS.items():
        kind: Any = import_module(f"crtk_msgs.{name.partition('.')[0]}")
        for part in name.split(".")[1:]:
            kind = getattr(kind, part)
        assert " ".join(f"{k}:{v}" for k, v in kind.get_fields_and_field_types().items()) == fields


@pytest.mark.slow
def test_all_that_the_build_imports_comes_with_the_extras_ros_and_crtk(tmp_path: Path) -> None:
    """A fresh clone has no more than these; colcon, which the tests bring, has its packages too."""
    script = (
        f"import sys, pathlib; before = set(sys.modules); sys.path.insert(0, {str(SOURCE)!r})\n"
        "import build_without_ament as b\n"
        f"b.generate(pathlib.Path({str(tmp_path)!r}), pathlib.Path(sys.prefix) / 'share')\n"
        "print(*{name.partition('.')[0] for name in set(sys.modules) - before})"
    )
    done = subprocess.run(
        [sys.executable, "-c", script], env=environment(), capture_output=True, text=True, timeout=100, check=True
    )
    found, modules = packages_distributions(), done.stdout.splitlines()[-1].split()
    assert "catkin_pkg" in modules
    there = brought("teleop_core", "ros", "crtk") | {"setuptools", "pip"}
    needed = {name: {canonicalize_name(one) for one in found[name]} for name in modules if name in found}
    assert {name for name, ways in needed.items() if not ways & there} == set()


def brought(name: str, *extras: str) -> set[str]:
    """Names of a distribution and of all that it requires with some extras."""
    found, waiting = set[tuple[str, str]](), [(name, extra) for extra in ("", *extras)]
    while waiting:
        if (one := waiting.pop()) in found:
            continue
        found.add(one)
        for text in requires(one[0]) or ():
            need = Requirement(text)
            if need.marker is None or need.marker.evaluate({"extra": one[1]}):
                waiting += [(canonicalize_name(need.name), extra) for extra in ("", *need.extras)]
    return {canonicalize_name(name) for name, _ in found}


@pytest.mark.parametrize("fails", ["-m pip", "build_without"])
def test_make_fails_where_the_messages_are_not_built(fails: str, tmp_path: Path) -> None:
    python = tmp_path / "bin/python"
    python.parent.mkdir()
    python.write_text(f'#!/bin/sh\ncase "$*" in *"{fails}"*|-c*) exit 1;; esac\n')
    python.chmod(0o755)
    command = ["make", "-C", str(SOURCE.parents[1]), "-o", "setup", f"VENV={tmp_path}", "crtk_msgs"]
    assert subprocess.run(command, capture_output=True, check=False, timeout=100).returncode != 0


def test_without_a_compiler_one_line_says_what_to_install(tmp_path: Path) -> None:
    script: Any = [sys.executable, SOURCE / "build_without_ament.py", "--prefix", tmp_path]
    named = environment() | {"CC": "no-such-compiler"}
    done = subprocess.run(script, env=named, capture_output=True, text=True, timeout=100, check=False)
    assert done.returncode == 1
    (line,) = done.stderr.splitlines()
    assert "no compiler 'no-such-compiler'" in line
    assert "apt install gcc" in line
