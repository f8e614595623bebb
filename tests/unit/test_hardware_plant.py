"""Plants by name: what the hardware does beside its model, each fault alone, and mistakes."""

import math
from typing import Any

import numpy as np
import pytest

from present import present
from random_arms import standard_link
from teleop_core.base import errors
from teleop_core.base.parameters import MARKS, NoParameters, build, parameter, specs
from teleop_core.graph.signals import TICK_NS
from teleop_core.robots import hardware, load_robot
from teleop_core.robots.robot import Robot
from teleop_core.slave import pair
from teleop_core.slave.plants import PLANTS, Physics, Plant, register_plant
from teleop_core.slave.plants.hardware import FAULTS, HARDWARE, faults_of
from teleop_lab.fitting.rests import Mover

ARM = load_robot("rcrt1")
TARGET = ARM.home + np.array([0.5, -0.4, -0.04, 0.6, 0.5, 0.4])


def slave(plant: str = "hardware", controller: str = "source_pid", **settings: Any) -> pair.ArmParameters:
    given = {"plant.kind": plant, "controller.kind": controller}
    return build(pair.ArmParameters, given | settings)


def rest(*without: str, **settings: Any) -> Any:
    """Mover after a move to the target, and the encoders' rest less the target (6,)."""
    mover = Mover(slave(**dict[str, Any]({"plant.hardware.without": without}), **settings))
    return mover, mover.move(TARGET) - TARGET


def test_without_any_fault_the_hardware_is_the_ideal_plant_without_friction() -> None:
    none = slave(**dict[str, Any]({"plant.hardware.without": tuple(FAULTS)}))
    ideal = slave("ideal", coulomb=(0.0,) * 6)
    rests: Any = [Mover(parameters).move(TARGET) for parameters in (none, ideal)]
    assert np.array_equal(*rests)


def test_dry_friction_stops_a_joint_short_by_its_size_over_kp() -> None:
    mover, off = rest("wandering", "bias", "weights", "drive_steps")
    kp = mover.slave.simulated.arm.gains[:, 0]
    short = faults_of(ARM).coulomb / kp
    towards = np.sign(ARM.home - TARGET)
    step = present(ARM.drives).encoder_step
    for joint in (0, 1, 3, 4, 5):  # an integrator brings d3 there
        assert abs(off[joint] - towards[joint] * short[joint]) < 2.5 * step[joint], joint
    assert abs(off[2]) < 3 * step[2]


def test_bias_and_weight_push_a_joint_without_friction_off_by_their_size_over_kp() -> None:
    mover, off = rest("wandering", "friction", "drive_steps")
    kp, faults = mover.slave.simulated.arm.gains[:, 0], faults_of(ARM)
    gravity = np.zeros(6)
    present(ARM.dynamics).gravity(TARGET, faults.dynamics.copy(), gravity)
    known = np.zeros(6)
    present(ARM.dynamics).gravity(TARGET, present(ARM.dynamics).parameters.copy(), known)
    expected = (faults.bias - (gravity - known)) / kp
    step = present(ARM.drives).encoder_step
    assert np.abs(off - expected)[[0, 1, 3, 4, 5]].max() < 2 * step.max()
    assert abs(off[1]) > 10 * step[1]  # the weight is felt


@pytest.mark.parametrize("law", ["pid", "friction_compensation", "adaptive"])
def test_a_law_that_can_hold_bias_and_weight_begins_in_balance(law: str) -> None:
    # Without friction whatever is not held moves axis 1, of the bias, or 2, of the weight, at once.
    made = pair.SimulatedArm(slave(
        controller=law, starts_at_home=True,
        **dict[str, Any]({"plant.hardware.without": ("friction", "wandering")}),
    ))  # fmt: skip
    for tick in range(1, 301):
        made.signals["now_ns"] = tick * TICK_NS
        made.step()
        off = np.abs(made.simulated.arm.q - ARM.home)[:2]
        assert (off < 1.5 * present(ARM.drives).encoder_step[:2]).all(), tick


def test_encoders_see_nothing_that_lies_behind_them() -> None:
    rests = [rest(*without)[1] for without in ((), ("play", "links"))]
    assert np.array_equal(*rests)


def test_true_tip_is_that_of_the_arm_as_built_behind_its_play() -> None:
    mover, _ = rest()
    faults, s = faults_of(ARM), mover.slave.simulated.state
    encoders = mover.slave.simulated.arm.q
    lag = encoders - s["carried"]
    assert np.abs(lag[:4]).max() < 1e-5  # what a joint hunts in the tick since
    assert abs(abs(lag[4]) - faults.play[4]) < 1e-5
    assert abs(lag[5]) <= faults.play[5] + faults.play[4] + 1e-5
    # Of a Denavit-Hartenberg chain written here, with the errors in its table.
    table = np.zeros((6, 4))  # a, alpha, d, theta
    table[:, 1] = np.array([-1.0, 1.0, 0.0, -1.0, 1.0, 0.0]) * math.pi / 2
    table[5, 2] = 0.037
    table += present(faults.links).vector.reshape(4, 6).T
    q, T = s["carried"], np.eye(4)
    for i, row in enumerate(table):
        a, alpha, d, theta = row + q[i] * np.eye(4)[2 if i == 2 else 3]
        T = T @ standard_link(theta, d, a, alpha)
    # The tip was seen at the start of the last tick, at rest.
    assert np.linalg.norm(mover.true_pose()[:3] - T[:3, 3]) < 1e-9


def test_drives_give_efforts_in_steps_of_their_converter() -> None:
    mover = Mover(slave(**dict[str, Any]({"plant.hardware.drive_bits": 8})))
    mover.move(TARGET)
    step = 2.0 * present(ARM.drives).effort_limit / 256
    effort = mover.slave.simulated.arm.effort - faults_of(ARM).bias
    assert np.abs(effort / step - np.round(effort / step)).max() < 1e-9


@pytest.mark.parametrize("fault", FAULTS)
def test_every_fault_can_be_left_out_alone(fault: str) -> None:
    parameters = slave(**dict[str, Any]({"plant.hardware.without": (fault,)}))
    kind = parameters.plant.kind
    with_it = HARDWARE.physics(slave().plant.kind.parameters, ARM)
    without = HARDWARE.physics(kind.parameters, ARM)
    differ = {name for name in vars(with_it) if not np.array_equal(getattr(with_it, name), getattr(without, name))}
    expected = {
        "friction": {"coulomb"}, "sticking": {"bristle"}, "wandering": {"wander"},
        "bias": {"bias"}, "weights": {"dynamics"}, "drive_steps": {"effort_step"},
        "play": {"play", "coupling"}, "links": {"tip_geometry"},
    }  # fmt: skip
    assert differ == expected[fault]


def test_every_number_of_the_hardware_says_how_it_is_known() -> None:
    assert set(faults_of(ARM).sources) == set(hardware.ENTRIES)
    for text in faults_of(ARM).sources.values():
        assert text.partition(":")[0] in MARKS
    numbers = [spec for spec in specs(HARDWARE.parameters) if spec.kind in {float, int}]
    assert all(spec.source for spec in numbers)
    with pytest.raises(errors.ParameterError, match="published"):
        parameter(1.0, doc="", source="my own measurement")


def test_another_robot_sticks_by_its_drive_table_and_is_made_as_drawn() -> None:
    made = pair.SimulatedArm(build(pair.ArmParameters, {"robot": "puma560", "plant.kind": "hardware"}))
    robot = made.robot
    assert np.array_equal(made.simulated.parameters["coulomb"], present(robot.drives).coulomb)
    assert (made.simulated.parameters["bristle"] > 0.0).all()
    assert np.array_equal(made.simulated.arm.tip_geometry, robot.geometry_row)


def test_a_plant_of_ones_own_moves_the_slave() -> None:
    def physics(parameters: NoParameters, robot: Robot) -> Physics:
        made = PLANTS.find("ideal").physics(None, robot)
        return type(made)(**(vars(made) | {"bias": 0.5 * np.eye(robot.n)[0]}))

    plant = register_plant(Plant("leaning", PLANTS.find("ideal").parameters, physics))
    try:
        off = Mover(slave("leaning")).move(TARGET) - TARGET
        assert off[0] > 5e-4
    finally:
        PLANTS.remove(plant.name)


@pytest.mark.parametrize(
    ("plant", "needed"),
    [
        ("no plant", "a Plant"),
        (Plant("bad", int, lambda p, r: None), "dataclass"),  # type: ignore[arg-type, return-value]
        (Plant("bad", HARDWARE.parameters, lambda p, r: None), "gives Physics"),  # type: ignore[arg-type, return-value]
        (Plant("bad", HARDWARE.parameters, lambda p, r: 1 / 0), "ZeroDivisionError"),  # type: ignore[arg-type, return-value]
    ],
)
def test_what_is_no_plant_is_refused_with_the_reason(plant: str | Plant, needed: str) -> None:
    with pytest.raises(errors.PartError, match=needed):
        PLANTS.add("bad", plant)
    assert "bad" not in PLANTS.names()
