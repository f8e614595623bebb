"""Arm bridge without ROS: names, what is believed of an arm, when it is commanded and how far."""

import re
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import yaml

from present import present
from teleop_core.base import build
from teleop_core.graph.operation import State
from teleop_core.robots import load_robot
from teleop_core.robots.joint_map import JointMap
from teleop_core.session.configuration import configure
from teleop_core.slave.bridges import BRIDGES, Command, arm_bridge, leading
from teleop_core.slave.bridges.hearing import Hearing, Sample, Wrong
from teleop_core.slave.parameters import SlaveParameters

MS = 1_000_000
SPEED = np.array([1.0, 2.0])
ROOT = Path(__file__).resolve().parents[2]
ARMS, UR5E = sorted((ROOT / "config/arms").glob("*.yaml")), ROOT / "examples/ur5e.urdf"


def hearing(oldest: float = 0.1) -> Hearing:
    return Hearing(JointMap(("a", "b"), ["b=elbow"], [1.0, -1.0]), SPEED, 0.02, oldest)


def sample(
    stamp_ms: int,
    position: tuple[float, ...] = (0.1, 0.2),
    names: tuple[str, ...] = ("a", "elbow"),
    velocity: tuple[float, ...] = (),
) -> Sample:
    return Sample(names, position, velocity, (), stamp_ms * MS)


def lead() -> leading.Lead:
    return leading.Lead(-np.ones(2), np.ones(2), SPEED, 0.02, 0.002)


def test_a_command_in_the_arms_order_and_signs_is_measured_as_what_was_commanded() -> None:
    joints = JointMap(("a", "b"), ["a=x", "b=y"], [-1.0, 1.0], [0.5, 0.0], ["y", "x"])
    ours = np.array([0.3, -0.7])
    sent = dict(zip(joints.order, joints.command(ours), strict=True))
    theirs = np.array([sent[name] for name in joints.theirs])
    assert joints.position(theirs) == pytest.approx(ours)


def test_names_in_another_order_among_others_are_read_by_name() -> None:
    heard = hearing()
    assert heard.hear(sample(1, (9.0, 0.2, 0.1), ("finger", "elbow", "a")), 2 * MS)
    assert heard.position == pytest.approx([0.1, -0.2])


@pytest.mark.parametrize(
    ("wrong", "reason", "words"),
    [
        (sample(3, names=("a", "wrist")), Wrong.NAMES, "it lacks elbow"),
        (sample(3, (0.1, 0.2, 0.3), ("a", "elbow", "a")), Wrong.NAMES, "a twice"),
        (sample(3, (0.1,)), Wrong.FORM, "position for each name"),
        (sample(3, (0.1, np.nan)), Wrong.FORM, "finite"),
        (sample(2), Wrong.STAMP, "stamps must rise"),
        (sample(1), Wrong.STAMP, "stamps must rise"),
        (sample(0), Wrong.STAMP, "no stamp; stamps: sent"),
        (sample(200), Wrong.STAMP, "by at most 0.1"),
        (sample(3, (0.2, 0.2)), Wrong.JUMP, "a jumped by 0.1"),
    ],
)
def test_a_sample_that_cannot_be_is_refused_and_changes_nothing(wrong: Sample, reason: Wrong, words: str) -> None:
    heard = hearing()
    assert heard.hear(sample(2), 2 * MS)
    assert not heard.hear(wrong, 3 * MS)
    assert words in heard.wrong
    assert heard.refused == {reason: 1}
    assert heard.position == pytest.approx([0.1, -0.2])
    assert heard.stamp_ns == 2 * MS


def test_nothing_is_believed_after_a_jump_before_the_arm_begins_anew() -> None:
    heard = hearing()
    heard.hear(sample(1), MS)
    heard.hear(sample(2, (0.9, 0.2)), 2 * MS)
    assert not heard.hear(sample(3), 3 * MS)
    heard.begin_anew()
    assert heard.hear(sample(4, (0.9, 0.2)), 4 * MS)


def test_a_speed_that_the_arm_does_not_know_is_that_of_its_motion() -> None:
    heard = hearing()
    for i in range(200):
        assert heard.hear(sample(1 + i, (0.5e-3 * i, 0.0), velocity=(np.nan, 0.0)), (1 + i) * MS)
    assert heard.velocity == pytest.approx([0.5, 0.0], rel=0.01)


def test_nothing_is_commanded_before_the_arm_stands_at_its_setpoint() -> None:
    led, measured = lead(), np.array([0.1, 0.0])
    assert not led.step(np.array([0.2, 0.0]), measured, ("a", "b"), 0.002)
    assert "a is 0.1 from its setpoint" in led.waits
    assert led.step(np.array([0.11, 0.0]), measured, ("a", "b"), 0.002)
    assert np.abs(led.position - measured).max() <= 1.2 * 0.002 * SPEED[0] + 1e-12


def test_no_command_is_faster_than_its_joint_or_beyond_its_limits() -> None:
    led = lead()
    assert led.step(np.zeros(2), np.zeros(2), ("a", "b"), 0.002)
    for _ in range(2000):
        before = led.position.copy()
        assert led.step(np.array([5.0, -5.0]), before, ("a", "b"), 10.0)
        assert (np.abs(led.position - before) <= 1.2 * 2 * 0.002 * SPEED + 1e-12).all()
    assert led.position == pytest.approx([1.0, -1.0])


def test_brakes_bring_the_command_to_where_the_arm_was_and_leave_it_there() -> None:
    led = lead()
    led.step(np.zeros(2), np.zeros(2), ("a", "b"), 0.002)
    at = np.array([-0.01, 0.01])
    for _ in range(100):
        assert led.brake(at, 0.002)
        at = at + 0.001  # it sags
    assert led.position == pytest.approx([-0.01, 0.01])
    assert not led.is_leading


def bridge(**values: int) -> arm_bridge.ArmBridge:
    made = arm_bridge.ArmBridge(build(arm_bridge.ArmBridgeParameters, values))
    made.signals["slave_operation"][0] = 1.0
    return made


def home_sample(made: arm_bridge.ArmBridge, stamp_ns: int) -> Sample:
    return Sample(made.joints.theirs, made.signals["slave_setpoint_js"].tolist(), (), (), stamp_ns)


def test_a_bridge_that_stood_still_does_not_lead_on_an_arm_that_has_moved_meanwhile() -> None:
    made = bridge()
    for ms in (2, 4, 3000):  # after a standstill too, as long as it is where it was commanded
        assert made.hear(home_sample(made, ms * MS), ms * MS)
        assert made.command(ms * MS, 0.0, True) is not None
    home = home_sample(made, 6000 * MS)
    assert made.hear(replace(home, position=[q + 0.05 for q in home.position]), home.stamp_ns)
    assert made.command(home.stamp_ns, 0.0, True) is None
    assert "from its setpoint" in made.trouble()


def test_a_silent_arm_server_or_setpoint_ends_the_commands() -> None:
    made = bridge()
    now = 10**9
    assert made.command(now, 0.0, True) is None
    assert made.hear(home_sample(made, now), now)
    assert made.command(now + MS, 0.0, True) is not None
    assert made.command(now + 2 * MS, 0.0, False) is None
    assert made.command(now + 3 * MS, 0.2, True) is None
    assert made.command(now + 4 * MS, 0.0, True) is not None
    assert made.command(now + 400 * MS, 0.0, True) is None
    assert "no valid sample" in made.trouble()


def test_an_arm_that_jumped_is_commanded_nothing_while_it_is_enabled() -> None:
    made, now = bridge(), 10**9
    made.signals["slave_operation"][0] = State.ENABLED
    assert made.hear(home_sample(made, now), now)
    assert made.command(now + MS, 0.0, True) is not None
    there = home_sample(made, now + 2 * MS)
    far = [there.position[0] + 0.5, *there.position[1:]]
    assert not made.hear(Sample(there.names, far, (), (), there.stamp_ns), now + 2 * MS)
    assert made.command(now + 3 * MS, 0.0, True) is None
    made.signals["slave_operation"][0] = State.FAULT
    assert made.hear(home_sample(made, now + 4 * MS), now + 4 * MS)


def test_an_arm_that_the_server_left_behind_is_not_passed_on_while_it_is_enabled() -> None:
    made, now = bridge(), 10**9
    made.signals["slave_operation"][0] = State.ENABLED
    there = home_sample(made, now)

    def hear(time_ns: int) -> bool:
        return made.hear(Sample(there.names, there.position, (), (), time_ns), time_ns)

    made.signals["slave_setpoint_js"][0] += 0.1  # the server was heard too late
    assert hear(now)
    assert made.command(now + MS, 0.0, True) is None
    assert hear(now + 50 * MS)
    assert not hear(now + 150 * MS)
    made.signals["slave_setpoint_js"][0] -= 0.1  # it comes by, on its way elsewhere
    assert made.command(now + 151 * MS, 0.0, True) is None
    assert "to begin" in made.trouble()
    made.signals["slave_operation"][0] = State.FAULT
    assert hear(now + 152 * MS)
    assert made.command(now + 153 * MS, 0.0, True) is not None


@pytest.mark.parametrize("moved", [0.0, 0.1])
def test_an_arm_that_was_left_behind_at_its_last_command_goes_the_rest_slowly_and_is_led_again(moved: float) -> None:
    made, now = bridge(), 10**9
    made.signals["slave_operation"][0] = State.ENABLED
    setpoint, robot = made.signals["slave_setpoint_js"], load_robot(arm_bridge.ArmBridgeParameters().robot)
    speed = present(robot.drives).speed_limit
    setpoint[:] = at = robot.home.copy()

    def tick() -> bool:
        nonlocal now
        now += 2 * MS
        is_heard = made.hear(Sample(made.joints.theirs, at.tolist(), (), (), now), now)
        if (command := made.command(now, 0.0, True)) is not None:
            share = 1.2 if made.lead_arm.is_leading else 0.1
            assert (np.abs(command.position - at) <= share * 2e-3 * speed + 1e-12).all()
            at[:] = command.position
        return is_heard

    assert tick()
    now += 400 * MS  # nothing is heard of the arm, and the server goes on
    setpoint[0] += 0.05
    assert made.command(now, 0.0, True) is None
    at[1] += moved  # by somebody
    heard = [tick() for _ in range(900)]
    assert not all(heard)
    assert heard[-1] == made.lead_arm.is_leading == (not moved)


@pytest.mark.parametrize("rate", arm_bridge.RATES)
def test_commands_go_out_at_the_rate_that_was_asked_for(rate: int) -> None:
    made = bridge(rate=rate)
    assert sum(made.is_due(i * MS) for i in range(1000)) == rate


def blank(_: str = "") -> SimpleNamespace:
    def time() -> SimpleNamespace:
        return SimpleNamespace(sec=0, nanosec=0)

    return SimpleNamespace(header=SimpleNamespace(stamp=time()), time_from_start=time())


@pytest.mark.parametrize("name", list(BRIDGES))
def test_every_kind_writes_the_positions_in_the_order_of_its_names(name: str) -> None:
    part, message = BRIDGES.find(name), blank()
    command = Command(("x", "y"), np.array([1.0, 2.0]), np.array([3.0, 4.0]), 0.004, 7 * 10**9)
    part.write(message, command, part.parameters(), blank)
    if name == "forward_command":
        assert message.data == [1.0, 2.0]
    elif name == "joint_trajectory":
        (point,) = message.points
        assert (message.joint_names, point.positions) == (["x", "y"], [1.0, 2.0])
        assert point.time_from_start.nanosec == 8_000_000
        assert message.header.stamp.sec == 0
    else:
        assert (message.name, message.position) == (["x", "y"], [1.0, 2.0])
        assert message.header.stamp.sec == 7


@pytest.mark.parametrize("file", ARMS, ids=lambda path: path.stem)
def test_the_configuration_of_each_arm_has_parameters_that_exist(file: Path) -> None:
    groups = {k: v["ros__parameters"] for k, v in yaml.safe_load(file.read_text()).items()}
    common = groups["/**"]
    made = build(arm_bridge.ArmBridgeParameters, common | groups["arm_bridge"])
    led = build(SlaveParameters, common | groups["slave"])
    assert not made.order or len(made.order) == len(led.start)
    assert not led.operation.starts_enabled


@pytest.mark.parametrize("file", ARMS, ids=lambda path: path.stem)
def test_a_session_takes_the_file_of_each_arm_and_leaves_the_bridge_its_own(file: Path, tmp_path: Path) -> None:
    text = file.read_text()
    robot = yaml.safe_load(text)["/**"]["ros__parameters"]["robot"]
    (tmp_path / "arm.yaml").write_text(re.sub(rf"{re.escape(robot)}.*", str(UR5E), text))
    said = [] if file.stem == "ur5e" else ["geometry=[tip=tool0]", "slave.start=[]"]
    session = configure(files=[tmp_path / "arm.yaml"], settings=said)
    assert session.groups["slave"].robot == session.groups["slave_sim"].robot == str(UR5E)
    assert not session.groups["slave"].operation.starts_enabled
