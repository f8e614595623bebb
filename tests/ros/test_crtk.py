"""Conformance on the real middleware: a CRTK arm of somebody else, and a test that is interrupted."""

import signal
import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from foreign_arm import ForeignArm
from live_process import wait_until
from present import present
from teleop_core.middleware.ros import ROS
from teleop_core.nodes.children import free_domain
from teleop_drill.conformance import Finding, RowResult
from teleop_drill.nodes.conformance import examine, left_behind
from teleop_drill.nodes.conformance_arm import ArmClient

pytestmark = pytest.mark.ros


@contextmanager
def foreign_arm(*faults: str) -> Iterator[ArmClient]:
    """Client of a foreign arm with these faults, which runs meanwhile."""
    domain, has_ended = int(free_domain()), threading.Event()
    world = ROS.guest(domain)
    own = ForeignArm(world, faults)
    thread = threading.Thread(target=own.serve, args=(lambda: not has_ended.is_set(),), daemon=True)
    thread.start()
    try:
        with ArmClient("PSM", domain) as arm:
            assert arm.is_there(20.0)
            yield arm
    finally:
        has_ended.set()
        thread.join(10)
        own.executor.shutdown()
        world.shutdown()


def findings_of(*faults: str, may_move: bool) -> dict[str, Finding]:
    """What is found of a foreign arm with these faults, by topic."""
    with foreign_arm(*faults) as arm:
        return {found.row.name: found for found in examine(arm, may_move=may_move)}


@pytest.mark.soak
def test_a_foreign_arm_without_fault_passes() -> None:
    found = findings_of("honest", may_move=True)
    sound = (
        "operating_state",
        "state_command",
        "measured_js",
        "measured_cp",
        "setpoint_js",
        "setpoint_cp",
        "move_jp",
        "servo_jp",
    )
    assert {name: found[name].verdict for name in sound} == dict.fromkeys(sound, RowResult.OK), found


def test_types_and_qualities_of_a_foreign_arm_are_those_that_discovery_tells() -> None:
    found = findings_of("type", "qos", may_move=False)
    assert "must be geometry_msgs/msg/PoseStamped" in found["measured_cp"].note
    assert "best effort" in found["measured_js"].note


def test_a_test_that_is_interrupted_claims_no_recording() -> None:
    domain = free_domain()
    command = [sys.executable, "-m", "teleop_core.commands.cli", "conformance", "slave", "--read-only",
               "--wait", "60", "--domain", domain]  # fmt: skip
    with subprocess.Popen(command, stderr=subprocess.PIPE, text=True) as process:
        wait_until(lambda: process.poll() is not None or takes_part(int(domain)), "a participant")
        process.send_signal(signal.SIGINT)
        assert present(process.stderr).read() == "teleop conformance: interrupted\n"
    assert process.returncode == 130


def takes_part(domain: int) -> bool:
    """Whether a participant of a ROS domain listens: DDSI-RTPS 2.5, 9.6.1.1.

    Looked up, not tried: a port that is tried is taken at just the wrong moment now and then.
    """
    lines = Path("/proc/net/udp").read_text(encoding="ascii").splitlines()[1:]
    ports = {int(line.split()[1].rpartition(":")[2], 16) for line in lines}
    return 7410 + 250 * domain in ports


def test_what_an_interrupted_test_leaves_is_told() -> None:
    with foreign_arm() as arm:
        assert left_behind(arm, may_move=False) == "nothing was commanded"
        assert "the arm is ENABLED and may be off by 0.01 rad" in left_behind(arm, may_move=True)
