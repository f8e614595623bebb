"""Several nodes together: safe with bad input, deaths and restarts, equal to virtual time."""

import signal
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from sensor_msgs.msg import JointState
from std_srvs.srv import Trigger

from teleop_core.coupling.mapping.inverse_kinematics import InverseKinematics, InverseKinematicsParameters
from teleop_core.graph import topics
from teleop_core.graph.topics import Topic
from teleop_core.kernels.geometry import Array
from teleop_core.robots import load_robot
from teleop_core.session.configuration import configure
from teleop_core.session.virtual import VirtualTime
from teleop_core.slave.operation import OperationParameters
from teleop_core.slave.pair import ArmParameters, SimulatedArm

if TYPE_CHECKING:
    from peers import AnyPeer as Peer
    from peers import Listener


ROBOT = load_robot("rcrt1")
HOME = ROBOT.home
MS = 1_000_000
LONGEST_TIMEOUT = 5.0  # [s], of a slave
STILL = 3e-4  # [rad or m], a few encoder steps: what counts as not moving
# A hand without tremor and noise that goes 20 mm away and stays there.
STEADY: dict[str, Any] = {
    "operator__kind": "hold",
    "operator__center": [0.0, 0.0, 0.02],
    "operator__approach_time": 2.0,
    "operator__rotation": 0.0,
    "operator__tremor_amplitude": 0.0,
    "device__gimbal_noise": 0.0,
}


def drive(peer: "Peer", topic: Topic, wanted: Any, listener: "Listener", start: int | None = None) -> int:
    """Send a value until the slave's setpoints carry its stamp; returns that stamp."""
    in_force = lambda: listener.take() and listener.stamps[-1] > (start or topics.NO_COMMAND_NS)  # noqa: E731
    return peer.feed(in_force, "command in force", {topic: wanted}, after=start)


def test_another_frame_and_another_order_of_joints_give_the_same_motion(peer: "Peer") -> None:
    setpoints = peer.listen(topics.SLAVE_SETPOINT_JS)
    peer.start("slave", reference_filter__is_on=False)
    publisher = peer.publisher(topics.SLAVE_SERVO_JP)
    wanted = HOME - 1e-4 * np.arange(1, 7)
    order = [3, 0, 5, 1, 4, 2]
    stamp = peer.time_ns()

    def followed() -> int | bool:
        nonlocal stamp
        stamp += MS
        message = JointState(
            name=["other", *(ROBOT.joint_names[i] for i in order)],
            position=[9.0, *(float(wanted[i]) for i in order)],
            velocity=[0.0] * 7,
        )
        message.header.frame_id = "somewhere_else"
        message.header.stamp.sec, message.header.stamp.nanosec = divmod(stamp, 10**9)
        publisher.publish(message)
        return setpoints.take() and np.array_equal(setpoints.values[-1], wanted)

    peer.wait(followed, "same setpoint")


def chain(peer: "Peer", master: dict[str, Any] = STEADY) -> None:
    # On a busy machine nothing is paused, held or aligned anew while the hand moves.
    calm: dict[str, Any] = {
        "slave": {"operation__longest_outage": 0.0, "command_timeout": LONGEST_TIMEOUT},
        "motion_scaling": {"feedback_timeout": LONGEST_TIMEOUT},
    }
    for name in ("slave", "inverse_kinematics", "motion_scaling"):
        peer.start(name, wait="", **calm.get(name, {}))
    for name in ("slave", "inverse_kinematics", "motion_scaling"):
        peer.wait_state(name, "active")
    peer.start("haptic_master", **master)


@pytest.mark.slow
def test_the_hand_rests_until_the_slave_follows(peer: "Peer") -> None:
    poses = peer.listen(topics.MASTER_MEASURED_CP)
    peer.start("haptic_master", patience=3600.0, **STEADY)
    peer.wait(lambda: poses.take() > 1000, "samples")
    assert np.ptp(poses.values, axis=0).max() == 0.0
    assert "waits" in peer.status("operator").message
    for name in ("slave", "inverse_kinematics", "motion_scaling"):
        peer.start(name, wait="")
    peer.wait(lambda: poses.take() and np.ptp(poses.values[-1000:], axis=0).max() > 1e-3, "motion")
    peer.wait_value("operator", "has_begun", lambda n: n == 1)


def rest(peer: "Peer", listener: "Listener") -> Array:
    """Joints of the slave once it has followed the hand to its rest."""

    def is_at_rest() -> bool:
        listener.take()
        q = np.array(listener.values[-1000:])[:, :6]
        travelled = np.abs(q[-1] - HOME).max() if len(q) else 0.0
        return travelled > 10.0 * STILL and len(q) == 1000 and np.ptp(q, axis=0).max() < STILL / 3

    peer.wait(is_at_rest, "slave at rest, away from home")
    return listener.values[-1][:6].copy()


def follows(peer: "Peer", setpoints: "Listener") -> None:
    """Wait until commands younger than now are in force.

    An outage of more than two seconds has paused the arm, which goes on on purpose only.
    """
    setpoints.forget()
    peer.wait(setpoints.take, "setpoints")
    old = setpoints.stamps[-1]

    def is_following() -> int | bool:
        if "PAUSED" in peer.status("slave").message:
            peer.call(Trigger, "/slave/resume", Trigger.Request())
        return setpoints.take() and setpoints.stamps[-1] > old + 500 * MS

    peer.wait(is_following, "following")


@pytest.mark.slow
@pytest.mark.parametrize(
    "name", ["motion_scaling", pytest.param("inverse_kinematics", marks=pytest.mark.soak), "haptic_master"]
)
def test_restarting_a_node_does_not_move_the_slave(peer: "Peer", name: str) -> None:
    measured, setpoints = (peer.listen(topics.SLAVE_MEASURED_JS), peer.listen(topics.SLAVE_SETPOINT_JS))
    chain(peer)
    before = rest(peer, measured)
    measured.forget()
    (old,) = [node for node in peer.nodes if node.name == name]
    assert old.end(signal.SIGTERM) == 0

    def holds() -> bool:
        measured.take()
        return peer.slave_holds()

    peer.wait(holds, "slave holds")
    # A new master starts in the inkwell, 20 mm away, and leaves it very slowly.
    slow: dict[str, Any] = STEADY | {"operator__approach_time": 60.0}
    peer.start(name, **(slow if name == "haptic_master" else {}))
    follows(peer, setpoints)
    assert measured.take() > 1000
    q = np.array(measured.values)[:, :6]
    held = q[np.abs(q - before).max(axis=1).argmax()]
    assert np.abs(held - before).max() < STILL
    assert np.abs(np.diff(q, axis=0)).max() < STILL


@pytest.mark.slow
def test_nodes_give_bit_equal_setpoints_to_the_core_for_the_same_commands(peer: "Peer") -> None:
    settings = [f"slave.start={HOME.tolist()}", "motion_scaling.reach_force.is_on=false"]
    session = VirtualTime(configure("free_motion", settings=settings))
    poses = session.run(2500)["slave_servo_cp"]
    listeners = [peer.listen(topic) for topic in (topics.SLAVE_SERVO_JP, topics.SLAVE_SETPOINT_JS)]
    references, setpoints = listeners
    # A machine that stands still is no outage here, and an arm that is heard of late blinds
    # nobody: the law is about numbers.
    patient: dict[str, Any] = {"operation__longest_outage": 0.0, "operation__longest_silence": 60.0}
    patient["operation__oldest_command"] = 0.0  # stamps from 0 on
    peer.start("slave", max_catch_up=10_000, command_timeout=LONGEST_TIMEOUT, **patient)
    # Stamps from 0 on: within the feedback timeout nothing depends on when feedback came.
    peer.start("inverse_kinematics", feedback_timeout=5.0)
    peer.publisher(topics.SLAVE_SERVO_CP)
    peer.wait(lambda: peer.ros.count_publishers(references.topic.name), "publisher of slave/servo_jp")
    peer.wait(lambda: setpoints.take() > 100, "slave/setpoint_js")

    def take_all() -> int:
        return [listener.take() for listener in listeners][-1]

    def wait_ticks(count: int) -> None:
        seen = take_all()
        peer.wait(lambda: take_all() > seen + count, "ticks")

    is_led = False
    for tick, pose in enumerate(poses, start=1):
        peer.send(topics.SLAVE_SERVO_CP, tick * MS, pose)
        wait_ticks(0 if is_led else 100)
        if not is_led and setpoints.stamps[-1] > topics.NO_COMMAND_NS:
            is_led = True
            wait_ticks(100)  # until the inverse kinematics has heard of it too
    wait_ticks(300)  # the end of the motion
    _end_slave(peer, setpoints)
    references.insist_on_all()
    assert len(references.stamps) > 1000
    assert np.ptp(references.values, axis=0).max() > 1e-2

    answers = _core_answers(poses, references.stamps)
    np.testing.assert_array_equal(answers, np.array(references.values))
    commands = dict(zip(references.stamps, references.values, strict=True))
    _assert_core_slave_leads_alike(commands, setpoints)


def _end_slave(peer: "Peer", setpoints: "Listener") -> None:
    """End the slave; every setpoint of a tick was seen since the first one that was."""
    (slave,) = [node for node in peer.nodes if node.name == "slave"]
    assert slave.end(signal.SIGINT) == 0
    peer.wait(lambda: peer.status("slave").values["state"] == "finalized", "last report")
    assert peer.status("slave").number("dropped_time_ms") == 0
    setpoints.insist_on_all()


def _core_answers(poses: Array, stamps: list[int]) -> Array:
    stage = InverseKinematics(InverseKinematicsParameters(feedback_timeout=5.0))
    stage.signals["slave_setpoint_js"] = HOME
    answers: list[Any] = []
    for stamp in stamps:
        if answers:  # the slave is known to follow the first
            stage.signals["slave_setpoint_js_ns"] = stamps[0]
        stage.signals["slave_servo_cp_ns"] = stamp
        stage.signals["slave_servo_cp"] = poses[stamp // MS - 1]
        stage.step()
        answers.append(stage.signals["slave_servo_jp"].copy())
    return np.array(answers)


def _assert_core_slave_leads_alike(commands: dict[int, Array], setpoints: "Listener") -> None:
    operation = OperationParameters(oldest_command=0.0)
    given = ArmParameters(start=tuple(HOME.tolist()), command_timeout=LONGEST_TIMEOUT, operation=operation)
    stage = SimulatedArm(given)
    row = stage.signals
    for i, in_force in enumerate(setpoints.stamps):
        if in_force not in {row["slave_servo_jp_ns"], topics.NO_COMMAND_NS}:
            row["slave_servo_jp_ns"], row["slave_servo_jp"] = in_force, commands[in_force]
        row["now_ns"] = 10**9 + i * MS
        stage.step()
        assert row["slave_setpoint_js_ns"] == in_force
        np.testing.assert_array_equal(setpoints.values[i], row["slave_setpoint_js"], str(i))
