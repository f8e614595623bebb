"""Paths: where the operator's hand wants to be, as a pure function of time."""

import math
from dataclasses import dataclass

import numpy as np

from teleop_core.errors import ParameterError
from teleop_core.geometry import Array
from teleop_core.parameters import parameter

KINDS = ("random", "line", "circle", "points", "bag", "hold")


@dataclass(frozen=True, kw_only=True)
class PathParameters:
    """What the hand wants to do, relative to where the stylus starts, in the master's base."""

    kind: str = parameter("random", choices=KINDS, fixed=True, doc="shape of the motion")
    center: tuple[float, ...] = parameter(
        (0.0, 0.0, 0.0), unit="m", lower=-0.3, upper=0.3, length=3, fixed=True,
        doc="centre of the motion, first point of a line",
    )  # fmt: skip
    approach_time: float = parameter(
        4.0, unit="s", lower=0.1, upper=60.0, fixed=True, doc="smooth move from start to the centre"
    )
    size: tuple[float, ...] = parameter(
        (0.03, 0.03, 0.03), unit="m", lower=0.0, upper=0.3, length=3, fixed=True,
        doc="random: width of the region; circle: diameters on x, y, z; line: from end to end",
    )  # fmt: skip
    period: float = parameter(
        8.0, unit="s", lower=0.1, upper=600.0, fixed=True,
        doc="time of one round; random: of the slowest part of the motion; points: per leg",
    )  # fmt: skip
    tilt: tuple[float, ...] = parameter(
        (0.0, 0.0, 0.0), unit="rad", lower=-1.5, upper=1.5, length=3, fixed=True,
        doc="turn of the stylus at the centre, as a rotation vector",
    )  # fmt: skip
    rotation: float = parameter(
        0.2, unit="rad", lower=0.0, upper=1.5, fixed=True,
        doc="largest random turn of the stylus about each axis",
    )  # fmt: skip
    points: tuple[float, ...] = parameter(
        (), unit="m", lower=-0.3, upper=0.3, fixed=True,
        doc="points: x, y, z of each stop relative to the centre, one after the other",
    )  # fmt: skip
    bag: str = parameter("", fixed=True, doc="bag: recording whose master/measured_cp is followed")

    def __post_init__(self) -> None:
        if self.kind == "points" and (not self.points or len(self.points) % 3):
            raise ParameterError("path.points", self.points, "x, y, z of at least one point")
        if self.kind == "bag" and not self.bag:
            raise ParameterError("path.bag", self.bag, "a recording, for path.kind bag")


def minimum_jerk(share: Array) -> Array:
    """Smooth step from 0 to 1 with rest at both ends, over ``share`` of its time clipped to [0, 1].

    Source:
        Flash and Hogan 1985, eq. 6.
    """
    x = np.clip(share, 0.0, 1.0)
    return x**3 * (10.0 - 15.0 * x + 6.0 * x * x)


class Path:
    """Wanted motion of the hand: :meth:`sample` gives it at any times.

    Args:
        parameters: Shape of the motion.
        rng: Draws the phases of random motion, once; the same seed gives the same path.
        recorded: Times (N,) [s] from 0, and positions [m] and rotation vectors [rad] relative to
            the first (N, 6), for the kind "bag".
    """

    # Parts of random motion: cycles per period, incommensurate so that it does not repeat.
    _CYCLES = np.array([1.0, math.sqrt(3.0), math.sqrt(7.0), math.sqrt(13.0)])
    _SHARES = np.array([0.5, 0.4, 0.25, 0.15])

    def __init__(
        self,
        parameters: PathParameters,
        rng: np.random.Generator,
        recorded: tuple[Array, Array] | None = None,
    ) -> None:
        self._p = parameters
        self._phases = rng.uniform(0.0, 2.0 * math.pi, (6, len(self._CYCLES)))
        self._recorded = recorded
        self._shape = getattr(self, f"_{parameters.kind}")

    def sample(self, times: Array) -> tuple[Array, Array]:
        """Wanted place and turn of the hand.

        Args:
            times: Times (N,) since the start [s].

        Returns:
            Position relative to the start (N, 3) [m] and rotation vector relative to the start
            (N, 3) [rad], both at rest and zero at time 0.
        """
        p = self._p
        if p.kind == "bag":
            moves = self._shape(times)
            return moves[:, :3], moves[:, 3:]
        moved = np.maximum(times - p.approach_time, 0.0)
        # Motion grows over its first second, so that it starts at rest; points do by themselves.
        grown = minimum_jerk(moved)[:, None]
        approach = minimum_jerk(times / p.approach_time)[:, None]
        turn = p.rotation * self._random_unit(moved, slice(3, 6)) * grown
        shape = self._shape(moved)
        position = approach * np.array(p.center) + (shape if p.kind == "points" else grown * shape)
        return position, approach * np.array(p.tilt) + turn

    def _random_unit(self, times: Array, axes: slice) -> Array:
        """Smooth random motion within [-1, 1] on three axes, (N, 3)."""
        rate = 2.0 * math.pi * self._CYCLES / self._p.period
        waves = np.sin(times[:, None, None] * rate + self._phases[axes])
        return np.sin(0.5 * math.pi * (waves @ self._SHARES))

    def _random(self, times: Array) -> Array:
        return 0.5 * np.array(self._p.size) * self._random_unit(times, slice(0, 3))

    def _line(self, times: Array) -> Array:
        share = 0.5 - 0.5 * np.cos(2.0 * math.pi * times / self._p.period)
        return share[:, None] * np.array(self._p.size)

    def _circle(self, times: Array) -> Array:
        angle = 2.0 * math.pi * times / self._p.period
        unit = np.stack((np.cos(angle), np.sin(angle), np.sin(angle)), axis=1)
        return 0.5 * np.array(self._p.size) * unit

    def _points(self, times: Array) -> Array:
        stops = np.vstack((np.zeros(3), np.reshape(self._p.points, (-1, 3))))
        # The last fifth of each leg is a rest at the stop.
        leg = np.minimum(times / self._p.period, len(stops) - 1 - 1e-9)
        index = leg.astype(int)
        share = minimum_jerk((leg - index) / 0.8)[:, None]
        return stops[index] + share * (stops[index + 1] - stops[index])

    def _bag(self, times: Array) -> Array:
        assert self._recorded is not None
        at, moves = self._recorded
        return np.stack([np.interp(times, at, column) for column in moves.T], axis=1)

    def _hold(self, times: Array) -> Array:
        return np.zeros((len(times), 3))
