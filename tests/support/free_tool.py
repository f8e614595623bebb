"""Free tool: a rigid tool with several points that is dragged or flies through an object."""

import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from led_tip import DT, PIECES, needle
from teleop_core.kernels import Array, kernel, pointer, record, record_array
from teleop_core.robots.drives import ACCELERATION
from teleop_core.robots.robot import Robot
from teleop_core.session.configuration import configure
from teleop_core.shapes.hole import HoleParameters
from teleop_core.slave import joints, simulation
from teleop_core.slave.slave_sim import SlaveSim
from teleop_core.slave.world.contact import ContactState, add_push, touch

JOINTS = 6  # the tip's place along the base, and turns about the base's axes


@kernel
def free_acceleration(q: Any, dq: Any, net: Any, dynamics: Any, ddq: Any) -> None:
    """Of a body with mass [kg], inertia [kg·m²] about the tip in all directions, and gravity (3,).

    Its centre of mass is its tip.
    """
    for k in range(3):
        ddq[k] = net[k] / dynamics[0] + dynamics[2 + k]
        ddq[3 + k] = net[3 + k] / dynamics[1]


FREE = pointer(free_acceleration, ACCELERATION)


@kernel
def _turn(axis: Array, by: Array) -> None:
    """Turn an axis (3,) by a rotation vector (3,) [rad]."""
    angle = math.sqrt(by[0] * by[0] + by[1] * by[1] + by[2] * by[2])
    if angle == 0.0:
        return
    u, a = by / angle, axis.copy()
    along = u[0] * a[0] + u[1] * a[1] + u[2] * a[2]
    for k in range(3):
        i, j = (k + 1) % 3, (k + 2) % 3
        across = u[i] * a[j] - u[j] * a[i]
        axis[k] = math.cos(angle) * a[k] + math.sin(angle) * across + (1.0 - math.cos(angle)) * along * u[k]


@kernel
def _place(arm: Any, q: Array, axis: Array) -> None:
    for k in range(3):
        arm.T[k, 3], arm.T[k, 2] = q[k], axis[k]


@kernel
def stored(p: Any, contacts: NDArray[np.void]) -> float:
    """Energy in the springs of all points that touch [J]."""
    energy = 0.0
    for point in range(contacts.shape[0]):
        s = contacts[point]
        if s.gap < 0.0:
            square = s.gap * s.gap
            for k in range(3):
                square += s.stuck[k] * s.stuck[k]
            energy += 0.5 * p.world_stiffness * square
    return energy


@kernel
def _drag(
    p: Any, contacts: NDArray[np.void], arm: Any, q: Array, axis: Array, steps: Array, felt: Array, account: Array
) -> None:
    push, speed, middle, energy, turned = np.empty(6), np.empty(6), np.empty(6), 0.0, 0.0
    for tick in range(len(steps)):
        _place(arm, q, axis)
        for k in range(6):
            speed[k] = steps[tick, k] / 1e-3
        touch(p, contacts, arm, q, speed, felt[tick])
        account[tick, 0], account[tick, 1] = energy - stored(p, contacts), turned
        for piece in range(PIECES):
            work = 0.0
            for k in range(6):
                middle[k] = q[k] + (piece + 0.5) / PIECES * steps[tick, k]
                push[k] = 0.0
            add_push(p, contacts, middle, speed, push)
            for k in range(6):
                work -= push[k] * steps[tick, k] / PIECES
            energy += work
            turned += abs(work)
        for k in range(6):
            q[k] += steps[tick, k]
        _turn(axis, steps[tick, 3:])


@kernel
def _fly(
    p: Any,
    s: simulation.SimulationState,
    contacts: NDArray[np.void],
    arm: Any,
    acceleration: Callable[..., object],
    dynamics: Array,
    q: Array,
    dq: Array,
    axis: Array,
    found: Array,
) -> None:
    effort, felt, before = np.zeros(6), np.zeros(6), np.empty(6)
    for tick in range(len(found)):
        _place(arm, q, axis)
        touch(p, contacts, arm, q, dq, felt)
        for k in range(6):
            found[tick, k], found[tick, 6 + k], found[tick, 12 + k] = q[k], dq[k], felt[k]
            before[k] = q[k]
        found[tick, 18] = stored(p, contacts)
        for k in range(3):
            found[tick, 19 + k] = axis[k]
        joints.integrate(acceleration, dynamics, p, s, contacts, p.steps, effort, q, dq, 1e-3)
        _turn(axis, q[3:] - before[3:])


def _records(points: int, numbers: dict[str, float]) -> tuple[object, NDArray[np.void]]:
    p, contacts = record(simulation.SimulationRecord, JOINTS), record_array(ContactState, points, JOINTS)
    known = {"world_stiffness": 1000.0, "steps": 2, "friction_speed": 1.0, "tool_length": 0.02}
    for key, value in (known | numbers).items():
        p[key] = value
    return p, contacts


def drag(
    begin: ArrayLike,
    axis: ArrayLike,
    steps: Array,
    name: str = "plane",
    parameters: Any = None,
    points: int = 5,
    **numbers: float,
) -> tuple[Array, Array, Array]:
    """Wrenches (ticks, 6) [N, N·m], energy lost (ticks,) and work turned over (ticks,) [J].

    Args:
        begin: Place of the tip from the middle of the object (3,) [m].
        axis: Of the tool at first (3,), out of its tip.
        steps: Motion of the tip in each tick, place and turns (ticks, 6) [m, rad].
        name: Of the object.
        parameters: Of its shape; None for their defaults.
        points: Of the tool.
        numbers: Of the record of parameters, beside those of 1000 N/m.
    """
    p, contacts = _records(points, numbers)
    felt, account = np.zeros((len(steps), 6)), np.zeros((len(steps), 2))
    q = np.concatenate((begin, np.zeros(3)))
    arm = needle(name, parameters, JOINTS)
    _drag(p, contacts, arm, q, np.array(axis, float), np.ascontiguousarray(steps), felt, account)
    return felt, account[:, 0], account[:, 1]


def fly(
    begin: tuple[float, float, float],
    speed: Sequence[float] | Array,
    ticks: int,
    axis: Sequence[float] | Array = (0.0, 0.0, -1.0),
    name: str = "plane",
    parameters: HoleParameters | None = None,
    points: int = 1,
    mass: float = 1.0,
    inertia: float = 1.0,
    gravity: tuple[float, float, float] = (0.0, 0.0, -9.81),
    **numbers: float,
) -> Any:
    """Motion of a body that only the object and gravity push, a dict of arrays (ticks, ...).

    Its keys: ``place`` (3,) [m] and ``turn`` (3,) [rad] of the tip, ``speed`` (6,), ``felt`` (6,)
    [N, N·m], ``stored`` [J] in springs, ``axis`` (3,) of the tool.

    Args:
        begin: Place of the tip from the middle of the object (3,) [m].
        speed: At first, linear and angular (6,) or linear (3,).
        ticks: Number of them, of 1 ms.
        axis: Of the tool at first (3,).
        name: Of the object.
        parameters: Of its shape; None for their defaults.
        points: Of the tool.
        mass: [kg].
        inertia: About its tip, where its centre of mass is, in all directions [kg·m²].
        gravity: [m/s²].
        numbers: Of the record of parameters, beside those of 1000 N/m.
    """
    p, contacts = _records(points, numbers)
    q, dq, found = np.zeros(6), np.zeros(6), np.zeros((ticks, 22))
    q[:3], dq[: len(speed)] = begin, speed
    thing, body = needle(name, parameters, JOINTS), np.array([mass, inertia, *gravity])
    state = record(simulation.SimulationState, JOINTS)
    _fly(p, state, contacts, thing, FREE, body, q, dq, np.array(axis, float), found)
    keys: dict[str, Any] = {
        "place": slice(3),
        "turn": slice(3, 6),
        "speed": slice(6, 12),
        "felt": slice(12, 18),
        "stored": 18,
        "axis": slice(19, 22),
    }
    return {key: found[:, part] for key, part in keys.items()} | {"time": DT * np.arange(ticks)}


def after_a_tick(robot: Robot, texts: list[str], joints: Any = None, plant: str = "ideal") -> tuple[Array, Array]:
    """Speeds (n,) of an arm a tick after rest, at its start by default, and what its tip felt there (6,)."""
    zero = [0.0] * robot.n
    settings = [f"robot={robot.name}", f"plant={plant}", f"slave_sim.coulomb={zero}", *texts]
    arm = SlaveSim(configure("free_motion", settings=settings).group("slave_sim"))
    arm.arm.q[:] = arm.state["link"] = arm.state["carried"] = robot.start if joints is None else joints
    arm.signals["slave_setpoint_js"] = arm.arm.q
    arm.step()
    return arm.arm.dq.copy(), arm.signals["slave_true_cf"].copy()
