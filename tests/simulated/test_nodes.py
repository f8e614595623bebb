"""Every node, as a real process, answers on its topics, takes parameters and ends cleanly."""

import re
import signal
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import GetState
from rcl_interfaces.srv import DescribeParameters, GetParameters

from teleop_core.bags.reader import Bag
from teleop_core.graph import topics
from teleop_core.graph.stage import STAGES
from teleop_core.kernels.geometry import Array
from teleop_core.nodes.start import main
from teleop_core.robots import load_robot

if TYPE_CHECKING:
    from peers import AnyPeer as Peer


HOME = load_robot("rcrt1").home
REST = [0.0, -0.06, -0.08, 1.0, 0.0, 0.0, 0.0]
MS = 1_000_000


def test_haptic_master_sends_one_sample_per_millisecond_on_all_its_topics(peer: "Peer") -> None:
    listeners = {topic: peer.listen(topic) for topic in STAGES.find("haptic_master").writes}
    peer.start("haptic_master")

    def common() -> set[Any]:
        """Stamps that came on all topics, each of which is found at another moment."""
        for listener in listeners.values():
            listener.take()
        return set.intersection(*(set(listener.stamps) for listener in listeners.values()))

    peer.wait(lambda: len(common()) > 150, "samples of all topics")
    for listener in listeners.values():
        assert (np.diff(listener.stamps) > 0).all()
    steps = np.diff(sorted(common()))
    assert (steps % MS == 0).all()


def test_motion_scaling_is_silent_until_it_knows_where_the_slave_is(peer: "Peer") -> None:
    answers = peer.listen(topics.SLAVE_SERVO_CP)
    forces = peer.listen(topics.MASTER_SERVO_CF)
    peer.start("motion_scaling")

    def received() -> Any:
        peer.send(topics.MASTER_MEASURED_CP, 1 * MS, REST)
        status = peer.status("motion_scaling")
        return status and status.number("received.master/measured_cp") > 0

    peer.wait(received, "samples at motion_scaling")
    assert answers.take() == 0

    where = [0.4, 0.0, -0.2, 1.0, 0.0, 0.0, 0.0]
    fresh, still = {topics.MASTER_MEASURED_CP: REST}, {topics.SLAVE_SETPOINT_CP: where}
    last = peer.feed(lambda: answers.take() and forces.take(), "slave/servo_cp", fresh, still, after=MS)
    assert answers.stamps[0] in range(2 * MS, last + 1, MS)
    assert answers.stamps[0] == forces.stamps[0]
    np.testing.assert_array_equal(answers.values[0], where)


def test_a_button_that_was_pressed_and_released_while_the_node_stood_still_was_pressed(peer: "Peer") -> None:
    peer.start("motion_scaling")
    answers, stamp = peer.listen(topics.SLAVE_SERVO_CP), 0

    def send(*pressed: object) -> None:
        nonlocal stamp
        stamp += MS
        for topic, values in (
            (topics.SLAVE_SETPOINT_CP, REST),
            (topics.MASTER_BUTTONS, pressed),
            (topics.MASTER_MEASURED_CP, REST),
        ):
            peer.send(topic, stamp, values)

    def sent_and_answered() -> int:
        send(0.0, 0.0, 0.0)
        return answers.take()

    def is_fine() -> Any:
        send(0.0, 0.0, 0.0)
        asked = GetParameters.Request(names=["mode"])
        answer = peer.call(GetParameters, "/motion_scaling/get_parameters", asked)
        return answer.values[0].string_value == "fine"

    peer.wait(sent_and_answered, "an answer")
    (node,) = peer.nodes
    node.process.send_signal(signal.SIGSTOP)
    for is_pressed in (0.0, 1.0, 0.0, 0.0):
        send(0.0, 0.0, is_pressed)
    node.process.send_signal(signal.SIGCONT)
    peer.wait(is_fine, "fine mode")


def test_inverse_kinematics_answers_under_the_stamp_of_the_pose(peer: "Peer") -> None:
    robot = load_robot("rcrt1")
    answers = peer.listen(topics.SLAVE_SERVO_JP)
    peer.start("inverse_kinematics")
    goal = robot.fk(HOME)
    goal[0, 3] -= 1e-5  # within one tick's reach
    pose = np.array([*goal[:3, 3], *_quaternion(goal)])
    fresh, still = {topics.SLAVE_SERVO_CP: pose}, {topics.SLAVE_SETPOINT_JS: HOME}
    last = peer.feed(answers.take, "slave/servo_jp", fresh, still)
    assert answers.stamps[0] in range(MS, last + 1, MS)
    np.testing.assert_allclose(answers.values[0], robot.ik(goal, HOME).q, atol=1e-12)


def test_inverse_kinematics_warns_with_the_joint_that_holds_the_slave_back(peer: "Peer") -> None:
    robot, reach = load_robot("rcrt1"), peer.listen(topics.SLAVE_REACH)
    peer.start("inverse_kinematics")
    goal = robot.fk(HOME)
    goal[:3, 3] += 0.01 * robot.jacobian(HOME)[:3, 2]  # 10 mm past the end of d3
    pose = np.array([*goal[:3, 3], *_quaternion(goal)])

    def warned() -> bool:
        status = peer.status("inverse_kinematics")
        return status and "d3 is at its limit" in status.message and status.level == 1

    peer.feed(warned, "warning", {topics.SLAVE_SETPOINT_JS: HOME, topics.SLAVE_SERVO_CP: pose})
    assert reach.take()
    said = dict(zip(topics.SLAVE_REACH.columns, reach.values[-1], strict=True))
    assert (said["limit"], said["joint"]) == (topics.Limit.JOINT, 2)
    cut = [said["cut_x"], said["cut_y"], said["cut_z"]]
    np.testing.assert_allclose(cut, robot.fk(HOME)[:3, 3] - goal[:3, 3], atol=1e-9)


def _quaternion(transform: Array) -> Array:
    from teleop_core.kernels.geometry import pose_from_transform

    pose = np.empty(7)
    pose_from_transform(np.ascontiguousarray(transform), pose)
    return pose[3:]


def test_a_slave_sends_no_setpoint_before_its_arm_has_said_where_it_is(peer: "Peer") -> None:
    setpoints = peer.listen(topics.SLAVE_SETPOINT_JS)
    peer.start("slave", has_arm=False)
    peer.wait(lambda: "waits for slave/measured_js" in peer.status("slave").message, "concern")
    peer.wait_value("slave", "ticks", lambda ticks: ticks > 500)
    assert setpoints.take() == 0
    peer.start("slave_sim")
    peer.wait(lambda: setpoints.take() > 100, "setpoints")
    np.testing.assert_allclose(setpoints.values[0], HOME, atol=1e-12)


def test_slave_follows_and_passes_the_stamp_of_the_command_on(peer: "Peer") -> None:
    setpoints = peer.listen(topics.SLAVE_SETPOINT_JS)
    measured = peer.listen(topics.SLAVE_MEASURED_JS)
    peer.start("slave")
    peer.wait(lambda: measured.take() > 100, "slave/measured_js")
    assert set(setpoints.stamps) <= {topics.NO_COMMAND_NS}
    wanted = HOME - 0.001 * np.eye(6)[0]

    def arrived() -> bool:
        return bool(setpoints.take()) and np.allclose(setpoints.values[-1], wanted, atol=1e-9)

    last = peer.feed(arrived, "slave at the reference", {topics.SLAVE_SERVO_JP: wanted})
    assert setpoints.stamps[-1] in range(MS, last + 1, MS)
    steps = np.diff(measured.stamps)
    assert (steps > 0).all()
    assert (steps % MS == 0).all()


def heard_by_recorder(peer: "Peer") -> int:
    """Send samples until one is recorded; returns the stamp of the last one.

    A best-effort writer may know its reader before the reader knows it: what it sends until then
    is lost, and from then on nothing is.
    """

    def is_heard() -> Any:
        status = peer.status("recorder")
        return status and status.number("received.master/measured_cp") > 0

    return peer.feed(is_heard, "samples at the recorder", {topics.MASTER_MEASURED_CP: REST})


def test_recorder_keeps_what_was_sent_until_the_signal_and_the_configuration(peer: "Peer", tmp_path: Path) -> None:
    recorder = peer.start("recorder", out=str(tmp_path / "bag"), scenario="mine")
    sent = heard_by_recorder(peer) + MS * np.arange(1, 501)
    for stamp in sent:
        peer.send(topics.MASTER_MEASURED_CP, int(stamp), REST)
    assert recorder.end() == 0
    bag = Bag(tmp_path / "bag")
    peer.insist_on_all("recorder")
    np.testing.assert_array_equal(bag.read(topics.MASTER_MEASURED_CP).stamp_ns[-500:], sent)
    assert bag.metadata["scenario"] == "mine"
    assert "haptic_master" in bag.metadata["configuration"]


@pytest.mark.slow
def test_every_node_ends_with_0(peer: "Peer", tmp_path: Path) -> None:
    for name in STAGES:
        parameters: dict[str, Any] = {"out": str(tmp_path / "bag")} if name == "recorder" else {}
        peer.start(name, wait="", **parameters)
    for node in peer.nodes:
        peer.wait_state(node.name, "active")
    peer.wait_value("recorder", "received.slave/measured_js", lambda n: n > 0)  # they have met
    for node in peer.nodes:
        node.process.send_signal(signal.SIGTERM)
    assert {n.name: n.wait(60) for n in peer.nodes} == dict.fromkeys(STAGES, 0)
    assert Bag(tmp_path / "bag").topics["slave/measured_js"].count > 0


def test_parameters_are_described_with_unit_and_bounds(peer: "Peer") -> None:
    peer.start("slave_sim", autostart=False, wait="unconfigured")
    names = ["viscous", "gravity_compensation", "robot", "controller.pid.kp", "integration_steps"]
    request = DescribeParameters.Request(names=names)
    found = peer.call(DescribeParameters, "/slave_sim/describe_parameters", request).descriptors
    viscous, gravity, robot, gains, steps = found
    assert viscous.description.endswith("[N·m·s/rad or N·s/m]")
    assert gravity.additional_constraints == "one of published, all, none"
    assert robot.read_only
    assert not gains.read_only
    assert steps.integer_range[0].to_value == 50
    answer = peer.call(GetParameters, "/slave_sim/get_parameters", GetParameters.Request(names=names))
    assert answer.values[3].type == 8  # doubles, although empty


def test_relations_between_parameters_hold_and_can_be_changed_at_once(peer: "Peer") -> None:
    peer.start("slave")
    change: dict[str, Any] = {"reference_filter__gain": 0.2, "reference_filter__zero": 50.0}
    alone = peer.set("slave", **change)
    assert [entry.successful for entry in alone] == [False, False]
    assert "gain" in alone[0].reason
    assert peer.set("slave", at_once=True, **change)[0].successful


def test_a_new_gain_is_used_from_the_next_sample_on(peer: "Peer") -> None:
    answers = peer.listen(topics.SLAVE_SERVO_CP)
    peer.start("motion_scaling", feedback_timeout=5.0)
    where, pose = [0.4, 0.0, -0.2, 1.0, 0.0, 0.0, 0.0], list(REST)

    fresh = {topics.SLAVE_SETPOINT_CP: where, topics.MASTER_MEASURED_CP: pose}
    stamp = peer.feed(lambda: answers.take() >= 3, "motion_scaling at work", fresh)

    def moved() -> float:
        """Slave travel of one millimetre of master travel along x."""
        nonlocal stamp
        answers.take()
        before, last = answers.values[-1], stamp
        pose[0] += 1e-3
        new = {topics.MASTER_MEASURED_CP: pose}
        stamp = peer.feed(lambda: answers.take() and answers.stamps[-1] > last, "answer", new, after=last)
        return float(np.linalg.norm(answers.values[-1][:3] - before[:3]))

    assert moved() == pytest.approx(1e-3, rel=1e-6)
    assert peer.set("motion_scaling", coarse_gain=0.25)[0].successful
    assert moved() == pytest.approx(0.25e-3, rel=1e-6)


@pytest.mark.parametrize("name", list(STAGES))
def test_a_supervisor_drives_the_lifecycle_twice(
    peer: "Peer", tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: Any
) -> None:
    monkeypatch.chdir(tmp_path)  # the recorder makes bags/ here
    node = peer.start(name, autostart=False, wait="unconfigured")
    watched = topics.SLAVE_MEASURED_JS if name == "slave_sim" else None
    listener = peer.listen(watched) if watched else None
    for _ in range(2):
        assert peer.change(name, Transition.TRANSITION_CONFIGURE)
        if listener:
            assert listener.take() == 0
        assert peer.change(name, Transition.TRANSITION_ACTIVATE)
        if listener:
            peer.wait(lambda: listener.take() > 10, "samples while active")
        state = peer.call(GetState, f"/{name}/get_state", GetState.Request())
        assert state.current_state.label == "active"
        assert peer.change(name, Transition.TRANSITION_DEACTIVATE)
        if listener:
            peer.wait_value(name, "ticks", lambda n: n > 0)
            listener.forget()
        assert peer.change(name, Transition.TRANSITION_CLEANUP)
        if name == "recorder":
            (bag,) = (tmp_path / "bags").iterdir()
            assert (bag / "metadata.yaml").exists()
            bag.rename(tmp_path / f"bag{len(list(tmp_path.iterdir()))}")
    assert node.end() == 0


def test_a_refused_configure_leaves_the_node_usable_by_the_supervisor(peer: "Peer", tmp_path: Path) -> None:
    (tmp_path / "taken").mkdir()
    node = peer.start("recorder", autostart=False, out=str(tmp_path / "taken"), wait="unconfigured")
    assert not peer.change("recorder", Transition.TRANSITION_CONFIGURE)
    (tmp_path / "taken").rmdir()
    assert peer.change("recorder", Transition.TRANSITION_CONFIGURE)
    assert node.end() == 0


@pytest.mark.parametrize("name", [*STAGES, "teleop_session"])
def test_help_of_an_executable_names_its_topics_and_starts_nothing(
    name: Any, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(sys, "argv", [name, "--help"])
    assert main() == 0
    text = capsys.readouterr().out
    assert text.startswith(f"usage: {name}")
    stage = STAGES.find(name) if name in STAGES else STAGES.find("slave")
    topics = {topic.name for topic in (*stage.reads, *stage.writes)}
    assert (name == "teleop_session") != (topics <= set(re.findall(r"[\w/]+", text)))


def test_help_of_a_stage_that_there_is_not_names_those_there_are(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(sys, "argv", ["stage", "nosuch", "--help"])
    assert main() == 2
    assert "slave_sim" in capsys.readouterr().err
