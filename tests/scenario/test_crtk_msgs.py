"""CRTK's messages, as ``make crtk_msgs`` builds them where the package is not installed."""

import subprocess
import sys
from importlib import import_module
from pathlib import Path
from typing import Any

import pytest

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


def test_without_a_compiler_one_line_says_what_to_install(tmp_path: Path) -> None:
    script: Any = [sys.executable, SOURCE / "build_without_ament.py", "--prefix", tmp_path]
    named = environment() | {"CC": "no-such-compiler"}
    done = subprocess.run(script, env=named, capture_output=True, text=True, timeout=100, check=False)
    assert done.returncode == 1
    (line,) = done.stderr.splitlines()
    assert "no compiler 'no-such-compiler'" in line
    assert "apt install gcc" in line
