"""Arms of MuJoCo models: kinematics and inertias are the model's own; unusable models are refused in one line."""

from pathlib import Path

import mujoco
import numpy as np
import pytest

import teleop_core as tc
from present import present
from teleop_core.base import ParameterError, TeleopError
from teleop_core.robots.dynamics.chain_dynamics import inertia_matrix
from teleop_scene import models, truth
from teleop_scene.arm import SceneRobot, arm_of

ODD = """<mujoco><compiler angle="radian"/><option gravity="1 2 -9"/><worldbody>
  <body name="stand" pos="0.3 -0.2 0.1" euler="0.3 -0.2 0.7">
    <body name="first" pos="0 0 0.2" euler="0 0.4 0">
      <joint name="a" axis="0 -1 0.2" pos="0.02 0 0.01" ref="0.3" armature="0.02" range="-1 1"/>
      <geom size="0.05" mass="1" pos="0 0 0.1"/>
      <body name="second" pos="0.2 0 0">
        <joint name="s" type="slide" axis="0.1 0 -1" ref="-0.05" armature="0.3" range="-0.2 0.2"/>
        <joint name="b" axis="1 0 0" armature="0.01" range="-2 2"/>
        <geom type="box" size="0.05 0.02 0.1" mass="0.7" pos="0.05 0 0"/>
        <body name="fixed" pos="0 0.1 0"><geom size="0.03" mass="0.2"/>
          <body name="third" pos="0 0 0.15"><joint name="c" axis="0 0 1" armature="0.01" range="-3 3"/>
            <geom size="0.03" mass="0.3" pos="0.1 0 0"/><site name="tip" pos="0.1 0.02 0" euler="0.2 0 0.1"/>
          </body></body></body></body></body>
  <body name="ball" pos="2 0 1"><freejoint/><geom size="0.1"/></body>
</worldbody>{more}</mujoco>"""


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(7)


def odd(more: str = "") -> tuple[mujoco.MjModel, SceneRobot]:
    model = mujoco.MjModel.from_xml_string(ODD.format(more=more))
    return model, arm_of(Path("odd.xml"), model)


def placed(model: mujoco.MjModel, robot: SceneRobot, q: np.ndarray) -> mujoco.MjData:
    data = mujoco.MjData(model)
    data.qpos[model.jnt_qposadr[robot.chain.joints]] = q
    mujoco.mj_forward(model, data)
    return data


def test_the_tip_is_where_mujoco_has_it_in_every_posture(rng: np.random.Generator) -> None:
    model, robot = odd()
    for q in rng.uniform(robot.lower, robot.upper, (20, robot.n)):
        site = placed(model, robot, q).site("tip")
        T = robot.world_base @ robot.fk(q)
        np.testing.assert_allclose(T[:3, 3], site.xpos, atol=1e-14)
        np.testing.assert_allclose(T[:3, :3], site.xmat.reshape(3, 3), atol=1e-14)


def test_weight_and_inertia_are_those_of_the_model(rng: np.random.Generator) -> None:
    model, robot = odd()
    dynamics, dofs = robot.dynamics, model.jnt_dofadr[robot.chain.joints]
    assert dynamics is not None
    row, weight, inertia = dynamics.parameters.copy(), np.zeros(robot.n), np.zeros((robot.n, robot.n))
    for q in rng.uniform(robot.lower, robot.upper, (20, robot.n)):
        data = placed(model, robot, q)
        dynamics.gravity(q, row, weight)
        np.testing.assert_allclose(weight, data.qfrc_bias[dofs], atol=1e-12)
        inertia_matrix(q, row, inertia)
        whole = np.zeros((model.nv, model.nv))
        mujoco.mj_fullM(model, data, whole)
        np.testing.assert_allclose(inertia, whole[np.ix_(dofs, dofs)], atol=1e-12)


def test_the_arm_begins_where_the_keyframe_says() -> None:
    more = '<keyframe><key qpos="0.5 0.1 -0.3 1.2 2 0 1 1 0 0 0"/></keyframe>'
    assert odd(more)[1].home.tolist() == [0.5, 0.1, -0.3, 1.2]


@pytest.mark.parametrize("robot", ["cubes.xml", "drawer.xml", "peg_in_hole.xml"])
def test_our_scenes_begin_at_rest_and_touch_nothing_but_their_table(robot: str) -> None:
    arm = tc.load_robot(robot)
    assert isinstance(arm, SceneRobot)
    model = models.model_of(arm.file)
    data = mujoco.MjData(model)
    data.qpos[:] = arm.begin
    mujoco.mj_forward(model, data)
    assert data.contact.dist.min(initial=0.0) > -1e-3
    assert np.isfinite(data.qacc).all()


def test_motions_and_contacts_are_those_of_closed_forms() -> None:
    bounds = (1e-5, 1e-4, 1e-5, 1e-6, 0.01, 1.5, 1e-3)
    for found, bound in zip(truth.comparisons(), bounds, strict=True):
        assert abs(found.difference) < bound, found


REFUSED = {
    "equality constraint 0": '<equality><joint joint1="a" joint2="c"/></equality>',
    "third to world": '<equality><connect body1="third" anchor="0 0 0"/></equality>',
    "pulls at joint a": '<tendon><fixed><joint joint="a" coef="1"/><joint joint="c" coef="1"/></fixed></tendon>',
}


@pytest.mark.parametrize("words", REFUSED)
def test_constraints_that_inverse_kinematics_cannot_use_are_refused_by_name(words: str) -> None:
    with pytest.raises(ParameterError, match=words) as told:
        odd(REFUSED[words])
    assert "\n" not in str(told.value)


def test_a_weld_to_a_free_body_is_a_load_and_not_refused() -> None:
    assert odd('<equality><weld body1="third" body2="ball"/></equality>')[1].n == 4


@pytest.mark.parametrize(
    ("tip", "words"), [("hook", "hook"), ("stand", "hinge or slide joint"), ("ball", "free joint")]
)
def test_a_missing_or_unmoved_tip_is_refused_by_name(tip: str, words: str) -> None:
    model = mujoco.MjModel.from_xml_string(ODD.format(more=""))
    with pytest.raises(ParameterError, match=words):
        arm_of(Path("odd.xml"), model, tip)


def test_a_scene_without_its_package_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    from teleop_core.robots.parts import SCENES

    monkeypatch.setattr(SCENES, "_parts", {})
    monkeypatch.setattr(SCENES, "_installed", {})
    with pytest.raises(TeleopError, match="in the distribution teleop_scene"):
        tc.load_robot("cubes.xml")


def test_an_arm_that_begins_inside_another_body_is_told() -> None:
    assert not odd()[1].notes
    more = '<keyframe><key qpos="0.5 0.1 -0.3 1.2 0.5 0 0.3 1 0 0 0"/></keyframe>'
    (note,) = odd(more)[1].notes
    assert "mm inside" in note
    assert "ball" in note


BESIDE = """<mujoco><asset><model name="arm" file="{urdf}"/></asset><worldbody>
  <body name="block" pos="1.5 0 0.02"><freejoint/><geom type="box" size="0.02 0.02 0.02"/></body>
  <frame pos="0 0 0.1"><attach model="arm" body="base_link" prefix="arm_"/></frame>
  <geom type="plane" size="2 2 0.1"/></worldbody></mujoco>"""


def test_an_arm_from_a_urdf_in_a_scene_has_the_kinematics_of_the_urdf_and_follows(
    rng: np.random.Generator, tmp_path: Path
) -> None:
    urdf = Path(__file__).resolve().parents[2] / "examples" / "ur5e.urdf"
    (file := tmp_path / "beside.xml").write_text(BESIDE.format(urdf=urdf), encoding="utf-8")
    alone, robot = tc.load_robot(str(urdf), tip="tool0"), tc.load_robot(str(file), tip="arm_tool0")
    assert robot.joint_names == tuple(f"arm_{name}" for name in alone.joint_names)
    for q in rng.uniform(alone.lower, alone.upper, (20, alone.n)):
        np.testing.assert_allclose(robot.fk(q), alone.fk(q), atol=1e-9)
    assert {path.name for path in models.files_of(file).values()} == {"beside.xml", "ur5e.urdf"}
    score = tc.run("free_motion", duration=3.0, robot=robot).score()
    assert present(score.position_error_mm.rms) < 0.1
