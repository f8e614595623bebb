"""People: hands that move as recorded ones do, at the rates and with the gaps of recorders.

Minimum-jerk moves from place to place and attitude to attitude, with rests between them. Made with
scipy alone, so that they say nothing of how this package turns and interpolates.
"""

from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from teleop_core.bags.memory import MemoryBag
from teleop_core.bags.series import Series
from teleop_core.graph.topics import MASTER_BUTTONS, MASTER_MEASURED_CP
from teleop_core.kernels.geometry import Array
from teleop_core.session.recording import Recording

_BEGIN_NS = 5_000_000_000


@dataclass(frozen=True)
class Person:
    """A recorder and who moves its sensor.

    Attributes:
        rate: Samples per second.
        jitter: Largest error of a stamp, in periods.
        extent: Width of the region [m] on each axis.
        turn: Largest turn [rad] from the middle attitude, about any axis.
        speed: Mean speed of moves [m/s].
    """

    rate: float
    jitter: float
    extent: tuple[float, float, float]
    turn: float
    speed: float


PEOPLE = {
    "da_vinci_30": Person(30.0, 0.3, (0.12, 0.12, 0.08), 1.0, 0.06),
    "da_vinci_36": Person(36.0, 0.4, (0.2, 0.2, 0.15), 1.57, 0.12),
    "motion_capture": Person(100.0, 0.0, (0.8, 0.6, 0.4), 1.57, 0.3),
    "pen": Person(609.0, 0.0, (0.2, 0.15, 0.1), 1.2, 0.12),
}


def moves(person: Person, seconds: float, seed: int = 1) -> tuple[NDArray[np.int64], Array]:
    """Stamps (N,) [ns] and poses (N, 7), position [m] and quaternion w, x, y, z."""
    rng = np.random.default_rng(seed)
    ends, places, attitudes = [0.0], [np.zeros(3)], [Rotation.identity()]
    while ends[-1] <= seconds:
        place = rng.uniform(-0.5, 0.5, 3) * person.extent
        axis = rng.normal(size=3)
        turn = person.turn * np.sqrt(rng.uniform()) * axis / np.linalg.norm(axis)
        way = float(np.linalg.norm(place - places[-1]))
        time = max(0.3, way / person.speed * rng.uniform(0.7, 1.5))
        for wait, is_moving in ((time, True), (rng.uniform(0.0, 0.6), False)):
            ends.append(ends[-1] + wait)
            places.append(place if is_moving else places[-1])
            attitudes.append(Rotation.from_rotvec(turn) if is_moving else attitudes[-1])
    count = int(seconds * person.rate)
    times = (np.arange(count) + person.jitter * rng.uniform(-0.5, 0.5, count)) / person.rate
    times -= times[0]
    at = np.clip(np.searchsorted(ends, times, side="right") - 1, 0, len(ends) - 2)
    share = (times - np.array(ends)[at]) / np.diff(ends)[at]
    share = share**3 * (10.0 - 15.0 * share + 6.0 * share**2)
    steps = np.diff(places, axis=0)[at]
    turns = np.array([(a.inv() * b).as_rotvec() for a, b in pairwise(attitudes)])[at]
    now = Rotation.concatenate(attitudes)[at] * Rotation.from_rotvec(share[:, None] * turns)
    poses = np.hstack((np.array(places)[at] + share[:, None] * steps, now.as_quat()[:, [3, 0, 1, 2]]))
    return np.round(times * 1e9).astype(np.int64) + _BEGIN_NS, np.ascontiguousarray(poses)


def recorded(
    stamp_ns: NDArray[np.int64], poses: Array, buttons: Array | None = None, name: str = "person"
) -> Recording:
    """Recording of a master's poses and, if given, buttons (N, 3), as another program made it."""
    series = {MASTER_MEASURED_CP: Series(stamp_ns, stamp_ns, poses, (), "master_base")}
    if buttons is not None:
        series[MASTER_BUTTONS] = Series(stamp_ns, stamp_ns, buttons)
    return Recording(MemoryBag(name, series, {}, {}))


def person(name: str, seconds: float, seed: int = 1) -> Recording:
    """Recording of one of :data:`PEOPLE`."""
    return recorded(*moves(PEOPLE[name], seconds, seed), name=name)


def saved(name: str, seconds: float, folder: Path, seed: int = 1) -> Path:
    """The same on disk; its directory."""
    path = folder / name
    person(name, seconds, seed).save(path)
    return path
