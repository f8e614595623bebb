"""Kernels of commands are there before the first tick: no stop waits for a compiler."""

import subprocess
import sys

import pytest

from teleop_core.kernels import IS_COMPILED

# In a process of its own: here other tests have compiled them already.
SCRIPT = """
import gc
import weakref
import numpy as np
from teleop_core.kernels import is_kernel
from teleop_core.slave.operation import Fault
from teleop_core.slave.operation.states import COMMANDS
from teleop_core.base.parameters import build
from teleop_core.slave.pair import ArmParameters, SimulatedArm


def ready():
    return {f"{k.py_func.__module__}.{k.py_func.__qualname__}"
            for k in gc.get_objects()
            if type(k) is not weakref.ProxyType and is_kernel(k) and k.codes}


def tick(slave, count):
    for _ in range(count):
        slave.signals["now_ns"] += 10**6
        slave.step()


slave = SimulatedArm(ArmParameters(starts_at_home=True))
slave.server.motion.load()
tick(slave, 10)
before = ready()
slave.server.press(is_pressed=False, heard_ns=0)
slave.server.press(is_pressed=True, heard_ns=0)
slave.server.fail(Fault.STALL, 1.0, 0.5)
for command in COMMANDS:
    slave.server.request(command)
    tick(slave, 10)
home = slave.robot.home
slave.server.motion.move(home - 0.01)
slave.server.motion.move_by(0.0 * home)
slave.server.motion.solve(slave.robot.fk(home))
slave.server.motion.drive_joints(0.0 * home, 0)
slave.server.motion.drive_tip(np.zeros(6), 0)
soft = {"starts_at_home": True, "controller.pid.bandwidth": (20.0,) * 6}
slave.retune(build(ArmParameters, soft))
tick(slave, 10)
assert any(name.endswith("_request") for name in before), before
print(*sorted(ready() - before))
"""


@pytest.mark.slow
@pytest.mark.skipif(not IS_COMPILED, reason="nothing is compiled in pure Python")
def test_commands_faults_and_new_gains_compile_nothing_once_a_slave_runs() -> None:
    done = subprocess.run([sys.executable, "-c", SCRIPT], capture_output=True, text=True, timeout=300, check=False)
    assert done.returncode == 0, done.stderr
    assert done.stdout.split() == []
