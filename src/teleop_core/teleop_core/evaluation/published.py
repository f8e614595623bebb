"""Published figures: what the RCRT-1 reached with a Phantom Omni and a human operator."""

import math
from dataclasses import dataclass

SOURCE = "Vongbunyong 2008, Table 8.2"


@dataclass(frozen=True)
class Published:
    """Root mean square and maximum of one mode: position [mm], angles [deg]."""

    mode: str
    gain: float
    position_mm: tuple[float, float]
    roll_deg: tuple[float, float]
    pitch_deg: tuple[float, float]
    yaw_deg: tuple[float, float]


COARSE = Published("coarse", 1.0, (0.338, 0.702), (0.044, 0.172), (0.092, 0.828), (0.112, 0.537))
# Table 8.2's maximum; the text's 0.266 mm is below its own root mean square.
FINE = Published("fine", 0.1, (0.293, 0.791), (0.077, 0.628), (0.105, 0.832), (0.153, 0.811))

BOX_OVERSHOOT_MM = 1.0
"""How far the source's paths went beyond each wall, about [mm] (section 7.6)."""
ORIENTATION_MAX_DEG = 0.9
"""What the source claims for every angle in both modes [deg] (chapter 8)."""


def published_for(gain: float | None, robot: str | None = "rcrt1") -> Published | None:
    """Figures of the mode whose gain is nearer, on a scale of ratios.

    Returns:
        None without a gain, and for another robot than the one they are of; a recording that
        does not name its robot (None) may be of it.
    """
    if gain is None or not gain > 0.0 or robot not in {"rcrt1", None}:
        return None
    return min((COARSE, FINE), key=lambda mode: abs(math.log(gain / mode.gain)))
