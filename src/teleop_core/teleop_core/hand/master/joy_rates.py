"""Joy rates: poses from the axes of Joy messages, which drivers of gamepads and 3-D mice send."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from teleop_core.base import Within, fixed
from teleop_core.hand.devices.pilot import RateParameters, steer
from teleop_core.kernels import Array

_LONGEST = 0.1  # a longer time between two messages is integrated as this time [s]


@dataclass(frozen=True, kw_only=True)
class JoyParameters(RateParameters):
    """How a device that sends rates in Joy messages moves the stylus, in the device's own frame."""

    axes: tuple[int, ...] = fixed(
        (0, 1, 2, 3, 4, 5),
        Within(-1, 63),
        "axes of the Joy that move the stylus along x, y, z and turn it about x, y, z; -1: no axis",
        length=6,
    )
    held_button: int = fixed(
        -1, Within(-1, 63), "index of the button that must be held to move; -1: no button is needed"
    )
    reach: float = fixed(
        0.1, Within(0.001, 1.0, "m"), "largest distance of the stylus from its start, along each axis", source="assumed"
    )


class JoyRates:
    """Pose (7,) integrated from the rates of Joy messages; it begins at the origin, without rotation.

    Args:
        parameters: Axes, speeds and bounds.
    """

    def __init__(self, parameters: JoyParameters) -> None:
        self._parameters, self._stamp_ns = parameters, 0
        self.pose: Array = np.array([0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0])

    def step(self, axes: Sequence[float], buttons: Sequence[int], stamp_ns: int) -> str:
        """Integrate up to the stamp [ns] of a message; return a text about its fault, empty for a valid message.

        A wrong message does not move the pose.
        """
        p = self._parameters
        if max(p.axes) >= len(axes) or p.held_button >= len(buttons):
            return f"its Joy has {len(axes)} axes and {len(buttons)} buttons, fewer than the parameters name"
        said = np.array([axes[place] if place >= 0 else 0.0 for place in p.axes], np.float64)
        if not np.isfinite(said).all():
            return "an axis of its Joy is not a finite number"
        time = min(max(1e-9 * (stamp_ns - self._stamp_ns), 0.0), _LONGEST) if self._stamp_ns else 0.0
        self._stamp_ns = max(stamp_ns, self._stamp_ns)
        if p.held_button >= 0 and not buttons[p.held_button]:
            return ""
        ends = np.full(3, p.reach)
        steer(self.pose, np.clip(said, -1.0, 1.0), time, p, -ends, ends)
        return ""
