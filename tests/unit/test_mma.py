"""MMA handle: closed form, tables, loop closure and Jacobian (spec cases H1-H9, H20, H21)."""

import math

import numpy as np
import pinocchio
import pytest
import roboticstoolbox as rtb

from teleop_core.errors import ParameterError, ShapeError, UnknownNameError
from teleop_core.geometry import rotation
from teleop_core.robots import list_robots, load_robot
from teleop_core.robots.mma import holding_torques
from teleop_core.robots.mma_models import (
    frames,
    joints_of_model,
    loop_closure,
    passive_angles,
    readings_of_serial,
    table_a,
    table_b,
    table_c,
)

MM = 1e-3
# The spec gives derived values to 0.01 mm and asks for 0.05 mm and 1e-4.
PLACE, TURN = 0.05 * MM, 1e-4
# Table 4.7 prints one decimal of a millimetre, once cut instead of rounded (160.7 for 160.76).
PRINTED = 0.07 * MM
# Sums of a dozen products of lengths below 1 m.
EXACT = 1e-12
SERIAL_HOME = np.radians([0.0, -90.0, 90.0, 0.0, 90.0, 0.0, 0.0])
# Frame: table 4.7 model, prototype, recomputed model [mm].
TABLE_4_7 = {
    "4": ((160.7, 0, 325.2), (158.5, 0, 323.5), (160.76, 0, 325.23)),
    "5": ((160.7, 0, 393.1), (158.5, 0, 391.0), (160.76, 0, 393.05)),
    "6": ((160.7, -20.1, 393.1), (158.5, -22.9, 391.0), (160.76, -20.11, 393.05)),
    "8": ((160.7, -55.2, 418.3), (158.5, -56.6, 417.2), (160.76, -55.18, 418.29)),
    "9": ((122.4, -55.2, 418.3), (124, -56.6, 417.5), (122.36, -55.18, 418.29)),
    "12": ((3.6, -71.3, 482.1), (3.6, -72.9, 481.5), (3.63, -71.27, 482.08)),
}


@pytest.fixture(scope="module")
def mma():
    return load_robot("mma")


def serial_frames(mma, serial):
    return frames(table_b(mma.geometry), np.asarray(serial))


def random_readings(count, seed=0):
    return np.random.default_rng(seed).uniform(-math.pi, math.pi, (count, 7))


def tool_of_model(mma, q, model):
    table = {"A": table_a, "B": table_b, "C": table_c}[model](mma.geometry)
    return list(frames(table, joints_of_model(q, model)).values())[-1]


def test_mma_is_listed_with_seven_joints_and_one_turn_about_home(mma):
    assert "mma" in list_robots()
    assert mma.n == 7
    assert np.allclose(mma.upper - mma.lower, 2.0 * math.pi, rtol=0, atol=1e-15)


@pytest.mark.parametrize("name", TABLE_4_7)
def test_dummy_frames_at_home_stand_where_recomputed(mma, name):  # H1
    origin = serial_frames(mma, SERIAL_HOME)[name][:3, 3]
    assert np.abs(origin - np.array(TABLE_4_7[name][2]) * MM).max() < PLACE


def test_dummy_frames_turn_the_tool_by_half_a_turn_at_home(mma):  # H1
    tool = serial_frames(mma, SERIAL_HOME)["12"]
    assert np.abs(tool[:3, :3] - np.diag([-1.0, -1.0, 1.0])).max() < TURN


@pytest.mark.parametrize("name", TABLE_4_7)
def test_dummy_frames_at_home_agree_with_the_printed_table(mma, name):  # H2
    origin = serial_frames(mma, SERIAL_HOME)[name][:3, 3]
    assert np.abs(origin - np.array(TABLE_4_7[name][0]) * MM).max() < PRINTED


def test_conventional_table_at_home_gives_its_published_pose(mma):  # H3
    home = np.radians([0.0, -90.0, 90.0, 0.0, 0.0, -90.0, 90.0])
    chain = frames(table_a(mma.geometry), home)
    assert np.abs(chain["8"][:3, 3] - np.array([122.36, -35.07, 456.84]) * MM).max() < PLACE
    assert np.abs(chain["8"][:3, :3] - [[0, 1, 0], [-1, 0, 0], [0, 0, 1]]).max() < TURN
    assert np.abs(chain["4"][:3, 3] - np.array([160.76, 0.0, 325.23]) * MM).max() < PLACE


def test_conventional_and_dummy_frames_share_increments_and_differ_by_a_quarter_turn(mma):
    quarter = rotation("z", -0.5 * math.pi)
    for q in random_readings(50):
        a, b = tool_of_model(mma, q, "A"), tool_of_model(mma, q, "B")
        assert np.abs(b[:3, :3] - a[:3, :3] @ quarter).max() < EXACT


def test_conventional_description_is_the_handle_without_its_offsets(mma):
    conventional = load_robot("mma", model="A")
    for q in random_readings(50):
        assert np.abs(conventional.fk(q) - tool_of_model(mma, q, "A")).max() < EXACT


def test_hybrid_at_home_gives_the_published_pose_and_passive_angles(mma):  # H5
    pose = mma.fk(mma.home)
    assert np.abs(pose[:3, 3] - np.array([3.63, -71.27, 482.08]) * MM).max() < PLACE
    assert np.abs(pose[:3, :3] - np.diag([-1.0, -1.0, 1.0])).max() < TURN
    assert np.allclose(np.degrees(passive_angles(mma.home)), [90.0, 90.0], atol=1e-9)


def test_prototype_was_measured_within_three_millimetres_per_axis(mma):  # H6
    chain = serial_frames(mma, SERIAL_HOME)
    gaps = np.array([chain[k][:3, 3] - np.array(v[1]) * MM for k, v in TABLE_4_7.items()])
    assert np.abs(gaps).max() < 2.8 * MM
    assert np.linalg.norm(gaps, axis=1).max() < 4.14 * MM


def test_both_ways_round_the_parallelogram_meet(mma):  # H7
    q = np.radians([20.0, -80.0, -15.0, 75.0, 0.0, 0.0, 0.0])
    assert np.allclose(np.degrees(passive_angles(q)), [90.0, 90.0], atol=1e-9)
    loop = loop_closure(q, mma.geometry)
    # Printed to 0.1 µm.
    meeting = np.array([181.0791, 65.9074, 336.3932]) * MM
    assert np.abs(loop.along_link_3 - meeting).max() < 1e-7
    assert np.abs(loop.along_link_3a - meeting).max() < 1e-7
    frame_4 = np.array([178.3019, 64.8966, 370.1742]) * MM
    assert np.abs(loop.frame_4 - frame_4).max() < 1e-7


def test_loop_closes_for_every_reading_and_any_split_of_the_short_side(mma):
    for q, side in zip(random_readings(100), np.linspace(0.005, 0.06, 100), strict=True):
        loop = loop_closure(q, mma.geometry, side)
        assert np.abs(loop.along_link_3 - loop.along_link_3a).max() < EXACT
        table = frames(table_c(mma.geometry, side), joints_of_model(q, "C"))
        assert np.abs(table["4'"][:3, 3] - loop.frame_4).max() < EXACT
        assert np.abs(table["12"] - mma.fk(q)).max() < EXACT


def test_closed_form_is_the_product_of_both_tables_for_random_readings(mma):  # H9
    for q in random_readings(300):
        pose = mma.fk(q)
        assert np.abs(pose - tool_of_model(mma, q, "C")).max() < EXACT
        assert np.abs(pose - tool_of_model(mma, q, "B")).max() < EXACT


def test_readings_and_serial_joints_are_inverse_maps():
    for q in random_readings(20):
        assert np.allclose(readings_of_serial(joints_of_model(q, "B")), q, rtol=0, atol=1e-14)


@pytest.mark.parametrize(
    ("serial", "shared", "place", "quaternion"),
    [
        ((30, -90, 90, 0, 90, 0, 0), (0, 90), (38.7787, -59.9066, 482.08),
         (0, 0, 0.9659, -0.2588)),
        ((0, -60, 70, -10, 90, 0, 0), (-30, 70), (94.9177, -71.27, 429.0494), (0, 0, 1, 0)),
    ],
)  # fmt: skip
def test_further_points_of_the_specification(mma, serial, shared, place, quaternion):
    serial = np.radians(np.array(serial, float))
    q = np.concatenate((serial[:2], np.radians(shared), serial[4:]))
    x, y, z, w = quaternion
    wanted = pinocchio.Quaternion(w, x, y, z).normalized().matrix()
    for pose in (serial_frames(mma, serial)["12"], mma.fk(q)):
        assert np.abs(pose[:3, 3] - np.array(place) * MM).max() < 1e-7
        assert np.abs(pose[:3, :3] - wanted).max() < TURN


def test_printed_last_row_of_the_dummy_table_is_not_reproduced(mma):  # H20
    rows = list(table_b(mma.geometry))
    rows[-1] = rows[-1]._replace(alpha=0.5 * math.pi)
    wrong = frames(tuple(rows), SERIAL_HOME)["12"][:3, 3]
    assert np.abs(wrong - np.array([3.63, -34.77, 445.58]) * MM).max() < PLACE
    assert np.linalg.norm(wrong - mma.fk(mma.home)[:3, 3]) > 50.0 * MM


def test_signed_offsets_are_refused_by_the_closed_form():  # H21
    with pytest.raises(ParameterError) as caught:
        load_robot("mma", d7=-0.03507, d9=-0.03840)
    assert caught.value.name == "d7"


def test_signed_offsets_would_move_the_tool(mma):  # H21
    row = mma.geometry_row.copy()
    names = list(mma.geometry)
    for name in ("d7", "d9"):
        row[names.index(name)] *= -1.0
    pose = np.empty((4, 4))
    mma.kernels.fk(mma.home.copy(), row, pose)
    assert np.abs(pose[:2, 3] - np.array([80.43, -1.13]) * MM).max() < PLACE


def test_tool_in_roboticstoolbox_is_the_same(mma):
    arm = rtb.DHRobot(
        [
            rtb.RevoluteMDH(a=row.a, alpha=row.alpha, d=row.d, offset=row.theta)
            for row in table_b(mma.geometry)
        ]
    )
    moving = [row.joint >= 0 for row in table_b(mma.geometry)]
    for q in random_readings(20):
        joints = np.zeros(len(moving))
        joints[moving] = joints_of_model(q, "B")
        assert np.abs(arm.fkine(joints).A - mma.fk(q)).max() < EXACT


def pinocchio_model(mma):
    """Serial model B from joint placements alone, without any D-H routine of ours."""
    model, parent, fixed, order = pinocchio.Model(), 0, pinocchio.SE3.Identity(), []
    for row in table_b(mma.geometry):
        c, s = math.cos(row.alpha), math.sin(row.alpha)
        tilt = np.array([[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]])
        fixed = fixed * pinocchio.SE3(tilt, np.array([row.a, 0.0, 0.0]))
        along = pinocchio.SE3(np.eye(3), np.array([0.0, 0.0, row.d]))
        if row.joint < 0:
            fixed = fixed * along * pinocchio.SE3(rotation("z", row.theta), np.zeros(3))
            continue
        parent = model.addJoint(parent, pinocchio.JointModelRZ(), fixed * along, row.name)
        order.append(row.joint)
        fixed = pinocchio.SE3.Identity()
    model.addFrame(pinocchio.Frame("tool", parent, fixed, pinocchio.FrameType.OP_FRAME))
    assert order == list(range(7))
    return model


def test_pose_and_jacobian_in_pinocchio_are_the_same(mma):
    model = pinocchio_model(mma)
    data, frame = model.createData(), model.getFrameId("tool")
    for q in random_readings(50):
        serial = joints_of_model(q, "B")
        pinocchio.framesForwardKinematics(model, data, serial)
        assert np.abs(data.oMf[frame].homogeneous - mma.fk(q)).max() < EXACT
        columns = pinocchio.computeFrameJacobian(
            model, data, serial, frame, pinocchio.LOCAL_WORLD_ALIGNED
        )
        hybrid = columns.copy()
        hybrid[:, 2], hybrid[:, 3] = columns[:, 3], columns[:, 2] - columns[:, 3]
        assert np.abs(hybrid - mma.jacobian(q)).max() < EXACT


def test_jacobian_at_home_is_the_published_one(mma):
    serial = [
        [71.27, 344.31, 156.85, 156.85, 51.16, 63.79, 0.0],
        [3.63, 0.0, 0.0, 0.0, -157.13, 0.0, -63.79],
        [0.0, -3.63, -3.63, 157.13, 0.0, 157.13, 0.0],
        [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0],
        [0.0, 1.0, 1.0, 1.0, 0.0, 1.0, 0.0],
        [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0],
    ]
    wanted = np.array(serial)
    wanted[:3] *= MM
    wanted[:, 2], wanted[:, 3] = wanted[:, 3].copy(), wanted[:, 2] - wanted[:, 3]
    assert np.abs(mma.jacobian(mma.home) - wanted).max() < 1e-9


def test_jacobian_is_the_finite_difference_of_the_pose(mma):
    step = 1e-6  # truncation 1e-12, rounding 1e-10
    for q in random_readings(50):
        pose, J = mma.fk(q), mma.jacobian(q)
        for i in range(7):
            move = np.zeros(7)
            move[i] = step
            rate = (mma.fk(q + move) - mma.fk(q - move)) / (2.0 * step)
            turning = rate[:3, :3] @ pose[:3, :3].T
            spin = (turning[2, 1], turning[0, 2], turning[1, 0])
            assert np.abs(J[:, i] - (*rate[:3, 3], *spin)).max() < 1e-8


def test_rank_falls_to_five_at_the_wrist_whatever_the_arm_does(mma):
    for q in random_readings(20):
        q[4], q[5] = 0.5 * math.pi, -0.5 * math.pi
        assert np.linalg.svd(mma.jacobian(q), compute_uv=False)[-1] < 1e-12


def test_stretched_elbow_alone_is_not_singular(mma):
    q = np.array([0.3, -1.2, 0.5, 0.0, 0.6, 0.7, 0.1])
    assert np.linalg.svd(mma.jacobian(q), compute_uv=False)[-1] > 1e-3


def test_no_reading_takes_the_tool_out_of_the_published_reach(mma):
    poses = mma.fk(random_readings(20000))
    distance = np.linalg.norm(poses[:, :3, 3] - [0.0, 0.0, mma.geometry["d1"]], axis=1)
    assert distance.max() < 624.13 * MM


def test_batches_agree_with_single_poses(mma):
    readings = random_readings(5)
    batch = mma.fk(readings)
    for pose, q in zip(batch, readings, strict=True):
        assert np.array_equal(pose, mma.fk(q))


def test_tool_force_is_held_by_the_transposed_jacobian_and_the_shoulder_residual(mma):
    q, wrench = mma.home + 0.1, np.array([1.0, -2.0, 3.0, 0.1, 0.2, -0.3])
    idle = holding_torques(mma, q, np.zeros(6))
    assert np.count_nonzero(idle) == 1
    torques = holding_torques(mma, q, wrench) - idle
    speeds = np.random.default_rng(3).normal(size=7)
    # Virtual work: what the joints put in comes out at the tip.
    assert math.isclose(torques @ speeds, wrench @ (mma.jacobian(q) @ speeds), rel_tol=1e-12)


def test_shoulder_torque_lifts_against_gravity(mma):
    level = mma.home.copy()
    level[1] = 0.0
    # Residual of the published spring in the worst pose, 1.011 N·m, towards smaller θ2.
    assert math.isclose(holding_torques(mma, level, np.zeros(6))[1], -1.011, abs_tol=1e-3)


@pytest.mark.parametrize(
    ("options", "error"),
    [
        ({"model": "D"}, UnknownNameError),
        ({"a4": 0.1}, UnknownNameError),
        ({"a2": 0.0}, ParameterError),
        ({"d1": math.nan}, ParameterError),
    ],
)
def test_impossible_geometry_is_refused(options, error):
    with pytest.raises(error):
        load_robot("mma", **options)


def test_bad_vectors_are_refused(mma):
    with pytest.raises(ShapeError):
        holding_torques(mma, np.zeros(6), np.zeros(6))
    with pytest.raises(ParameterError):
        holding_torques(mma, mma.home, np.full(6, np.nan))
    with pytest.raises(ShapeError):
        joints_of_model(np.zeros((2, 7)), "B")
    with pytest.raises(UnknownNameError):
        joints_of_model(np.zeros(7), "D")
    with pytest.raises(ShapeError):
        mma.fk(np.eye(4))
