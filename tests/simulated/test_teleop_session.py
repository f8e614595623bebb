"""The composed session: all nodes in one process, and others in the place of some."""

import ast
import os
import subprocess
import sys
from typing import TYPE_CHECKING

import pytest

from present import present
from teleop_core.graph.layers import RealTimeParameters
from teleop_core.middleware.real_time import apply_options, is_priority_granted

if TYPE_CHECKING:
    pass

pytestmark = [pytest.mark.slow]


def test_real_time_options_are_taken_or_refused_in_one_line() -> None:
    allowed = os.sched_getaffinity(0)
    try:
        (refusal,) = apply_options(RealTimeParameters(cpus=(4096,), freeze_gc=False))
        assert "real_time.cpus" in refusal
        assert str(sorted(allowed)) in refusal
        assert apply_options(RealTimeParameters(cpus=tuple(allowed), freeze_gc=False)) == []
    finally:
        os.sched_setaffinity(0, allowed)


def test_with_a_priority_all_threads_come_before_other_processes_but_not_what_they_start() -> None:
    if not is_priority_granted(10):
        pytest.skip("the system grants no priority")
    script = """
import os, subprocess, sys, threading
from teleop_core.middleware.real_time import apply_options, is_priority_granted
from teleop_core.graph.layers import RealTimeParameters
threading.Thread(target=sys.stdin.read).start()
assert apply_options(RealTimeParameters(priority=10, freeze_gc=False)) == []
threads = sorted(map(int, os.listdir("/proc/self/task")))
print([os.sched_getparam(thread).sched_priority for thread in threads])
started = "import os; print(os.sched_getparam(0).sched_priority)"
subprocess.run([sys.executable, "-c", started], check=True)
"""
    process = subprocess.Popen(
        [sys.executable, "-uc", script], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    )
    with process:
        said = [present(process.stdout).readline().strip() for _ in range(2)]
        present(process.stdin).close()
    main, *others = ast.literal_eval(said[0])
    assert main == 10
    assert set(others) == {1}
    assert said[1] == "0"
