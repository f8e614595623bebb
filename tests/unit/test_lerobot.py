"""LeRobot: loops of another program lead the slave, within all its limits, and ask the hand."""

import ast
from pathlib import Path

import numpy as np
import pytest

import teleop_core as tc
from present import present
from teleop_core.kernels.geometry import Array
from teleop_core_lerobot import MasterSide, SlaveSide

PACKAGE = Path(__file__).resolve().parents[2] / "src/lerobot_robot_teleop_core"
sides = pytest.importorskip("teleop_core_lerobot", reason="lerobot_robot_teleop_core is missing")
AT_HOME = ("slave.starts_at_home=true",)
INWARD = np.array([1.0, 1.0, -1.0, 1.0, 1.0, 1.0])  # the third joint is at its upper limit at home
# What a subclass must have, as LeRobot's documents ask: Bring your own hardware, 0.6.1.
BOTH = {
    "config_class", "name", "action_features", "is_connected", "is_calibrated", "connect",
    "calibrate", "configure", "disconnect",
}  # fmt: skip
ROBOT = BOTH | {"observation_features", "get_observation", "send_action"}
TELEOPERATOR = BOTH | {"feedback_features", "get_action", "send_feedback", "enable_torque", "disable_torque"}
CAMERA = {"is_connected", "find_cameras", "connect", "read", "async_read", "read_latest", "disconnect"}


@pytest.fixture
def slave() -> SlaveSide:
    made = sides.SlaveSide(scenario="free_motion", settings=AT_HOME)
    made.begin()
    return made


def joints_of(side: MasterSide | SlaveSide, named: dict[str, float]) -> Array:
    return np.array([named[key] for key in side.joint_keys])


def inside(slave: SlaveSide) -> Array:
    """Joints (n,) where it is, a little inside all limits."""
    return joints_of(slave, slave.observe()) + 1e-4 * INWARD


def sent(slave: SlaveSide, joints: Array) -> Array:
    """What comes back for joints (n,)."""
    return joints_of(slave, slave.send(dict(zip(slave.joint_keys, joints, strict=True))))


def test_actions_are_the_references_of_the_same_session_without_a_loop() -> None:
    master = sides.MasterSide(scenario="free_motion", fps=30)
    master.begin()
    actions = [joints_of(master, master.next_action()) for _ in range(60)]
    session = tc.VirtualTime(tc.configuration("free_motion"))
    lead = session.lead
    rows = session.run(lead + 2000)["slave_servo_jp"]
    ticks = [lead + 1000 * k // 30 - 1 for k in range(1, 61)]
    assert np.array_equal(actions, rows[ticks])
    assert np.ptp(actions, axis=0).max() > 1e-3


@pytest.mark.parametrize("fps", [1, 7, 30, 60, 1000])
def test_as_many_calls_as_a_second_has_are_one_second(fps: int) -> None:
    slave = sides.SlaveSide(scenario="free_motion", settings=AT_HOME, fps=fps)
    slave.begin()
    begin, home = slave._session.now_ns, slave.observe()
    for _ in range(fps):
        slave.send({key: home[key] for key in slave.joint_keys})
    assert slave._session.now_ns - begin == 1_000_000_000


def test_reference_within_all_limits_comes_back_and_the_slave_gets_there(slave: SlaveSide) -> None:
    begin = inside(slave)
    goal = begin + 0.01 * INWARD
    for share in np.linspace(0.0, 1.0, 31):
        assert np.array_equal(sent(slave, begin + share * (goal - begin)), begin + share * (goal - begin))
    for _ in range(30):
        sent(slave, goal)
    assert joints_of(slave, slave.observe()) == pytest.approx(goal, abs=1e-3)


def test_references_that_come_by_the_loop_are_joined_without_steps(slave: SlaveSide) -> None:
    begin = joints_of(slave, slave.observe())
    slave._bag = "kept"  # keeps the rows
    for k in range(60):
        sent(slave, begin + 0.003 * min(k, 40) * INWARD)
    setpoint = np.concatenate([block["slave_setpoint_js"] for block in slave._blocks])[:, 0]
    step = np.abs(np.diff(setpoint)).max()
    assert 0.0 < step < 3 * 0.003 / 33  # a stair has its whole rise in a few ticks


def test_reference_beyond_a_joint_limit_comes_back_at_the_limit(slave: SlaveSide) -> None:
    robot = tc.load_robot("rcrt1")
    joints = joints_of(slave, slave.observe())
    reach = 0.03 * present(robot.drives).speed_limit
    for _ in range(600):
        wanted = joints + reach * (np.arange(robot.n) == 0)
        back = sent(slave, wanted)
        assert (back <= robot.upper).all()
        if back[0] < wanted[0]:
            break
        joints = back
    assert back[0] == robot.upper[0] < wanted[0]


def test_reference_that_is_a_jump_comes_back_as_the_one_before(slave: SlaveSide) -> None:
    before = sent(slave, joints_of(slave, slave.observe()))
    assert np.array_equal(sent(slave, before + 3.0 * INWARD), before)
    assert joints_of(slave, slave.observe()) == pytest.approx(before, abs=1e-3)


def test_stopped_slave_holds_and_says_where_whatever_is_sent() -> None:
    slave = sides.SlaveSide(scenario="free_motion", settings=(*AT_HOME, "slave.operation.events=[stop@0.5]"))
    slave.begin()
    begin, back = joints_of(slave, slave.observe()), []
    for k in range(60):
        back.append(sent(slave, begin + 0.001 * k * INWARD))
    assert np.ptp(back[:10], axis=0).min() > 5e-3
    assert np.ptp(back[20:], axis=0).max() == 0.0
    assert (np.abs(back[-1] - begin) < 0.03).all()


def test_bag_has_what_was_observed_and_sent(tmp_path: Path) -> None:
    slave = sides.SlaveSide(scenario="free_motion", settings=AT_HOME, fps=50, bag=str(tmp_path / "bag"))
    slave.begin()
    lead = slave._session.now_ns // 1_000_000
    begin, seen, given = inside(slave), [], []
    for k in range(25):
        seen.append(joints_of(slave, slave.observe()))
        given.append(sent(slave, begin + 0.001 * k * INWARD))
    slave.end()
    bag = tc.open_recording(tmp_path / "bag")
    measured = bag["slave/measured_js"]
    ticks = lead + 20 * np.arange(25) - 1
    assert np.array_equal(measured.values[ticks][:, : len(begin)], seen)
    assert np.array_equal(bag["given/servo_jp"].values[ticks[1:]], given[:-1])


def test_hand_feels_its_own_session_until_a_force_is_given() -> None:
    master = sides.MasterSide(scenario="palpation", fps=10)
    master.begin()
    felt = []
    for _ in range(30):
        master.next_action()
        felt.append(master._row["master_servo_cf"].copy())
    session = tc.VirtualTime(tc.configuration("palpation"))
    lead = session.lead
    rows = session.run(lead + 3000)["master_servo_cf"]
    assert np.abs(felt).max() > 0.05
    assert np.array_equal(felt, rows[lead + 99 :: 100])


def test_hand_feels_the_force_that_is_given_as_it_feels_one_that_is_measured() -> None:
    felt = {}
    for force in (0.0, 1.0, 2.0):
        master = sides.MasterSide(scenario="palpation")
        master.begin()
        for _ in range(3):
            master.feel({"force.x": 0.0, "force.y": 0.0, "force.z": force, "theta1.pos": 9.0})
            master.next_action()
        felt[force] = master._row["master_servo_cf"][:3].copy()
    assert np.array_equal(felt[0.0], np.zeros(3))
    assert np.linalg.norm(felt[1.0]) > 0.05
    assert felt[2.0] == pytest.approx(2.0 * felt[1.0], rel=1e-6)


def test_hand_takes_over_where_a_program_has_led_the_slave_without_a_jump() -> None:
    robot = tc.load_robot("rcrt1")
    master = sides.MasterSide(scenario="free_motion")
    master.begin()
    for _ in range(15):
        master.next_action()
    master.hold()
    held = np.array([joints_of(master, master.next_action()) for _ in range(20)])
    assert np.ptp(held[1:], axis=0).max() == 0.0  # the hand still moves, and moves nothing
    there = held[-1] + 0.05 * INWARD  # as LeRobot's smooth_move_to: no action is asked for on the way
    for share in np.linspace(0.0, 1.0, 61):
        joints = held[-1] + share * (there - held[-1])
        master.feel(dict(zip(master.joint_keys, joints, strict=True)))
    master.release()
    led = np.array([joints_of(master, master.next_action()) for _ in range(60)])
    tips = np.array([robot.fk(joints)[:3, 3] for joints in (there, *led)])
    steps = np.linalg.norm(np.diff(tips, axis=0), axis=1)
    assert steps[0] < 1e-3
    assert steps.max() < 3e-3  # the hand's own motion in a period
    assert np.linalg.norm(tips[-1] - tips[0]) > 5e-3  # it leads again


def test_joints_given_to_a_free_master_move_nothing() -> None:
    actions = []
    for is_given in (False, True):
        master = sides.MasterSide(scenario="free_motion")
        master.begin()
        if is_given:
            master.feel(dict.fromkeys(master.joint_keys, 1.0))
        actions.append([joints_of(master, master.next_action()) for _ in range(10)])
    assert np.array_equal(actions[0], actions[1])


def test_joints_beyond_a_limit_lead_to_the_limit() -> None:
    robot = tc.load_robot("rcrt1")
    master = sides.MasterSide(scenario="free_motion")
    master.begin()
    master.hold()
    wanted = joints_of(master, master.next_action()) + np.array([9.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    master.feel(dict(zip(master.joint_keys, wanted, strict=True)))
    for _ in range(300):
        reached = joints_of(master, master.next_action())
    assert reached[0] == pytest.approx(robot.upper[0], abs=1e-5)


def test_both_sides_refuse_what_they_cannot_use(slave: SlaveSide) -> None:
    with pytest.raises(tc.ParameterError, match=r"theta1\.pos") as caught:
        slave.send({"theta1.pos": 0.0})
    assert caught.value.name == "action"
    with pytest.raises(tc.ParameterError, match="finite"):
        sent(slave, joints_of(slave, slave.observe()) * np.nan)
    with pytest.raises(tc.SessionError, match="runs already"):
        slave.begin()
    slave.end()
    for call in (slave.end, slave.observe, lambda: slave.send({})):
        with pytest.raises(tc.SessionError, match="begin one first"):
            call()
    with pytest.raises(tc.ParameterError, match="fps"):
        sides.SlaveSide(fps=0)
    with pytest.raises(tc.ParameterError, match="one arm, with given_joints"):
        sides.SlaveSide(settings=("teleop.arms=[left,right]",))
    with pytest.raises(tc.UnknownNameError):
        sides.MasterSide(robot="no_such_robot")
    master = sides.MasterSide(scenario="free_motion")
    master.begin()
    with pytest.raises(tc.ParameterError, match=r"force\.z"):
        master.feel({"force.x": 0.0, "force.y": 0.0})
    with pytest.raises(tc.ParameterError, match=r"theta1\.pos"):
        master.feel(dict.fromkeys(master.joint_keys, np.nan))


@pytest.mark.parametrize(
    ("package", "base", "names"),
    [
        ("lerobot_robot_teleop_core", "Robot", ROBOT),
        ("lerobot_teleoperator_teleop_core", "Teleoperator", TELEOPERATOR),
        ("lerobot_camera_teleop_core", "Camera", CAMERA),
    ],
)
def test_class_for_lerobot_has_what_its_documents_ask_for(package: str, base: str, names: set[str]) -> None:
    tree = ast.parse((PACKAGE / package / "__init__.py").read_text())
    classes = {node.name: node for node in tree.body if isinstance(node, ast.ClassDef)}
    # In this order: what robot and teleoperator share stands in for LeRobot's abstract.
    bases = [base] if base == "Camera" else ["Connection", base]
    device = next(c for c in classes.values() if [ast.unparse(b) for b in c.bases] == bases)
    defined = {node.name for node in device.body if isinstance(node, ast.FunctionDef)}
    if base != "Camera":
        defined |= set(vars(sides.Connection))
    defined |= {ast.unparse(n.targets[0]) for n in device.body if isinstance(n, ast.Assign)}
    assert defined >= names
    assert f"{device.name}Config" in classes  # LeRobot finds the class by this name


def test_lerobot_makes_both_by_their_type_and_a_loop_runs() -> None:
    pytest.importorskip("lerobot", reason="lerobot is not installed: it brings torch")
    from lerobot.robots import make_robot_from_config
    from lerobot.robots.config import RobotConfig
    from lerobot.teleoperators import TeleoperatorConfig, make_teleoperator_from_config
    from lerobot.utils.import_utils import register_third_party_plugins

    register_third_party_plugins()
    kind, teleop_kind = (base.get_choice_class("teleop_core") for base in (RobotConfig, TeleoperatorConfig))
    robot = make_robot_from_config(kind(scenario="free_motion"))
    teleop = make_teleoperator_from_config(teleop_kind(scenario="free_motion"))
    with robot, teleop:
        for _ in range(10):
            action = teleop.get_action()
            assert robot.send_action(action) == action
            assert set(action) == set(robot.action_features) == set(teleop.action_features)
            assert set(robot.get_observation()) == set(robot.observation_features)
            teleop.send_feedback(robot.get_observation())
    assert not robot.is_connected
    assert not teleop.is_connected


def test_pictures_of_a_scene_are_features_before_the_session_and_observations_in_it() -> None:
    pytest.importorskip("mujoco", reason="teleop_scene is not installed")
    from teleop_scene import models
    from teleop_scene.camera import Camera
    from teleop_scene.parameters import View

    scene = str(models.OWN / "cubes.xml")
    slave = sides.SlaveSide(scene, "free_motion", fps=20, cameras=["front:96x64"])
    assert slave.pictures == {"front": (64, 96, 3)}
    try:
        Camera(models.OWN / "cubes.xml", View("front", 64, 64)).close()
    except tc.TeleopError:
        pytest.skip("no OpenGL without a screen (EGL) on this machine")
    slave.begin()
    first = slave.observe()
    assert set(first) == {*slave.observed_keys, "front"}
    assert (first["front"].shape, first["front"].dtype) == ((64, 96, 3), np.uint8)
    assert np.array_equal(first["front"], slave.observe()["front"])
    goal = {key: first[key] for key in slave.joint_keys}
    for _ in range(20):
        goal[slave.joint_keys[0]] += 0.02
        slave.send(goal)
    assert np.mean(slave.observe()["front"] != first["front"]) > 0.02
    slave.end()


def test_cameras_without_a_scene_are_refused() -> None:
    pytest.importorskip("mujoco", reason="teleop_scene is not installed")
    with pytest.raises(tc.ParameterError, match=r"SCENE\.xml"):
        sides.SlaveSide(scenario="free_motion", cameras=["front"])
    from teleop_scene import models

    with pytest.raises(tc.ParameterError, match="16 to 4096"):
        sides.SlaveSide(str(models.OWN / "cubes.xml"), cameras=["front:1x1"])


def test_gymnasium_finds_no_fault_with_the_environment_of_lerobot() -> None:
    pytest.importorskip("lerobot", reason="lerobot is not installed: it brings torch")
    from gymnasium.utils.env_checker import check_env
    from lerobot.envs.configs import EnvConfig
    from lerobot.utils.import_utils import register_third_party_plugins

    register_third_party_plugins()
    config = EnvConfig.get_choice_class("teleop_core")(
        scenario="free_motion", settings=["teleop.stages=[display,task]", "task.kind=reach"]
    )
    check_env(next(iter(config.create_envs(1).values()))[0].envs[0].unwrapped, skip_render_check=True)
