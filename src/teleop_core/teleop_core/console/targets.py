"""Targets: the points to which a simulated operator goes, in the space of the hand."""

import numpy as np

from teleop_core.console.link import Parameters
from teleop_core.geometry import Array
from teleop_core.operators.rest import REST_POSITION

_POINTS = {"tour": "tour.points", "points": "points"}
"""Operators that go to points, and where these stand."""


def targets_of(parameters: Parameters, arm: str) -> Array:
    """Points (N, 3) [m] in master_base to which the operator of an arm goes; none for others.

    Args:
        parameters: As :meth:`~teleop_core.console.link.Link.parameters` gives them.
        arm: Namespace of the arm.
    """
    node = f"{arm}/operator" if arm else "operator"
    values = {name: info.value for (owner, name), info in parameters.items() if owner == node}
    points = values.get(_POINTS.get(str(values.get("kind")), ""))
    center = np.array(values.get("center", (0.0, 0.0, 0.0)), dtype=np.float64)
    if not isinstance(points, tuple) or not points or len(points) % 3:
        return np.zeros((0, 3))
    return np.asarray(REST_POSITION + center + np.reshape(np.array(points, np.float64), (-1, 3)))
