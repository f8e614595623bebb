"""Controllers as parts: PD beside PID, own laws, and what is refused."""

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from led_slave import LedSlave
from present import present
from teleop_core.base import PartError, build
from teleop_core.graph import DT
from teleop_core.kernels import Array, kernel
from teleop_core.robots import load_robot
from teleop_core.slave.controllers import CONTROLLERS, Controller, register_controller
from teleop_core.slave.controllers.pd import PD, PdParameters, pd_control
from teleop_core.slave.controllers.pid import PidParameters, pid_control, pid_gains
from teleop_core.slave.pair import ArmParameters, SimulatedArm
from teleop_core.slave.slave_sim import ControllerParameters

ARM = load_robot("rcrt1")


def own(name: str = "own", **more: int | Callable[..., object] | type[float] | None) -> Any:
    parts: dict[str, Any] = {"parameters": PidParameters, "gains": pid_gains, "control": pid_control, "memory": 4}
    return Controller(name, **{**parts, **more})


def slave(kind: str, **values: Any) -> SimulatedArm:
    return SimulatedArm(
        ArmParameters(controller=build(ControllerParameters, {"kind": kind}), start=tuple(ARM.home.tolist()), **values)
    )


def trace(arm: SimulatedArm, goal: Array, ticks: int) -> Array:
    """Measured joints, speeds and efforts (ticks, 18) under a constant command."""
    return LedSlave(arm).along([goal] * ticks)["slave_measured_js"]


def test_pd_effort_is_that_of_its_formula() -> None:
    gains, memory, effort = np.array([[100.0, 2.0]]), np.array([[0.2, 0.5]]), np.empty(1)
    one = np.ones(1)
    pd_control(gains, memory, 0.3 * one, 0.21 * one, 0.4 * one, 1e3 * one, DT, effort)
    speed = 0.5 + ((0.21 - 0.2) / DT - 0.5) / 2.0
    assert math.isclose(effort[0], 100.0 * (0.3 - 0.21) - 2.0 * speed + 0.4, rel_tol=1e-12)
    assert np.allclose(memory, [[0.21, speed]], rtol=1e-12, atol=0)


def test_pd_gains_put_both_poles_at_the_bandwidth() -> None:
    drives, viscous = ARM.drives, present(ARM.drives).viscous
    gains = PD.gains(PdParameters(), ARM, viscous)
    # inertia (s + bandwidth)²
    assert np.allclose(gains[:, 0], present(drives).bandwidth ** 2 * present(drives).inertia, rtol=1e-12, atol=0)
    damping = (gains[:, 1] + viscous) / present(drives).inertia
    assert np.allclose(damping, 2.0 * present(drives).bandwidth, rtol=1e-12, atol=0)


def test_pd_sags_under_gravity_that_the_pid_holds() -> None:
    # What the spring of the law leaves of axis 2: gravity over its gain.
    goal = ARM.home - np.array([0, 0.2, 0, 0, 0, 0])
    off = {}
    for kind in ("pid", "pd"):
        arm = slave(kind, gravity_compensation="none")
        off[kind] = np.abs(trace(arm, goal, 3000)[-1, :6] - goal)
    count = present(ARM.drives).encoder_step
    assert (off["pid"] <= count).all()
    assert off["pd"][1] > 10 * count[1]


@pytest.mark.parametrize("kind", ["pid", "pd"])
def test_every_law_moves_the_arm_to_its_goal_where_gravity_is_compensated(kind: str) -> None:
    goal = ARM.home - 0.02 * present(ARM.drives).speed_limit
    last = trace(slave(kind, gravity_compensation="all"), goal, 3000)[-1]
    # Dry friction over the spring of a law without an integrator.
    stiffness = PD.gains(PdParameters(), ARM, present(ARM.drives).viscous)[:, 0]
    room = present(ARM.drives).coulomb / stiffness + 2 * present(ARM.drives).encoder_step
    assert (np.abs(last[:6] - goal) <= room).all()


def test_own_law_in_plain_python_gives_the_same_bits_as_compiled(own_parts: None) -> None:
    register_controller(own("plain", control=pid_control.py_func))
    goal = ARM.home - 0.02 * present(ARM.drives).speed_limit
    plain, compiled = (trace(slave(kind), goal, 300) for kind in ("plain", "pid"))
    # Begin and shift are those of the integrator, which an own law may leave out.
    compiled_without = register_controller(own("compiled"))
    same = trace(slave(compiled_without.name), goal, 300)
    assert np.array_equal(plain, same)
    assert not np.array_equal(plain, compiled)


def test_effort_of_every_law_is_cut_at_the_drive_s(own_parts: None) -> None:
    register_controller(own("strong", control=shaped(1e6)))
    efforts = trace(slave("strong", trials="small"), ARM.home, 5)[:, 12:]
    assert (np.abs(efforts) <= present(ARM.drives).effort_limit).all()


def test_what_an_own_law_raises_while_it_runs_reaches_the_user(own_parts: None) -> None:
    def control(*arrays: Any) -> None:
        effort = arrays[-1]
        effort[:] = 0.0
        if len(effort) == ARM.n:
            raise RuntimeError("my own mistake")

    register_controller(own("raising", control=control))
    with pytest.raises(RuntimeError, match="my own mistake"):
        slave("raising").step()


def shaped(value: float | Array) -> Callable[..., None]:
    def control(*arrays: Any) -> None:
        arrays[-1][:] = value

    return control


def table(value: Array) -> Callable[..., object]:
    return lambda parameters, robot, viscous: value


FORM = "control(gains, memory, setpoint"
BAD = {
    "control takes two arguments": ({"control": lambda gains, effort: None}, FORM),
    "kernel takes two arguments": ({"control": kernel(lambda gains, effort: None)}, FORM),
    "efforts are too many": ({"control": shaped(np.zeros(9))}, FORM),
    "efforts are no numbers": ({"control": shaped(math.nan)}, "efforts are finite"),
    "control is none": ({"control": None}, "callable control"),
    "gains take one argument": ({"gains": lambda parameters: None}, FORM),
    "gains are a row": ({"gains": table(np.zeros(3))}, "(4, k)"),
    "gains are of other joints": ({"gains": table(np.zeros((5, 3)))}, "(4, k)"),
    "gains are no numbers": ({"gains": table(np.full((4, 3), math.nan))}, "finite numbers"),
    "gains are too few": ({"gains": table(np.zeros((4, 1)))}, "efforts are finite"),
    "begin takes nothing": ({"begin": lambda: None}, FORM),
    "shift takes nothing": ({"shift": lambda: None}, FORM),
    "memory is too small": ({"memory": 0}, "no more memory than it declares, 0"),
    "parameters are no dataclass": ({"parameters": float}, "dataclass"),
    "a wish for the model is no yes or no": ({"uses_model": "yes"}, "uses_model"),
}


@pytest.mark.parametrize("case", BAD)
def test_law_that_cannot_work_is_refused_before_anything_runs(own_parts: None, case: str) -> None:
    values: Any
    values, expected = BAD[case]
    with pytest.raises(PartError) as error:
        register_controller(own(**values))
    assert (error.value.kind, error.value.name) == ("controller", "own")
    assert expected in error.value.expected
    assert "\n" not in str(error.value)
    assert "own" not in CONTROLLERS.names()
