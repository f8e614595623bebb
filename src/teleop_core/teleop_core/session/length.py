"""Length of a session: as long as the recordings that its hands follow, unless a duration is set."""

from collections.abc import Iterable
from dataclasses import fields, replace

import numpy as np

from teleop_core.graph.layers import SESSION, Layer, SessionParameters
from teleop_core.hand.master.operator import OPERATOR
from teleop_core.hand.operators import OPERATORS, Setting
from teleop_core.hand.operators.behaviour import OperatorParameters
from teleop_core.hand.operators.shapes import PHASES
from teleop_core.session.configuration import Configuration


def as_long_as_followed(made: Configuration, given: Iterable[Layer]) -> Configuration:
    """Session with the duration of the recordings that its operators follow.

    If the scenario itself chooses such an operator, the session lasts at least the scenario's duration. The slave then
    has time to arrive at the end of the hand's motion.

    Args:
        made: The session.
        given: Layers of the session without defaults and scenario; a duration in these layers is kept.

    Raises:
        TeleopError: A recording cannot be read.
    """
    said = list(given)
    if any("duration" in layer.get(SESSION, {}) for layer in said):
        return made
    lengths = [length for name in made.groups if (length := _length(made, name)) is not None]
    if not lengths:
        return made
    if made.scenario and not any(map(_chooses_operator, said)):
        lengths.append(made.session.duration)
    bounds = next(f for f in fields(SessionParameters) if f.name == "duration").metadata
    duration = float(np.clip(max(lengths), bounds["lower"], bounds["upper"]))
    session = replace(made.session, duration=duration)
    return replace(made, groups=made.groups | {SESSION: session})


def _chooses_operator(layer: Layer) -> bool:
    """Whether a layer sets the kind of an operator."""
    operators = (said for name, said in layer.items() if name.rpartition("/")[2] == OPERATOR.name)
    return any("kind" in said for said in operators)


def _length(made: Configuration, name: str) -> float | None:
    """Duration of an operator's motion [s]; None for other stages, and for a motion without end."""
    operator = made.groups[name]
    if not isinstance(operator, OperatorParameters):
        return None
    part = OPERATORS.find(operator.kind.kind)
    if part.length is None:
        return None
    setting = Setting(operator, np.zeros(PHASES), operator.seed)
    return part.length(operator.kind.parameters, setting)
