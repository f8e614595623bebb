"""Every robot through the nodes: all in sessions, closed loops in separate processes."""

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from teleop_core.bags.messages import layout
from teleop_core.graph import topics
from teleop_core.kernels.geometry import Array, pose_from_transform, rotation, transform
from teleop_core.robots import list_robots, load_robot
from teleop_core.robots.robot import Robot
from teleop_core.session.configuration import configure
from teleop_core.session.virtual import VirtualTime

if TYPE_CHECKING:
    from peers import AnyPeer as Peer

SHORT = ("operator.approach_time=0.5", "operator.size=[0.02, 0.02, 0.02]")
KINDS = ("rcrt1", "puma560", "stewart", "scara_stewart", "three_finger_hand")
"""Robots of each kind; the others go by ``make soak``."""
SLAVES = [pytest.param(name, marks=() if name in KINDS else pytest.mark.soak) for name in list_robots()]
GRID = 55e-6  # m, reading step of the Phantom Omni
MS = 1_000_000


@pytest.fixture
def short_session(peer: Any, tmp_path: Path) -> Callable[..., Any]:
    """Recording of two seconds of a session, and joints (n,) that moved less than in virtual time.

    Half as far is enough: the hand waits until the slave follows.
    """

    def run(setting: Any) -> Any:
        configuration = configure("free_motion", settings=[*SHORT, setting])
        begin = None

        def has_led() -> bool:
            nonlocal begin
            operator, slave = peer.status("operator"), peer.status("slave")
            if begin is None and operator and slave and operator.number("has_begun"):
                begin = slave.number("ticks")
            return begin is not None and slave.number("ticks") > begin + 2000

        bag = peer.run(configuration, has_led, tmp_path / "bag")
        session = VirtualTime(configuration)
        measured = bag.read(topics.SLAVE_MEASURED_JS)
        wanted = session.run(2000)["slave_measured_js"]
        assert measured.names == session.joint_names[""]
        travel, wanted_travel = (np.ptp(rows[:, : len(measured.names)], axis=0) for rows in (measured.values, wanted))
        assert wanted_travel.max() > 1e-3
        return bag, travel < 0.5 * wanted_travel

    return run


def off_grid(bag: Any) -> Any:
    """Largest distance of a master reading from the Phantom's grid, in its steps."""
    steps = bag.read(topics.MASTER_MEASURED_CP).values[:, :3] / GRID
    return np.abs(steps - np.rint(steps)).max()


@pytest.mark.parametrize("name", SLAVES)
def test_every_slave_follows_the_hand_through_a_session_of_nodes(short_session: Callable[..., Any], name: str) -> None:
    bag, is_short = short_session(f"robot={name}")
    assert not is_short.any()
    assert off_grid(bag) < 1e-6


def test_the_mma_leads_a_session_of_nodes_with_its_own_encoders(short_session: Callable[..., Any]) -> None:
    bag, is_short = short_session("device.handle=mma")
    assert not is_short.any()
    assert off_grid(bag) > 0.1


def send_pose(peer: "Peer", stamp: int, T: Array) -> None:
    """Publish a pose of the slave's tip."""
    pose = np.empty(7)
    pose_from_transform(T, pose)
    peer.send(topics.SLAVE_SERVO_CP, stamp, pose)


def beside_home(robot: Robot) -> Array:
    """Pose some millimetres and degrees away from home: further than one tick reaches."""
    home = robot.fk(robot.home)
    turn = rotation("x", 0.02) @ rotation("y", -0.01) @ rotation("z", 0.03)
    return transform(home[:3, :3] @ turn, home[:3, 3] + [4e-3, -3e-3, 2e-3])


def test_the_hybrids_node_answers_a_pose_with_joints_that_lead_there(peer: "Peer") -> None:
    peer.start("inverse_kinematics", robot="scara_stewart")
    robot = load_robot("scara_stewart")
    goal, answers = beside_home(robot), peer.listen(topics.SLAVE_SERVO_JP)
    written = layout(topics.SLAVE_SETPOINT_JS, robot.joint_names)
    setpoints, stamp = peer.publisher(topics.SLAVE_SETPOINT_JS), 0

    def answered() -> bool:
        """Send on as a slave that is always where it was told to be; 30 ms lead to the goal."""
        nonlocal stamp
        stamp += MS
        where = (answers.stamps[-1], answers.values[-1]) if answers.take() else (0, robot.home)
        setpoints.publish(written.encode_one(*where))
        send_pose(peer, stamp, goal)
        return len(answers.stamps) >= 100

    peer.wait(answered, "slave/servo_jp")
    assert set(answers.stamps) <= set(range(MS, stamp + 1, MS))
    # The pose goes through a quaternion, joints are those of its solution: rounding only.
    assert np.abs(robot.fk(answers.values[-1]) - goal).max() < 1e-9


def test_a_stewart_slave_goes_where_a_pose_says_from_process_to_process(peer: "Peer") -> None:
    robot = load_robot("stewart")
    goal, stamp = beside_home(robot), 0
    setpoints, measured = (peer.listen(topic) for topic in (topics.SLAVE_SETPOINT_JS, topics.SLAVE_MEASURED_JS))
    for name in ("slave", "inverse_kinematics"):
        peer.start(name, wait="", robot="stewart")
    for name in ("slave", "inverse_kinematics"):
        peer.wait_state(name, "active")

    def arrived() -> Any:
        nonlocal stamp
        stamp += MS
        send_pose(peer, stamp, goal)
        q = setpoints.values[-1] if setpoints.take() else robot.home
        return np.abs(robot.fk(q) - goal).max() < 1e-9

    peer.wait(arrived, "slave at the goal")
    measured.forget()
    peer.wait(lambda: measured.take() > 200, "legs after that")
    legs = np.array(measured.values)[:, : robot.n]
    # Millimetres from home; friction and the drives' lag leave a few encoder steps of 1 µm.
    assert np.abs(legs[-1] - robot.ik(goal).q).max() < 1e-4
