"""Two-port: hybrid matrix, felt impedance, bandwidth and Llewellyn's number, measured at spectral lines."""

import math
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from teleop_core.base.errors import ParameterError
from teleop_core.graph.signals import DT
from teleop_core.hand.operators.shapes import minimum_jerk
from teleop_core.kernels.geometry import Array
from teleop_lab.experiments.one_axis import Grip, Mapped

Complex = NDArray[np.complex128]

PERIOD = 10.0
"""Period of the excitation [s]; the excited frequencies are multiples of 0.1 Hz."""
_TICKS = round(PERIOD / DT)
BINS = np.unique(2 * (np.geomspace(1.0, 300.0, 24) / 2.0).round().astype(int) + 1)
"""Excited multiples of 1/PERIOD, from 0.1 to 30 Hz. They are odd, because quadratic distortion appears only at even
multiples."""
LINES: Array = BINS / PERIOD
"""Frequencies that are excited (L,) [Hz]."""
S: Complex = np.multiply(2j * np.pi, LINES, dtype=np.complex128)
"""Laplace's variable at the lines (L,) [rad/s]."""
AMPLITUDE = 0.15e-3
"""Amplitude of each line of the hand's displacement [m]."""
_APPROACH = 3.0  # duration of the hand's approach to the centre of its motion [s]
_GROWTH = 1.0  # duration in which the multisine then rises to its full amplitude [s]
_FIRM = Grip(0.02, 5000.0, 40.0)
"""A stiff hand, whose motion hardly depends on the force."""


def multisine(times: Array) -> Array:
    """Displacement (N,) [m] of the excitation at times (N,) [s]; whole periods repeat exactly.

    Source:
        Schroeder 1970: phases that grow with the square of a line's number keep the peak low.
    """
    number = np.arange(len(LINES))
    phases = np.pi * number * number / len(LINES)
    waves: Array = np.sin(2.0 * np.pi * np.multiply.outer(times, LINES) + phases)
    return AMPLITUDE * waves.sum(axis=1)


def excitation(times: Array) -> tuple[Array, Array]:
    """Completed share of the approach (N,), and the displacement (N,) [m] that is added to the approach."""
    grown = minimum_jerk((times - _APPROACH) / _GROWTH)
    return minimum_jerk(times / _APPROACH), grown * multisine(times)


@dataclass(frozen=True, eq=False)
class Ports:
    """Signals of both ports in one experiment: complex amplitudes (L,) at the excited lines.

    Attributes:
        hand_speed: Speed of the hand at the master [m/s].
        hand_force: Force of the hand on the master [N].
        tip_speed: Speed of the slave's tip [m/s].
        tip_force: Force of the tip on the world [N].
        stray: Share of a signal outside of the lines, up to the last line: the largest value of the forces and the
            tip's displacement. It is 0 for a linear system in steady state.
    """

    hand_speed: Complex
    hand_force: Complex
    tip_speed: Complex
    tip_force: Complex
    stray: float

    @classmethod
    def of(cls, hand: Array, push: Array, tip: Array, reaction: Array) -> "Ports":
        """Compute the ports from measurements along one axis; only the last period is used.

        Args:
            hand: Positions of the hand (N,) [m].
            push: Force of the master on the hand (N,) [N].
            tip: Positions of the slave's tip (N,) [m].
            reaction: Force of the world on the tip (N,) [N].

        Raises:
            ParameterError: The measurements are shorter than one period.
        """
        if len(hand) < _TICKS:
            raise ParameterError("ticks", len(hand), f"at least {_TICKS}: one period of the excitation")
        places = [_spectrum(values) for values in (hand, tip)]
        forces = [-_spectrum(values) for values in (push, reaction)]
        fast, slow = (S * place[BINS] for place in places)
        at_hand, at_tip = (force[BINS] for force in forces)
        return cls(fast, at_hand, slow, at_tip, max(map(_stray, (*forces, places[1]))))

    @property
    def felt(self) -> Complex:
        """Impedance that the hand feels (L,) [N·s/m]."""
        return self.hand_force / self.hand_speed

    @property
    def world(self) -> Complex:
        """Impedance of the world (L,) [N·s/m]."""
        return self.tip_force / self.tip_speed


def _spectrum(values: Array) -> Complex:
    found: Complex = np.fft.rfft(values[-_TICKS:]) / (0.5 * _TICKS)
    return found


def _stray(values: Complex) -> float:
    power = np.abs(values[1 : BINS[-1] + 1]) ** 2
    whole, lines = float(power.sum()), BINS - 1
    power[lines] = 0.0
    # Amplitudes below a nanonewton or a nanometre are rounding errors.
    return math.sqrt(float(power.sum()) / whole) if whole > 1e-18 else 0.0


def hybrid_matrix(experiments: Sequence[Ports]) -> Complex:
    """Hybrid matrix (L, 2, 2) that fits the given experiments best.

    The matrix maps (speed of the hand, force on the world) to (force of the hand, negative speed of the tip).

    Raises:
        ParameterError: The experiments do not differ enough, for example because all have the same world.

    Source:
        Hannaford 1989 for the matrix of teleoperators. Each row is fitted by least squares.
    """
    given = np.stack([np.stack((ports.hand_speed, ports.tip_force), axis=-1) for ports in experiments], axis=1)
    answers = np.stack([np.stack((ports.hand_force, -ports.tip_speed), axis=-1) for ports in experiments], axis=1)
    sizes = np.linalg.norm(given, axis=1, keepdims=True)  # magnitudes of speed and force
    scaled = given / np.where(sizes > 0.0, sizes, 1.0)
    if (np.linalg.matrix_rank(scaled, tol=1e-6) < 2).any():
        raise ParameterError("experiments", len(experiments), "two or more whose worlds differ")
    found: Complex = np.linalg.pinv(scaled) @ answers
    return np.swapaxes(found / np.swapaxes(sizes, 1, 2), 1, 2)


def felt_impedance(hybrid: Complex, world: Complex) -> Complex:
    """Impedance (L,) [N·s/m] that a hand feels through a hybrid matrix (L, 2, 2).

    Args:
        hybrid: The matrix.
        world: Impedance of the world (L,) [N·s/m].

    Source:
        Hashtrudi-Zaad and Salcudean 2001, transmitted impedance.
    """
    (h11, h12), (h21, h22) = np.moveaxis(hybrid, 0, -1)
    return h11 - h12 * h21 * world / (1.0 + h22 * world)


def llewellyn(hybrid: Complex) -> Array:
    """Llewellyn's number (L,) of hybrid matrices (L, 2, 2); the two-port is absolutely stable if it is at least 1.

    An active port reduces the number. The number is infinite if nothing is transmitted in one direction.

    Source:
        Llewellyn 1952, in the form of Adams and Hannaford 1999 and Hashtrudi-Zaad and
        Salcudean 2001: -cos(arg(h12 h21)) + 2 Re(h11) Re(h22) / |h12 h21|.
    """
    (h11, h12), (h21, h22) = np.moveaxis(hybrid, 0, -1)
    loop = h12 * h21
    size = np.abs(loop)
    passive = np.where((h11.real < 0.0) | (h22.real < 0.0), -1.0, 1.0)
    losses = passive * np.abs(h11.real * h22.real)
    with np.errstate(divide="ignore", invalid="ignore"):
        number: Array = (2.0 * losses - loop.real) / size
    return np.where(size > 0.0, number, np.inf)


def bandwidth(gain: Complex) -> float:
    """Lowest frequency [Hz] at which a gain (L,) is 3 dB below the ideal value 1, interpolated between the lines.

    Returns:
        The frequency; 0 if the gain is already lower at the first line, infinity if the gain is lower at no line.
    """
    size = np.abs(gain)
    low = np.flatnonzero(size < math.sqrt(0.5))
    if not len(low):
        return math.inf
    last = int(low[0])
    if last == 0:
        return 0.0
    (x0, x1), (y0, y1) = (np.log(values[last - 1 : last + 1]) for values in (LINES, size))
    return math.exp(x0 + (x1 - x0) * (0.5 * math.log(0.5) - y0) / (y1 - y0))


@dataclass(frozen=True)
class Lag:
    """Model of an arm, in ticks of 1 ms, that follows its command with a first-order lag and yields to force.

    Attributes:
        time: Time constant [s].
        compliance: Displacement of the arm divided by the force of the world [m/N].
        late: Delay of commands and of forces, in ticks.
    """

    time: float
    compliance: float
    late: int

    @property
    def share(self) -> float:
        """Share of the remaining distance that the arm moves in a tick."""
        return -math.expm1(-DT / self.time)

    def hybrid(self) -> Complex:
        """Exact hybrid matrix (L, 2, 2) of position-force with this arm.

        Source:
            Lawrence 1993, position-force: the position is sent to the slave, and the force is sent back. The sampled
            lag is share / (1 - (1 - share) / z).
        """
        later = np.exp(-S * DT)
        lag = self.share / (1.0 - (1.0 - self.share) * later)
        matrix = np.zeros((len(S), 2, 2), dtype=np.complex128)
        matrix[:, 0, 1] = later ** (self.late + 1)
        matrix[:, 1, 0] = -lag * later**self.late
        matrix[:, 1, 1] = S * self.compliance * lag * later
        return matrix

    def ports(self, stiffness: float) -> Ports:
        """Simulate our hand, device and mapping with this arm at a spring, and return both ports.

        Args:
            stiffness: Stiffness of the spring [N/m]; 0 for no spring. The spring pushes and pulls.
        """
        chain = Mapped(_FIRM, {"coarse_gain": 1.0})
        begin = chain.step(np.zeros(3))[2]
        there, back = deque([begin] * self.late), deque([0.0] * (self.late + 1))
        times: Array = DT * np.arange(round((_APPROACH + 2.0 * _GROWTH + PERIOD) / DT), dtype=float)
        wanted = excitation(times)[1] + chain.master.state["position"][1]
        rows = np.empty((len(times), 4))
        tip, force = 0.0, np.zeros(3)
        for i in range(len(times)):
            chain.master.signals["hand_servo_cp"][1] = wanted[i]
            force[2] = back.popleft()
            there.append(chain.step(force)[2])
            yielded = -self.compliance * stiffness * tip
            tip += self.share * (there.popleft() - begin + yielded - tip)
            back.append(-stiffness * tip)
            rows[i] = chain.master.state["position"][1], chain.push[1], tip, -stiffness * tip
        return Ports.of(*rows.T)
