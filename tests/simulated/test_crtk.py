"""CRTK: a stock client moves our arms."""

from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from geometry_msgs.msg import PoseStamped, TwistStamped, WrenchStamped
from lifecycle_msgs.msg import Transition
from sensor_msgs.msg import JointState
from std_msgs.msg import Empty

from stock_client import MIDDLE, StockClient, crtk
from teleop_core.kernels.geometry import Array, framed_wrenches
from teleop_core.middleware.platform import Qos

if TYPE_CHECKING:
    from peers import AnyPeer as Peer

TURN = np.array([0.01, 0.0, 0.0, 0.0, 0.0, 0.0])


@pytest.fixture
def client(peer: "Peer") -> StockClient:
    return StockClient.of_slave(peer)


def test_a_pose_is_moved_to_and_one_out_of_reach_is_refused_and_counted(client: StockClient) -> None:
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


def test_a_composed_session_takes_streams_of_a_client_unless_its_own_stages_command(peer: "Peer", compose: Any) -> None:
    compose(operator={"approach_time": 1.0, "patience": 0.0}, slave={"operation": {"longest_outage": 0.0}})
    client = StockClient(peer)
    told = {"setpoint_cp", "setpoint_js"}
    client.wait(lambda: told <= {*client.newest} and client.newest["setpoint_cp"].header.stamp.sec > 0, "a hand")
    goal = JointState(position=(client.joints() + TURN).tolist())
    for name, message in (("servo_jp", goal), ("servo_cp", PoseStamped(pose=client.newest["setpoint_cp"].pose))):
        for _ in range(100):
            client.send(name, message)  # there is a reader
            client.spin()
        peer.wait_value("slave", f"refused.slave/{name}", lambda count: count >= 1)
    assert peer.change("haptic_master", Transition.TRANSITION_DEACTIVATE)

    def rests() -> bool:
        before = client.joints()
        for _ in range(100):
            client.spin()
        return np.array_equal(before, client.joints())

    client.wait(rests, "rest without a hand")
    goal = JointState(position=(client.joints() + TURN).tolist())

    def is_there() -> bool:
        client.send("servo_jp", goal)
        return np.allclose(client.joints(), goal.position, atol=1e-9)

    client.wait(is_there, "where the client leads")
    pose = client.newest["setpoint_cp"].pose
    pose.position.z += 0.002

    def is_higher() -> bool:
        client.send("servo_cp", PoseStamped(pose=pose))
        told = client.newest["setpoint_cp"].pose
        return told is not pose and abs(told.position.z - pose.position.z) < 1e-5

    client.wait(is_higher, "where the client leads the tip")


def test_states_are_commanded_and_told_and_a_paused_arm_refuses_to_move(client: StockClient) -> None:
    client.send("state_command", crtk.StringStamped(string="pause"))
    client.reaches(("PAUSED", True, False))
    client.send("move_jp", JointState(position=[a - 0.05 for a in MIDDLE]))
    client.peer.wait_value("slave", "refused.slave/move_jp", lambda count: count == 1)

    def resumed() -> Any:  # which an arm refuses that is not known to be at rest yet
        client.send("state_command", crtk.StringStamped(string="resume"))
        return client.state() == ("ENABLED", True, False)

    client.wait(resumed, "resumed")
    client.wait(lambda: np.array_equal(client.joints(), MIDDLE), "where it was")


def six(wrench: Any) -> Array:
    force, torque = wrench.force, wrench.torque
    return np.array([force.x, force.y, force.z, torque.x, torque.y, torque.z])


def test_a_measured_force_is_told_along_the_tip_and_about_the_base_under_its_stamp(client: StockClient) -> None:
    node, newest = client.peer.ros, client.newest
    for name in ("body/measured_cf", "spatial/measured_cf"):
        node.create_subscription(WrenchStamped, f"slave/{name}", client.taker(name), Qos())
    node.create_subscription(PoseStamped, "slave/measured_cp", client.taker("measured_cp"), Qos())
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

    def is_driven() -> bool:
        client.send("servo_jv", JointState(velocity=[0.05, 0.0, 0.0, 0.0, 0.0, 0.0]))
        return bool(client.joints()[0] > before[0])

    client.wait(is_driven, "motion")
    status = client.peer.status
    client.peer.wait(lambda: status("slave").values["motion"] == "nothing", "rest")
    goal = [*MIDDLE[:2], 0.02, *MIDDLE[3:]]
    client.send("move_jp", JointState(position=goal))
    client.reaches(("ENABLED", True, True))
    client.send("hold", Empty())
    client.reaches(("ENABLED", True, False))
    assert client.joints()[2] > goal[2] + 0.001


HUGE = (1e155, 1e307, float(np.finfo(float).max), float("inf"), float("nan"))


def messages_of(size: float) -> list[tuple[str, Any]]:
    """Every motion command with numbers of a size."""
    joints, pose, twist = [size, 0.0, -size, 0.0, size, 0.0], PoseStamped(), TwistStamped()
    pose.pose.position.x, pose.pose.position.z, pose.pose.orientation.w = size, -size, 1.0
    twist.twist.linear.x, twist.twist.angular.z = size, size
    named = ("move_jp", "move_jr", "interpolate_jp", "servo_jr", "servo_jp")
    speeds = [("servo_jv", JointState(velocity=joints)), ("servo_cv", twist)]
    poses = [("move_cp", pose), ("interpolate_cp", pose)]
    return [*((name, JointState(position=joints)) for name in named), *speeds, *poses]


def test_no_command_of_any_size_poisons_the_arm(client: StockClient) -> None:
    before = client.joints()
    for size in HUGE:
        for name, message in messages_of(size):
            client.send(name, message)
            client.spin()
            assert np.isfinite(client.joints()).all(), (name, size)
    client.peer.wait_value("slave", "refused.slave/servo_cv", lambda count: count >= 1)
    assert np.abs(client.joints() - before).max() < 1e-3
    client.reaches(("ENABLED", True, False))
    client.send("move_jp", JointState(position=[a + 0.01 for a in MIDDLE]))
    client.wait(lambda: np.allclose(client.joints(), np.array(MIDDLE) + 0.01, atol=1e-9), "the goal")


def test_an_old_enable_does_not_wake_the_arm_and_an_old_pause_stops_it(client: StockClient) -> None:
    def old(word: str) -> None:
        message = crtk.StringStamped(string=word)
        message.header.stamp.sec = client.peer.time_ns() // 10**9 - 60
        client.commands["state_command"].publish(message)

    client.send("state_command", crtk.StringStamped(string="resume"))  # finds the reader
    old("pause")
    client.reaches(("PAUSED", True, False))
    for _ in range(50):
        old("resume")
        client.spin()
    assert client.state() == ("PAUSED", True, False)
    assert any("s old, at most 5 s" in one.text for one in client.peer.machine.log)  # type: ignore[attr-defined]


def test_a_speed_that_is_a_minute_old_moves_nothing_and_is_counted(client: StockClient) -> None:
    before = client.joints()
    message = JointState(velocity=[0.05, 0.0, 0.0, 0.0, 0.0, 0.0])

    def refused() -> Any:
        publisher = client.commands["servo_jv"]
        message.header.stamp.sec, message.header.stamp.nanosec = divmod(client.peer.time_ns() - 60 * 10**9, 10**9)
        publisher.publish(message)
        status = client.peer.status("slave")
        return status and float(status.values.get("refused.slave/servo_jv", 0)) >= 20

    client.send("servo_jv", JointState(velocity=[0.0] * 6))
    client.wait(refused, "twenty refused")
    assert np.array_equal(client.joints(), before)
