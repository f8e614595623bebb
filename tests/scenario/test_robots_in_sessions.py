"""Every robot in the whole graph: as slave, as master's handle, with options, in virtual time."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from present import present
from teleop_core.bags.reader import Bag
from teleop_core.graph import topics
from teleop_core.robots import list_robots, load_robot
from teleop_core.session import runner, virtual
from teleop_core.session.configuration import configure

SHORT = ("teleop.duration=3.0", "operator.approach_time=1.0", "operator.size=[0.02, 0.02, 0.02]")


WITH = {"pointer": ("slave_sim.controller.kind=computed_torque",)}
"""What a robot needs besides: PID at 1 kHz is too slow for the drives of an ideal pointer, and is refused."""
TABLES = sorted(map(str, Path("config/robots").glob("*.yaml")))


@pytest.mark.slow
@pytest.mark.parametrize("name", [*list_robots(), *TABLES])
def test_every_robot_follows_a_session_inside_its_limits_and_drives(name: Any, tmp_path: Path) -> None:
    configuration = configure("free_motion", settings=[*SHORT, *WITH.get(name, ()), f"robot={name}"])
    runner.simulate(configuration, tmp_path / "bag")
    robot, bag = load_robot(name), Bag(tmp_path / "bag")
    references = bag.read(topics.SLAVE_SERVO_JP)
    assert references.names == robot.joint_names
    assert (references.values >= robot.lower - 1e-9).all()
    assert (references.values <= robot.upper + 1e-9).all()
    steps = np.abs(np.diff(references.values, axis=0))
    assert (steps <= present(robot.drives).speed_limit * 1e-3 + 1e-12).all()
    measured = bag.read(topics.SLAVE_MEASURED_JS).values[:, : robot.n]
    setpoints = bag.read(topics.SLAVE_SETPOINT_JS).values
    # A drive at its speed limit is never further behind than that speed takes in 0.1 s.
    assert (np.abs(measured - setpoints) < present(robot.drives).speed_limit * 0.1).all()
    assert np.ptp(measured, axis=0).max() > 1e-3


@pytest.mark.slow
@pytest.mark.parametrize("model", ["A", "B", "C"])
def test_the_mma_reads_the_hand_as_well_as_its_encoders_allow(model: str) -> None:
    handle = ("device.handle=mma", f"device.handle_geometry=[model={model}]")
    poses = [
        virtual.VirtualTime(configure("coarse_box", settings=[*SHORT, *extra])).run(3000)["master_measured_cp"]
        for extra in ((), handle)
    ]
    # The Phantom's own reading step is 0.055 mm; the handle's encoders give less than 0.03 mm.
    assert np.abs(poses[0][:, :3] - poses[1][:, :3]).max() < 1e-4


@pytest.mark.slow
def test_an_option_of_a_robot_reaches_both_stages_that_need_it() -> None:
    session = virtual.VirtualTime(configure(settings=["robot=scara_stewart", "geometry=[heading=carried]"]))
    fixed = load_robot("scara_stewart")
    stages: Mapping[str, Any] = session.stages
    solver, slave = (stages[name].robot for name in ("inverse_kinematics", "slave"))
    assert solver.geometry != fixed.geometry
    assert slave.geometry == solver.geometry
