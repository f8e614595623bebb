"""``teleop compile``: sessions of the scenarios find their kernels compiled."""

import subprocess
import sys
from pathlib import Path

import pytest

from teleop_core.commands.compiling import configured_job, phases_of
from teleop_core.kernels import IS_COMPILED
from teleop_core.session.virtual import VirtualTime
from teleop_core.shapes import SHAPES

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
    compile_ahead = [sys.executable, "-m", "teleop_core.commands.cli", "compile"]
    for command, told in (
        (compile_ahead, ""),
        (compile_ahead, "all kernels are there\n"),
        ([sys.executable, "-c", SESSION], "0\n"),
    ):
        done = subprocess.run(command, capture_output=True, text=True, timeout=600, check=False)
        assert done.returncode == 0, done.stderr
        assert told in ("", done.stdout)


def test_every_part_that_is_compiled_ahead_is_configured_and_has_the_file_that_it_needs(tmp_path: Path) -> None:
    jobs = [job for jobs in phases_of() for job in jobs]
    shapes = {text.partition("=")[2] for job in jobs for text in job.texts if text.startswith("fixture=")}
    kernels = {SHAPES.find(name).distance for name in SHAPES}
    assert {SHAPES.find(name).distance for name in shapes} == kernels
    assert len(shapes) == len(kernels)
    for job in jobs:
        configuration = configured_job(job, tmp_path)
        if "fixture=mesh" in job.texts:
            VirtualTime(configuration)
