"""Presets: import options for the files of known systems, by name; both hands where they have two.

Sources:
    jigsaws: Gao and others 2014, the data set's description of its 76 columns, 30 Hz; rotation
    matrices stand row by row. qualisys: Track Manager, export of rigid bodies (6D) as TSV; matrices
    stand column by column, which the Euler angles beside them confirm. dvrk: CRTK topics of the
    da Vinci Research Kit since 2.0. unity: the engine's left-handed axes, x to the right, y up, z
    forward, become those of ROS, x forward, y to the left, z up.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import TYPE_CHECKING

from teleop_core.base.errors import ParameterError, UnknownNameError

if TYPE_CHECKING:
    from teleop_exchange.options import ImportOptions, Option

Changes = Mapping[str, "Option"]
"""Import options by name."""


@dataclass(frozen=True)
class Preset:
    """Options of files of one kind.

    Attributes:
        text: What it is for, in a few words.
        options: Options of every hand.
        arms: Options of each hand beside these, the default arm first; none if there is one hand.
    """

    text: str
    options: Changes = field(default_factory=dict)
    arms: Mapping[str, Changes] = field(default_factory=dict)


_PEDALS = "console/clutch|footpedals/clutch|"
PRESETS: Mapping[str, Preset] = MappingProxyType({
    "dvrk": Preset(
        "bags of the da Vinci Research Kit: both masters and the clutch pedal",
        {"buttons_topic": _PEDALS},
        {"left": {"topic": "MTML/measured_cp"}, "right": {"topic": "MTMR/measured_cp"}},
    ),
    "jigsaws": Preset(
        "kinematics of JIGSAWS, 76 columns at 30 Hz: both masters",
        {"rate": 30.0, "unit": "m"},
        {"left": {"position": "1-3", "matrix": "4-12"},
         "right": {"position": "20-22", "matrix": "23-31"}},
    ),
    "qualisys": Preset(
        "rigid bodies (6D) of Qualisys Track Manager, TSV: the first one",
        {"unit": "mm", "time_unit": "s", "matrix_order": "column",
         "matrix": tuple(f"Rot[{i}]" for i in range(9))},
    ),
    "unity": Preset(
        "tables written by Unity: left-handed axes, y up, metres, degrees",
        {"unit": "m", "handedness": "left", "axes": ("+z", "-x", "+y"), "angles": "deg",
         "quaternion_order": "xyzw"},
    ),
})  # fmt: skip


def options_of(
    base: "ImportOptions", preset: str, arms: Mapping[str, Changes], changes: Changes
) -> dict[str, "ImportOptions"]:
    """Options of each arm, the default one first; ``{"": ...}`` if there is one without a name.

    Args:
        base: Where they start.
        preset: Name of one of :data:`PRESETS`, or empty.
        arms: What is said of each hand beside what is said of all; in place of the preset's hands.
        changes: What is said of all; over the preset.

    Raises:
        UnknownNameError: There is no such preset or option.
        ParameterError: An arm has no name that a topic can have.
    """
    if preset and preset not in PRESETS:
        raise UnknownNameError("--preset", preset, PRESETS)
    known = PRESETS[preset] if preset else Preset("")
    given = {**known.options, **changes}
    hands = arms or known.arms
    if not arms and {"position", "topic"} & set(changes):  # one hand of those of the preset
        hands = {}
    for name in hands:
        if not name.isidentifier() or not name.isascii():
            raise ParameterError("--arm", name, "a name of letters, digits and _")
    if not hands:
        return {"": base.changed(**given)}
    return {name: base.changed(**{**given, **own}) for name, own in hands.items()}
