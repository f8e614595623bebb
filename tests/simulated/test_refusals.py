"""Messages from outside that cannot be used: each is refused, counted and told, and the slave stays where it is."""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
import pytest
from sensor_msgs.msg import JointState, Joy

from peers import JOINTS
from simulated.conftest import SimulatedPeer
from teleop_core.bags.messages import Refusal, layout
from teleop_core.graph import topics
from teleop_core.graph.topics import Topic
from teleop_core.kernels.geometry import pose_from_transform
from teleop_core.middleware.platform import Qos
from teleop_core.nodes.streams import message_type
from teleop_core.robots import load_robot

HOME = load_robot("rcrt1").home - 0.05 * np.eye(6)[2]  # with room to all limits
POSE = np.empty(7)
pose_from_transform(np.ascontiguousarray(load_robot("rcrt1").fk(HOME)), POSE)
REST = np.array([0.0, -0.06, -0.08, 1.0, 0.0, 0.0, 0.0])
MS = 1_000_000
STILL = 3e-4  # [rad or m], a few encoder steps: what counts as not moving
GARBAGE = b"\0\1\0\0" + bytes(range(200, 256))
HAND, BUTTONS, GOAL, JOINT_GOAL = (
    topics.MASTER_MEASURED_CP, topics.MASTER_BUTTONS, topics.SLAVE_SERVO_CP, topics.SLAVE_SERVO_JP)  # fmt: skip
CHAINS: dict[str, tuple[Topic, Any, tuple[str, ...]]] = {
    # what leads the slave through a node, and the nodes behind it
    "motion_scaling": (HAND, REST, ("motion_scaling", "inverse_kinematics")),
    "inverse_kinematics": (GOAL, POSE, ("inverse_kinematics",)),
    "slave": (JOINT_GOAL, HOME, ()),
}


class Case(NamedTuple):
    """A message at a node: its topic, what is sent at a stamp, and the reason that is told."""

    node: str
    topic: Topic
    message: Callable[[int], Any]
    reason: Refusal | str


def row(values: Any, topic: Topic, late: int = 0) -> Callable[[int], Any]:
    """A message as our own nodes make it."""
    return lambda stamp: layout(topic, JOINTS).encode_one(stamp - late, np.asarray(values, np.float64))


def joints(names: Any, position: Any) -> Callable[[int], Any]:
    """A message of joints as anybody makes it."""

    def make(stamp: int) -> Any:
        message = JointState(name=list(names), position=[float(x) for x in position])
        message.header.stamp.sec, message.header.stamp.nanosec = divmod(stamp, 10**9)
        return message

    return make


FAR, LEVER = HOME - 0.9 * np.eye(6)[0], np.array([1.0, 1.0, 1.0, 0.9, 1.0, 1.0, 1.0])
CASES = [
    *(Case(node, topic, lambda _: GARBAGE, Refusal.MALFORMED) for node, topic in (
        ("motion_scaling", HAND), ("motion_scaling", BUTTONS), ("inverse_kinematics", GOAL), ("slave", JOINT_GOAL))),
    *(Case(node, topic, row(good + wrong, topic), Refusal.NOT_FINITE) for wrong in (np.nan, np.inf)
      for node, (topic, good, _) in CHAINS.items()),
    *(Case(node, topic, row(good * LEVER, topic), Refusal.NOT_UNIT) for node, topic, good in (
        ("motion_scaling", HAND, REST), ("inverse_kinematics", GOAL, POSE))),
    *(Case(node, topic, row(good, topic, late=60_000 * MS), Refusal.NOT_NEWER)
      for node, (topic, good, _) in CHAINS.items()),
    Case("motion_scaling", BUTTONS, lambda _: Joy(buttons=[1]), Refusal.FEW_BUTTONS),
    Case("slave", JOINT_GOAL, joints("abcdef", HOME), Refusal.WRONG_NAMES),
    Case("slave", JOINT_GOAL, joints(JOINTS, HOME[:4]), Refusal.WRONG_LENGTH),
    Case("slave", JOINT_GOAL, row(FAR, JOINT_GOAL), "jump"),
    *(Case(node, topic, row(good, topic), reason) for reason in (Refusal.SECOND_PUBLISHER, Refusal.FLOOD)
      for node, (topic, good, _) in CHAINS.items()),
]  # fmt: skip
CASES.sort(key=lambda case: case.node)  # so that each machine is made once


def is_still(places: list[np.ndarray]) -> bool:
    return bool(np.abs(np.array(places)[:, : len(HOME)] - HOME).max() < STILL)


@pytest.fixture(scope="module")
def chain(request: pytest.FixtureRequest) -> tuple[str, SimulatedPeer]:
    """A slave that holds its arm, and the nodes that lead it, on one machine."""
    peer = SimulatedPeer()
    for name in CHAINS[request.param][2]:
        peer.start(name, flood_rate=2000)
    peer.start("slave", start=HOME.tolist(), operation__longest_outage=0.0, flood_rate=2000)
    places = peer.listen(topics.SLAVE_MEASURED_JS)
    peer.wait(lambda: places.take() and is_still(places.values[-1:]), "the slave at its start")
    return request.param, peer


@pytest.mark.parametrize(
    ("chain", "case"), [(case.node, case) for case in CASES], indirect=["chain"],
    ids=[f"{case.topic.name} {getattr(case.reason, 'name', case.reason)}" for case in CASES],
)  # fmt: skip
def test_what_cannot_be_used_is_refused_counted_and_told_and_the_slave_stays(
    chain: tuple[str, SimulatedPeer], case: Case
) -> None:
    node, peer = chain
    lead, good, _ = CHAINS[node]
    places = peer.listen(topics.SLAVE_MEASURED_JS)
    received, key = f"received.{lead.name}", f"refused.{case.topic.name}.{getattr(case.reason, 'name', 'jump').lower()}"
    count = lambda name: peer.status(node).number(name) if peer.status(node) else 0.0  # noqa: E731

    def is_led(before: float) -> int:
        """Send what holds the slave where it is until the node takes it."""
        return peer.feed(lambda: count(received) > before + 50, "good messages", {lead: good}, after=peer.time_ns())

    stamp = is_led(count(received))
    taken, refused = count(received), count(key)
    places.forget()
    if case.reason is Refusal.SECOND_PUBLISHER:
        publisher = peer.ros.create_publisher(message_type(case.topic.ros_type), case.topic.name, Qos())
    else:
        publisher = peer.publisher(case.topic)

    def is_told() -> bool:
        nonlocal stamp
        stamp += MS
        if case.reason is Refusal.SECOND_PUBLISHER:
            peer.send(lead, stamp, good)
        for _ in range(20 if case.reason is Refusal.FLOOD else 1):
            publisher.publish(case.message(stamp))
        status = peer.status(node)
        told = getattr(case.reason, "value", "jumped")
        return status.number(key) > refused and status.level == 1 and told in status.message

    peer.wait(is_told, key)
    peer.ros.destroy(publisher) if case.reason is Refusal.SECOND_PUBLISHER else None
    is_led(taken)
    places.take()
    assert len(places.values) > 100
    assert is_still(places.values)


def test_every_reason_to_refuse_a_message_has_a_case() -> None:
    assert {case.reason for case in CASES} >= set(Refusal)
