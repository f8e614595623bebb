"""Bodies of robots are where their kinematics says; what does not close is drawn all the same."""

from itertools import accumulate

import numpy as np
import pytest

import teleop_core as tc
from teleop_core.kernels.geometry import rotations_from_quaternions
from teleop_core.kinematics import FkStatus
from teleop_core.robots import Robot
from teleop_core.robots.bodies import Bodies, Joint, Solid, bodies_of
from teleop_core.robots.bodies.describe import serial_bodies, unknown_bodies
from teleop_core.robots.solids import along
from teleop_machines.mma_models import frames, joints_of_model, loop_closure, model_table

TABLE = {
    "name": "own",
    "convention": "modified",
    "angles": "degrees",
    "rows": [
        {"theta": "q", "lower": -150, "upper": 150},
        {"a": 0.4, "alpha": 30, "theta": "q", "lower": -120, "upper": 120, "home": 60},
        {"a": 0.3, "alpha": -90, "d": "q", "lower": -0.1, "upper": 0.1},
    ],
    "task": ["x", "y", "z"],
}
SERIAL = ("rcrt1", "puma560", "scara", "planar_3r", "five_axis")
OFF = np.array([0.2, 0.1, 0.5, -0.3, 0.4, 0.2, 0.1])
ROUNDING = 1e-12  # m and of rotation matrices, on robots of about a metre
LOOPS_CLOSE = 1e-7  # m: bound of REACHED, with which robots call a loop closed


def closing(robot: Robot, count: int = 20) -> tuple[np.ndarray, np.ndarray]:
    """Joint vectors about home that assemble, and their tips."""
    rng = np.random.default_rng(5)
    width = 0.1 * (robot.upper - robot.lower)
    q = np.clip(robot.home + rng.uniform(-width, width, (200, robot.n)), robot.lower, robot.upper)
    # Joints drawn at random contradict each other where they say more than the pose: ik's do not.
    q = robot.ik_batch(robot.solve_fk_batch(q, search=False).T, robot.home).q
    answer = robot.solve_fk_batch(q, search=False)
    good = answer.status < int(FkStatus.NOT_CLOSED)
    return q[good][:count], answer.T[good][:count]


def end_of(solid: Solid, pose: np.ndarray, sign: float) -> np.ndarray:
    """End (3,) of a capsule of a body at a pose (7,), in the base."""
    own = rotations_from_quaternions(solid.pose[3:]) @ [0.0, 0.0, sign * 0.5 * solid.size[1]]
    return rotations_from_quaternions(pose[3:]) @ (own + solid.pose[:3]) + pose[:3]


def legs_of(bodies: Bodies, poses: np.ndarray) -> np.ndarray:
    """Both ends of every leg (k, 2, 3) at poses (B, 7)."""
    tubes = [name for name in bodies.names if name.startswith("leg")]
    count = len({name.partition("_")[0] for name in tubes})
    last = len(tubes) // count
    ends = []
    for leg in range(1, count + 1):
        lower, upper = (bodies.index(f"leg{leg}_tube{k}") for k in (1, last))
        start = end_of(bodies.bodies[lower].solids[0], poses[lower], -1.0)
        ends.append((start, end_of(bodies.bodies[upper].solids[0], poses[upper], 1.0)))
    return np.array(ends)


@pytest.mark.parametrize("name", tc.list_robots())
def test_the_last_body_is_the_tip_of_forward_kinematics(name: str) -> None:
    robot = tc.load_robot(name)
    q, tips = closing(robot)
    assert len(q)
    if name in SERIAL:  # in all its range
        q = np.random.default_rng(2).uniform(robot.lower, robot.upper, (200, robot.n))
        tips = robot.fk(q)
    poses = bodies_of(robot).poses(q)
    assert np.abs(poses[:, -1, :3] - tips[:, :3, 3]).max() < ROUNDING
    assert np.abs(rotations_from_quaternions(poses[:, -1, 3:]) - tips[:, :3, :3]).max() < ROUNDING


@pytest.mark.parametrize("name", SERIAL)
def test_a_joint_moves_the_bodies_after_it_alone(name: str) -> None:
    robot = tc.load_robot(name)
    bodies, start = bodies_of(robot), 0.5 * (robot.lower + robot.upper)
    still = bodies.poses(start)
    for joint in range(robot.n):
        moved = start.copy()
        moved[joint] += 0.01
        differs = np.abs(bodies.poses(moved) - still).max(axis=1) > 1e-6
        assert np.flatnonzero(differs)[0] == bodies.joint_body[joint]


def test_axes_of_bodies_are_those_of_a_table() -> None:
    """Frame i of a modified table has z along joint i, whatever moved before."""
    robot = tc.robot_from_table(TABLE)
    table, bodies = tc.robots.parse_table(TABLE), bodies_of(robot)
    assert bodies.bodies[3].joint is Joint.PRISMATIC
    for q in np.random.default_rng(4).uniform(robot.lower, robot.upper, (20, 3)):
        expected = list(accumulate(table.link_transforms(q), np.matmul))
        poses = bodies.poses(q)
        axes = rotations_from_quaternions(poses[1:4, 3:])[..., 2]
        for pose, axis, frame in zip(poses[1:4], axes, expected, strict=False):
            off = pose[:3] - frame[:3, 3]
            assert np.linalg.norm(np.cross(axis, frame[:3, 2])) < ROUNDING
            assert np.linalg.norm(np.cross(axis, off)) < ROUNDING
        assert poses[-1, :3] == pytest.approx(robot.fk(q)[:3, 3], abs=ROUNDING)


def test_both_branches_of_the_mma_meet_where_its_published_loop_closes() -> None:
    robot = tc.load_robot("mma")
    bodies, q = bodies_of(robot), robot.home + OFF
    poses, loop = bodies.poses(q), loop_closure(q, robot.geometry)
    branch, chain = bodies.index("link3b"), bodies.index("link4")
    end = end_of(bodies.bodies[branch].solids[1], poses[branch], 1.0)
    assert end == pytest.approx(loop.frame_4, abs=ROUNDING)
    assert poses[chain, :3] == pytest.approx(loop.along_link_3, abs=ROUNDING)
    table = frames(model_table("C", robot.geometry), joints_of_model(q, "C"))
    knee = bodies.index("link3a")
    assert poses[knee, :3] == pytest.approx(table["3"][:3, 3], abs=ROUNDING)
    axes = rotations_from_quaternions(poses[:, 3:])
    assert abs(axes[knee, :, 2] @ table["3"][:3, 2]) == pytest.approx(1.0, abs=ROUNDING)


@pytest.mark.parametrize("mode", [1.0, -1.0])
def test_coupler_and_rocker_of_a_four_bar_end_in_one_point(mode: float) -> None:
    robot = tc.load_robot("four_bar", mode=mode)
    bodies = bodies_of(robot)
    for theta in np.linspace(-3.0, 3.0, 13):
        poses = bodies.poses([theta])
        coupler, rocker = (
            end_of(bodies.bodies[i].solids[1], poses[i], 1.0) for i in (bodies.index("coupler"), bodies.index("rocker"))
        )
        assert coupler == pytest.approx(rocker, abs=LOOPS_CLOSE)


def test_a_parallelogram_keeps_its_coupler_parallel_to_the_ground() -> None:
    robot = tc.load_robot("parallelogram")
    bodies = bodies_of(robot)
    poses = bodies.poses([[0.0], [2.0], [-3.0]])
    coupler, rocker = bodies.index("coupler"), bodies.index("rocker")
    assert np.abs(poses[:, coupler, 3] - 1.0).max() < ROUNDING
    for row in poses:
        ends = [end_of(bodies.bodies[i].solids[1], row[i], 1.0) for i in (coupler, rocker)]
        assert ends[0] == pytest.approx(ends[1], abs=ROUNDING)


@pytest.mark.parametrize(
    ("name", "geometry"),
    [
        ("stewart", {}),
        ("rps3", {}),
        ("scara_stewart", {}),
        ("scara_stewart", {"heading": "carried"}),
        ("scara_stewart", {"sigma_b": 0.2, "sigma_m": 0.2}),
    ],
)
def test_legs_are_as_long_as_their_joints_say(name: str, geometry: dict[str, float | str]) -> None:
    robot = tc.load_robot(name, **geometry)
    bodies = bodies_of(robot)
    # The legs of a pose close; drawn lengths of the hybrid's similar hexagons would not.
    _, tips = closing(robot)
    q = robot.ik_batch(tips[:5], robot.home).q
    for joints in q:
        ends = legs_of(bodies, bodies.poses(joints))
        lengths = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
        assert lengths == pytest.approx(joints[-len(lengths) :], abs=LOOPS_CLOSE)


def test_fingers_end_at_the_corners_of_the_object_that_they_hold() -> None:
    robot = tc.load_robot("three_finger_hand")
    bodies = bodies_of(robot)
    poses = bodies.poses(robot.home)
    held = bodies.index("object")
    corners = [end_of(solid, poses[held], -1.0) for solid in bodies.bodies[held].solids]
    for finger in range(3):
        last = bodies.index(f"finger{finger + 1}_link3")
        touch = end_of(bodies.bodies[last].solids[1], poses[last], 1.0)
        assert min(np.linalg.norm(corners - touch, axis=1)) < LOOPS_CLOSE


def test_joints_that_do_not_close_are_drawn_and_refuse_nothing() -> None:
    robot = tc.load_robot("stewart")
    apart = robot.home.copy()
    apart[0] *= 3.0
    assert robot.solve_fk(apart).status >= FkStatus.NOT_CLOSED
    assert np.isfinite(bodies_of(robot).poses(apart)).all()
    crank = tc.load_robot("four_bar", l0=0.4, l1=0.3, l2=0.1, l3=0.1)
    assert np.isfinite(bodies_of(crank).poses([3.0])).all()


@pytest.mark.parametrize("name", ["rcrt1", "stewart", "four_bar", "mma"])
def test_joints_that_are_not_finite_leave_the_base_where_it_is(name: str) -> None:
    robot = tc.load_robot(name)
    poses = bodies_of(robot).poses(np.full(robot.n, np.nan))
    assert np.isfinite(poses[0]).all()
    assert np.isnan(poses[-1]).any()


def test_what_nobody_described_is_a_base_a_dotted_line_and_a_tip() -> None:
    robot = tc.load_robot("rps3")
    bodies, tip = unknown_bodies(robot), robot.fk(robot.home)[:3, 3]
    poses = bodies.poses(robot.home)
    assert poses[-1, :3] == pytest.approx(tip, abs=ROUNDING)
    assert np.abs(np.cross(poses[1:-1, :3], tip)).max() < ROUNDING
    assert serial_bodies(robot) is None
    assert serial_bodies(tc.load_robot("parallelogram")) is None  # a push along a circle


@pytest.mark.parametrize("name", tc.list_robots())
def test_every_robot_has_sound_bodies(name: str) -> None:
    robot = tc.load_robot(name)
    bodies = bodies_of(robot)
    assert bodies is bodies_of(robot)
    assert bodies.names[0] == "base"
    assert bodies.names[-1] == "tip"
    assert len(set(bodies.names)) == len(bodies.names)
    assert all(body.parent < i for i, body in enumerate(bodies.bodies))
    assert len(bodies.joint_body) == robot.n
    batch = bodies.poses(np.stack((robot.home, robot.start)))
    assert batch.shape == (2, len(bodies.names), 7)
    assert np.array_equal(batch[0], bodies.poses(robot.home))
    assert np.abs(np.linalg.norm(batch[..., 3:], axis=-1) - 1.0).max() < 1e-9
    placed = batch[0, :, :3]
    assert np.linalg.norm(placed, axis=1).max() < 2.0 * bodies.size


def test_directions_turn_z_along_themselves_whichever_way_they_point() -> None:
    ways = np.array([[0, 0, 1], [0, 0, -1], [1, 0, 0], [0.1, -2, 0.3], [1e-12, 0, -1], [0, 0, 0]])
    turned = rotations_from_quaternions(along(ways.astype(float)))[..., 2]
    lengths = np.linalg.norm(ways, axis=1)
    assert np.abs(turned[:5] - ways[:5] / lengths[:5, None]).max() < 1e-9
    assert turned[5] == pytest.approx([0.0, 0.0, 1.0])
