"""Closed loops against pinocchio: trees of joints whose ends are pinned together.

Every mechanism is drawn again as pinocchio joints, from its lengths alone; Newton steps on
pinocchio's constraint Jacobian close the loops, and its kinematics tells where the tip is.
"""

import math
from collections.abc import Iterator, Mapping
from functools import cache
from typing import Any

import numpy as np
import pinocchio
import pytest
from numpy.typing import ArrayLike, NDArray
from pinocchio import SE3

from teleop_core.kernels.geometry import Array
from teleop_core.robots import IkStatus, load_robot
from teleop_core.robots.robot import Robot
from teleop_machines.four_bar import FourBar
from teleop_machines.mobility import PLANAR, SPATIAL, degrees_of_freedom
from teleop_machines.rps3 import assembly_modes
from teleop_machines.stewart import PAIRED, Layout
from teleop_machines.three_finger_hand import Grasp, Hand

# Sums of a dozen products of lengths up to some metres.
EXACT = 1e-12
# Both sides solve to rounding, 1e-15; what is solved loses the condition of the loops, up to 50,
# and 2e4 for the third joints of the hand.
SOLVED = 1e-9
# Singular value of a constraint Jacobian, over the largest, that counts as zero.
ZERO = 1e-9
X, Y, Z = np.eye(3)
THIRDS = 2.0 * math.pi / 3.0 * np.arange(3)


def at(*point: float) -> Any:
    return SE3(np.eye(3), np.array(point, float))


class Mechanism:
    """Tree of joints with pins; ``x`` is pinocchio's configuration, q the robot's joint vector."""

    def __init__(self) -> None:
        self.motors: list[Any]
        self.pins: list[Any]
        self.model, self.pins, self.motors, self.tip_frame = pinocchio.Model(), [], [], 0

    def add(self, parent: int, joint: Any, place: SE3 | None = None) -> int:
        """Number of a new joint, placed in the body of its parent."""
        name = str(self.model.njoints)
        return self.model.addJoint(parent, joint, place or SE3.Identity(), name)

    def pin(self, first: int, there: tuple[float, int, int], second: int, here: Any) -> None:
        """Keep a point of one body at a point of another."""
        kind, ends = pinocchio.ContactType.CONTACT_3D, (at(*there), at(*here))
        self.pins.append((kind, first, ends[0], second, ends[1]))

    def finish(self, motors: list[int], body: int, tip: SE3 | None = None) -> None:
        """Say which joints are q, and where the tip is."""
        frame = pinocchio.Frame("tip", body, tip or at(0, 0, 0), pinocchio.FrameType.OP_FRAME)
        self.tip_frame, self.motors, self.body = self.model.addFrame(frame), motors, body
        self.data, self.start = self.model.createData(), pinocchio.neutral(self.model)
        self.pins = [pinocchio.RigidConstraintModel(kind, self.model, *ends) for kind, *ends in self.pins]
        self.pin_data = [pin.createData() for pin in self.pins]
        # Joint velocities per motor speed (nv, n); a joint may be geared to several motors.
        self.gears = np.zeros((self.model.nv, len(motors)))
        self.gears[self.columns(*motors), range(len(motors))] = 1.0

    @property
    def free(self) -> NDArray[np.int64]:
        """Columns that no motor turns."""
        return np.flatnonzero(~self.gears.any(axis=1))

    def columns(self, *joints: int) -> NDArray[np.int64]:
        """Where joints are in velocities."""
        spans = [(self.model.idx_vs[j], self.model.nvs[j]) for j in joints]
        return np.concatenate([np.arange(first, first + count) for first, count in spans])

    def put(self, x: Array, joint: int, value: float | SE3) -> Array:
        """Configuration with one joint at a number or, for a free body, a pose."""
        x, first = x.copy(), self.model.idx_qs[joint]
        numbers = pinocchio.SE3ToXYZQUAT(value) if isinstance(value, SE3) else np.array([value])
        x[first : first + len(numbers)] = numbers
        return x

    def q(self, x: Array, joints: Any = None) -> Array:
        """Joint vector of a configuration."""
        return x[[self.model.idx_qs[j] for j in joints or self.motors]]

    def gaps(self, x: Array) -> Array:
        """How far the ends are apart, in axes of the first (3 k,) [m]."""
        pinocchio.forwardKinematics(self.model, self.data, x)
        for pin, data in zip(self.pins, self.pin_data, strict=True):
            pin.calc(self.model, self.data, data)
        return np.concatenate([data.c1Mc2.translation for data in self.pin_data])

    def slopes(self, x: Array) -> Array:
        """Constraint Jacobian (3 k, nv)."""
        self.gaps(x)
        pinocchio.computeJointJacobians(self.model, self.data, x)
        return np.vstack(
            [
                pinocchio.getConstraintJacobian(self.model, self.data, pin, data)
                for pin, data in zip(self.pins, self.pin_data, strict=True)
            ]
        )

    def closed(self, x: Array, free: NDArray[np.int64] | None = None) -> Array:
        """Configuration next to x in which all pins hold; only free columns move."""
        free, move = self.free if free is None else free, np.zeros(self.model.nv)
        for _ in range(50):
            gaps = self.gaps(x)
            if np.abs(gaps).max() < 1e-15:
                break
            move[free] = np.linalg.lstsq(self.slopes(x)[:, free], gaps, rcond=ZERO)[0]
            move *= min(1.0, 0.3 / max(np.abs(move).max(), 1e-300))
            x = pinocchio.integrate(self.model, x, move)
        assert np.abs(gaps).max() < EXACT
        return x

    def led(self, q: Array) -> Array:
        """Closed configuration with the motors at q, in the assembly that start leads to."""
        x, ways = self.start, q - self.q(self.start)
        count = max(1, math.ceil(np.abs(ways).max() / 0.1))
        for _ in range(count):
            x = self.closed(pinocchio.integrate(self.model, x, self.gears @ ways / count))
        return x

    def speeds(self, x: Array, given: Array, free: NDArray[np.int64] | None = None) -> Array:
        """Joint velocities (nv, k) that keep the pins, with given ones on columns not free."""
        free, slopes, out = self.free if free is None else free, self.slopes(x), given.copy()
        out[free] -= np.linalg.lstsq(slopes[:, free], slopes @ given, rcond=ZERO)[0]
        assert np.abs(slopes @ out).max() < SOLVED
        return out

    def freedoms(self, x: Array, locked: ArrayLike = ()) -> int:
        """In how many ways the mechanism moves, some columns locked."""
        columns = np.setdiff1d(np.arange(self.model.nv), locked)
        values = np.linalg.svd(self.slopes(x)[:, columns], compute_uv=False)
        return len(columns) - int((values > ZERO * values[0]).sum())

    def tip(self, x: Array) -> Array:
        """Pose of the tip (4, 4)."""
        pinocchio.framesForwardKinematics(self.model, self.data, x)
        return self.data.oMf[self.tip_frame].homogeneous.copy()

    def tip_slopes(self, x: Array) -> Array:
        """Twist of the tip in base axes, linear first, per joint velocity (6, nv)."""
        axes = pinocchio.LOCAL_WORLD_ALIGNED
        return pinocchio.computeFrameJacobian(self.model, self.data, x, self.tip_frame, axes)


# -- mechanisms ----------------------------------------------------------------------------------


def add_legs(drawn: Mechanism, ground: int, body: int, base: Array, platform: Array) -> list[int]:
    """Six legs of a universal joint and a slide, pinned to a body: the slides."""
    slides = []
    for b, m in zip(base, platform, strict=True):
        hinge = drawn.add(ground, pinocchio.JointModelRX(), at(*b))
        hinge = drawn.add(hinge, pinocchio.JointModelRY())
        slides.append(drawn.add(hinge, pinocchio.JointModelPZ()))
        drawn.pin(slides[-1], (0, 0, 0), body, m)
    return slides


def raised(drawn: Any, slides: list[int], height: float) -> Mechanism:
    """Start with a level body on all its legs."""
    for slide in slides:
        drawn.start = drawn.put(drawn.start, slide, height)
    drawn.start = drawn.put(drawn.start, drawn.body, at(0, 0, height))
    drawn.legs = np.concatenate([drawn.columns(j - 2, j - 1, j) for j in slides])
    drawn.start = drawn.closed(drawn.start, drawn.legs)
    return drawn


def stewart(layout: Layout, height: float) -> Any:
    drawn = Mechanism()
    body = drawn.add(0, pinocchio.JointModelFreeFlyer())
    slides = add_legs(drawn, 0, body, layout.base, layout.platform)
    drawn.finish(slides, body)
    return raised(drawn, slides, height)


def hybrid(g: Mapping[str, float], heading: str) -> Any:
    """SCARA with six legs on its end, which a wrist keeps from turning or not."""
    drawn: Any = Mechanism()
    arm = [drawn.add(0, pinocchio.JointModelRZ(), at(0, 0, g["h1"]))]
    arm.append(drawn.add(arm[0], pinocchio.JointModelRZ(), at(g["l1"], 0, 0)))
    arm.append(drawn.add(arm[1], pinocchio.JointModelPZ(), at(g["l2"], 0, 0)))
    drawn.ground = arm[2]
    if heading == "fixed":
        drawn.ground = drawn.add(arm[2], pinocchio.JointModelRZ())
    body = drawn.add(drawn.ground, pinocchio.JointModelFreeFlyer())
    sign, sixths = np.array([1.0, -1.0] * 3), math.pi / 3.0 * np.arange(6)
    base, platform = (
        r * np.stack((np.cos(angles), np.sin(angles), 0.0 * angles), axis=1)
        for r, angles in ((g["r_b"], sixths - sign * g["sigma_b"]), (g["r_m"], sixths + sign * g["sigma_m"]))
    )
    slides = add_legs(drawn, drawn.ground, body, base, platform)
    drawn.finish([*arm, *slides], body, at(0, 0, g["e_eff"]))
    if heading == "fixed":
        drawn.gears[drawn.columns(drawn.ground), :2] = -1.0
    return raised(drawn, slides, g["w_z"])


def rps3(g: Mapping[str, float]) -> Mechanism:
    drawn = Mechanism()
    body, slides = drawn.add(0, pinocchio.JointModelFreeFlyer()), []
    for angle in THIRDS:
        out = np.array([math.cos(angle), math.sin(angle), 0.0])
        inward = SE3(pinocchio.exp3((angle + math.pi) * Z), g["b"] * out)
        hinge = drawn.add(0, pinocchio.JointModelRevoluteUnaligned(-Y), inward)
        slides.append(drawn.add(hinge, pinocchio.JointModelPX()))
        drawn.pin(slides[-1], (0, 0, 0), body, g["a"] * out)
    drawn.finish(slides, body)
    for slide in slides:
        drawn.start = drawn.put(drawn.start, slide, g["l_home"])
        drawn.start = drawn.put(drawn.start, slide - 1, 1.0)
    drawn.start = drawn.closed(drawn.put(drawn.start, body, at(0, 0, g["l_home"])))
    return drawn


def four_bar(l0: float, l1: float, l2: float, l3: float, a: float, mode: float) -> Mechanism:
    drawn = Mechanism()
    crank = drawn.add(0, pinocchio.JointModelRZ())
    coupler = drawn.add(crank, pinocchio.JointModelRZ(), at(l1, 0, 0))
    rocker = drawn.add(0, pinocchio.JointModelRZ(), at(l0, 0, 0))
    drawn.pin(coupler, (l2, 0, 0), rocker, (l3, 0, 0))
    drawn.finish([crank], coupler, at(a, 0, 0))
    for joint in (coupler, rocker):
        drawn.start = drawn.put(drawn.start, joint, mode * 1.0)
    drawn.start = drawn.closed(drawn.start)
    return drawn


def hand(g: Mapping[str, float]) -> Any:
    """Fingers of the hand pinned to the object; theta and psi are the motors."""
    drawn: Any = Mechanism()
    body, drawn.fingers = drawn.add(0, pinocchio.JointModelFreeFlyer()), []
    thumb = SE3(pinocchio.exp3(g["gamma"] * Y), np.zeros(3))
    places = (at(0, -g["d"], g["h"]), at(0, g["d"], g["h"]), thumb)
    for i, (place, angle) in enumerate(zip(places, THIRDS, strict=True), start=1):
        lift = SE3(pinocchio.exp3(math.pi / 2.0 * X), np.array([g[f"l{i}1"], 0.0, 0.0]))
        theta = drawn.add(0, pinocchio.JointModelRZ(), place)
        psi = drawn.add(theta, pinocchio.JointModelRZ(), lift)
        phi = drawn.add(psi, pinocchio.JointModelRZ(), at(g[f"l{i}2"], 0, 0))
        corner = g["side"] / math.sqrt(3.0) * np.array([math.cos(angle), math.sin(angle), 0.0])
        drawn.pin(phi, (g[f"l{i}3"], 0, 0), body, corner)
        drawn.fingers += [theta, psi, phi]
    drawn.finish([j for k, j in enumerate(drawn.fingers) if k % 3 < 2], body)
    return drawn


CASES = ("stewart", "rps3", "four_bar", "four_bar_crossed", "hybrid_fixed", "hybrid_carried")
IN_PAIRS = {"sigma_b": math.radians(15.0), "sigma_m": math.radians(15.0)}


@cache
def case(name: str) -> Any:
    """Robot with as many motors as freedoms of its loops (and arm), and its drawing."""
    kind, _, option = name.partition("_")
    if kind == "stewart":
        robot = load_robot("stewart")
        return robot, stewart(PAIRED, robot.geometry["z0"])
    if kind == "rps3":
        robot = load_robot("rps3")
        return robot, rps3(robot.geometry)
    if kind == "four":
        robot = load_robot("four_bar", mode=-1.0 if option.endswith("crossed") else 1.0)
        return robot, four_bar(**robot.geometry)
    robot = load_robot("scara_stewart", heading=option, **IN_PAIRS)
    return robot, hybrid(robot.geometry, option)


def assembled(name: str, count: int) -> Iterator[tuple[Array, Array]]:
    """Joint vectors, and configurations that pinocchio assembled with them."""
    robot, drawn = case(name)
    rng = np.random.default_rng(CASES.index(name))
    for _ in range(count):
        q = drawn.q(drawn.start) * rng.uniform(0.93, 1.07, robot.n)
        if robot.n == 1:
            q = rng.uniform(-math.pi, math.pi, 1)
        if robot.n == 9:
            q[:3] = rng.uniform([-2.5, -2.5, 0.0], [2.5, 2.5, 0.5])
        yield q, drawn.led(q)


# -- laws ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", CASES)
def test_direct_kinematics_is_the_pose_that_pinocchio_assembles(name: str) -> None:
    robot, drawn = case(name)
    for q, x in assembled(name, 20):
        assert np.abs(robot.fk(q) - drawn.tip(x)).max() < SOLVED


@pytest.mark.parametrize("name", CASES)
def test_jacobian_is_how_the_pinned_loops_move(name: str) -> None:
    robot, drawn = case(name)
    for q, x in assembled(name, 20):
        moves = drawn.tip_slopes(x) @ drawn.speeds(x, drawn.gears)
        assert np.abs(robot.jacobian(q) - moves).max() < SOLVED * max(1.0, np.abs(moves).max())


@pytest.mark.parametrize("name", CASES[:4])
def test_inverse_kinematics_gives_the_motors_of_an_assembled_pose_back(name: str) -> None:
    robot, drawn = case(name)
    for q, x in assembled(name, 20):
        result = robot.ik(drawn.tip(x), seed=q + 0.01)
        assert np.abs(result.q - q).max() < SOLVED


# Links, joints and freedoms of the joints, as the lecture counts them; the hybrid's arm adds three.
COUNTS = {
    "stewart": (14, 18, 36, SPATIAL),
    "rps3": (8, 9, 15, SPATIAL),
    "four_bar": (4, 4, 4, PLANAR),
    "hybrid_carried": (17, 21, 39, SPATIAL),
}


@pytest.mark.parametrize("name", COUNTS)
def test_pinned_loops_have_the_counted_mobility_and_the_motors_hold_them(name: str) -> None:
    (robot, drawn), (links, joints, freedoms, space) = case(name), COUNTS[name]
    for _, x in assembled(name, 5):
        counted = degrees_of_freedom(links, joints, freedoms, space=space)
        assert drawn.freedoms(x) == counted == robot.n
        assert drawn.freedoms(x, drawn.columns(*drawn.motors)) == 0


# -- legs ----------------------------------------------------------------------------------------

SIXTHS: Any = math.pi / 3.0 * np.arange(6)
HEXAGONS = Layout.circular(0.2, SIXTHS, 0.1, SIXTHS)


def scattered() -> Layout:
    rng = np.random.default_rng(11)
    flat = np.array([1.0, 1.0, 0.2])
    return Layout(0.2 * flat * rng.normal(size=(6, 3)), 0.1 * flat * rng.normal(size=(6, 3)))


LAYOUTS = {"pairs": PAIRED, "hexagons": HEXAGONS, "scattered": scattered()}


def platform_poses(seed: int, count: int, tilt: float = 0.6) -> Iterator[SE3]:
    rng = np.random.default_rng(seed)
    for _ in range(count):
        turn = pinocchio.rpy.rpyToMatrix(*rng.uniform(-tilt, tilt, 3))
        yield SE3(turn, rng.uniform([-0.05, -0.05, 0.15], [0.05, 0.05, 0.25]))


@pytest.mark.parametrize("name", LAYOUTS)
def test_legs_and_leg_jacobian_are_those_of_a_platform_pinned_to_slides(name: str) -> None:
    layout = LAYOUTS[name]
    drawn = stewart(layout, 0.2)
    for T in platform_poses(1, 20):
        x = drawn.closed(drawn.put(drawn.start, drawn.body, T), drawn.legs)
        assert np.abs(layout.legs(T.homogeneous) - drawn.q(x)).max() < EXACT
        # Twists of the body in base axes; a free body's own are along its axes.
        given = np.zeros((drawn.model.nv, 6))
        given[drawn.columns(drawn.body)] = np.kron(np.eye(2), T.rotation.T)
        slides = drawn.speeds(x, given, drawn.legs)[drawn.columns(*drawn.motors)]
        assert np.abs(layout.leg_jacobian(T.homogeneous) - slides).max() < SOLVED


def test_only_the_published_hexagons_move_with_all_slides_locked() -> None:
    for name, layout in LAYOUTS.items():
        drawn = stewart(layout, 0.2)
        for T in platform_poses(2, 10):
            x = drawn.closed(drawn.put(drawn.start, drawn.body, T), drawn.legs)
            still_moves = drawn.freedoms(x, drawn.columns(*drawn.motors))
            assert still_moves == (1 if name == "hexagons" else 0) == 6 - layout.rank(T.homogeneous)


# -- hybrid --------------------------------------------------------------------------------------

HYBRIDS = [(heading, sigmas) for heading in ("fixed", "carried") for sigmas in ({}, IN_PAIRS)]


def tool_poses(count: int) -> Iterator[SE3]:
    """Poses with tilts that the ball joints allow, in the ring that the arm reaches."""
    rng = np.random.default_rng(21)
    for _ in range(count):
        turn = pinocchio.rpy.rpyToMatrix(*rng.uniform(-0.5, 0.5, 2), rng.uniform(-1.0, 1.0))
        radius, angle = rng.uniform(0.3, 0.8), rng.uniform(-math.pi, math.pi)
        place = np.array([radius * math.cos(angle), radius * math.sin(angle), 0.5])
        yield SE3(turn, place)


def held(robot: Robot, drawn: Any, T: SE3) -> Iterator[tuple[Array, SE3, Array]]:
    """Solutions for a tool pose, and configurations with their arm that hold the tool there."""
    tool = at(0, 0, robot.geometry["e_eff"])
    for q in robot.ik_all(T.homogeneous):
        ways = np.concatenate((q[:3] - drawn.q(drawn.start)[:3], np.zeros(6)))
        x = pinocchio.integrate(drawn.model, drawn.start, drawn.gears @ ways)
        pinocchio.forwardKinematics(drawn.model, drawn.data, x)
        platform = drawn.data.oMi[drawn.ground].actInv(T * tool.inverse())
        yield q, platform, drawn.closed(drawn.put(x, drawn.body, platform), drawn.legs)


@pytest.mark.parametrize(("heading", "sigmas"), HYBRIDS)
def test_both_elbows_of_the_hybrid_hold_the_platforms_centre_on_the_legs_they_name(
    heading: str, sigmas: dict[str, float]
) -> None:
    robot = load_robot("scara_stewart", heading=heading, **sigmas)
    drawn, count = hybrid(robot.geometry, heading), 0
    for T in tool_poses(10):
        for q, platform, x in held(robot, drawn, T):
            assert np.abs(platform.translation - robot.geometry["w_z"] * Z).max() < EXACT
            assert np.abs(drawn.q(x) - q).max() < EXACT
            assert np.abs(drawn.tip(x) - T.homogeneous).max() < EXACT
            count += 1
    assert count == 20


@pytest.mark.parametrize(("heading", "sigmas"), HYBRIDS)
def test_hybrid_jacobian_is_right_for_moves_that_hold_the_platforms_centre(
    heading: str, sigmas: dict[str, float]
) -> None:
    robot = load_robot("scara_stewart", heading=heading, **sigmas)
    drawn = hybrid(robot.geometry, heading)
    turns = np.zeros((drawn.model.nv, 3))
    turns[drawn.columns(drawn.body)[3:]] = np.eye(3)
    given = np.hstack((drawn.gears[:, :3], turns))
    for T in tool_poses(10):
        for q, _, x in held(robot, drawn, T):
            moves = drawn.speeds(x, given, drawn.legs)
            motors = moves[drawn.columns(*drawn.motors)]
            wanted = drawn.tip_slopes(x) @ moves
            assert np.abs(robot.jacobian(q) @ motors - wanted).max() < SOLVED


# -- 3-RPS ---------------------------------------------------------------------------------------


def test_every_assembly_mode_of_the_3rps_closes_its_pins() -> None:
    robot, drawn = case("rps3")
    rng, found = np.random.default_rng(31), 0
    for _ in range(20):
        lengths = robot.home * rng.uniform(0.7, 1.3, 3)
        modes = assembly_modes(lengths, b=robot.geometry["b"], a=robot.geometry["a"])
        for angles, T in zip(modes.angles, modes.transforms, strict=True):
            x = drawn.put(drawn.start, drawn.body, SE3(T))
            for slide, length, angle in zip(drawn.motors, lengths, angles, strict=True):
                x = drawn.put(drawn.put(x, slide, length), slide - 1, angle)
            assert np.abs(drawn.gaps(x)).max() < SOLVED
            found += 1
    assert found > 80


def test_pins_leave_the_3rps_its_height_and_normal_and_legs_answer_to_these_alone() -> None:
    robot, drawn = case("rps3")
    for q, x in assembled("rps3", 20):
        elsewhere = at(0.03, -0.02, 0) * SE3(drawn.tip(x)) * SE3(pinocchio.exp3(0.3 * Z), 0.0 * Z)
        assert np.abs(robot.ik(elsewhere.homogeneous).q - q).max() < SOLVED


# -- four-bar and parallelogram ------------------------------------------------------------------


def test_closure_angles_close_a_chain_of_three_joints_pinned_to_the_ground() -> None:
    rng, closed = np.random.default_rng(41), 0
    for _ in range(200):
        l0, l1, l2, l3 = lengths = rng.uniform(0.5, 4.0, 4)
        theta1 = rng.uniform(-math.pi, math.pi)
        status, phi1, phi2, phi3 = FourBar(*lengths).close(theta1)
        if status != 0:
            continue
        drawn, parent = Mechanism(), 0
        for place in (at(0, 0, 0), at(l1, 0, 0), at(l2, 0, 0)):
            parent = drawn.add(parent, pinocchio.JointModelRZ(), place)
        drawn.pin(parent, (l3, 0, 0), 0, (l0, 0, 0))
        drawn.finish([1], parent)
        for mode in range(2):
            x = np.array([theta1, phi2[mode], phi3[mode]])
            # Where the rocker hardly moves, rounding of the squares shows as its root.
            assert np.abs(drawn.gaps(x)).max() < SOLVED
            rocker = drawn.tip(x)[:2, 0]
            link = np.array([math.cos(phi1[mode]), math.sin(phi1[mode])])
            assert np.abs(rocker + link).max() < SOLVED
            closed += 1
    assert closed > 200


def parallelogram(theta: float) -> tuple[Robot, Mechanism, Array]:
    robot = load_robot("parallelogram")
    l0, l1, a = (robot.geometry[symbol] for symbol in ("l0", "l1", "a"))
    drawn = four_bar(l0, l1, l0, l1, a, 1.0)
    return robot, drawn, np.array([theta, -theta, theta])


@pytest.mark.parametrize("theta", [-3.0, -1.7, -0.2, 0.4, 1.2, 2.9])
def test_parallelogram_is_the_four_bar_whose_coupler_does_not_turn(theta: float) -> None:
    robot, drawn, x = parallelogram(theta)
    assert np.abs(drawn.gaps(x)).max() < EXACT
    assert drawn.freedoms(x) == 1
    moves = drawn.tip_slopes(x) @ drawn.speeds(x, drawn.gears)
    assert np.abs(robot.jacobian([theta]) - moves).max() < SOLVED
    result = robot.ik(drawn.tip(x), seed=[theta + 0.1])
    assert result.status == IkStatus.FOLLOWED
    assert abs(result.q[0] - theta) < EXACT
    assert np.abs(robot.fk([theta]) - drawn.tip(x)).max() < EXACT


@pytest.mark.parametrize("theta", [0.0, math.pi])
def test_where_all_links_are_in_line_the_parallelogram_takes_one_of_two_motions(theta: float) -> None:
    robot, drawn, x = parallelogram(theta)
    assert drawn.freedoms(x) == 2
    parallel = np.array([[1.0], [-1.0], [1.0]])
    assert np.abs(drawn.slopes(x) @ parallel).max() < EXACT
    assert np.abs(drawn.tip_slopes(x) @ parallel - robot.jacobian([theta])).max() < EXACT


# -- hand ----------------------------------------------------------------------------------------


@cache
def grasp() -> Any:
    """Hand with unequal fingers that holds its object at home, and its drawing."""
    robot = load_robot("three_finger_hand", l11=0.028, l22=0.052, l23=0.041, l33=0.043)
    drawn = hand(robot.geometry)
    for joint, angle in zip(drawn.fingers, robot.home, strict=True):
        drawn.start = drawn.put(drawn.start, joint, angle)
    drawn.start = drawn.closed(drawn.start, drawn.columns(drawn.body))
    return robot, drawn


def grasps(count: int) -> Iterator[tuple[Array, Array]]:
    """Object poses beside home, and the grasps that pinocchio moves its fingers to."""
    _, drawn = grasp()
    rng, home = np.random.default_rng(51), SE3(drawn.tip(drawn.start))
    for _ in range(count):
        shift = SE3(pinocchio.exp3(rng.uniform(-0.3, 0.3, 3)), rng.uniform(-0.01, 0.01, 3))
        T = home * shift
        x = drawn.put(drawn.start, drawn.body, T)
        yield T.homogeneous, drawn.closed(x, drawn.columns(*drawn.fingers))


def test_fingers_follow_the_object_with_the_joints_of_inverse_kinematics() -> None:
    robot, drawn = grasp()
    for T, x in grasps(30):
        q = drawn.q(x, drawn.fingers)
        assert np.abs(robot.ik(T).q - q).max() < SOLVED
        assert np.abs(robot.fk(q) - drawn.tip(x)).max() < SOLVED


def test_every_branch_of_the_fingers_holds_the_pins_of_the_object() -> None:
    robot, drawn = grasp()
    for T, x in grasps(10):
        solutions = robot.ik_all(T)
        assert len(solutions) >= 8
        for q in solutions:
            bent = x
            for joint, angle in zip(drawn.fingers, q, strict=True):
                bent = drawn.put(bent, joint, angle)
            assert np.abs(drawn.gaps(bent)).max() < EXACT


def test_hand_jacobian_is_right_for_moves_that_hold_the_object() -> None:
    robot, drawn = grasp()
    fingers, body = drawn.columns(*drawn.fingers), drawn.columns(drawn.body)
    given = np.zeros((drawn.model.nv, 6))
    given[body] = np.eye(6)
    for _, x in grasps(20):
        assert drawn.freedoms(x) == degrees_of_freedom(11, 12, 18)
        moves = drawn.speeds(x, given, fingers)
        wanted = drawn.tip_slopes(x) @ moves
        jacobian = robot.jacobian(drawn.q(x, drawn.fingers))
        assert np.abs(jacobian @ moves[fingers] - wanted).max() < SOLVED


def test_third_joints_that_hold_the_object_are_those_that_the_pins_leave() -> None:
    robot, drawn = grasp()
    rng, answers = np.random.default_rng(52), Hand(robot.geometry)
    for _, x in grasps(30):
        assert drawn.freedoms(x, drawn.columns(*drawn.motors)) == 0
        q = drawn.q(x, drawn.fingers)
        result = answers.hold(drawn.q(x).reshape(3, 2), q[2::3] + rng.uniform(-0.02, 0.02, 3))
        assert result.status == Grasp.HELD
        assert np.abs(result.q - q).max() < SOLVED
