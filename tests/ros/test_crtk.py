"""CRTK: a stock client moves our arms, and the conformance test finds what is wrong with others."""

import math
import signal
import subprocess
import sys
import threading
import time
from collections import deque
from collections.abc import Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from geometry_msgs.msg import PoseStamped
from rclpy.context import Context
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import JointState
from std_msgs.msg import Empty

from live_process import wait_until
from present import present
from stock_client import MIDDLE, StockClient, crtk
from teleop_core.nodes.children import free_domain
from teleop_drill.conformance import Finding, Verdict
from teleop_drill.nodes import conformance, conformance_arm

if TYPE_CHECKING:
    from ros.conftest import Peer

pytestmark = pytest.mark.ros

SPEED = 0.017
"""Of the foreign arm [rad/s]: as fast as a hundredth of a radian is commanded in a sine of two seconds. Where commands
come late it catches up no faster, or its motion would be over before its speeds could be told."""


@pytest.fixture
def client(peer: "Peer") -> StockClient:
    return StockClient.of_slave(peer)


@pytest.mark.soak
def test_a_move_without_names_arrives_busy_on_the_way_and_not_afterwards(peer: "Peer") -> None:
    client = StockClient.of_slave(peer)
    goal = [a + 0.05 for a in MIDDLE]
    goal[2] = 0.35
    client.was_busy = False
    client.send("move_jp", JointState(position=goal))
    client.wait(lambda: client.was_busy, "busy")
    client.reaches(("ENABLED", True, False))
    client.wait(lambda: np.allclose(client.joints(), goal, atol=1e-9), "the goal")
    client.wait(lambda: np.allclose(client.newest["goal_js"].position, goal), "goal_js")


@pytest.mark.soak
def test_a_single_servo_jp_without_names_is_gone_to_all_the_way(client: StockClient) -> None:
    goal = [a + 0.02 for a in MIDDLE]
    goal[2] = 0.36
    peer, received = client.peer, 0.0
    while not received:  # the first may be lost: the slave need not know its sender yet
        client.send("servo_jp", JointState(position=goal))
        sent: Any = peer.status("slave").number("ticks")
        peer.wait_value("slave", "ticks", lambda ticks: ticks > sent + 1500)
        received = peer.status("slave").number("received.slave/servo_jp")
    assert received == 1
    client.wait(lambda: np.allclose(client.joints(), goal, atol=1e-6), "the reference")


def test_speeds_end_with_the_messages_and_hold_ends_a_move(client: StockClient) -> None:
    before = client.joints()
    for _ in range(10):
        client.send("servo_jv", JointState(velocity=[0.05, 0.0, 0.0, 0.0, 0.0, 0.0]))
        client.spin()
    client.wait(lambda: client.joints()[0] > before[0], "motion")
    status = client.peer.status
    client.peer.wait(lambda: status("slave").values["motion"] == "nothing", "rest")
    # The slowest joint needs five seconds for this way: hold comes in time on a busy machine too.
    goal = [*MIDDLE[:2], 0.02, *MIDDLE[3:]]
    client.send("move_jp", JointState(position=goal))
    client.reaches(("ENABLED", True, True))
    client.send("hold", Empty())
    client.reaches(("ENABLED", True, False))
    assert client.joints()[2] > goal[2] + 0.001


class ForeignArm(Node):
    """A small CRTK arm of somebody else, with three joints, and what is wrong with it."""

    def __init__(self, context: Context, faults: tuple[object, ...]) -> None:
        super().__init__("foreign", context=context, use_global_arguments=False, enable_rosout=False)
        self.faults, self.state, self.q = set(faults), "ENABLED", [0.1, 0.2, 0.3]
        self.goal, self.speed, self.busy_until = list(self.q), 0.5, 0.0
        best = ReliabilityPolicy.BEST_EFFORT
        quality = QoSProfile(depth=10, **({"reliability": best} if "qos" in faults else {}))
        if "no state" not in faults:
            self.states = self.create_publisher(crtk.OperatingState, "PSM/operating_state", 10)
        self.measured = self.create_publisher(JointState, "PSM/measured_js", quality)
        self.setpoint = self.create_publisher(JointState, "PSM/setpoint_js", 10)
        self.past: Any
        self.past, self.home = deque(maxlen=50), list(self.q)
        self.last_ns = self.get_clock().now().nanoseconds
        kind = JointState if "type" in faults else PoseStamped
        self.pose = self.create_publisher(kind, "PSM/measured_cp", 10)
        self.create_subscription(crtk.StringStamped, "PSM/state_command", self.command, 10)
        self.create_subscription(JointState, "PSM/move_jp", self.move, 10)
        self.create_subscription(JointState, "PSM/servo_jp", self.servo, 10)
        self.create_timer(0.01, self.tick)

    def command(self, message: Any) -> None:
        word = {"pause": "PAUSED", "resume": "ENABLED"}.get(message.string)
        if "any word" in self.faults:
            word = word or "DISABLED"
        self.state = word or self.state

    def move(self, message: Any) -> None:
        if self.state == "ENABLED" or "moves paused" in self.faults:
            self.goal = list(message.position)
            self.busy_until = time.monotonic() + 0.15

    def servo(self, message: Any) -> None:
        if self.state == "ENABLED":
            self.goal = list(message.position)

    def lying(self, dt: float) -> Any:
        """Joints and speeds as this arm tells them, a time after it told the last ones [s]."""
        self.past.append(list(self.q))
        before = self.past[-2] if len(self.past) > 1 else self.q
        told, speed = list(self.q), [(a - b) / dt for a, b in zip(self.q, before, strict=True)]
        if "frozen" in self.faults:
            told = list(self.home)
        if "scaled" in self.faults:
            told = [h + 0.5 * (q - h) for h, q in zip(self.home, told, strict=True)]
        if "late" in self.faults:
            told = self.past[0]
        if "speeds" in self.faults:
            speed = [2.0 * v for v in speed]
        return told, speed

    def tick(self) -> None:
        time_now, is_busy = self.get_clock().now(), False
        now = time_now.to_msg()
        # Ten milliseconds, more on a busy machine: speeds are those of the time that passed.
        dt = max(1e-9 * (time_now.nanoseconds - self.last_ns), 1e-3)
        self.last_ns = time_now.nanoseconds
        for i in range(3):
            step = min(max(self.goal[i] - self.q[i], -SPEED * dt), SPEED * dt)
            self.q[i] += step
            is_busy = is_busy or abs(step) > 0.0
        is_busy = (is_busy or time.monotonic() < self.busy_until) and "never busy" not in self.faults
        if "no state" not in self.faults:
            state = crtk.OperatingState(state=self.state, is_homed=True, is_busy=is_busy)
            state.header.stamp = now
            self.states.publish(state)
        told, speed = self.lying(dt)
        joints = JointState(name=["a", "b", "c"], position=told)
        if self.faults & {"speeds", "honest"}:
            joints.velocity = speed
        setpoint = JointState(name=["a", "b", "c"], position=list(self.q))
        setpoint.header.stamp = now
        self.setpoint.publish(setpoint)
        if "stamp" not in self.faults:
            joints.header.stamp = now
        if "nan" in self.faults:
            joints.position[1] = math.nan
        if "length" in self.faults:
            joints.velocity = [0.0]
        self.measured.publish(joints)
        if "type" not in self.faults:
            pose = PoseStamped()
            pose.header.stamp, pose.pose.orientation.w = now, 0.5 if "unit" in self.faults else 1.0
            self.pose.publish(pose)


def findings_of(faults: tuple[str, ...], *, may_move: bool) -> dict[str, Finding]:
    """What is found of a foreign arm with these faults, by topic."""
    with foreign_arm(*faults) as arm:
        return {found.row.name: found for found in conformance.examine(arm, may_move=may_move)}


@contextmanager
def foreign_arm(*faults: object) -> Iterator[conformance_arm.Arm]:
    """Client of a foreign arm with these faults, which runs meanwhile."""
    domain, context = int(free_domain()), Context()
    context.init(args=[], domain_id=domain)
    node, executor = ForeignArm(context, faults), SingleThreadedExecutor(context=context)
    executor.add_node(node)

    def spin() -> None:
        with suppress(ExternalShutdownException):
            executor.spin()

    thread = threading.Thread(target=spin, daemon=True)
    thread.start()
    try:
        with conformance_arm.Arm("PSM", domain) as arm:
            assert arm.is_there(20.0)
            yield arm
    finally:
        executor.shutdown()
        thread.join(10)
        node.destroy_node()
        context.try_shutdown()


LOOKED = (("",), ("stamp", "no state"), ("nan", "unit"), ("length", "type"), ("qos",))
MOVED = (("honest",), ("moves paused", "frozen"), ("never busy", "speeds"), ("any word",), ("scaled",), ("late",))
"""Faults of each arm: of several none hides another."""


def examined(arms: tuple[tuple[str, ...], ...], *, may_move: bool) -> dict[str, Future[Any]]:
    """What is found of foreign arms, by fault: all at once, since each test mostly waits."""
    with ThreadPoolExecutor(len(arms)) as pool:
        found = {faults: pool.submit(findings_of, faults, may_move=may_move) for faults in arms}
    return {fault: told for faults, told in found.items() for fault in faults}


@pytest.fixture(scope="module")
def by_looking() -> Any:
    return examined(LOOKED, may_move=False)


@pytest.fixture(scope="module")
def by_moving() -> Any:
    return examined(MOVED, may_move=True)


@pytest.mark.slow
def test_a_foreign_arm_without_fault_passes_and_is_only_moved_by_what_it_takes(by_moving: Any) -> None:
    found = by_moving["honest"].result()
    verdicts = {name: one.verdict for name, one in found.items()}
    sound = ("operating_state", "state_command", "measured_js", "measured_cp", "setpoint_js", "move_jp", "servo_jp")
    assert {name: verdicts[name] for name in sound} == dict.fromkeys(sound, Verdict.OK), found
    others = {verdict for name, verdict in verdicts.items() if name not in sound}
    assert others == {Verdict.ABSENT}


@pytest.mark.parametrize(
    ("fault", "topic", "note"),
    [
        ("stamp", "measured_js", "stamp is 0"),
        ("nan", "measured_js", "not finite"),
        ("length", "measured_js", "different lengths"),
        ("unit", "measured_cp", "length 0.5"),
        ("type", "measured_cp", "must be geometry_msgs/msg/PoseStamped"),
        ("qos", "measured_js", "best effort"),
        ("no state", "operating_state", ""),
    ],
)
def test_faults_of_a_foreign_arm_are_found_by_looking(by_looking: Any, fault: str, topic: str, note: str) -> None:
    found = by_looking[fault].result()[topic]
    assert found.verdict is Verdict.FAILED
    assert note in found.note


@pytest.mark.slow
@pytest.mark.parametrize(
    ("fault", "topic", "note"),
    [
        ("moves paused", "state_command", "while PAUSED"),
        ("any word", "state_command", "no command changed the state"),
        ("never busy", "move_jp", "never rose"),
    ],
)
def test_faults_of_a_foreign_arm_are_found_by_trying(by_moving: Any, fault: str, topic: str, note: str) -> None:
    found = by_moving[fault].result()[topic]
    assert found.verdict is Verdict.FAILED
    assert note in found.note


@pytest.mark.slow
@pytest.mark.parametrize(
    ("fault", "topics", "note"),
    [
        ("frozen", ("measured_js", "servo_jp", "move_jp"), "measured_js by 0"),
        ("scaled", ("measured_js", "servo_jp", "move_jp"), "measured_js by 0.00"),
        ("late", ("measured_js", "servo_jp", "move_jp"), "setpoint"),
        ("speeds", ("measured_js",), "add up to another way"),
    ],
)
def test_an_arm_that_lies_about_where_it_is_is_found_by_moving_it(
    by_moving: Any, fault: str, topics: tuple[str, ...], note: str
) -> None:
    found = by_moving[fault].result()
    for topic in topics:
        assert found[topic].verdict is Verdict.FAILED, (topic, found[topic])
        assert note in found[topic].note, found[topic]


def test_a_test_that_is_interrupted_claims_no_recording() -> None:
    domain = free_domain()
    command = [sys.executable, "-m", "teleop_core.cli", "conformance", "slave", "--read-only",
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
        assert conformance.left_behind(arm, may_move=False) == "nothing was commanded"
        assert "the arm is ENABLED and may be off by 0.01 rad" in conformance.left_behind(arm, may_move=True)


def test_nothing_is_commanded_when_only_looking(by_looking: Any) -> None:
    found = by_looking[""].result()
    assert found["move_jp"].verdict is Verdict.SKIPPED
    assert found["state_command"].note == "read only"
