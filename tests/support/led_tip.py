"""Led tip: a tip that is led along any way through an object, what it feels and what it loses."""

from collections.abc import Iterable
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from teleop_core.kernels import Array, fields_of, kernel, pointer, record, record_array
from teleop_core.kinematics import FK
from teleop_core.slave.simulation import SimulationRecord
from teleop_core.slave.world import WORLD_OBJECTS, contact
from teleop_core.slave.world.button import ButtonRecord

DT = 1e-3
PIECES = 16  # pieces of way in a tick, along each of which the push does its work


@kernel
def straight(q: Any, geometry: Any, jacobian: Any) -> None:
    """Jacobian of a tip whose joints are its place, and its turns about the base's axes if six."""
    jacobian[:] = 0.0
    for k in range(jacobian.shape[1]):
        jacobian[k, k] = 1.0


class Needle(NamedTuple):
    """What a contact takes of an arm, whose joints are the tip's place [m], and its turns [rad]."""

    jacobian: object
    distance: object
    tip: np.ndarray
    tip_geometry: np.ndarray
    T: np.ndarray
    shape: np.ndarray
    offset: np.ndarray
    normal: np.ndarray
    J: np.ndarray


def needle(name: str, parameters: Any = None, joints: int = 3) -> Needle:
    """A needle before an object, with the defaults of its parameters if there are no others."""
    part = WORLD_OBJECTS.find(name)
    return Needle(
        pointer(straight, FK),
        part.pointer,
        np.zeros(joints),
        np.zeros(3),
        np.zeros((4, 4)),
        part.numbers(parameters or part.parameters()),
        np.zeros(3),
        np.zeros(3),
        np.zeros((6, joints)),
    )


@kernel
def _stored_in_button(p: SimulationRecord, s: Any, depth: Any) -> Any:
    """Energy that a button can give back [J] by what moves along its normal."""
    rising, falling = min(depth, p.click_travel), min(depth, p.stroke) - p.click_travel
    energy = 0.5 * p.click_force * rising * rising / p.click_travel
    if falling > 0.0:
        slope = (p.contact_force - p.click_force) / (p.stroke - p.click_travel)
        energy += p.click_force * falling + 0.5 * slope * falling * falling
    beyond = max(depth - p.stroke, 0.0)
    energy = (1.0 - 0.5 * p.hysteresis) * (energy + p.contact_force * beyond)
    bristle = 10.0 * p.click_force / min(p.click_travel, p.stroke - p.click_travel)
    return energy + 0.5 * p.world_stiffness * beyond**2 + 0.5 * bristle * s.held**2


@kernel
def _stored(p: SimulationRecord, s: Any) -> Any:
    """Energy that the object can give back [J]: by its surface, or by springs of the channel."""
    stiffness, depth, square = p.world_stiffness, max(-s.gap, 0.0), 0.0
    for k in range(3):
        square += s.stuck[k] * s.stuck[k] if s.gap < 0.0 else 0.0
    if p.click_force > 0.0:
        return 0.5 * stiffness * square + _stored_in_button(p, s, depth)
    if s.is_open:
        ahead = min(max(depth - s.cut, 0.0), p.cutting_force / stiffness)
        return 0.5 * stiffness * (square + s.drawn * s.drawn + ahead * ahead)
    most = p.puncture_force / stiffness if p.puncture_force > 0.0 else depth
    spring = min(depth, most)
    return 0.5 * stiffness * (square + spring * spring) + p.puncture_force * (depth - spring)


@kernel
def _lead(p: SimulationRecord, contacts: Any, arm: Any, way: Array, felt: Array, lost: Array) -> None:
    """Lead the tip along ``way`` (N, 3), a tick each ``PIECES`` rows.

    Writes the force at the begin of each tick (ticks, 6), and the energy lost so far (ticks,): what
    the tip gave less what is stored.
    """
    speed, push, middle, energy = np.zeros(3), np.zeros(3), np.zeros(3), 0.0
    s = contacts[0]
    for tick in range(len(felt)):
        first = tick * PIECES
        for k in range(3):
            arm.T[k, 3] = way[first, k]
            speed[k] = (way[first + 1, k] - way[first, k]) * PIECES / 1e-3
        contact.touch(p, contacts, arm, way[first], speed, felt[tick])
        lost[tick] = energy - _stored(p, s)
        if not s.is_near:
            continue
        for i in range(first, first + PIECES):
            for k in range(3):
                middle[k] = 0.5 * (way[i, k] + way[i + 1, k])
                speed[k] = (way[i + 1, k] - way[i, k]) * PIECES / 1e-3
                push[k] = 0.0
            contact.add_push(p, contacts, middle, speed, push)
            for k in range(3):
                energy -= push[k] * (way[i + 1, k] - way[i, k])


def lead(way: Array, name: str = "plane", parameters: Any = None, **numbers: float) -> Any:
    """Forces (ticks, 3) [N], energy lost (ticks,) [J] and state of a tip led through places.

    Args:
        way: Places (ticks, 3) [m] from the middle of the object.
        name: Of the object.
        parameters: Of its shape; None for their defaults.
        numbers: Of it, beside those of soft tissue.
    """
    # Whole records: numba takes a record for another one that begins with the same fields.
    p, contacts = record(SimulationRecord, 3), record_array(contact.ContactState, 1, 3)
    known = {
        "world_stiffness": 200.0,
        "puncture_force": 0.5,
        "cutting_force": 0.1,
        "shaft_friction": 20.0,
        "hole_radius": 2e-3,
    }
    for key, value in (known | numbers).items():
        p[key] = value
    for key, *_ in fields_of(ButtonRecord):
        p[key] = getattr(parameters, key, 0.0)
    times = np.arange(PIECES * (len(way) - 1) + 1) / PIECES
    fine = np.column_stack([np.interp(times, np.arange(len(way)), column) for column in way.T])
    felt, lost = np.zeros((len(way) - 1, 6)), np.zeros(len(way) - 1)
    _lead(p, contacts, needle(name, parameters), fine, felt, lost)
    return felt[:, :3], lost, contacts[0]


def assert_none_gains_energy(ways: Iterable[Array], name: str, parameters: Any, friction: float) -> None:
    """Assert that of closed ways through an object none gets energy from it; with friction each loses some.

    Args:
        ways: Of each the places (ticks, 3) [m] from the middle of the object; those that end inside do not count.
        name: Of the object.
        parameters: Of its shape.
        friction: Its coefficient of friction; 0 for an object without damping too.
    """
    made_of = {"world_stiffness": 1000.0, "world_friction": friction, "world_damping": 2.0 * friction}
    shares = []
    for way in ways:
        force, lost, _ = lead(way, name, parameters, puncture_force=0.0, **made_of)
        turned = np.abs((force[:-1] * np.diff(way[:-1], axis=0)).sum(axis=1)).sum()
        if turned > 1e-3 and not force[-1].any():
            shares.append(lost[-1] / turned)
    assert len(shares) > 10
    assert min(shares) > (0.0 if friction else -1e-3)


def along_z(*heights: float, speed: float = 0.02) -> Array:
    """Straight way (N, 3) [m] through heights, at a speed [m/s]."""
    legs = [np.linspace(a, b, max(round(abs(b - a) / speed / DT), 200), endpoint=False) for a, b in pairwise(heights)]
    z = np.append(np.concatenate(legs), heights[-1])
    return np.column_stack((np.zeros((len(z), 2)), z))


def wandering(seed: int, ticks: int = 3000) -> Array:
    """Way (N, 3) [m] that wanders through the surface at z = 0, and begins and ends above it."""
    rng, times = np.random.default_rng(seed), DT * np.arange(ticks)
    rates, phases = rng.uniform(0.3, 6.0, (6, 3)), rng.uniform(0.0, 2.0 * np.pi, (6, 3))
    sizes = rng.normal(size=(6, 3)) * (1e-3, 1e-3, 5e-3)
    way = np.einsum("ij,nij->nj", sizes, np.sin(2.0 * np.pi * times[:, None, None] * rates + phases))
    share = np.minimum(1.0, np.minimum(times, times[::-1]) / 0.2)
    way[:, 2] = share * (way[:, 2] - 2e-3) + (1.0 - share) * 0.01
    return way
