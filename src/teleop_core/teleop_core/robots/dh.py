"""Denavit-Hartenberg chains from a table: standard, modified and Sheth-Uicker, as robots.

A table is YAML, one row per link, written as in a textbook with ``q`` in the place of the joint
variable::

    name: scara
    convention: modified        # alpha, a: of the link before; standard: of the link itself
    angles: degrees             # or radians, the default; lengths are metres
    rows:
      - {theta: q, lower: -150, upper: 150}
      - {a: 0.4, theta: q, lower: -150, upper: 150}
      - {a: 0.3, d: -q, lower: 0.0, upper: 0.2, name: d3}
      - {theta: q - 90}

Entries that are left out are 0. A row without ``q`` is a fixed frame, such as a tool. Turning
joints without limits have ±180 degrees; sliding ones must state theirs.

Source:
    Denavit and Hartenberg 1955 (standard, also distal); Craig 2005 (modified, proximal); Sheth
    and Uicker 1971, in the order that reproduces the other two.
"""

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from teleop_core.errors import ParameterError, ShapeError, UnknownNameError
from teleop_core.geometry import Array, checked_array, rotation, transform
from teleop_core.robots import dh_kernels
from teleop_core.robots.kinematics import DIRECTIONS, Kernels
from teleop_core.robots.robot import Robot

# Elementary motions of one row, left to right: what, along or about which axis, by which symbol.
CONVENTIONS = {
    "standard": (("turn", "z", "theta"), ("slide", "z", "d"),
                 ("slide", "x", "a"), ("turn", "x", "alpha")),
    "modified": (("turn", "x", "alpha"), ("slide", "x", "a"),
                 ("turn", "z", "theta"), ("slide", "z", "d")),
    "sheth_uicker": (("turn", "z", "gamma"), ("slide", "z", "c"),
                     ("turn", "x", "alpha"), ("slide", "x", "a"),
                     ("turn", "z", "beta"), ("slide", "z", "b")),
}  # fmt: skip
_EXPRESSION = re.compile(r"([+-]?)\s*q\s*(?:([+-])\s*([0-9.eE]+))?")
_JOINT_KEYS = ("name", "lower", "upper", "home")


@dataclass(frozen=True, kw_only=True)
class DhJoint:
    """Joint of a row: its symbol is ``sign * q`` plus the row's constant; limits [rad or m]."""

    name: str
    symbol: str
    sign: float
    lower: float
    upper: float
    home: float


@dataclass(frozen=True, kw_only=True)
class DhRow:
    """One row: constants by symbol [rad, m], and the joint if it has one."""

    constants: Mapping[str, float]
    joint: DhJoint | None = None


@dataclass(frozen=True, kw_only=True)
class DhTable:
    """A chain: rows in one convention, from the base to the tip.

    ``task`` names the directions that the arm is to control, in base axes, of
    :data:`DIRECTIONS`; the others are left to the residual.
    """

    name: str
    convention: str
    rows: tuple[DhRow, ...]
    task: tuple[str, ...] = DIRECTIONS

    @property
    def joints(self) -> tuple[DhJoint, ...]:
        """Joints from the base to the tip; their number is the chain's degrees of freedom."""
        return tuple(row.joint for row in self.rows if row.joint)

    def link_transforms(self, q: object) -> Array:
        """Transform of each row, frame i in frame i-1.

        Args:
            q: Joint vector (n,) [rad, m].

        Returns:
            (rows, 4, 4); their product from left to right is ``T_base_tip``.

        Raises:
            ShapeError: Another shape.
            ParameterError: NaN or infinity.
        """
        values = checked_array("q", q, (len(self.joints),))
        if values.ndim != 1:
            raise ShapeError("q", (len(self.joints),), values.shape)
        moves, out = iter(values), np.empty((len(self.rows), 4, 4))
        for i, row in enumerate(self.rows):
            out[i] = np.eye(4)
            value = next(moves) * row.joint.sign if row.joint else 0.0
            for kind, axis, symbol in CONVENTIONS[self.convention]:
                amount = row.constants.get(symbol, 0.0)
                if row.joint and symbol == row.joint.symbol:
                    amount += value
                out[i] = out[i] @ elementary(kind, axis, amount)
        return out

    def robot(self) -> Robot:
        """The chain as a robot with numeric inverse kinematics; it has no drives."""
        return Robot(
            name=self.name,
            joint_names=tuple(joint.name for joint in self.joints),
            lower=np.array([joint.lower for joint in self.joints]),
            upper=np.array([joint.upper for joint in self.joints]),
            home=np.array([joint.home for joint in self.joints]),
            geometry=self._geometry(),
            kernels=Kernels(
                fk=dh_kernels.fk,
                jacobian=dh_kernels.jacobian,
                ik=dh_kernels.ik,
                ik_all=dh_kernels.ik_all,
            ),
            task_mask=tuple(direction in self.task for direction in DIRECTIONS),
        )

    def _geometry(self) -> dict[str, float]:
        """Row of :mod:`teleop_core.robots.dh_kernels`, every number with a name."""
        kinds, reach, fixed = [], 0.0, [np.eye(4)]
        for row in self.rows:
            for kind, axis, symbol in CONVENTIONS[self.convention]:
                amount = row.constants.get(symbol, 0.0)
                fixed[-1] = fixed[-1] @ elementary(kind, axis, amount)
                reach += abs(amount) if kind == "slide" else 0.0
                if row.joint and symbol == row.joint.symbol:
                    kinds.append(row.joint.sign * (1.0 if kind == "turn" else 2.0))
                    fixed.append(np.eye(4))
                    if kind == "slide":
                        reach += max(abs(row.joint.lower), abs(row.joint.upper))
        names = {f"kind{i + 1}": kind for i, kind in enumerate(kinds)}
        weights = {f"controls_{name}": float(name in self.task) for name in DIRECTIONS}
        numbers = {
            f"fixed{i}_{r}{c}": float(matrix[r, c])
            for i, matrix in enumerate(fixed)
            for r in range(3)
            for c in range(4)
        }
        return {**names, "reach": reach if reach > 0.0 else 1.0, **weights, **numbers}


def elementary(kind: str, axis: str, amount: float) -> Array:
    """Transform (4, 4) of a "turn" [rad] about or a "slide" [m] along a coordinate axis."""
    if kind == "turn":
        return transform(rotation(axis, amount), np.zeros(3))
    return transform(np.eye(3), amount * np.eye(3)["xyz".index(axis)])


def load_table(path: Path | str) -> DhTable:
    """Table from a YAML file.

    Raises:
        ParameterError: Not YAML, or an entry that is missing or not possible.
        UnknownNameError: A convention, direction or entry that does not exist.
        OSError: The file cannot be read.
    """
    try:
        content = yaml.safe_load(Path(path).read_text(encoding="utf-8"))
    except (yaml.YAMLError, UnicodeDecodeError) as error:
        raise ParameterError("table", str(path), f"a YAML file ({error})") from error
    return parse_table(content)


def parse_table(content: Any) -> DhTable:
    """Table from what its YAML file holds; errors as :func:`load_table`."""
    if not isinstance(content, Mapping):
        raise ParameterError("table", content, "a mapping with name, convention and rows")
    _known("entry", content, ("name", "convention", "angles", "task", "rows"))
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
    return DhTable(name=content["name"], convention=convention, rows=parsed, task=tuple(task))


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
            constants[symbol] = scale * _number(f"{where} {symbol}", text)
            continue
        match = _EXPRESSION.fullmatch(text.strip())
        if match is None or axis != "z" or joint is not None:
            wanted = "a number, or for one z symbol of the row an expression like q, -q or q - 90"
            raise ParameterError(f"{where} {symbol}", text, wanted)
        offset = _number(f"{where} {symbol}", float(match[3] or 0.0))
        constants[symbol] = scale * (-offset if match[2] == "-" else offset)
        joint = _joint(number, row, symbol, -1.0 if match[1] == "-" else 1.0, scale, kind)
    if joint is None and any(key in row for key in _JOINT_KEYS[1:]):
        raise ParameterError(where, dict(row), "without limits and home, for it has no q")
    return DhRow(constants=constants, joint=joint)


def _joint(
    number: int, row: Mapping[str, Any], symbol: str, sign: float, scale: float, kind: str
) -> DhJoint:
    where = f"row {number}"
    circle = math.pi / scale if kind == "turn" else None
    bounds = []
    for key, default in (("lower", circle and -circle), ("upper", circle)):
        bounds.append(scale * _number(f"{where} {key}", row.get(key, default)))
    lower, upper = bounds
    if lower >= upper:
        raise ParameterError(f"{where} lower", lower, f"below upper ({upper!r})")
    middle = 0.0 if lower <= 0.0 <= upper else 0.5 * (lower + upper)
    home = scale * _number(f"{where} home", row["home"]) if "home" in row else middle
    if not lower <= home <= upper:
        raise ParameterError(f"{where} home", home, f"between {lower!r} and {upper!r}")
    name = str(row.get("name", f"q{number}"))
    return DhJoint(name=name, symbol=symbol, sign=sign, lower=lower, upper=upper, home=home)


def _number(name: str, value: Any) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        raise ParameterError(name, value, "a finite number")
    return float(value)


def _choice(name: str, value: Any, choices: Any) -> str:
    if not isinstance(value, str) or value not in choices:
        raise UnknownNameError(name, value, choices)
    return value


def _known(name: str, entries: Mapping[Any, Any], known: tuple[str, ...]) -> None:
    for entry in entries:
        if entry not in known:
            raise UnknownNameError(f"{name} entry", entry, known)
