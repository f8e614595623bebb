"""Button: an upright post whose surface gives way with a click, over a stiff stop.

Its spring resists more and more up to the click force, then less until it is on its stop, which is
made of the material of the world. On the way out it pushes less than on the way in: dry friction in
it, a share of its force, is a second spring that yields at this bound.
"""

from dataclasses import dataclass

import numpy as np

from teleop_core.base import ParameterError, Within, parameter
from teleop_core.kernels import Array, Fields, inner
from teleop_core.shapes import Shape
from teleop_core.shapes.basis import drawing
from teleop_core.shapes.cylinder import CylinderParameters, cylinder_distance, cylinder_outline

_STIFFER = 10.0  # spring of the friction, over the steepest that the snapping one can be
_LARGEST = 100.0  # click force [N]


class ButtonNumbers(Fields):
    """Fields of a parameter record with the spring of a button; no click force: no button."""

    click_force: float  # [N]
    click_travel: float  # [m]
    contact_force: float  # [N]
    stroke: float  # [m]
    hysteresis: float


class ButtonState(Fields):
    """Fields of a state record with what a button does."""

    gap: float  # of the tip, along the normal in force [m]
    is_pressed: int
    presses: int  # so far
    held: float  # bend of the friction's spring, positive inwards [m]


@dataclass(frozen=True, kw_only=True)
class ButtonParameters(CylinderParameters):
    """A post that is pressed from above, or from any other side."""

    radius: float = parameter(0.02, Within(1e-3, 1.0, "m"), "of the post")
    length: float = parameter(0.03, Within(1e-3, 2.0, "m"), "from end to end")
    direction: tuple[float, ...] = parameter((0.0, 0.0, 1.0), Within(-1.0, 1.0), "upwards, of any length", length=3)
    click_force: float = parameter(1.0, Within(0.01, _LARGEST, "N"), "on the way in, where it snaps", source="assumed")
    click_travel: float = parameter(2e-3, Within(1e-4, 0.1, "m"), "way to the click", source="assumed")
    contact_force: float = parameter(
        0.4, Within(0.0, _LARGEST, "N"), "on the way in, just before the stop", source="assumed"
    )
    stroke: float = parameter(3e-3, Within(2e-4, 0.1, "m"), "way to the stop", source="assumed")
    hysteresis: float = parameter(
        0.3, Within(0.0, 1.0), "share of the spring's force that is missing on the way out", source="assumed"
    )

    def __post_init__(self) -> None:
        half = min(self.radius, 0.5 * self.length)
        super().__post_init__()
        if self.stroke >= half:
            text = f"less than the radius and half of the length ({half:g} m)"
            raise ParameterError("button.stroke", self.stroke, text)
        if not self.stroke > self.click_travel:
            text = f"more than click_travel ({self.click_travel:g} m)"
            raise ParameterError("button.stroke", self.stroke, text)
        if self.contact_force > self.click_force:
            text = f"at most click_force ({self.click_force:g} N)"
            raise ParameterError("button.contact_force", self.contact_force, text)


@inner
def _spring(p: ButtonNumbers, depth: float) -> float:
    """Force of the spring on the way in [N], at a depth [m]."""
    if depth <= p.click_travel:
        return p.click_force * max(depth, 0.0) / p.click_travel
    fallen = min((depth - p.click_travel) / (p.stroke - p.click_travel), 1.0)
    return p.click_force + fallen * (p.contact_force - p.click_force)


@inner
def _stiffness(p: ButtonNumbers) -> float:
    """Stiffness of the friction's spring [N/m].

    It is more than the slope of the bound, or the bound would lead the spring and give it energy.
    """
    return _STIFFER * p.click_force / min(p.click_travel, p.stroke - p.click_travel)


@inner
def follow_button(p: ButtonNumbers, s: ButtonState, before: float) -> None:
    """Let the friction take up the way of a tick, and count the press.

    The button is pressed from the stop on, and until it is back at the click.

    Args:
        p: Parameters.
        s: State, with the gap now; written.
        before: Gap a tick ago [m].
    """
    depth = max(-s.gap, 0.0)
    most = 0.5 * p.hysteresis * _spring(p, depth) / _stiffness(p)
    s.held = min(max(s.held + depth - max(-before, 0.0), -most), most)
    if depth >= p.stroke:
        s.presses += 1 - s.is_pressed
        s.is_pressed = 1
    elif depth <= p.click_travel:
        s.is_pressed = 0


@inner
def push_of_button(p: ButtonNumbers, s: ButtonState, depth: float) -> float:
    """Push of spring and friction [N] at a depth [m]; that of the stop comes on top.

    Within a tick it is a function of the place alone.
    """
    spring = _spring(p, depth)
    most = 0.5 * p.hysteresis * spring
    friction = _stiffness(p) * (s.held + depth - max(-s.gap, 0.0))
    return spring - most + min(max(friction, -most), most)


def count_presses(depths: Array, parameters: ButtonParameters, *, is_pressed: bool) -> tuple[int, bool]:
    """Count presses along a way, as :func:`follow_button` does tick by tick.

    Args:
        depths: Of the tip behind the surface, shape (N,) [m].
        parameters: Of the button.
        is_pressed: Whether it was pressed before the first of them.

    Returns:
        Number of new presses, and whether it is pressed at the end.
    """
    is_down = depths >= parameters.stroke
    is_known = is_down | (depths <= parameters.click_travel)  # in between it stays as it was
    states = np.append(is_pressed, is_down[is_known])
    return int(np.sum(states[1:] & ~states[:-1])), bool(states[-1])


def button_outline(parameters: ButtonParameters) -> Array:
    """The post, and its upper end where that is on its stop, (N, 3) [m] around the middle."""
    axis = drawing.unit_vector(parameters.direction)
    stop = (0.5 * parameters.length - parameters.stroke) * axis
    end = drawing.ring(stop, axis, parameters.radius)
    return drawing.with_lifts([cylinder_outline(parameters), end])


BUTTON = Shape("button", ButtonParameters, cylinder_distance, button_outline)
