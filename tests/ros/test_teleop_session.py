"""The composed session: all nodes in one process, and others in the place of some."""

import signal
from collections.abc import Callable
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState
from std_srvs.srv import Trigger

from teleop_core.bags.reader import Bag
from teleop_core.graph import topics
from teleop_core.graph.graph import BUILT_IN, RECORDER_NAME
from teleop_core.graph.topics import STREAMS
from teleop_core.nodes.crews import Processes
from teleop_core.robots import load_robot
from teleop_core.session.configuration import configure
from teleop_core.session.virtual import VirtualTime

if TYPE_CHECKING:
    from ros.conftest import Listener, Peer

pytestmark = [pytest.mark.ros, pytest.mark.slow]
NODES = [*BUILT_IN, RECORDER_NAME]
HOME = load_robot("rcrt1").home.tolist()
MS = 1_000_000
TIMEOUT = 90.0
"""Of an end in order [s]."""


SETTINGS = {
    "operator": {"approach_time": 1.0, "patience": 0.0},
    "motion_scaling": {"reach_force": {"is_on": False}},
}


@pytest.fixture
def session(compose: Callable[..., object]) -> Any:
    """Process of the composed session, all its nodes active."""
    return compose(**SETTINGS)


@pytest.fixture(scope="module")
def recorded(composed_session: Any) -> Bag:
    """Recording of three seconds of a session."""
    with composed_session(**SETTINGS) as (peer, process, bag):
        peer.wait_value("slave", "ticks", lambda ticks: ticks > 3000)
        process.send_signal(signal.SIGINT)
        assert process.wait(TIMEOUT) == 0
        return Bag(bag)


def change(peer: "Peer", name: str, transition: Any) -> None:
    request = ChangeState.Request(transition=Transition(id=transition))
    assert peer.call(ChangeState, f"/{name}/change_state", request).success


def test_a_composed_session_loses_no_sample_between_its_stages(recorded: Bag) -> None:
    sample, pose, joints = (
        recorded.read(t).stamp_ns
        for t in (topics.MASTER_MEASURED_CP, topics.SLAVE_SERVO_CP, topics.SLAVE_SERVO_JP)
    )
    # From the first sample on that was taken when the slave had said where it is.
    assert np.array_equal(sample[sample >= pose[0]], pose)
    assert np.array_equal(pose[pose >= joints[0]], joints)
    assert len(sample) - len(joints) < 20
    assert (np.diff(sample) == MS).all()
    assert (np.diff(recorded.read(topics.SLAVE_MEASURED_JS).stamp_ns) == MS).all()


def test_a_composed_session_computes_what_virtual_time_computes(recorded: Bag) -> None:
    live_poses = recorded.read(topics.MASTER_MEASURED_CP).values
    settings = ["operator.approach_time=1.0", "haptic_master.patience=0.0",
                f"slave.start={HOME}", "motion_scaling.reach_force.is_on=false"]  # fmt: skip
    virtual = VirtualTime(configure(settings=settings)).run(len(live_poses))
    # No force acts without a box, so the hand moves alike; its sample is the same, bit for bit.
    assert np.array_equal(live_poses, virtual["master_measured_cp"])


def test_an_outside_master_takes_over_when_the_inside_one_is_off(
    peer: "Peer", session: object
) -> None:
    change(peer, "haptic_master", Transition.TRANSITION_DEACTIVATE)
    peer.wait_state("haptic_master", "inactive")
    commands = peer.listen(topics.SLAVE_SERVO_CP)
    rest = np.array([0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0])
    clock = peer.node.get_clock()
    publisher = peer.publisher(topics.MASTER_MEASURED_CP, readers=2)  # scaling and recorder

    step = [0]

    def moved() -> bool:
        step[0] += 1
        now = clock.now().nanoseconds
        pose = rest + np.array([0.0, 1e-5 * step[0], 0.0, 0, 0, 0, 0])
        peer.send(topics.MASTER_MEASURED_CP, now, pose)
        return commands.take() > 200 and np.ptp(np.array(commands.values)[:, 2]) > 1e-3

    assert publisher.get_subscription_count() >= 2
    peer.wait(moved, "slave commands that follow the outside master")


def test_the_inside_master_comes_back_without_a_jump(peer: "Peer", session: object) -> None:
    measured = peer.listen(topics.SLAVE_MEASURED_JS)
    # Few samples are no stream, of which an outage would pause the arm.
    peer.wait(
        lambda: measured.take() and np.ptp(np.array(measured.values)[:, :6], axis=0).max() > 1e-3,
        "motion",
    )
    change(peer, "haptic_master", Transition.TRANSITION_DEACTIVATE)
    peer.wait_state("haptic_master", "inactive")
    peer.wait(peer.slave_holds, "slave holds")
    change(peer, "haptic_master", Transition.TRANSITION_ACTIVATE)
    peer.wait_state("haptic_master", "active")
    # An outage of more than two seconds has paused the arm, which goes on on purpose only, and at
    # rest. What it is asked for while it brakes is refused.
    peer.wait(lambda: peer.call(Trigger, "/slave/resume", Trigger.Request()).success, "resumed")
    count = measured.take()
    peer.wait(lambda: measured.take() > count + 1000, "samples")
    # A millisecond of the fastest hand motion here is far below this step [rad, m].
    assert np.abs(np.diff(np.array(measured.values)[:, :6], axis=0)).max() < 0.01


def test_a_node_may_leave_a_composed_session_in_any_moment(peer: "Peer", session: Any) -> None:
    for _ in range(20):
        for transition in (
            Transition.TRANSITION_DEACTIVATE, Transition.TRANSITION_CLEANUP,
            Transition.TRANSITION_CONFIGURE, Transition.TRANSITION_ACTIVATE,
        ):  # fmt: skip
            change(peer, "haptic_master", transition)
    ticks = peer.status("slave").number("ticks")
    peer.wait_value("slave", "ticks", lambda now: now > ticks + 500)
    session.send_signal(signal.SIGINT)
    assert session.wait(TIMEOUT) == 0


def test_live_composed_records_all_topics_at_times_that_rise_from_stage_to_stage(
    peer: "Peer", session_until: Callable[..., tuple[Bag, str]]
) -> None:
    enough = {topic.name: 1500 for topic in STREAMS}
    configuration = configure("coarse_box", settings=["teleop.duration=600.0"])
    bag, text = session_until(
        configuration, lambda: peer.has_recorded(enough), processes=Processes.ONE
    )
    assert all(f"{name} is ready" in text for name in NODES)
    for topic in STREAMS:
        assert bag.topics[topic.name].count > 1500, topic.name
    chain = (topics.MASTER_MEASURED_CP, topics.SLAVE_SERVO_CP, topics.SLAVE_SERVO_JP,
             topics.SLAVE_SETPOINT_JS)  # fmt: skip
    series = [bag.read(topic) for topic in chain]
    for before, after in pairwise(series):
        _, i, j = np.intersect1d(before.stamp_ns, after.stamp_ns, return_indices=True)
        assert len(i) > 500
        assert (after.log_ns[j] >= before.log_ns[i]).all()


def rest_of(measured: "Listener") -> Any:
    """Joints of an arm that has not moved for 500 samples; nothing before."""
    measured.take()
    joints = np.array(measured.values)[-500:, :6]
    is_still = len(joints) == 500 and np.ptp(joints, axis=0).max() < 1e-4
    return joints[-1].tolist() if is_still else None


@pytest.mark.alone
def test_a_flood_of_commands_is_not_followed_faster_and_drops_no_step(
    peer: "Peer", session: object
) -> None:
    change(peer, "inverse_kinematics", Transition.TRANSITION_DEACTIVATE)
    peer.wait_state("inverse_kinematics", "inactive")
    measured = peer.listen(topics.SLAVE_MEASURED_JS)
    peer.wait(measured.take, "joints")
    home, clock = peer.wait(lambda: rest_of(measured), "the arm at rest"), 0
    status = peer.status("slave")
    known = [(status.number("received.slave/servo_jp"), status.number("dropped_time_ms"))]

    def flooded_without_loss() -> Any:
        """Send far more than the slave takes, until it has got a thousand and dropped no step.

        A machine that stood still for a moment costs a flood; one that the slave cannot bear
        costs every flood.
        """
        nonlocal clock
        for _ in range(500):
            clock = max(clock + 1, peer.node.get_clock().now().nanoseconds)
            peer.send(topics.SLAVE_SERVO_JP, clock, home)
        status = peer.status("slave")
        received, lost = (
            status.number("received.slave/servo_jp"),
            status.number("dropped_time_ms"),
        )
        if lost != known[-1][1]:
            known.append((received, lost))
        return received > known[-1][0] + 1000

    peer.wait(flooded_without_loss, "a thousand commands at the slave, and no step dropped")
    measured.take()
    assert np.ptp(np.array(measured.values)[-500:, :6], axis=0).max() < 1e-3
