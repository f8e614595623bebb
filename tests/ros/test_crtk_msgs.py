"""CRTK's messages, as they are made where the package is not installed."""

import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from teleop_core.nodes.children import environment, free_domain

SOURCE = Path(__file__).resolve().parents[2] / "src" / "crtk_msgs"
pytestmark = [
    pytest.mark.ros,
    pytest.mark.slow,
    pytest.mark.skipif(not (shutil.which("cc") and shutil.which("c++")), reason="no compiler"),
]
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
SHOW_FIELDS = """
import sys, crtk_msgs.msg, crtk_msgs.srv
for name in sys.argv[1:]:
    kind = crtk_msgs
    for part in name.split("."):
        kind = getattr(kind, part)
    print(*(f"{k}:{v}" for k, v in kind.get_fields_and_field_types().items()))
"""
SEND_AND_TAKE = """
import rclpy
from rclpy.task import Future
from crtk_msgs.msg import OperatingState
from crtk_msgs.srv import TriggerOperatingState
rclpy.init()
node, came = rclpy.create_node("both"), Future()
node.create_subscription(OperatingState, "operating_state", came.set_result, 10)
node.create_publisher(OperatingState, "operating_state", 10).publish(
    OperatingState(state="ENABLED", is_homed=True)
)
rclpy.spin_until_future_complete(node, came, timeout_sec=30)
print(came.result().state, came.result().is_homed, came.result().is_busy)
def answer(request, response):
    response.operating_state.state = "FAULT"
    return response
node.create_service(TriggerOperatingState, "ask", answer)
client = node.create_client(TriggerOperatingState, "ask")
client.wait_for_service(30)
asked = client.call_async(TriggerOperatingState.Request())
rclpy.spin_until_future_complete(node, asked, timeout_sec=30)
print(asked.result().operating_state.state)
rclpy.shutdown()
"""


@pytest.fixture(scope="module")
def env(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """Environment in which the package is found that was built just now, wherever others are."""
    prefix = tmp_path_factory.mktemp("crtk") / "prefix"
    script: Any = [sys.executable, SOURCE / "build_without_ament.py", "--prefix", prefix]
    done = subprocess.run(script, capture_output=True, text=True, timeout=300, check=False)
    assert done.returncode == 0, done.stderr
    (module,) = prefix.glob("lib/python*/site-packages")
    given = environment()
    libraries = f"{prefix / 'lib'}:{given.get('LD_LIBRARY_PATH', '')}"
    return given | {"PYTHONPATH": str(module), "LD_LIBRARY_PATH": libraries}


def run(env: Any, *arguments: object) -> Any:
    named = env | {"ROS_DOMAIN_ID": free_domain()}
    command: Any = [sys.executable, "-c", *arguments]
    done = subprocess.run(
        command, env=named, capture_output=True, text=True, timeout=100, check=False
    )
    assert done.returncode == 0, done.stderr
    return done.stdout.splitlines()


def test_every_field_has_the_name_type_and_place_that_crtk_gives_it(env: dict[str, str]) -> None:
    shown = dict(zip(FIELDS, run(env, SHOW_FIELDS, *FIELDS), strict=True))
    assert shown == FIELDS


def test_built_messages_cross_the_middleware(env: dict[str, str]) -> None:
    assert run(env, SEND_AND_TAKE) == ["ENABLED True False", "FAULT"]


def test_without_a_compiler_one_line_says_what_to_install(tmp_path: Path) -> None:
    script: Any = [sys.executable, SOURCE / "build_without_ament.py", "--prefix", tmp_path]
    named = environment() | {"CC": "no-such-compiler"}
    done = subprocess.run(
        script, env=named, capture_output=True, text=True, timeout=100, check=False
    )
    assert done.returncode == 1
    (line,) = done.stderr.splitlines()
    assert "no compiler 'no-such-compiler'" in line
    assert "apt install gcc" in line
