"""Force sensor: simulates the measurement of the force on the tip by a real sensor.

The contact force passes a low-pass with the bandwidth of the sensor's electronics. Then the weight of the tool behind
the sensor, the sensor's bias, and noise are added. Each sample has new random noise.
"""

import math
from dataclasses import dataclass

import numpy as np

from teleop_core.base import Within, parameter
from teleop_core.graph import Noise, Row
from teleop_core.kernels import Fields, Wrench, inner
from teleop_core.slave.arm import ArmParts

STANDARD_GRAVITY = 9.80665
"""Weight divided by mass [m/s²]; the weight acts along -z of the slave's base."""
_STREAM = 3  # number of the random stream, used with the seed; the human operator uses streams 1 and 2


class SensorRecord(Fields):
    """Fields of a parameter record with the properties of the sensor."""

    is_ideal: int
    has_noise: int
    sensor_share: float
    sensor_offset: Wrench
    sensor_noise: Wrench


class SensorState(Fields):
    """Fields of a state record with the low-pass and the noise."""

    felt: Wrench
    sensed: Wrench
    next_noise: int


@dataclass(frozen=True, kw_only=True)
class ForceSensorParameters:
    """The force sensor behind the tip, ideal by default, and the force estimate without a sensor."""

    force_noise: float = parameter(
        0.0,
        Within(0.0, 100.0, "N"),
        "standard deviation of the noise of a sample, the same for each axis",
        source="assumed: none, an ideal sensor",
    )
    torque_noise: float = parameter(
        0.0,
        Within(0.0, 10.0, "N·m"),
        "standard deviation of the noise of a sample, the same for each axis",
        source="assumed: none, an ideal sensor",
    )
    force_bias: tuple[float, ...] = parameter(
        (0.0, 0.0, 0.0),
        Within(-100.0, 100.0, "N"),
        "force that the sensor reports without contact, in axes of the slave's base",
        length=3,
        source="assumed: none, an ideal sensor",
    )
    torque_bias: tuple[float, ...] = parameter(
        (0.0, 0.0, 0.0),
        Within(-10.0, 10.0, "N·m"),
        "torque that the sensor reports without contact, in axes of the slave's base",
        length=3,
        source="assumed: none, an ideal sensor",
    )
    force_bandwidth: float = parameter(
        0.0,
        Within(0.0, 500.0, "Hz"),
        "cutoff frequency of the sensor's first-order low-pass, which acts before the noise is added; 0: no low-pass",
        source="assumed: none, an ideal sensor",
    )
    tool_mass: float = parameter(
        0.0,
        Within(0.0, 10.0, "kg"),
        "mass between sensor and tip; the sensor measures its weight, but not its inertial force",
        source="assumed: none, an ideal sensor",
    )
    estimate: bool = parameter(
        False, doc="whether slave/estimated_cf contains the force estimated from drive efforts and joint motion"
    )
    estimate_bandwidth: float = parameter(
        10.0,
        Within(0.1, 200.0, "Hz"),
        "bandwidth of the force estimate",
        source="assumed: above the frequencies of a hand, and below those that encoder steps disturb",
    )

    def write(self, p: SensorRecord, dt: float) -> None:
        """Write these values into the record of a simulated arm whose tick is ``dt`` [s]."""
        p["sensor_share"] = -math.expm1(-2.0 * math.pi * self.force_bandwidth * dt)
        p["sensor_noise"] = [self.force_noise] * 3 + [self.torque_noise] * 3
        p["sensor_offset"] = self.force_bias + self.torque_bias
        p["sensor_offset"][2] -= self.tool_mass * STANDARD_GRAVITY
        p["has_noise"] = np.any(p["sensor_noise"])
        p["is_estimated"] = self.estimate
        p["observer_gain"] = 2.0 * math.pi * self.estimate_bandwidth
        p["is_ideal"] = not (p["has_noise"] or p["sensor_share"] or np.any(p["sensor_offset"]))


class SensorNoise(Noise):
    """Noise of a sensor, reproducible with the same seed."""

    def __init__(self, seed: int) -> None:
        super().__init__()
        self._seed = seed
        self.reset()

    def reset(self) -> None:
        """Restart the noise from its first sample."""
        self.begin(np.random.default_rng((self._seed, _STREAM)))


@inner
def sense(p: SensorRecord, s: SensorState, arm: ArmParts, row: Row) -> None:
    """Write ``slave_measured_cf``: the sensor's measurement of ``slave_true_cf``.

    The low-pass is exact for a force that is constant during a tick.

    Args:
        p: Parameters.
        s: State; written.
        arm: Arm; its ``noises`` are standard normal numbers (N, 6).
        row: Signals.
    """
    for i in range(6):
        true = row.slave_true_cf[i]
        s.sensed[i] += p.sensor_share * (s.felt[i] - s.sensed[i])
        s.felt[i] = true
        if p.is_ideal:
            row.slave_measured_cf[i] = true
        else:
            passed = s.sensed[i] if p.sensor_share > 0.0 else true
            noise = p.sensor_noise[i] * arm.noises[s.next_noise % arm.noises.shape[0], i]
            row.slave_measured_cf[i] = passed + p.sensor_offset[i] + noise
    s.next_noise += p.has_noise
