"""Filters: the reference low-pass that keeps gimbal noise off the slave."""

from teleop_core.kernels import kernel


@kernel
def lag_step(
    value: float, last_input: float, last_output: float, gain: float, zero: float, pole: float, dt: float
) -> float:
    """Next output of the first-order lag ``gain (s + zero) / (s + pole)`` by forward Euler.

    ``c(k) = (1 - pole T) c(k-1) + gain (zero T - 1) r(k-1) + gain r(k)``. The defaults of the source, 0.1 (s + 100)/(s
    + 10), pass slow motion unchanged, reduce fast motion to a tenth, and lag behind a ramp by 90 ms.

    Args:
        value: Input of this tick.
        last_input: Input of the last tick.
        last_output: Output of the last tick.
        gain: High-frequency gain.
        zero: Zero [rad/s].
        pole: Pole [rad/s]; must be below 2/dt, otherwise the output diverges.
        dt: Tick [s].

    Source:
        Vongbunyong 2008, eqs. 6.2.8-6.2.9; printed there with the pole outside the unit circle.
    """
    return (1.0 - pole * dt) * last_output + gain * (zero * dt - 1.0) * last_input + gain * value
