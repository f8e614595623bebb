"""package.xml: everything that the package imports is declared, by rosdep's names or as a note."""

import ast
import re
from pathlib import Path
from xml.etree import ElementTree

PACKAGE = Path(__file__).resolve().parents[2] / "src" / "teleop_core"
ROS = re.compile(
    r"rclpy|rcl_interfaces|builtin_interfaces|ament_index_python|launch|launch_ros|std_srvs|.*_msgs"
)
NAMED_BY = {"pyyaml": "python3-yaml"}


def manifest():
    text = (PACKAGE / "package.xml").read_text()
    root = ElementTree.fromstring(text)
    return {node.text for node in root if node.tag.endswith("depend")}, text


def imported():
    """Top-level names of all modules that sources import."""
    for file in (PACKAGE / "teleop_core").rglob("*.py"):
        for node in ast.walk(ast.parse(file.read_text())):
            if isinstance(node, ast.Import):
                yield from (alias.name.partition(".")[0] for alias in node.names)
            elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
                yield node.module.partition(".")[0]


def test_every_ros_package_that_is_imported_is_declared():
    declared, _ = manifest()
    used = {name for name in imported() if ROS.fullmatch(name)}
    assert {"rclpy", "diagnostic_msgs", "launch"} <= used
    assert used - declared == set()


def test_every_python_dependency_is_declared_or_noted_as_one_of_pip():
    declared, text = manifest()
    note = re.search(r"From pip.*?-->", text, re.DOTALL).group()
    listed = re.search(r"install_requires=\[(.*?)\]", (PACKAGE / "setup.py").read_text(), re.DOTALL)
    names = re.findall(r'"([a-z0-9_]+)', listed.group(1))
    assert "numpy" in names
    for name in names:
        key = NAMED_BY.get(name, f"python3-{name}")
        assert (key in declared) != (f" {name} " in note.replace("\n", " ")), name
