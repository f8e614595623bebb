"""Rendering: the force that the device applies for a commanded force, limited by peak force and motor heat."""

import math

from teleop_core.hand.master.device import DeviceParameters
from teleop_core.kernels import Array, Fields, inner

# While the heat rises through the last quarter of its allowed range, the peak force falls to the continuous force.
_LAST = 0.25


class RenderingRecord(Fields):
    """Fields of a parameter record with the allowed forces of the motors."""

    device: DeviceParameters
    warming: float  # share by which the heat approaches its final value in a tick


class RenderingState(Fields):
    """Fields of a state record with the heat of the motors."""

    heat: float  # mean square of the force [N²]


@inner
def largest_force(p: RenderingRecord, s: RenderingState) -> float:
    """Force that the device can apply in this tick [N].

    The heat of the motors is the mean square of the force, by a first-order lag: a balance of Joule heat and cooling.
    It never exceeds the square of the continuous force. Up to three quarters of that square, the peak force is
    available. Above, the square of the available force falls linearly with the heat. So a constant command ends at the
    continuous force.

    Args:
        p: Parameters.
        s: State.
    """
    continuous, peak = p.device.continuous_force, p.device.peak_force
    bearable = continuous * continuous
    if continuous >= peak:
        return peak
    left = max(bearable - s.heat, 0.0)
    square = bearable + (peak * peak - bearable) * min(left / (_LAST * bearable), 1.0)
    # If a tick is long compared with the time constant, the force is limited so that the heat stays in its range.
    return math.sqrt(min(square, s.heat + left / p.warming))


@inner
def render(p: RenderingRecord, s: RenderingState, command: Array, force: Array) -> float:
    """Write the force (3,) [N] that the device applies for a command (3,) [N], and update the heat.

    Args:
        p: Parameters.
        s: State; written.
        command: Commanded force.
        force: Applied force, in the direction of the command; written.

    Returns:
        The largest force that was possible [N].
    """
    most = largest_force(p, s)
    size = math.sqrt(command[0] ** 2 + command[1] ** 2 + command[2] ** 2)
    share = 1.0 if size <= most else most / size
    square = 0.0
    for i in range(3):
        force[i] = share * command[i]
        square += force[i] * force[i]
    s.heat += (square - s.heat) * p.warming
    return most
