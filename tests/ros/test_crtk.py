"""CRTK: a stock client moves our arms, and the conformance test finds what is wrong with others."""

import math
import signal
import subprocess
import sys
import threading
import time
from collections import deque
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from geometry_msgs.msg import PoseStamped, TwistStamped, WrenchStamped
from rclpy.context import Context
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import JointState
from std_msgs.msg import Empty

from live_process import wait_until
from present import present
from teleop_core.kernels.geometry import Array, framed_wrenches
from teleop_core.nodes.children import free_domain
from teleop_drill.conformance import Verdict
from teleop_drill.nodes.conformance import examine, left_behind
from teleop_drill.nodes.conformance_arm import Arm

if TYPE_CHECKING:
    from ros.conftest import Peer

crtk = pytest.importorskip("crtk_msgs.msg")
pytestmark = pytest.mark.ros

MIDDLE = [0.1, 1.7, 0.36, 0.2, 0.5, 0.1]
SPEED = 0.017
"""Of the foreign arm [rad/s]: as fast as a hundredth of a radian is commanded in a sine of two
seconds. Where commands come late it catches up no faster, or its motion would be over before its
speeds could be told."""
# A busy machine is no fault of the arm's.
CALM: dict[str, Any] = {
    "operation__longest_outage": 0.0, "command_timeout": 5.0, "start": MIDDLE, "start_speed": 1.0,
}  # fmt: skip


class StockClient:
    """What crtk_python_client does: reliable, ten deep, stamped now, joints without names."""

    def __init__(self, peer: "Peer", arm: str = "slave") -> None:
        self.newest: dict[Any, Any]
        self.peer, self.arm, self.newest, self.was_busy = peer, arm, {}, False
        for name, kind in (
            ("operating_state", crtk.OperatingState), ("setpoint_cp", PoseStamped),
            ("setpoint_js", JointState), ("goal_js", JointState), ("measured_cv", TwistStamped),
        ):  # fmt: skip
            peer.node.create_subscription(kind, f"{arm}/{name}", self.taker(name), 10)
        self.commands: dict[Any, Any]
        self.commands = {}

    def taker(self, name: str) -> Callable[..., Any]:
        def take(message: Any) -> None:
            self.newest[name] = message
            if name == "operating_state":
                self.was_busy = self.was_busy or message.is_busy

        return take

    def spin(self) -> None:
        self.peer.executor.spin_once(timeout_sec=0.02)

    def wait(self, condition: Callable[[], object] | Callable[[], bool], what: str) -> Any:
        def turn() -> object:
            self.spin()
            return condition()

        return self.peer.wait(turn, what)

    def send(self, name: str, message: Any) -> None:
        if name not in self.commands:
            own = self.peer.node.create_publisher(type(message), f"{self.arm}/{name}", 10)
            self.commands[name] = own
            self.wait(lambda: own.get_subscription_count() > 0, f"a reader of {name}")
        if hasattr(message, "header"):
            message.header.stamp = self.peer.node.get_clock().now().to_msg()
        self.commands[name].publish(message)

    def state(self) -> tuple[Any, Any, Any] | None:
        found = self.newest.get("operating_state")
        return found and (found.state, found.is_homed, found.is_busy)

    def reaches(self, state: tuple[str, bool, bool]) -> Any:
        return self.wait(lambda: self.state() == state, f"{state}, not {self.state()}")

    def joints(self) -> Array:
        return np.array(self.newest["setpoint_js"].position)


@pytest.fixture
def client(peer: "Peer") -> StockClient:
    peer.start("slave", **CALM)
    client = StockClient(peer)
    client.reaches(("ENABLED", True, False))
    client.wait(lambda: len(client.newest) >= 3, "setpoints")
    return client


def test_a_move_without_names_arrives_busy_on_the_way_and_not_afterwards(
    client: StockClient,
) -> None:
    goal = [a + 0.05 for a in MIDDLE]
    goal[2] = 0.35
    client.was_busy = False
    client.send("move_jp", JointState(position=goal))
    client.wait(lambda: client.was_busy, "busy")
    client.reaches(("ENABLED", True, False))
    client.wait(lambda: np.allclose(client.joints(), goal, atol=1e-9), "the goal")
    client.wait(lambda: np.allclose(client.newest["goal_js"].position, goal), "goal_js")


def test_a_pose_is_moved_to_and_one_out_of_reach_is_refused_and_counted(
    client: StockClient,
) -> None:
    pose = client.newest["setpoint_cp"].pose
    goal = PoseStamped(pose=pose)
    goal.pose.position.z -= 0.01
    client.was_busy = False
    client.send("move_cp", goal)
    client.wait(lambda: client.was_busy, "busy")
    client.reaches(("ENABLED", True, False))
    z = goal.pose.position.z
    client.wait(lambda: abs(client.newest["setpoint_cp"].pose.position.z - z) < 1e-9, "the pose")
    goal.pose.position.z -= 5.0
    client.send("move_cp", goal)
    client.peer.wait_value("slave", "refused.slave/move_cp", lambda count: count == 1)


def test_states_are_commanded_and_told_and_a_paused_arm_refuses_to_move(
    client: StockClient,
) -> None:
    client.send("state_command", crtk.StringStamped(string="pause"))
    client.reaches(("PAUSED", True, False))
    client.send("move_jp", JointState(position=[a - 0.05 for a in MIDDLE]))
    client.peer.wait_value("slave", "refused.slave/move_jp", lambda count: count == 1)

    def resumed() -> Any:  # which an arm refuses that is not known to be at rest yet
        client.send("state_command", crtk.StringStamped(string="resume"))
        return client.state() == ("ENABLED", True, False)

    client.wait(resumed, "resumed")
    client.wait(lambda: np.array_equal(client.joints(), MIDDLE), "where it was")


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


def six(wrench: Any) -> Array:
    force, torque = wrench.force, wrench.torque
    return np.array([force.x, force.y, force.z, torque.x, torque.y, torque.z])


def test_a_measured_force_is_told_along_the_tip_and_about_the_base_under_its_stamp(
    client: StockClient,
) -> None:
    node, newest = client.peer.node, client.newest
    for name in ("body/measured_cf", "spatial/measured_cf"):
        node.create_subscription(WrenchStamped, f"slave/{name}", client.taker(name), 10)
    node.create_subscription(PoseStamped, "slave/measured_cp", client.taker("measured_cp"), 10)
    message = WrenchStamped()
    message.wrench.force.x, message.wrench.torque.z = 2.0, 0.1

    def tip() -> Array:
        p, q = newest["measured_cp"].pose.position, newest["measured_cp"].pose.orientation
        return np.array([p.x, p.y, p.z, q.w, q.x, q.y, q.z])

    def told() -> (
        bool | tuple[Any, Any] | None
    ):  # between the zeros of the simulated sensor; the pose is one of the arm at rest
        client.send("measured_cf", message)
        client.spin()
        if not {"body/measured_cf", "spatial/measured_cf", "measured_cp"} <= newest.keys():
            return None
        body, spatial = newest["body/measured_cf"], newest["spatial/measured_cf"]
        if spatial.wrench.force.x != 2.0 or body.header.stamp != spatial.header.stamp:
            return None
        expected = framed_wrenches(six(message.wrench), tip())
        said = six(body.wrench), six(spatial.wrench)
        return np.allclose(said, expected, rtol=0.0, atol=1e-6) and (body, spatial)

    body, spatial = client.wait(told, "the force in both frames")
    assert body.header.stamp.sec > 0
    assert (body.header.frame_id, spatial.header.frame_id) == ("slave_tip", "slave_base")


def test_a_disabled_master_pushes_with_no_force(peer: "Peer") -> None:
    peer.start("haptic_master", patience=3600.0)
    client = StockClient(peer, "master")
    client.reaches(("ENABLED", True, False))
    client.send("state_command", crtk.StringStamped(string="disable"))
    client.reaches(("DISABLED", True, False))


class ForeignArm(Node):
    """A small CRTK arm of somebody else, with three joints, and what is wrong with it."""

    def __init__(self, context: Context, faults: tuple[object, ...]) -> None:
        super().__init__("foreign", context=context, use_global_arguments=False,
                         enable_rosout=False)  # fmt: skip
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
        is_busy = (
            is_busy or time.monotonic() < self.busy_until
        ) and "never busy" not in self.faults
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


def findings_of(fault: Any, *, may_move: Any) -> dict[Any, Any]:
    """What is found of a foreign arm with this fault, by topic."""
    with foreign_arm(fault) as arm:
        return {found.row.name: found for found in examine(arm, may_move=may_move)}


@contextmanager
def foreign_arm(*faults: object) -> Iterator[Arm]:
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
        with Arm("PSM", domain) as arm:
            assert arm.is_there(20.0)
            yield arm
    finally:
        executor.shutdown()
        thread.join(10)
        node.destroy_node()
        context.try_shutdown()


LOOKED = ("", "stamp", "nan", "length", "unit", "type", "qos", "no state")
MOVED = ("honest", "moves paused", "any word", "never busy", "frozen", "scaled", "late", "speeds")


def examined(
    faults: tuple[str, str, str, str, str, str, str, str], *, may_move: bool
) -> dict[Any, Any]:
    """What is found of foreign arms, by fault: several at once, since each test mostly waits."""
    with ThreadPoolExecutor(4) as pool:
        return {fault: pool.submit(findings_of, fault, may_move=may_move) for fault in faults}


@pytest.fixture(scope="module")
def by_looking() -> Any:
    return examined(LOOKED, may_move=False)


@pytest.fixture(scope="module")
def by_moving() -> Any:
    return examined(MOVED, may_move=True)


@pytest.mark.slow
def test_a_foreign_arm_without_fault_passes_and_is_only_moved_by_what_it_takes(
    by_moving: Any,
) -> None:
    found = by_moving["honest"].result()
    verdicts = {name: one.verdict for name, one in found.items()}
    sound = ("operating_state", "state_command", "measured_js", "measured_cp", "setpoint_js",
             "move_jp", "servo_jp")  # fmt: skip
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
def test_faults_of_a_foreign_arm_are_found_by_looking(
    by_looking: Any, fault: str, topic: str, note: str
) -> None:
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
def test_faults_of_a_foreign_arm_are_found_by_trying(
    by_moving: Any, fault: str, topic: str, note: str
) -> None:
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
        assert left_behind(arm, may_move=False) == "nothing was commanded"
        assert "the arm is ENABLED and may be off by 0.01 rad" in left_behind(arm, may_move=True)


def test_nothing_is_commanded_when_only_looking(by_looking: Any) -> None:
    found = by_looking[""].result()
    assert found["move_jp"].verdict is Verdict.SKIPPED
    assert found["state_command"].note == "read only"
