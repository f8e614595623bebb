"""A UR5e from a URDF, led through an arm bridge by a whole session, and broken by the drill."""

import shlex
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from itertools import chain, repeat
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rclpy
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from std_msgs.msg import Float64MultiArray

import teleop_core as tc
from drill_runs import run_drill
from live_process import wait_until
from mutants import ROOT
from present import present
from teleop_console.console_session import ConsoleSession
from teleop_core.graph.topics import MASTER_MEASURED_CP, SLAVE_MEASURED_CP
from teleop_core.nodes.children import environment, free_domain
from teleop_core.session import api

pytestmark = [pytest.mark.ros, pytest.mark.slow]

CONTROLLER = [sys.executable, str(ROOT / "tests/support/plain_controller.py"), "forward_command", "ur5e"]
URDF = ROOT / "examples/ur5e.urdf"
START = (0.0, -1.57, 1.57, -1.57, -1.57, 0.0)
ARM = [f"robot={URDF}", "geometry=[tip=tool0]", f"start={list(START)}"]
BRIDGE = [sys.executable, "-m", "teleop_core.nodes", "arm_bridge", "--ros-args"]
_PULLED = 0.03  # m
STEP = 2.5  # 1.2 of a rated speed, over two periods at most, in steps of one at the rated speed


@pytest.fixture
def bridge(tmp_path: Path) -> list[Any]:
    """Command of the bridge that leads the arm."""
    file = tmp_path / "arm.yaml"
    file.write_text(
        f"/**:\n  ros__parameters:\n    robot: {URDF}\n    geometry: [tip=tool0]\n"
        "arm_bridge:\n  ros__parameters:\n    kind: forward_command\n    rate: 500\n",
        encoding="utf-8",
    )
    return [*BRIDGE, "--params-file", str(file)]


@contextmanager
def witness(domain: int) -> Iterator[Callable[[], object]]:
    """What the controller says of its commands: first one's distance, and the largest step."""
    context = Context()
    context.init(domain_id=domain)
    node = rclpy.create_node("looks_on", context=context, start_parameter_services=False)
    executor = SingleThreadedExecutor(context=context)
    executor.add_node(node)
    said = []

    def take_data(message: Any) -> None:
        said.append(list(message.data))

    node.create_subscription(Float64MultiArray, "witness", take_data, 10)

    def newest() -> list[Any]:
        while not said or np.isnan(said[-1][0]):
            executor.spin_once(0.1)
        for _ in range(100):
            executor.spin_once(0.0)
        return said[-1]

    try:
        yield newest
    finally:
        executor.shutdown()
        node.destroy_node()
        context.shutdown()


@contextmanager
def arm(*others: Any) -> Iterator[Any]:
    """A domain in which the others run, and what the controller among them witnesses at the end."""
    env = environment() | {"ROS_DOMAIN_ID": free_domain()}
    started = [subprocess.Popen(command, env=env) for command in others]
    try:
        with witness(int(env["ROS_DOMAIN_ID"])) as newest:
            yield env, newest
    finally:
        for other in started:
            other.terminate()
        codes = [other.wait(60) for other in started]
    assert set(codes) == {0}


def led(tmp_path: Path, bridge: Any, seed: int, *settings: Any, operator: Any = ()) -> Any:
    """A recorded session that leads the arm, and what the controller witnessed."""
    out = tmp_path / f"bag_{seed}"
    live = [
        sys.executable, "-m", "teleop_core.commands.cli", "live", "--without", "slave_sim",
        *(["--without", "operator"] if operator else []),
        "--out", str(out), "--duration", "8", "--set", *ARM, *settings,
    ]  # fmt: skip
    others = [[*CONTROLLER, str(seed)], bridge, *([operator] if operator else [])]
    with arm(*others) as (env, newest):
        done = subprocess.run(live, env=env, check=False, capture_output=True, text=True, timeout=300)
        first, largest = newest()
    assert done.returncode == 0, done.stdout + done.stderr
    return tc.open_recording(out), first, largest


def goes_home_and_follows(recording: tc.Recording, first: Any, largest: Any) -> None:
    assert first <= STEP
    assert largest <= STEP
    measured, setpoints = recording["slave/measured_js"], recording["slave/setpoint_js"]
    joints = measured.values[:, : len(START)]
    assert np.abs(joints[0] - START).max() > 0.05  # it stood elsewhere
    off = np.abs(joints - START).max(axis=1)
    home = int(np.flatnonzero(off < 0.01)[0])
    # After that it goes where its setpoints go.
    later = setpoints.log_ns > measured.log_ns[home]
    asked, went = np.ptp(setpoints.values[later], axis=0), np.ptp(joints[home:], axis=0)
    assert asked.max() > 0.02
    assert went.max() > 0.8 * asked.max()


@pytest.mark.soak
def test_a_session_leads_it_home_and_after_the_hand_without_a_jump(tmp_path: Path, bridge: list[Any]) -> None:
    goes_home_and_follows(*led(tmp_path, bridge, 1))


@pytest.mark.soak
def test_a_gamepad_leads_it_home_and_after_its_stick_without_a_jump(tmp_path: Path, bridge: list[Any]) -> None:
    pytest.importorskip("pygame")
    pad = [sys.executable, str(ROOT / "tests/support/padded_operator.py"), "operator"]
    operator = [*pad, "--ros-args", "-p", "kind:=gamepad"]
    recording, first, largest = led(tmp_path, bridge, 1, "operator=gamepad", operator=operator)
    goes_home_and_follows(recording, first, largest)
    hand = recording["hand/servo_cp"][["x", "y", "z"]]
    assert sorted(np.ptp(hand, axis=0))[1] > 0.02  # round and round in a plane


@pytest.mark.soak
def test_a_person_at_the_console_leads_it_without_a_jump(
    tmp_path: Path, bridge: list[Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    remote = ["operator=remote", "operator.patience=0.0", "teleop.duration=3600.0"]
    remote += ["operator.remote.timeout=1.5"]  # a busy console is no reason to let go
    configured = api.configuration(None, texts=[*remote, *ARM])
    with arm([*CONTROLLER, "1"], bridge) as (env, newest):
        monkeypatch.setenv("ROS_DOMAIN_ID", env["ROS_DOMAIN_ID"])
        with (
            ConsoleSession(configured, tmp_path / "bag", print, without=["slave_sim"]) as session,
            session.link() as link,
        ):
            seen = link.view().arms[""]
            wait_until(lambda: link.view() and "ENABLED, homed" in seen.operation_text, "homed")
            tip, stylus = (present(seen.get(SLAVE_MEASURED_CP))[:3], present(seen.get(MASTER_MEASURED_CP))[:7])
            ways = chain(np.linspace(0.0, _PULLED, 100), repeat(_PULLED))  # a grip moves nothing

            def is_pulled() -> Any:
                link.hold("", stylus + next(ways) * np.eye(7)[0])
                link.view()
                return np.linalg.norm(present(seen.get(SLAVE_MEASURED_CP))[:3] - tip) > 0.5 * _PULLED

            wait_until(is_pulled, "an arm that is pulled")
        first, largest = newest()
    goes_home_and_follows(tc.open_recording(tmp_path / "bag"), first, largest)


@pytest.mark.soak
def test_it_starts_twenty_times_without_a_jump(tmp_path: Path, bridge: list[Any]) -> None:
    for seed in range(2, 22):
        goes_home_and_follows(*led(tmp_path, bridge, seed))


@pytest.mark.soak
def test_the_drill_stops_it_as_a_simulated_arm(tmp_path: Path, bridge: list[Any]) -> None:
    code, text, outcomes = run_drill(
        tmp_path, "stop_topic", "--drives", shlex.join(bridge), "--arm", shlex.join(CONTROLLER), "--set", *ARM
    )
    one = outcomes["stop_topic"]
    assert (one["state"], one["told"]) == ("FAULT", "stop")
    assert one["measured"]["step_ratio"]["value"] <= 1.0 + 1e-9, text
    assert one["recovered_s"] is not None, text
    assert (code == 0) is one["is_passed"]
