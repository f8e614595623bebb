"""Denavit-Hartenberg chains from a table: standard, modified and Sheth-Uicker, as robots.

A table is YAML, one row per link, written as in a textbook, with ``q`` for the joint variable::

    name: scara
    convention: modified        # alpha, a: of the link before; standard: of the link itself
    angles: degrees             # or radians, the default; lengths are metres
    rows:
      - {theta: q, lower: -150, upper: 150}
      - {a: 0.4, theta: q, lower: -150, upper: 150}
      - {a: 0.3, d: -q, lower: 0.0, upper: 0.2, name: d3}
      - {theta: q - 90}

Entries that are left out are 0. A row without ``q`` is a fixed frame, such as a tool. Turning joints without limits get
±180 degrees; sliding joints must state their limits. ``home`` is the posture of the published or natural zero.
``start`` is the posture at which sessions start; joints without ``start`` use ``home``. If no row has a ``start``, a
posture with room in all directions is searched (:mod:`teleop_core.robots.freedom`).

Every chain can be a slave. Its drives are described, joint by joint, in a separate section::

    drives:
      q1: {inertia: 0.6, speed_limit: 200, effort_limit: 60}
      d3: {inertia: 6.0, speed_limit: 1.0}

The entries are those of :class:`~teleop_core.robots.drives.Drives`: For turning joints, ``speed_limit``,
``friction_speed`` (per second) and ``encoder_step`` are in the table's unit of angles. All other entries are in SI
units (N·m·s/rad, rad/s). Missing entries are assumed (:mod:`teleop_core.robots.arms.dh_drives`), and
``Robot.drives.assumed`` names them. The axes have no dynamic coupling, and gravity counts as balanced.

Source:
    Denavit and Hartenberg 1955 (standard, also distal); Craig 2005 (modified, proximal); Sheth and Uicker 1971, with
    the order of motions that includes the other two conventions as special cases.
"""

import math
import re
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from teleop_core.base import ParameterError, UnknownNameError, damage_told, plain_yaml
from teleop_core.base.ranges import MOST_OF_ARM, check
from teleop_core.kinematics import DIRECTIONS
from teleop_core.robots.arms.dh_chain import CONVENTIONS, DhJoint, DhRow, DhTable, elementary
from teleop_core.robots.arms.dh_drives import parse_drives
from teleop_core.robots.robot import Robot

__all__ = [
    "CONVENTIONS",
    "DIRECTIONS",
    "DhJoint",
    "DhRow",
    "DhTable",
    "elementary",
    "load_table",
    "parse_table",
    "robot_from_table",
]
_EXPRESSION = re.compile(r"([+-]?)\s*q\s*(?:([+-])\s*((?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?))?", re.A)
_JOINT_KEYS = ("name", "lower", "upper", "home", "start")


def load_table(path: Path | str) -> DhTable:
    """Table from a YAML file.

    Raises:
        RecordingError: The file cannot be read, or is not YAML.
        ParameterError: An entry is missing or impossible.
        UnknownNameError: A convention, direction or entry that does not exist.
    """
    with damage_told(Path(path)):
        return parse_table(plain_yaml.read(Path(path)))


def robot_from_table(content: object) -> Robot:
    """Robot from the content of a table's YAML file; errors as in :func:`load_table`."""
    return parse_table(content).robot()


def parse_table(content: object) -> DhTable:
    """Table from the content of its YAML file; errors as in :func:`load_table`."""
    if not isinstance(content, Mapping):
        raise ParameterError("table", content, "a mapping with name, convention and rows")
    _known("entry", content, ("name", "convention", "angles", "task", "rows", "drives"))
    convention = _choice("convention", content.get("convention"), CONVENTIONS)
    angles = _choice("angles", content.get("angles", "radians"), ("radians", "degrees"))
    rows, task = content.get("rows"), content.get("task", DIRECTIONS)
    if not isinstance(content.get("name"), str):
        raise ParameterError("name", content.get("name"), "a text")
    if not isinstance(rows, list) or not rows:
        raise ParameterError("rows", rows, "a list with at least one row")
    if not isinstance(task, list | tuple) or not task:
        raise ParameterError("task", task, "a list of directions")
    for direction in task:
        _choice("task", direction, DIRECTIONS)
    unit = math.pi / 180.0 if angles == "degrees" else 1.0
    parsed = tuple(_row(i + 1, row, convention, unit) for i, row in enumerate(rows))
    if not any(row.joint for row in parsed):
        raise ParameterError("rows", rows, "with q in at least one row")
    table = DhTable(name=content["name"], convention=convention, rows=parsed, task=tuple(task))
    names = [joint.name for joint in table.joints]
    if len(set(names)) < len(names):
        raise ParameterError("rows", names, "with joint names that differ")
    return replace(table, drives=parse_drives(content.get("drives"), names, table.kinds, unit))


def _row(number: int, row: Any, convention: str, unit: float) -> DhRow:
    where = f"row {number}"
    if not isinstance(row, Mapping):
        raise ParameterError(where, row, "a mapping of symbols")
    kinds = {symbol: (kind, axis) for kind, axis, symbol in CONVENTIONS[convention]}
    _known(where, row, (*kinds, *_JOINT_KEYS))
    constants: dict[str, float] = {}
    joint = None
    for symbol, (kind, axis) in kinds.items():
        scale = unit if kind == "turn" else 1.0
        text = row.get(symbol, 0.0)
        if not isinstance(text, str):
            constants[symbol] = scale * _number(f"{where} {symbol}", text, kind)
            continue
        match = _EXPRESSION.fullmatch(text.strip())
        if match is None or axis != "z" or joint is not None:
            wanted = "a number, or for one z symbol of the row an expression like q, -q or q - 90"
            raise ParameterError(f"{where} {symbol}", text, wanted)
        offset = _number(f"{where} {symbol}", float(match[3] or 0.0), kind)
        constants[symbol] = scale * (-offset if match[2] == "-" else offset)
        joint = _joint(number, row, symbol, -1.0 if match[1] == "-" else 1.0, scale, kind)
    if joint is None and any(key in row for key in _JOINT_KEYS[1:]):
        raise ParameterError(where, dict(row), "without limits, home and start, for it has no q")
    return DhRow(constants=constants, joint=joint)


def _joint(number: int, row: Mapping[str, Any], symbol: str, sign: float, scale: float, kind: str) -> DhJoint:
    where = f"row {number}"
    circle = math.pi / scale if kind == "turn" else None
    bounds = []
    for key, default in (("lower", circle and -circle), ("upper", circle)):
        bounds.append(scale * _number(f"{where} {key}", row.get(key, default), kind))
    lower, upper = bounds
    if lower >= upper:
        raise ParameterError(f"{where} lower", lower, f"below upper ({upper!r})")
    middle = 0.0 if lower <= 0.0 <= upper else 0.5 * (lower + upper)
    home = scale * _number(f"{where} home", row["home"], kind) if "home" in row else middle
    start = scale * _number(f"{where} start", row["start"], kind) if "start" in row else None
    for name, value in (("home", home), ("start", home if start is None else start)):
        if not lower <= value <= upper:
            raise ParameterError(f"{where} {name}", value, f"between {lower!r} and {upper!r}")
    name = str(row.get("name", f"q{number}"))
    return DhJoint(name=name, symbol=symbol, sign=sign, lower=lower, upper=upper, home=home, start=start)


def _number(name: str, value: Any, kind: str) -> float:
    """Length [m] or angle; the bounds of angles in radians are used for degrees too."""
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        raise ParameterError(name, value, "a finite number")
    return check(name, float(value), "rad" if kind == "turn" else "m", MOST_OF_ARM)


def _choice(name: str, value: Any, choices: Any) -> str:
    if not isinstance(value, str) or value not in choices:
        raise UnknownNameError(name, value, choices)
    return value


def _known(name: str, entries: Mapping[Any, Any], known: tuple[str, ...]) -> None:
    for entry in entries:
        if entry not in known:
            raise UnknownNameError(f"{name} entry", entry, known)
