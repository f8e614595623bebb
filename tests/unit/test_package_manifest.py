"""package.xml: everything that a package imports is declared, by rosdep's names or as a note."""

import ast
import re
from collections.abc import Iterator
from configparser import ConfigParser
from pathlib import Path
from xml.etree import ElementTree

import pytest

from present import present

SOURCES = Path(__file__).resolve().parents[2] / "src"
PACKAGES = (
    "teleop_core",
    "teleop_machines",
    "teleop_console",
    "teleop_exchange",
    "teleop_scene",
    "teleop_lab",
    "teleop_drill",
)
ROS = re.compile(r"rclpy|rcl_interfaces|builtin_interfaces|ament_index_python|launch|launch_ros|std_srvs|.*_msgs")
NAMED_BY = {"pyyaml": "python3-yaml"} | {name: name for name in PACKAGES}


def manifest(package: str) -> tuple[set[str], str]:
    text = (SOURCES / package / "package.xml").read_text()
    root = ElementTree.fromstring(text)
    return {node.text or "" for node in root if node.tag.endswith("depend")}, text


def imported(package: str) -> Iterator[str]:
    """Top-level names of all modules that sources import."""
    for file in (SOURCES / package / package).rglob("*.py"):
        for node in ast.walk(ast.parse(file.read_text())):
            if isinstance(node, ast.Import):
                yield from (alias.name.partition(".")[0] for alias in node.names)
            elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
                yield node.module.partition(".")[0]


@pytest.mark.parametrize("package", PACKAGES)
def test_every_ros_package_that_is_imported_is_declared(package: str) -> None:
    declared, _ = manifest(package)
    used = {name for name in imported(package) if ROS.fullmatch(name)}
    assert used or package in {"teleop_exchange", "teleop_scene", "teleop_lab", "teleop_machines"}
    assert used - declared == set()


@pytest.mark.parametrize("package", PACKAGES)
def test_every_python_dependency_is_declared_or_noted_as_one_of_pip(package: str) -> None:
    declared, text = manifest(package)
    note = present(re.search(r"From pip.*?-->", text, re.DOTALL)).group()
    setup = (SOURCES / package / "setup.py").read_text()
    listed = present(re.search(r"install_requires=\[(.*?)\]", setup, re.DOTALL))
    names = re.findall(r'"([a-z0-9_-]+)', listed.group(1))
    assert "numpy" in names
    for name in names:
        key = NAMED_BY.get(name, f"python3-{name}")
        assert (key in declared) != (f" {name} " in note.replace("\n", " ")), name


def test_the_files_that_colcon_test_runs_are_there() -> None:
    package = Path(__file__).resolve().parents[2] / "src" / "teleop_core"
    given = ConfigParser()
    given.read(package / "setup.cfg", encoding="utf-8")
    files = given["tool:pytest"]["testpaths"].split()
    assert len(files) >= 10
    assert all((package / file).is_file() for file in files)
