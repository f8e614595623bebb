"""``teleop compile``: sessions of the scenarios find their kernels compiled."""

import subprocess
import sys

import pytest

from teleop_core.kernels import IS_COMPILED

SESSION = """
from teleop_core.session import api
from teleop_core.kernels.progress import compiled_count
from teleop_core.graph.layers import list_scenarios

for scenario in list_scenarios():
    api.run(scenario, duration=0.5)
print(compiled_count())
"""


@pytest.mark.slow
@pytest.mark.skipif(not IS_COMPILED, reason="nothing is compiled in pure Python")
def test_what_was_compiled_ahead_no_scenario_compiles_again() -> None:
    compile_ahead = [sys.executable, "-m", "teleop_core.cli", "compile"]
    for command, told in (
        (compile_ahead, ""),
        (compile_ahead, "all kernels are there\n"),
        ([sys.executable, "-c", SESSION], "0\n"),
    ):
        done = subprocess.run(command, capture_output=True, text=True, timeout=600, check=False)
        assert done.returncode == 0, done.stderr
        assert told in ("", done.stdout)
