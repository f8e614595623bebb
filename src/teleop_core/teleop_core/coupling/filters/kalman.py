"""Kalman: a model of a hand with constant speed and random accelerations, plus a tremor that oscillates."""

import math
from dataclasses import dataclass

from teleop_core.base import Within, parameter
from teleop_core.coupling.filters import TremorFilter
from teleop_core.kernels import Array, inner, kernel
from teleop_core.kernels.room import room

_COVARIANCE = 4
"""Index in the memory of the covariance (4, 4) of position and speed of hand and tremor."""
_HAS_BEGUN = 20
"""Index in the memory of the flag whether there is a covariance."""
FASTEST = 1.0
"""Standard deviation of a hand's initial speed [m/s]."""


@dataclass(frozen=True, kw_only=True)
class KalmanParameters:
    """Accelerations and tremor of the hand, and noise of the readings; all are independent of the sample rate."""

    acceleration_noise: float = parameter(
        0.02,
        Within(1e-6, 100.0, "m/s²/√Hz"),
        "square root of the spectral density of the intended acceleration, which is white noise",
        source="derived: gives the smallest error from the intended motion, for a hand as in scenario human",
    )
    reading_noise: float = parameter(
        1.6e-7,
        Within(1e-9, 0.1, "m/√Hz"),
        "square root of the spectral density of the noise of the readings, which is white",
        source="derived: in the same way as acceleration_noise; it is 5 µm per sample at 1 kHz",
    )
    frequency: float = parameter(10.0, Within(4.0, 20.0, "Hz"), "frequency at which the tremor's spectrum has its peak")
    half_width: float = parameter(
        1.0,
        Within(0.01, 5.0, "Hz"),
        "frequency difference from the peak of the tremor's spectrum to half of it; the wider, the "
        "less tremor is removed",
        source="assumed: tremor of 8 to 12 Hz (Elble and Koller 1990)",
    )
    tremor: float = parameter(
        45e-6,
        Within(0.0, 0.1, "m"),
        "RMS amplitude of the tremor on each axis",
        source="derived: 77 µm over three axes, as for the operator human",
    )


@inner
def _model(numbers: Array, period: float, F: Array, W: Array) -> None:
    """Write the transition matrix (4, 4) of a period into ``F``, and the covariance (4, 4) of its noise into ``W``.

    The tremor is a damped oscillator driven by noise, with constant variance.
    """
    damping, rate = 2.0 * math.pi * numbers[3], 2.0 * math.pi * numbers[2]
    square, push = rate * rate + damping * damping, numbers[0] * numbers[0] * period
    left = math.exp(-damping * period)
    c, s = left * math.cos(rate * period), left * math.sin(rate * period) / rate
    for i in range(4):
        for j in range(4):
            F[i, j] = 1.0 if i == j else 0.0
            W[i, j] = 0.0
    F[0, 1] = period
    F[2, 2], F[2, 3], F[3, 2], F[3, 3] = c + damping * s, s, -square * s, c - damping * s
    W[0, 0], W[1, 1] = push * period * period / 3.0, push
    W[0, 1] = W[1, 0] = 0.5 * push * period
    place, speed = numbers[4] * numbers[4], numbers[4] * numbers[4] * square
    for i in range(2, 4):
        for j in range(2, 4):
            kept = F[i, 2] * place * F[j, 2] + F[i, 3] * speed * F[j, 3]
            W[i, j] = (place if i == 2 else speed) - kept if i == j else -kept


@inner
def _begin(numbers: Array, spread: float, memory: Array) -> None:
    """Initialise the estimate with the first reading, at which the sum of position and tremor is 0."""
    damping, rate = 2.0 * math.pi * numbers[3], 2.0 * math.pi * numbers[2]
    tremor, P = numbers[4] * numbers[4], memory[_COVARIANCE:]
    memory[_HAS_BEGUN] = 1.0
    P[0], P[2], P[8], P[10] = tremor + spread, -tremor, -tremor, tremor
    P[5], P[15] = FASTEST * FASTEST, tremor * (rate * rate + damping * damping)


@kernel
def kalman_filter(numbers: Array, memory: Array, value: float, period: float) -> float:
    """Position of the intended motion; the reading is the sum of intended motion and tremor.

    Intended motion and tremor are predicted: the hand at constant speed, and the tremor as an oscillation. Then each is
    corrected towards the reading, in proportion to its uncertainty.

    Source:
        Kalman 1960, theorem 3; Bar-Shalom, Li and Kirubarajan 2001, section 6.2.2 (white noise
        of the acceleration) and 5.2.3 (gain and covariance). Tremor as a resonance that noise
        drives: Gantert, Honerkamp and Timmer 1992 (an autoregressive process of order two).
    """
    F, W, M, at, shared = room(4, 4), room(4, 4), room(4, 4), room(4), room(4)
    spread, P = numbers[1] * numbers[1] / period, memory[_COVARIANCE:]
    _model(numbers, period, F, W)
    if memory[_HAS_BEGUN] == 0.0:
        _begin(numbers, spread, memory)
    for i in range(4):
        at[i] = 0.0
        for j in range(4):
            at[i] += F[i, j] * memory[j]
            M[i, j] = 0.0
            for k in range(4):
                M[i, j] += F[i, k] * P[4 * k + j]
    for i in range(4):
        for j in range(4):
            for k in range(4):
                W[i, j] += M[i, k] * F[j, k]
        shared[i] = W[i, 0] + W[i, 2]
    expected = shared[0] + shared[2] + spread
    off = value - at[0] - at[2]
    for i in range(4):
        memory[i] = at[i] + shared[i] / expected * off
        for j in range(4):
            P[4 * i + j] = W[i, j] - shared[i] * shared[j] / expected
    return memory[0]


KALMAN = TremorFilter("kalman", KalmanParameters, kalman_filter)
