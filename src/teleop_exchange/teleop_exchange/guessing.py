"""Guessing: chooses the columns of position and orientation by their names, and refuses if the choice is not unique.

Position and orientation belong to the same body: the words of their names that are neither axis nor quantity are equal,
as in ``left_pos_x`` and ``left_rot_w``.
"""

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NoReturn

import numpy as np

from teleop_core.base.errors import RecordingError
from teleop_core.kernels import length
from teleop_core.session.recorded_hand import COLUMNS
from teleop_exchange import names, orientation, tables

_EXACT = 0.02
"""Largest deviation from unit length of columns that are a quaternion by their numbers alone."""
_CLEARLY = 5.0  # columns are a quaternion if all others are this many times further from unit length
_ROUNDING = 1e-3  # deviation from unit length that few digits may cause
_MISSING = 1e-6  # length of a quaternion below which no orientation was measured
_KINDS = {
    "quaternion": ("wxyz", "w, x, y, z of a quaternion", "--quaternion"),
    "matrix": ("row", "rotation matrix, row by row,", "--matrix"),
    "rotation_vector": ("", "rotation vector", "--rotation-vector"),
    "euler": ("xyz", "roll, pitch, yaw about fixed x, y, z", "--euler xyz"),
    "angles": ("", "angles", "--euler xyz"),
}
"""Notations in the order of preference: order of the numbers, text and option. ``angles`` do not say their kind."""


@dataclass(frozen=True)
class Turn:
    """Columns of an orientation, in one of the notations of :data:`_KINDS`."""

    kind: str
    group: names.Group

    @property
    def order(self) -> str:
        """Order of the numbers."""
        return _KINDS[self.kind][0]

    @property
    def text(self) -> str:
        """Name of the notation."""
        return _KINDS[self.kind][1]


class Guesses:
    """Columns of position and orientation of a table with names; they are looked for when they are asked for.

    Args:
        table: The table.
        given: Columns that options name; they are no candidates.
    """

    def __init__(self, table: tables.Table, given: Collection[int] = ()) -> None:
        self._table, self._given = table, set(given)

    # -- quaternions -----------------------------------------------------------------------------

    @cached_property
    def _triples(self) -> list[names.Group]:
        """Columns x, y, z that are not those of a quaternion."""
        vectors = {column for group in self._quaternions for column in group.columns}
        return [group for group in self._free_triples() if not vectors & set(group.columns)]

    def _free_triples(self) -> list[names.Group]:
        return [group for group in names.triples(self._table.names) if not self._given & set(group.columns)]

    @cached_property
    def _quaternions(self) -> list[names.Group]:
        """Quaternions by their names; where the names do not tell it, those of unit length."""
        found = names.quaternions(self._table.names)
        named = [group for group in found if names.is_turn(group) and not self._given & set(group.columns)]
        bare = [group for group in found if not names.is_turn(group) and group.columns[0] not in self._given]
        return named + [one for group in bare for one in self._by_length(group)]

    def _by_length(self, group: names.Group) -> list[names.Group]:
        """The same w with the columns x, y, z that make the length 1; nothing if there are none.

        Raises:
            RecordingError: Several columns x, y, z fit equally well.
        """
        w, triples = group.columns[0], self._free_triples()
        tried = sorted(((off_unit(self._table, (w, *one.columns)), one) for one in triples), key=lambda one: one[0])
        fitting = [one for off, one in tried if not off > orientation.TOLERANCE]
        if len(fitting) > 1 and not are_clearly_unit(self._table, (w, *fitting[0].columns), (w, *fitting[1].columns)):
            listed = ", or ".join(self.listed(one.columns) for one in fitting)
            reason = f"may hold a quaternion of {self._table.names[w]!r} and {listed}; "
            raise RecordingError(self._table.path, f"{reason}say which: --quaternion W X Y Z and --position X Y Z")
        return [names.Group(one.stem, (w, *one.columns), one.body) for one in fitting[:1]]

    # -- position --------------------------------------------------------------------------------

    def position(self, turned: Sequence[int] = ()) -> tuple[int, ...]:
        """Columns of the position; empty if no names look like one.

        Args:
            turned: Columns of the orientation, if an option names them.

        Raises:
            RecordingError: Several bodies have a position.
        """
        found = names.positions(self._table.names, self._triples)
        if len(found) > 1 and turned:
            body = self._body_of(turned)
            found = [group for group in found if group.body == body] or found
        if len(found) > 1:
            listed = "; ".join(self.listed(group.columns) for group in found)
            reason = f"holds {len(found)} positions: {listed}; choose one by --position X Y Z"
            raise RecordingError(self._table.path, f"{reason}, or several by --arm")
        return found[0].columns if found else ()

    def _body_of(self, columns: Sequence[int]) -> tuple[str, ...] | None:
        """Body to which some columns belong by their names; None if the names do not tell it."""
        whole = [*names.triples(self._table.names), *names.quaternions(self._table.names)]
        whole += names.eulers(self._table.names)
        bodies = {group.body for group in whole if set(columns) & set(group.columns)}
        return bodies.pop() if len(bodies) == 1 else None

    # -- orientation -----------------------------------------------------------------------------

    def turn(self, position: Sequence[int]) -> Turn | None:
        """Orientation of the body of a position; None if there are no columns of an orientation.

        Raises:
            RecordingError: Several columns fit equally well, or those that fit have no known notation, or all belong to
                another body.
        """
        every = [turn for turn in self._turns() if not set(turn.group.columns) & set(position)]
        body = self._body_of(position)
        own = [turn for turn in every if turn.group.body == body]
        own = own or [turn for turn in every if _may_belong(turn.group.body, body)]
        if not own:
            if every:
                self._refuse_turns(every, "of another body than the position")
            return None
        first = next(kind for kind in _KINDS if any(turn.kind == kind for turn in own))
        chosen = [turn for turn in own if turn.kind == first]
        if len(chosen) > 1:
            self._refuse_turns(chosen, "which are equally good")
        if first == "angles":
            if not set(self._table.names) <= set(COLUMNS):
                self.refuse_angles(chosen[0].group.columns)
            return Turn("rotation_vector", chosen[0].group)  # a table of an operator
        return chosen[0]

    def _turns(self) -> list[Turn]:
        known = self._table.names
        groups = {
            "quaternion": self._quaternions,
            "matrix": names.matrices(known),
            "rotation_vector": names.rotation_vectors(self._triples),
            "euler": names.eulers(known),
            "angles": names.angles(self._triples),
        }
        return [Turn(kind, group) for kind, found in groups.items() for group in found]

    def _refuse_turns(self, turns: Sequence[Turn], why: str) -> NoReturn:
        """Refuse to choose one of some orientations."""
        listed = "; ".join(f"{_KINDS[turn.kind][2]} {self.listed(turn.group.columns)}" for turn in turns)
        reason = f"holds orientations {why}: {listed}; choose one, or give --orientation none"
        raise RecordingError(self._table.path, reason)

    def refuse_angles(self, columns: Sequence[int]) -> NoReturn:
        """Refuse to choose between Euler angles and a rotation vector."""
        listed = self.listed(columns)
        reason = f"holds angles whose names do not say what they are; give --euler xyz {listed} (or another order), or "
        reason += f"--rotation-vector {listed}, with --angles rad or deg; or --orientation none"
        raise RecordingError(self._table.path, reason)

    def listed(self, columns: Sequence[int]) -> str:
        """Names of some columns, as an option takes them."""
        return " ".join(self._table.names[column] for column in columns)


def off_unit(table: tables.Table, columns: Sequence[int]) -> float:
    """Deviation of the length of some columns from 1, of 90 % of the first rows; NaN without numbers."""
    rows = np.column_stack([table.sample(column).astype(np.float64) for column in columns])
    lengths = length(rows[np.isfinite(rows).all(axis=1)])
    lengths = lengths[lengths > _MISSING]
    return float(np.quantile(np.abs(lengths - 1.0), 0.9)) if len(lengths) else np.nan


def are_clearly_unit(table: tables.Table, columns: Sequence[int], others: Sequence[int]) -> bool:
    """Whether some columns have length 1 and others do not, so that only these columns can be a quaternion."""
    own, other = off_unit(table, columns), off_unit(table, others)
    return own < _EXACT and other > max(_CLEARLY * own, _ROUNDING)


def _may_belong(one: tuple[str, ...], other: tuple[str, ...] | None) -> bool:
    """Whether two bodies may be the same: the names of one do not contradict those of the other."""
    return other is None or set(one) <= set(other) or set(other) <= set(one)
