"""Drives of a table or file: the given values of each joint; missing values are assumed.

Missing values of a joint are those of a small laboratory arm, in proportion to the joint's inertia. So the simulation
can resolve the assumed friction.
"""

import math
from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np

from teleop_core.base import ParameterError, UnknownNameError, damage_told, plain_yaml
from teleop_core.base.ranges import check
from teleop_core.robots.drives import ENTRIES, MAY_BE_ZERO, Drives

# All values are assumed, in [rad, N·m, s] for turning joints and in [m, N, s] for sliding joints.
_INERTIA = {"turn": 0.1, "slide": 2.0}
_SPEEDS = {
    "turn": {"friction_speed": 0.01, "speed_limit": 2.0, "encoder_step": 2e-5, "bandwidth": 60.0},
    "slide": {"friction_speed": 1e-3, "speed_limit": 0.3, "encoder_step": 1e-6, "bandwidth": 60.0},
}
_PER_INERTIA = {
    "turn": {"viscous": 2.0, "coulomb": 1.0, "effort_limit": 100.0},
    "slide": {"viscous": 10.0, "coulomb": 0.4, "effort_limit": 40.0},
}
_UNITS = {
    "turn": {"inertia": "kg·m²", "viscous": "N·m·s/rad", "coulomb": "N·m", "friction_speed":
             "rad/s", "effort_limit": "N·m", "speed_limit": "rad/s", "encoder_step": "rad"},
    "slide": {"inertia": "kg", "viscous": "N·s/m", "coulomb": "N", "friction_speed": "m/s",
              "effort_limit": "N", "speed_limit": "m/s", "encoder_step": "m"},
}  # fmt: skip
# Largest assumed friction, divided by the effort limit; for viscous friction, at the largest speed.
_MOST_ASSUMED = {"coulomb": 0.1, "viscous": 0.5}
_OF_POSITION = ("friction_speed", "speed_limit", "encoder_step")  # entries in the table's unit of angles
_FASTEST = {"bandwidth": 500.0}  # [rad/s], the largest that the 1 kHz control allows
# Largest rate [1/s] at which friction may slow a joint; the integration, with two steps per millisecond, resolves it.
_STIFFEST = 2000.0


def assumed_drive(kind: str, stated: Mapping[str, float]) -> dict[str, float]:
    """All entries of one joint, SI units; missing entries are filled in.

    Args:
        kind: "turn" or "slide".
        stated: Entries of :data:`teleop_core.robots.drives.ENTRIES` that are known.
    """
    inertia = stated.get("inertia", _INERTIA[kind])
    scaled = {name: share * inertia for name, share in _PER_INERTIA[kind].items()}
    joint = {"inertia": inertia, **scaled, **_SPEEDS[kind], **stated}
    most = {"coulomb": joint["effort_limit"], "viscous": joint["effort_limit"] / joint["speed_limit"]}
    for name, share in _MOST_ASSUMED.items():
        if name not in stated:
            joint[name] = min(joint[name], share * most[name])
    return joint


def drives_of(kinds: Sequence[str], stated: Sequence[Mapping[str, float]]) -> Drives:
    """Drive table of joints, each "turn" or "slide", from the given entries [SI] of each."""
    joints = [assumed_drive(kind, own) for kind, own in zip(kinds, stated, strict=True)]
    columns = {name: np.array([joint[name] for joint in joints]) for name in ENTRIES}
    assumed = tuple(name for name in ENTRIES if any(name not in own for own in stated))
    return Drives(**columns, assumed=assumed)


def least_inertia(kind: str, viscous: float, coulomb: float) -> float:
    """Smallest inertia [kg·m² or kg] of a drive with which its friction is not too stiff for the simulation.

    Args:
        kind: "turn" or "slide".
        viscous: Viscous friction [N·m·s/rad or N·s/m]; 0 if this value will be assumed.
        coulomb: Dry friction [N·m or N], at the assumed ``friction_speed``; 0 if this value will be assumed.
    """
    slow, assumed = _SPEEDS[kind]["friction_speed"], _PER_INERTIA[kind]
    rate = (0.0 if viscous else assumed["viscous"]) + (0.0 if coulomb else assumed["coulomb"]) / slow
    # The result is slightly larger than needed, because rounding in the check of the rate could refuse it.
    return 1.001 * (viscous + coulomb / slow) / (_STIFFEST - rate)


def read_drives(path: Path, names: Sequence[str], kinds: Sequence[str]) -> tuple[dict[str, float], ...]:
    """Given entries [SI] of each joint, from a YAML file like the ``drives`` section of a table.

    Raises:
        RecordingError: The file cannot be read, or is not YAML.
        TeleopError: As in :func:`parse_drives`, except for friction that is too stiff.
    """
    with damage_told(path):
        return _entries(plain_yaml.read(path), names, kinds, 1.0)


def parse_drives(content: Any, names: Sequence[str], kinds: Sequence[str], unit: float) -> tuple[dict[str, float], ...]:
    """Given entries [SI] of each joint, from the ``drives`` section of a table.

    Args:
        content: Mapping of joint names to mappings of entries; None when there is no section.
        names: Names of the joints, in order.
        kinds: "turn" or "slide" for each joint.
        unit: The table's unit of angles in radians.

    Raises:
        UnknownNameError: A joint or an entry does not exist.
        ParameterError: A value is impossible.
    """
    stated = _entries(content, names, kinds, unit)
    for name, kind, own in zip(names, kinds, stated, strict=True):
        _refuse_stiff(f"drives {name}", assumed_drive(kind, own))
    return stated


def _entries(content: Any, names: Sequence[str], kinds: Sequence[str], unit: float) -> tuple[dict[str, float], ...]:
    section = {} if content is None else content
    if not isinstance(section, Mapping):
        raise ParameterError("drives", section, "a mapping from joint names to their entries")
    for name in section:
        if name not in names:
            raise UnknownNameError("drives joint", name, names)
    return tuple(
        _joint(f"drives {name}", section.get(name, {}), kind, unit if kind == "turn" else 1.0)
        for name, kind in zip(names, kinds, strict=True)
    )


def _joint(where: str, content: Any, kind: str, unit: float) -> dict[str, float]:
    if not isinstance(content, Mapping):
        raise ParameterError(where, content, "a mapping of entries such as {speed_limit: 2.0}")
    stated: dict[str, float] = {}
    for name, value in content.items():
        if name not in ENTRIES:
            raise UnknownNameError(f"{where} entry", name, ENTRIES)
        number = _number(f"{where} {name}", name, value)
        scaled = number * (unit if name in _OF_POSITION else 1.0)
        stated[name] = check(f"{where} {name}", scaled, _UNITS[kind].get(name, ""))
    return stated


def _number(where: str, name: str, value: Any) -> float:
    is_least_zero, most = name in MAY_BE_ZERO, _FASTEST.get(name, math.inf)
    needed = "a finite number" + (" >= 0" if is_least_zero else " > 0")
    needed += f", <= {most:g}" if name in _FASTEST else ""
    if isinstance(value, str):  # YAML 1.1 reads 1e-4, without a decimal point, as a string
        with suppress(ValueError):
            value = float(value)
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        raise ParameterError(where, value, needed)
    if value < 0.0 or (value == 0.0 and not is_least_zero) or value > most:
        raise ParameterError(where, value, needed)
    return float(value)


def _refuse_stiff(where: str, joint: Mapping[str, float]) -> None:
    rate = (joint["viscous"] + joint["coulomb"] / joint["friction_speed"]) / joint["inertia"]
    if rate > _STIFFEST:
        name = f"{where} (viscous + coulomb / friction_speed) / inertia"
        needed = f"at most {_STIFFEST:g}/s; raise inertia or friction_speed"
        raise ParameterError(name, rate, needed)
