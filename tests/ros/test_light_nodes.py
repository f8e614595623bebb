"""Light nodes: what a process of nodes does not load."""

import subprocess
import sys

import pytest

pytestmark = pytest.mark.ros

_LOADED = """
import sys
from teleop_core.graph.graph import BUILT_IN
from teleop_core.graph.stage import STAGES
from teleop_core.nodes.making import node_class
from teleop_core.nodes.streams import message_type
from teleop_core.middleware.ros_type_support import load_type_support

for name in set(BUILT_IN) - {"operator"}:  # who may be one that plays a recording
    node_class(STAGES.find(name))
    load_type_support([message_type(topic.ros_type) for topic in STAGES.find(name).ports])
print(*sys.modules)
"""


def modules_after(code: str) -> set[str]:
    return set(subprocess.run([sys.executable, "-c", code], capture_output=True, check=True, text=True).stdout.split())


def test_a_node_without_recordings_loads_no_reader_of_recordings_and_no_parser_of_messages() -> None:
    loaded = modules_after(_LOADED)
    assert "rosidl_generator_py" in loaded
    assert not loaded & {"teleop_core.bags.reader", "mcap", "lark", "em", "matplotlib"}


def test_who_generates_code_for_messages_still_can() -> None:
    code = "import teleop_core.nodes.base, sys; from rosidl_generator_py.generate_py_impl import "
    assert "lark" in modules_after(f"{code}generate_py\nprint(*sys.modules)")
