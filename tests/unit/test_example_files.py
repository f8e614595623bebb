"""Files of the examples: each needs what is public alone, and some test runs it."""

import ast
import sys
from pathlib import Path

from example_runs import EXAMPLES, NAMES
from present import present

PUBLIC = {
    "teleop_lab", "teleop_lab.calibration", "teleop_lab.policies", "teleop_core_lerobot", "teleop_core.graph.operation",
    "teleop_console.app", "teleop_console.controls", "teleop_console.link",
    "teleop_console.recorded", "teleop_console.server",
    "teleop_core", "teleop_core.evaluation", "teleop_core.evaluation.metric", "teleop_core.hand.operators",
    "teleop_core.hand.tasks", "teleop_core.shapes",
    "teleop_core.slave.controllers", "teleop_core.robots", "teleop_core.graph.topics",
    "teleop_drill", "teleop_console", "teleop_exchange", "teleop_lab.experiments", "numpy",
    "numpy.typing", "pandas", "plotly.graph_objects", "gymnasium", "mlflow", "stable_baselines3",
}  # fmt: skip
ROS_EXAMPLES = {"crtk_client", "foreign_slave", "own_exercise", "ros_device", "simulated_controller"}
ROS = {
    "crtk_msgs.msg",
    "rclpy",
    "diagnostic_msgs.msg",
    "rclpy.node",
    "rclpy.qos",
    "rclpy.signals",
    "geometry_msgs.msg",
    "sensor_msgs.msg",
    "std_msgs.msg",
    "teleop_core.middleware.platform",
    "teleop_drill.simulation.drill",
    "teleop_drill.simulation.stand_ins",
    "teleop_drill.simulation.platform",
    "teleop_drill.nodes.drill",
}


def test_examples_need_the_public_api_alone() -> None:
    for name in NAMES:
        imported = set()
        for node in ast.walk(ast.parse((EXAMPLES / f"{name}.py").read_text(encoding="utf-8"))):
            if isinstance(node, ast.Import):
                imported |= {alias.name for alias in node.names}
            elif isinstance(node, ast.ImportFrom):
                imported.add(present(node.module))
        allowed = PUBLIC | (ROS if name in ROS_EXAMPLES else set())
        standard = {module for module in imported if module.split(".")[0] in sys.stdlib_module_names}
        assert imported - standard <= allowed, name


def test_every_example_is_run_here_or_live() -> None:
    tests = Path(__file__).parents[1]
    runs = [tests / folder / "test_examples.py" for folder in ("scenario", "ros")]
    own = "".join(file.read_text(encoding="utf-8") for file in runs)
    assert all(f'run("{name}", ' in own or f'{name}.py"' in own for name in NAMES)
