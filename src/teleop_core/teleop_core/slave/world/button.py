"""Button: an upright post whose surface yields with a click, above a stiff stop.

Its spring force grows up to the click force, and then falls until the button is on its stop. The stop has the material
of the world. The button pushes less on release than on the press, because of dry friction. The dry friction is modelled
as a second spring, which yields at a bound: a share of the force of the first spring.
"""

from dataclasses import dataclass

import numpy as np

from teleop_core.base import ParameterError, Within, parameter
from teleop_core.kernels import Array, Fields, inner
from teleop_core.shapes import Shape
from teleop_core.shapes.basis import drawing
from teleop_core.shapes.cylinder import CylinderParameters, cylinder_distance, cylinder_outline

_STIFFER = 10.0  # stiffness of the friction's spring, divided by the steepest slope of the click spring
_LARGEST = 100.0  # largest click force [N]


class ButtonRecord(Fields):
    """Fields of a parameter record with the spring of a button; a click force of 0 means no button."""

    click_force: float  # [N]
    click_travel: float  # [m]
    contact_force: float  # [N]
    stroke: float  # [m]
    hysteresis: float


class ButtonState(Fields):
    """Fields of a state record with the state of a button."""

    gap: float  # gap of the tip along the present normal [m]
    is_pressed: int
    presses: int  # number of presses so far
    held: float  # bend of the friction's spring, positive inwards [m]


@dataclass(frozen=True, kw_only=True)
class ButtonParameters(CylinderParameters):
    """A post that is pressed from above, or from any other side."""

    radius: float = parameter(0.02, Within(1e-3, 1.0, "m"), "radius of the button's post")
    length: float = parameter(0.03, Within(1e-3, 2.0, "m"), "length of the button's post")
    direction: tuple[float, ...] = parameter(
        (0.0, 0.0, 1.0),
        Within(-1.0, 1.0),
        "axis of the button, pointing out of it; its length does not matter",
        length=3,
    )
    click_force: float = parameter(
        1.0, Within(0.01, _LARGEST, "N"), "force at which the button clicks, on the way in", source="assumed"
    )
    click_travel: float = parameter(2e-3, Within(1e-4, 0.1, "m"), "travel from rest to the click", source="assumed")
    contact_force: float = parameter(
        0.4, Within(0.0, _LARGEST, "N"), "force on the way in, just before the stop", source="assumed"
    )
    stroke: float = parameter(3e-3, Within(2e-4, 0.1, "m"), "travel from rest to the stop", source="assumed")
    hysteresis: float = parameter(
        0.3, Within(0.0, 1.0), "hysteresis: share of the spring's force that is lost on the way out", source="assumed"
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
def _spring(p: ButtonRecord, depth: float) -> float:
    """Force of the spring during a press [N], at a depth [m]."""
    if depth <= p.click_travel:
        return p.click_force * max(depth, 0.0) / p.click_travel
    fallen = min((depth - p.click_travel) / (p.stroke - p.click_travel), 1.0)
    return p.click_force + fallen * (p.contact_force - p.click_force)


@inner
def _stiffness(p: ButtonRecord) -> float:
    """Stiffness of the friction's spring [N/m].

    The stiffness is larger than the slope of the friction's bound over the travel. Otherwise the bound, which changes
    with the travel, would move the spring and add energy.
    """
    return _STIFFER * p.click_force / min(p.click_travel, p.stroke - p.click_travel)


@inner
def follow_button(p: ButtonRecord, s: ButtonState, before: float) -> None:
    """Update the friction by the motion of a tick, and count a press.

    The button counts as pressed from the moment it reaches the stop until it is back at the click.

    Args:
        p: Parameters.
        s: State with the present gap; written.
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
def push_of_button(p: ButtonRecord, s: ButtonState, depth: float) -> float:
    """Push of spring and friction [N] at a depth [m]; the push of the stop is added elsewhere.

    Within a tick the push is a function of the position alone.
    """
    spring = _spring(p, depth)
    most = 0.5 * p.hysteresis * spring
    friction = _stiffness(p) * (s.held + depth - max(-s.gap, 0.0))
    return spring - most + min(max(friction, -most), most)


def count_presses(depths: Array, parameters: ButtonParameters, *, is_pressed: bool) -> tuple[int, bool]:
    """Count presses along a path, as :func:`follow_button` does tick by tick.

    Args:
        depths: Depths of the tip behind the surface, shape (N,) [m].
        parameters: Parameters of the button.
        is_pressed: Whether the button was pressed before the first depth.

    Returns:
        Number of new presses, and whether the button is pressed at the end.
    """
    is_down = depths >= parameters.stroke
    is_known = is_down | (depths <= parameters.click_travel)  # between these two depths the state does not change
    states = np.append(is_pressed, is_down[is_known])
    return int(np.sum(states[1:] & ~states[:-1])), bool(states[-1])


def button_outline(parameters: ButtonParameters) -> Array:
    """Lines of the post, and of its upper end when pressed to the stop, (N, 3) [m] around the middle."""
    axis = drawing.unit_vector(parameters.direction)
    stop = (0.5 * parameters.length - parameters.stroke) * axis
    end = drawing.ring(stop, axis, parameters.radius)
    return drawing.with_lifts([cylinder_outline(parameters), end])


BUTTON = Shape("button", ButtonParameters, cylinder_distance, button_outline)
