"""Denavit-Hartenberg chains as values: rows in one convention, and the robot that is made from the rows."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np

from teleop_core.base import ShapeError
from teleop_core.kernels import Array, checked_array, product, rotation, transform
from teleop_core.kinematics import DIRECTIONS
from teleop_core.kinematics.closed_form.decomposition import SEARCH, Solution, solution_of
from teleop_core.robots.arms.dh_drives import drives_of
from teleop_core.robots.drives import Drives
from teleop_core.robots.dynamics.followers import Followers
from teleop_core.robots.robot import Robot

# Elementary motions of one row, from left to right. Each has a kind of motion, an axis and a symbol.
CONVENTIONS = {
    "standard": (("turn", "z", "theta"), ("slide", "z", "d"), ("slide", "x", "a"), ("turn", "x", "alpha")),
    "modified": (("turn", "x", "alpha"), ("slide", "x", "a"), ("turn", "z", "theta"), ("slide", "z", "d")),
    "sheth_uicker": (
        ("turn", "z", "gamma"),
        ("slide", "z", "c"),
        ("turn", "x", "alpha"),
        ("slide", "x", "a"),
        ("turn", "z", "beta"),
        ("slide", "z", "b"),
    ),
}


@dataclass(frozen=True, kw_only=True)
class DhJoint:
    """Joint of a row. The value of its symbol is ``sign * q`` plus the row's constant; limits in [rad or m]."""

    name: str
    symbol: str
    sign: float
    lower: float
    upper: float
    home: float
    start: float | None = None


@dataclass(frozen=True, kw_only=True)
class DhRow:
    """One row: constants by symbol [rad, m], and the joint if the row has a joint."""

    constants: Mapping[str, float]
    joint: DhJoint | None = None


@dataclass(frozen=True, kw_only=True)
class DhTable:
    """A chain: rows in one convention, from the base to the tip.

    ``task`` names the directions of :data:`DIRECTIONS` that the arm controls, in base axes; errors in the other
    directions appear in the residual. ``drives`` contains, for each joint, the given entries of its drive [SI];
    ``drives`` is empty if no entry is given.
    """

    name: str
    convention: str
    rows: tuple[DhRow, ...]
    task: tuple[str, ...] = DIRECTIONS
    drives: tuple[Mapping[str, float], ...] = ()

    @property
    def joints(self) -> tuple[DhJoint, ...]:
        """Joints from the base to the tip; one per degree of freedom of the chain."""
        return tuple(row.joint for row in self.rows if row.joint)

    @property
    def kinds(self) -> tuple[str, ...]:
        """For each joint "turn" or "slide"."""
        return tuple(kinds_of(self.convention)[joint.symbol] for joint in self.joints)

    def link_transforms(self, q: object) -> Array:
        """Transform of each row, frame i in frame i-1.

        Args:
            q: Joint vector (n,) [rad, m].

        Returns:
            (rows, 4, 4); their product from left to right is ``T_base_tip``.

        Raises:
            ShapeError: The shape of ``q`` is not (n,).
            ParameterError: ``q`` contains NaN or infinity.
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
                out[i] = product(out[i], elementary(kind, axis, amount))
        return out

    def robot(self, geometry: Mapping[str, float] = MappingProxyType({}), drives: Drives | None = None) -> Robot:
        """The chain as a robot, which can be a slave; its inverse kinematics are in closed form if the axes allow it.

        Args:
            geometry: Symbols and values that the robot shows; None for the symbols of its row.
            drives: Drive table that replaces the table's own.
        """
        kinds, fixed, reach = self._frames()
        stated = self.drives or ({},) * len(self.joints)
        return chain_robot(
            name=self.name,
            joints=self.joints,
            kinds=kinds,
            fixed=fixed,
            reach=reach,
            task=self.task,
            drives=drives or drives_of(self.kinds, stated),
            solution=solution_of(kinds, fixed, reach, self.task),
            geometry=geometry,
        )

    def _frames(self) -> tuple[list[float], list[Array], float]:
        """Kind of each joint, constant transforms between them, reach [m], for chain_robot."""
        kinds, reach, fixed = [], 0.0, [np.eye(4)]
        for row in self.rows:
            for kind, axis, symbol in CONVENTIONS[self.convention]:
                amount = row.constants.get(symbol, 0.0)
                fixed[-1] = product(fixed[-1], elementary(kind, axis, amount))
                reach += abs(amount) if kind == "slide" else 0.0
                if row.joint and symbol == row.joint.symbol:
                    kinds.append(row.joint.sign * (1.0 if kind == "turn" else 2.0))
                    fixed.append(np.eye(4))
                    if kind == "slide":
                        reach += max(abs(row.joint.lower), abs(row.joint.upper))
        return kinds, fixed, reach


def chain_robot(
    *,
    name: str,
    joints: Sequence[DhJoint],
    kinds: Sequence[float],
    fixed: Sequence[Array],
    reach: float,
    task: Sequence[str],
    drives: Drives,
    solution: Solution = SEARCH,
    followers: Followers | None = None,
    geometry: Mapping[str, float] = MappingProxyType({}),
) -> Robot:
    """Robot whose joints move about or along z, with constant transforms between them.

    Args:
        name: Name of the robot.
        joints: Joints from the base to the tip; their names, limits, home and start are used.
        kinds: Kind of each motion: 1 for a rotation, 2 for a translation; negative if it goes against its axis.
        fixed: Transforms (4, 4) before, between and after the motions, one more than motions.
        reach: Length [m] that relates distances to angles in the inverse kinematics; 0 means 1 m.
        task: Directions that the arm controls, of :data:`DIRECTIONS`.
        drives: Drive table.
        solution: Text about the method of inverse kinematics.
        followers: How the motions follow the joints; None if each motion is a joint.
        geometry: Symbols and values [m, rad] that the robot shows; None for the symbols of its row.
    """
    weights = {
        "reach": reach if reach > 0.0 else 1.0,
        **{f"controls_{direction}": float(direction in task) for direction in DIRECTIONS},
    }
    chain = {**{f"kind{i + 1}": kind for i, kind in enumerate(kinds)}, **weights}
    if followers is not None:
        chain = {
            **{f"joint{i + 1}": kind for i, kind in enumerate(followers.kinds)},
            **{f"joints_{key}": value for key, value in weights.items()},
            "motions": len(kinds) + 1.0,
            **{f"follower{i}": value for i, value in enumerate(followers.row)},
            **chain,
        }
    numbers = {
        f"fixed{i}_{r}{c}": float(matrix[r, c]) for i, matrix in enumerate(fixed) for r in range(3) for c in range(4)
    }
    row = {**chain, **numbers, **{f"solution{i}": value for i, value in enumerate(solution.constants)}}
    starts = [joint.home if joint.start is None else joint.start for joint in joints]
    return Robot(
        name=name,
        joint_names=tuple(joint.name for joint in joints),
        lower=np.array([joint.lower for joint in joints]),
        upper=np.array([joint.upper for joint in joints]),
        home=np.array([joint.home for joint in joints]),
        start=None if all(joint.start is None for joint in joints) else np.array(starts),
        geometry=geometry or row,
        row=np.array(list(row.values())) if geometry else None,
        kernels=solution.kernels,
        solution=solution.text,
        drives=drives,
        task_mask=tuple(direction in task for direction in DIRECTIONS),
    )


def elementary(kind: str, axis: str, amount: float) -> Array:
    """Transform (4, 4) of a "turn" [rad] about or a "slide" [m] along a coordinate axis."""
    if kind == "turn":
        return transform(rotation(axis, amount), np.zeros(3))
    return transform(np.eye(3), amount * np.eye(3)["xyz".index(axis)])


def kinds_of(convention: str) -> dict[str, str]:
    """Symbols of a row in a convention, and the kind of motion of each: "turn" or "slide"."""
    return {symbol: kind for kind, _, symbol in CONVENTIONS[convention]}
