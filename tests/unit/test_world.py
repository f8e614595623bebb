"""World: the push of a contact, and its energy."""

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

import teleop_core as tc
from present import present
from teleop_core.base.errors import ParameterError
from teleop_core.graph.topics import SLAVE_TRUE_CF
from teleop_core.kernels.geometry import Array
from teleop_core.robots import load_robot
from teleop_core.session import configuration, virtual
from teleop_core.slave.slave_sim import SlaveSim
from teleop_core.slave.world.contents import MATERIALS

BLOCK = [0.241, -0.236, -0.087]
"""Middle of the block that the scenario ``palpation`` presses, whose top is at -0.072."""


def pressed(*texts: str, ticks: int = 20_000, seconds: float = 12.0) -> NDArray[np.void]:
    """Signals of the scenario ``palpation`` from ``seconds`` on."""
    session = virtual.VirtualTime(configuration.configure("palpation", settings=list(texts)))
    return session.run(ticks)[round(1e3 * seconds) :]


def test_the_push_is_stiffness_times_depth_where_the_tip_is_truly() -> None:
    rows = pressed("reflection.architecture=unilateral", "world.damping=0", "world.material=own")
    depth = BLOCK[2] + 0.015 - rows["slave_true_cp"][:, 2]
    push = rows["slave_measured_cf"]
    assert depth.max() > 5e-3
    np.testing.assert_allclose(push[:, 2], np.maximum(1000.0 * depth, 0.0), atol=1e-9)
    assert np.all(np.hypot(push[:, 0], push[:, 1]) <= 0.3 * push[:, 2] + 1e-9)
    assert not push[:, 3:].any()


def after_a_tick(robot: tc.Robot, joints: Array, texts: list[str], plant: str = "ideal") -> tuple[Array, Array]:
    """Speeds (n,) that an arm at rest has after a tick, and what its tip felt at its begin (3,)."""
    zero = [0.0] * robot.n
    settings = [f"robot={robot.name}", f"plant={plant}", f"slave_sim.coulomb={zero}", *texts]
    arm = SlaveSim(configuration.configure("free_motion", settings=settings).group("slave_sim"))
    arm.arm.q[:] = arm.state["link"] = arm.state["carried"] = joints
    arm.signals["slave_setpoint_js"] = joints
    arm.step()
    return arm.arm.dq.copy(), arm.signals["slave_measured_cf"][:3].copy()


@pytest.mark.parametrize("name", ["rcrt1", "puma560", "planar_3r", "rps3", "stewart"])
def test_every_arm_is_accelerated_by_the_transposed_jacobian_of_the_push(name: str) -> None:
    robot = load_robot(name)
    J = robot.jacobian(robot.start)[:3]
    way = J @ J.T @ np.array([0.3, 0.5, -0.8])  # one that the arm can go
    way /= np.linalg.norm(way)
    pressed = robot.start + 1e-3 * np.linalg.pinv(J) @ way
    ball = robot.fk(robot.start)[:3, 3] + 0.0052 * way  # its surface is 0.2 mm ahead of the start
    texts = [
        "world=sphere",
        f"world.place={ball.tolist()}",
        "world.sphere.radius=0.005",
        "world.material=own",
        "world.stiffness=500.0",
    ]
    free, _ = after_a_tick(robot, pressed, [])
    pushed, force = after_a_tick(robot, pressed, texts)
    assert force @ way == pytest.approx(-0.4, rel=0.05)
    found = [np.zeros(robot.n), np.zeros(robot.n)]
    effort = robot.jacobian(pressed)[:3].T @ force
    for net, ddq in zip((np.zeros(robot.n), effort), found, strict=True):
        model = present(robot.dynamics)
        model.acceleration(pressed.copy(), np.zeros(robot.n), net, model.parameters.copy(), ddq)
    wanted = 1e-3 * (found[1] - found[0])
    np.testing.assert_allclose(pushed - free, wanted, atol=0.07 * np.abs(wanted).max())


def test_the_plant_that_is_the_machine_feels_the_push_behind_its_gears() -> None:
    robot = load_robot("rcrt1")
    center = (robot.fk(robot.start)[:3, 3] - [0.0, 0.0, 0.0155]).tolist()
    down = robot.start + 1e-3 * np.linalg.pinv(robot.jacobian(robot.start)[:3])[:, 2] * -2.0
    texts = ["world=box", f"world.place={center}"]
    (free, _), (pushed, force) = (after_a_tick(robot, down, more, "hardware") for more in ([], texts))
    assert force[2] > 0.05
    assert np.abs(pushed - free).max() > 1e-9


def test_a_surface_that_is_left_fast_does_not_pull() -> None:
    sticky = ("world.material=own", "world.damping=100.0", "reflection.architecture=unilateral")
    rows = pressed(*sticky)
    push, tip = rows["slave_measured_cf"], rows["slave_true_cp"]
    is_leaving = (tip[1:, 2] - tip[:-1, 2] > 1.2e-5) & (tip[1:, 2] < BLOCK[2] + 0.0145)
    assert is_leaving.sum() > 20
    assert not push[1:][is_leaving].any()
    assert push[:, 2].min() == 0.0


@pytest.mark.parametrize("material", MATERIALS)
def test_a_contact_gives_back_no_more_than_it_took(material: str) -> None:
    """Of the work of the push on the tip, from a moment without touch on."""
    top = -0.0801 + 4.0 / MATERIALS[material].stiffness  # pressed with some 4 N
    place = f"world.place={[*BLOCK[:2], top - 0.015]}"
    rows = pressed(f"world.material={material}", place, "reflection.architecture=unilateral", seconds=10.0)
    force, tip = rows["slave_measured_cf"][:, :3], rows["slave_true_cp"][:, :3]
    assert not force[0].any()
    assert 2.0 < force[:, 2].max() < 8.0
    ways = np.diff(tip, axis=0)
    power = np.einsum("ij,ij->i", 0.5 * (force[1:] + force[:-1]), ways)
    given = np.cumsum(power)  # of the block to the tip
    assert given.min() < -1e-5
    assert given.max() <= 1e-3 * np.abs(power).sum()


def test_dry_friction_holds_a_tip_that_is_dragged_less_than_it_carries() -> None:
    texts = (
        "world.material=own",
        "world.stiffness=1000.0",
        "reflection.architecture=unilateral",
        "operator.kind=circle",
        "operator.size=[0.004,0.0,0.004]",
        "operator.center=[0.0,-0.04,0.04]",
    )
    slips = {}
    for friction in (0.0, 2.0):
        rows = pressed(f"world.friction_coefficient={friction}", *texts)
        force = rows["slave_measured_cf"]
        across = np.hypot(force[:, 0], force[:, 1])
        slips[friction] = np.median(across / force[:, 2])
    assert slips[0.0] == 0.0
    assert 0.05 < slips[2.0] < 2.0


def test_an_object_that_the_tip_begins_in_is_refused_with_its_depth() -> None:
    table, wall = ["world=plane"], ["world=plane", "world.plane.normal=[1.0,0.0,0.0]"]
    with pytest.raises(ParameterError, match="mm inside"):
        virtual.VirtualTime(configuration.configure("free_motion", settings=table))
    with pytest.raises(ParameterError, match="cannot lie straight below"):
        virtual.VirtualTime(configuration.configure("free_motion", settings=wall))
    with pytest.raises(ParameterError, match="x, y, z, or empty"):
        configuration.configure("free_motion", settings=["world=box", "world.place=[0.1,0.2]"])
    with pytest.raises(ParameterError, match="given for scara_stewart"):
        virtual.VirtualTime(configuration.configure("free_motion", settings=["world=box", "robot=scara_stewart"]))
    with pytest.raises(ParameterError, match="a direction"):
        configuration.configure("free_motion", settings=["world=plane", "world.plane.normal=[0.0,0.0,0.0]"])


def test_the_hand_feels_the_push_along_its_own_axes_and_no_more_than_asked() -> None:
    rows = pressed(
        "world.stiffness=2000.0",
        "world.material=own",
        "reflection.max_force=1.0",
        "position_force.force_gain=0.5",
        "reach_force.is_on=false",
    )
    push, force = rows["slave_measured_cf"][:-1], rows["master_servo_cf"][1:]
    asked = 0.5 * np.column_stack((-push[:, 1], push[:, 2], -push[:, 0]))
    length = np.linalg.norm(asked, axis=1, keepdims=True)
    assert length.max() > 1.0
    np.testing.assert_allclose(force[:, :3], asked / np.maximum(length, 1.0), atol=1e-12)


def swing(stiffness: float, delay: float, passivity: str = "none") -> float:
    """Fastest that the hand gets [m/s] where it presses a block whose force comes late."""
    texts = [
        "world.material=own",
        f"world.stiffness={stiffness}",
        "world.damping=0.0",
        "world.friction_coefficient=0.0",
        "reflection.max_force=10.0",
        "feedback_timeout=1.0",
        f"reflection.passivity={passivity}",
        f"delays=[slave/measured_cf@motion_scaling={delay}]",
    ]
    places = pressed(*texts)["master_measured_cp"][:, :3]
    return np.linalg.norm(places[20:] - places[:-20], axis=1).max() / 0.02


def test_late_force_of_something_stiff_throws_the_hand_and_that_of_tissue_never_does() -> None:
    calm = swing(200.0, 0.001)
    assert all(swing(200.0, delay) < 1.1 * calm for delay in (0.05, 0.1, 0.3))
    assert all(swing(20_000.0, delay) > 3.0 * calm for delay in (0.02, 0.1))


def test_a_tank_keeps_late_force_of_something_stiff_from_throwing_the_hand() -> None:
    calm = swing(200.0, 0.001)
    for stiffness in (1000.0, 20_000.0):
        assert all(swing(stiffness, delay, "tank") < 2.0 * calm for delay in (0.001, 0.02, 0.1, 0.3))


def test_with_a_tank_no_touch_gives_back_more_than_it_took_and_pressing_feels_the_same() -> None:
    """By the account that the device keeps of its true motion."""
    scores = {}
    for passivity in ("none", "tank"):
        texts = {"reflection.passivity": passivity, "haptic_master.device.gimbal_noise": 0.0}
        scores[passivity] = tc.run("palpation", duration=16.0, settings=texts).score()
    returned = {name: score.value("contact.returned_max") for name, score in scores.items()}
    assert present(returned["none"]) > 1.5
    assert present(returned["tank"]) <= 1.02
    largest = {name: score.value("force_n.max") for name, score in scores.items()}
    assert largest["tank"] == pytest.approx(largest["none"], rel=0.05)


@settings(max_examples=6, deadline=None, derandomize=True)
@given(
    stiffness=st.floats(100.0, 50_000.0),
    delay=st.sampled_from([0.001, 0.02, 0.1, 0.35]),
    gain=st.floats(0.3, 5.0),
    kind=st.sampled_from(["line", "human", "circle"]),
)
def test_a_tank_is_passive_but_for_a_step_of_the_reading_whatever_is_touched(
    stiffness: float, delay: float, gain: float, kind: str
) -> None:
    """By what the tank can know: forces that were asked for, and places that were read."""
    rows = pressed(
        "reflection.passivity=tank",
        f"reflection.position_force.force_gain={gain}",
        "world.damping=0.0",
        "world.material=own",
        f"world.stiffness={stiffness}",
        "reach_force.is_on=false",
        f"delays=[slave/measured_cf@motion_scaling={delay}]",
        "feedback_timeout=1.0",
        f"operator.kind={kind}",
        seconds=3.0,
    )
    force: Any
    force, place = rows["master_servo_cf"][:-1, :3], rows["master_measured_cp"][:, :3]
    steps = np.diff(place, axis=0)
    # On the hand, but for the 5 mN that an empty tank allows.
    work = np.einsum("ij,ij->i", force, steps) - 0.005 * np.linalg.norm(steps, axis=1)
    largest = total = 0.0
    for step, pushes in zip(work.tolist(), force.any(axis=1).tolist(), strict=True):
        total = total + step if pushes else 0.0
        largest = max(largest, total)
    # The largest force over one step of the reading, which nobody sees in between.
    assert largest < 3.3 * 55e-6


def test_force_that_falls_silent_fades_within_a_tenth_of_a_second() -> None:
    session = virtual.VirtualTime(configuration.configure("palpation", settings=["feedback_timeout=0.05"]))
    stage = session.stages["motion_scaling"]
    row = stage.signals
    session.run(15_800)
    assert row["master_servo_cf"][1] > 0.5
    heard, pose_ns = int(row["slave_measured_cf_ns"]), int(row["master_measured_cp_ns"])
    pushes = []
    for tick in range(1, 201):
        row["master_measured_cp_ns"] = pose_ns + tick * 1_000_000
        row["slave_measured_cf_ns"] = heard
        stage.step()
        pushes.append(row["master_servo_cf"][1])
    steps = np.abs(np.diff(pushes))
    assert pushes[-1] == 0.0
    assert steps.max() < 0.02 * pushes[0]


def test_an_object_that_is_seen_from_another_base_is_the_same_object() -> None:
    base, place = [0.03, -0.02, 0.01], [0.03 + BLOCK[0], -0.02 + BLOCK[1], 0.01 + BLOCK[2]]
    own = pressed(ticks=13_000)
    moved = pressed(f"world.place={place}", f"world.base={base}", ticks=13_000)
    assert own["slave_true_cf"][:, 2].max() > 0.3
    np.testing.assert_allclose(moved["slave_true_cf"], own["slave_true_cf"], atol=1e-6)


def test_two_arms_touch_one_object_each_from_its_own_base() -> None:
    rows = pressed("teleop.arms=[right, left]", f"left/world.base={[0.0, 0.0, 0.004]}", ticks=13_000)
    low, high = (rows[SLAVE_TRUE_CF.of_arm(arm).field][:, 2].max() for arm in ("", "left"))
    assert 0.0 < high < low  # the base of the left one is 4 mm higher, so its tip is less deep
