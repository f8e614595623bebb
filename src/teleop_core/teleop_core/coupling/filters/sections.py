"""Sections: filters of second order from which notch, band stop and high-pass are made."""

from teleop_core.kernels import Array, inner

WIDTH = 3
"""Number of values that a section remembers: band-pass, low-pass, and input."""


@inner
def advance_section(memory: Array, at: int, value: float, slope: float, damping: float) -> None:
    """Advance the band-pass and the low-pass of a section to the next sample.

    With the input u, band-pass b and low-pass l obey ``db/dt = w (u - l - damping b)`` and ``dl/dt = w b``. They are
    integrated by the trapezoidal rule. For a constant period this is the bilinear transform; for a changing period it
    never diverges. The high-pass of the section is ``u - damping b - l``, its notch ``u - damping b``.

    Args:
        memory: Memory of the filter; written.
        at: Index in ``memory`` at which the section's :data:`WIDTH` numbers begin.
        value: Input.
        slope: ``tan(w period / 2)`` of the section's frequency w.
        damping: Inverse of the quality; 2 for critical damping.
    """
    band, low, before = memory[at], memory[at + 1], memory[at + 2]
    stiff = slope * (damping + slope)
    new = ((1.0 - stiff) * band + slope * (before + value - 2.0 * low)) / (1.0 + stiff)
    memory[at], memory[at + 1], memory[at + 2] = new, low + slope * (band + new), value
