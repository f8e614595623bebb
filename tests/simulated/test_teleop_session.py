"""The composed session: all nodes in one process, and others in the place of some."""

import ast
import os
import signal
import subprocess
import sys
from collections.abc import Callable
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from lifecycle_msgs.msg import Transition
from std_srvs.srv import Trigger

from present import present
from teleop_core.bags.reader import Bag
from teleop_core.graph import topics
from teleop_core.graph.layers import RealTimeParameters
from teleop_core.graph.topics import STREAMS
from teleop_core.middleware.real_time import apply_options, is_priority_granted
from teleop_core.robots import load_robot
from teleop_core.session.configuration import configure
from teleop_core.session.virtual import VirtualTime

if TYPE_CHECKING:
    from peers import AnyPeer as Peer

HOME = load_robot("rcrt1").home.tolist()
MS = 1_000_000


SETTINGS = {"operator": {"approach_time": 1.0, "patience": 0.0}, "motion_scaling": {"reach_force": {"is_on": False}}}


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
        assert process.wait() == 0
        return Bag(bag)


def test_a_composed_session_loses_no_sample_between_its_stages(recorded: Bag) -> None:
    sample, pose, joints = (
        recorded.read(t).stamp_ns for t in (topics.MASTER_MEASURED_CP, topics.SLAVE_SERVO_CP, topics.SLAVE_SERVO_JP)
    )
    # From the first sample on that was taken when the slave had said where it is.
    assert np.array_equal(sample[sample >= pose[0]], pose)
    assert np.array_equal(pose[pose >= joints[0]], joints)
    assert len(sample) - len(joints) < 20
    assert (np.diff(sample) == MS).all()
    assert (np.diff(recorded.read(topics.SLAVE_MEASURED_JS).stamp_ns) == MS).all()


def test_a_composed_session_computes_what_virtual_time_computes(recorded: Bag) -> None:
    live_poses = recorded.read(topics.MASTER_MEASURED_CP).values
    settings = [
        "operator.approach_time=1.0",
        "haptic_master.patience=0.0",
        f"slave.start={HOME}",
        "motion_scaling.reach_force.is_on=false",
    ]
    virtual = VirtualTime(configure(settings=settings)).run(len(live_poses))
    # No force acts without a box, so the hand moves alike; its sample is the same, bit for bit.
    assert np.array_equal(live_poses, virtual["master_measured_cp"])


def test_an_outside_master_takes_over_when_the_inside_one_is_off(peer: "Peer", session: object) -> None:
    assert peer.change("haptic_master", Transition.TRANSITION_DEACTIVATE)
    peer.wait_state("haptic_master", "inactive")
    commands = peer.listen(topics.SLAVE_SERVO_CP)
    rest = np.array([0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0])
    publisher = peer.publisher(topics.MASTER_MEASURED_CP, readers=2)  # scaling and recorder

    step = [0]

    def moved() -> bool:
        step[0] += 1
        pose = rest + np.array([0.0, 1e-5 * step[0], 0.0, 0, 0, 0, 0])
        peer.send(topics.MASTER_MEASURED_CP, peer.time_ns(), pose)
        return commands.take() > 200 and np.ptp(np.array(commands.values)[:, 2]) > 1e-3

    assert publisher.get_subscription_count() >= 2
    peer.wait(moved, "slave commands that follow the outside master")


def test_the_inside_master_comes_back_without_a_jump(peer: "Peer", session: object) -> None:
    measured = peer.listen(topics.SLAVE_MEASURED_CP)
    # Few samples are no stream, of which an outage would pause the arm.
    peer.wait(lambda: measured.take() and np.ptp(np.array(measured.values)[:, :3], axis=0).max() > 1e-3, "motion")
    assert peer.change("haptic_master", Transition.TRANSITION_DEACTIVATE)
    peer.wait_state("haptic_master", "inactive")
    peer.wait(peer.slave_holds, "slave holds")
    assert peer.change("haptic_master", Transition.TRANSITION_ACTIVATE)
    peer.wait_state("haptic_master", "active")
    # An outage of more than two seconds has paused the arm, which goes on on purpose only, and at
    # rest. What it is asked for while it brakes is refused.
    peer.wait(lambda: peer.call(Trigger, "/slave/resume", Trigger.Request()).success, "resumed")
    count = measured.take()
    peer.wait(lambda: measured.take() > count + 1000, "samples")
    # A millisecond of the fastest hand motion here is far below this step [m].
    assert np.abs(np.diff(np.array(measured.values)[:, :3], axis=0)).max() < 5e-4


def test_a_node_may_leave_a_composed_session_in_any_moment(peer: "Peer", session: Any) -> None:
    for _ in range(20):
        for transition in (
            Transition.TRANSITION_DEACTIVATE,
            Transition.TRANSITION_CLEANUP,
            Transition.TRANSITION_CONFIGURE,
            Transition.TRANSITION_ACTIVATE,
        ):
            assert peer.change("haptic_master", transition)
    ticks = peer.status("slave").number("ticks")
    peer.wait_value("slave", "ticks", lambda now: now > ticks + 500)
    session.send_signal(signal.SIGINT)
    assert session.wait() == 0


def test_a_composed_session_records_all_topics_at_times_that_rise_from_stage_to_stage(recorded: Bag) -> None:
    for topic in STREAMS:
        assert recorded.topics[topic.name].count > 1500, topic.name
    chain = (topics.MASTER_MEASURED_CP, topics.SLAVE_SERVO_CP, topics.SLAVE_SERVO_JP, topics.SLAVE_SETPOINT_JS)
    for before, after in pairwise(map(recorded.read, chain)):
        _, i, j = np.intersect1d(before.stamp_ns, after.stamp_ns, return_indices=True)
        assert len(i) > 500
        assert (after.log_ns[j] >= before.log_ns[i]).all()


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
