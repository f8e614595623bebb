"""Table source: a table with the motion of a hand; its columns are given by options or guessed."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from teleop_core.base import ParameterError, RecordingError
from teleop_core.kernels import Array, length
from teleop_exchange import episodes, guessing, names, source, tables, times
from teleop_exchange.options import BUTTONS, CHOICES, ORIENTATIONS, ImportOptions, option
from teleop_exchange.orientation import TOLERANCE, Attitudes

_TOLD = 8  # largest number of columns that a message lists by name


@dataclass(frozen=True)
class Columns:
    """Columns of a table by their meaning; missing columns are empty or None."""

    time: tuple[int, ...]
    position: tuple[int, ...]
    orientation: tuple[int, ...]
    buttons: dict[str, int]
    jaw: tuple[int, ...] = ()


class TableSource:
    """A table as a source of an import; see :class:`~teleop_exchange.source.Source`.

    Args:
        table: The table.
        options: Import options.

    Raises:
        UnknownNameError: A column does not exist.
        RecordingError: The table contains no time and no rate is given, or the table contains no position.
        ParameterError: An option is not allowed for a table.
    """

    def __init__(self, table: tables.Table, options: ImportOptions) -> None:
        self.path, self._table, self._options = table.path, table, options
        self.told: list[str] = []
        for name in ("topic", "buttons_topic", "frame", "parent"):
            if given := getattr(options, name):
                raise ParameterError(option(name), given, "left out: this file has columns")
        given = [column for name in ("time", "position", *ORIENTATIONS) for column in self._given(name)]
        self._guesses = guessing.Guesses(table, given) if table.is_named else None
        position = self._position()
        time = self._time(position)
        self.attitudes, orientation = self._orientation(position)
        taken = {*position, *time, *orientation}
        self._columns = Columns(time, position, orientation, self._buttons(taken), self._jaw())
        self._episodes = episodes.Episodes(table, options)
        self.has_time = bool(time)
        self.time_unit = self._time_unit(time)
        self.unit, self.is_unit_said = self._unit(position)
        time_label, place_label, turn_label = (
            ", ".join(table.names[column] for column in group) for group in (time, position, orientation)
        )
        self.labels = (time_label, place_label, turn_label)
        self._tell_unused({*taken, *self._columns.buttons.values(), *self._columns.jaw})

    # -- which columns ---------------------------------------------------------------------------

    def _given(self, name: str) -> tuple[int, ...]:
        wanted: tuple[str, ...] = getattr(self._options, name)
        wanted = wanted[1:] if name == "euler" else wanted
        return tuple(tables.column_of(self._table, one, option(name)) for one in wanted)

    def _told(self, what: str, columns: Sequence[int], more: str = "") -> tuple[int, ...]:
        listed = ", ".join(repr(self._table.names[column]) for column in columns)
        self.told.append(f"{what} = {listed}{more}")
        return tuple(columns)

    def _position(self) -> tuple[int, ...]:
        if given := self._given("position"):
            return given
        turned = next(filter(None, map(self._given, ORIENTATIONS)), ())
        found = self._guesses.position(turned) if self._guesses else self._position_by_place()
        if not found:
            reason = "has no columns that look like x, y, z: give --position X Y Z; "
            raise RecordingError(self.path, f"{reason}there are {self._listed()}")
        return self._told("x, y, z", found)

    def _position_by_place(self) -> tuple[int, ...]:
        """Columns of a table without names, chosen by the usual layout for its number of columns.

        Three columns are x, y, z. Four columns are time, x, y, z. Seven columns are x, y, z and a quaternion. Eight
        columns are time, x, y, z and a quaternion, as in the benchmark of Sturm and others 2012.
        """
        width = len(self._table.names)
        first = 1 if width in {4, 8} and self._is_rising(0) else 0
        if width - first not in {3, 7}:
            return ()
        front, back = range(first, first + 4), range(width - 4, width)
        if width - first == 7 and guessing.are_clearly_unit(self._table, front, back):
            reason = f"has a quaternion in the columns {front[0] + 1} to {front[-1] + 1}, by their length"
            raise RecordingError(self.path, f"{reason}: give --position and --quaternion, with --quaternion-order")
        return (first, first + 1, first + 2)

    def _is_rising(self, column: int) -> bool:
        numbers = self._table.sample(column).astype(np.float64)
        return len(numbers) > 1 and bool((np.diff(numbers) >= 0.0).mean() > 0.95)

    def _listed(self) -> str:
        table = self._table
        if not table.is_named:
            return f"{len(table.names)} without names, to be given by number from 1 on"
        return ", ".join(table.names[:40])

    def _time(self, position: tuple[int, ...]) -> tuple[int, ...]:
        if given := self._given("time"):
            return given
        if self._options.rate is not None:
            return ()
        found = names.find_time(self._table.names) if self._table.is_named else ()
        if not found and 0 not in position and self._is_rising(0):
            self._refuse_counter()
            found = (0,)
        if not found:
            reason = "has no column that looks like a time: give --time COL, or --rate HZ; there are "
            raise RecordingError(self.path, reason + self._listed())
        return self._told("time", found)

    def _refuse_counter(self) -> None:
        """Refuse a first column that numbers the rows: its name says so, or its whole numbers rise by one.

        Raises:
            RecordingError: The first column is no time.
        """
        name, rows = self._table.names[0], self._table.sample(0).astype(np.float64)
        steps = np.diff(rows[np.isfinite(rows)])
        is_whole = len(steps) > 0 and bool((rows[np.isfinite(rows)] % 1.0 == 0.0).all())
        is_named_counter = self._table.is_named and names.is_counter(name)
        if is_whole and (is_named_counter or float(np.median(steps)) == 1.0) and not names.unit_of((name,), (0,)):
            reason = f"has no time: its first column {name!r} counts the rows; give --rate HZ, or --time COL"
            raise RecordingError(self.path, f"{reason} if it is one; there are {self._listed()}")

    def _orientation(self, position: tuple[int, ...]) -> tuple[Attitudes, tuple[int, ...]]:
        o = self._options
        orders = {"matrix": o.matrix_order, "euler": o.euler[0] if o.euler else "xyz"}
        for kind in ("quaternion", "matrix", "euler", "rotation_vector"):
            if columns := self._given(kind):
                if kind == "quaternion":
                    orders[kind] = self._quaternion_order(columns)
                degrees = self._in_degrees(kind, columns)
                return Attitudes(kind, orders.get(kind, ""), degrees), columns
        if o.orientation == "none":
            return Attitudes("none"), ()
        return self._guessed_orientation(position)

    def _quaternion_order(self, columns: Sequence[int]) -> str:
        """Order of the columns of a quaternion.

        Raises:
            ParameterError: The order in the names of the columns differs from the option.
        """
        wanted = self._options.quaternion_order
        letters = [names.plain(self._table.names[column])[-1:] for column in columns]
        named = "".join(letters)
        if named in {"wxyz", "xyzw"}:
            if wanted not in {"auto", named}:
                needed = f"{named}, as the names of the columns of --quaternion say"
                raise ParameterError("--quaternion-order", wanted, needed)
            return named
        if wanted == "auto":
            self.told.append("quaternion in the order wxyz (else --quaternion-order xyzw)")
            return "wxyz"
        return wanted

    def _guessed_orientation(self, position: tuple[int, ...]) -> tuple[Attitudes, tuple[int, ...]]:
        if self._guesses is None:
            return self._orientation_by_place()
        if (turn := self._guesses.turn(position)) is None:
            self.told.append("orientation: none found, constant")
            return Attitudes("none"), ()
        columns = self._told(turn.text, turn.group.columns)
        is_degrees = self._in_degrees(turn.kind, columns)
        if turn.kind == "rotation_vector" and is_degrees and self._agreed("angles", columns) != "deg":
            self._guesses.refuse_angles(columns)
        return Attitudes(turn.kind, turn.order, is_degrees), columns

    def _orientation_by_place(self) -> tuple[Attitudes, tuple[int, ...]]:
        width = len(self._table.names)
        columns = tuple(range(width - 4, width))
        if width in {7, 8} and not self._options.position and self._are_unit(columns):
            wanted = self._options.quaternion_order
            order = "xyzw" if wanted == "auto" else wanted  # the order of the benchmark of Sturm and others
            self._told(f"quaternion in the order {order}", columns)
            return Attitudes("quaternion", order), columns
        self.told.append("orientation: none found, constant")
        return Attitudes("none"), ()

    def _are_unit(self, columns: Sequence[int]) -> bool:
        rows = np.column_stack([self._table.sample(c).astype(np.float64) for c in columns])
        lengths = length(rows[np.isfinite(rows).all(axis=1)])
        return len(lengths) > 0 and bool((np.abs(lengths - 1.0) < TOLERANCE).mean() > 0.9)

    def _in_degrees(self, kind: str, columns: Sequence[int]) -> bool:
        if kind not in {"euler", "rotation_vector"}:
            return False
        named = self._agreed("angles", columns)
        if self._options.angles != "auto":
            return named == "deg"
        sizes = [np.abs(self._table.sample(c).astype(np.float64)) for c in columns]
        largest = max((float(np.nanmax(s)) for s in sizes if np.isfinite(s).any()), default=0.0)
        is_degrees = named == "deg" or (named != "rad" and largest > 2.0 * math.pi + 0.1)
        why = "as the names say" if named else f"the largest is {largest:.3g}"
        self.told.append(f"angles in {'degrees' if is_degrees else 'radians'} ({why})")
        return is_degrees

    def _jaw(self) -> tuple[int, ...]:
        if not (wanted := self._options.jaw):
            return ()
        column = tables.column_of(self._table, wanted[0], "--jaw")
        return self._told("jaw", (column,), f", open at {wanted[1]}, closed at {wanted[2]}")

    def _buttons(self, taken: set[int]) -> dict[str, int]:
        found = {}
        for button in BUTTONS:
            wanted = getattr(self._options, button)
            if wanted:
                found[button] = tables.column_of(self._table, wanted, option(button))
            elif self._table.is_named:
                column = names.find_button(self._table.names, button)
                if column is None or column in taken:
                    continue
                if bool(np.isin(self._table.sample(column).astype(np.float64), (0.0, 1.0)).all()):
                    found[button] = column
                    self._told(f"button {button}", (column,))
                else:
                    name = self._table.names[column]
                    self.told.append(
                        f"no button {button}: {name!r} holds more than 0 and 1, true and false "
                        f"(--{button} takes it, pressed above --threshold)"
                    )
        return found

    def _tell_unused(self, taken: set[int]) -> None:
        known = self._table.names
        unused = [name for column, name in enumerate(known) if column not in taken]
        if unused:
            more = f" and {len(unused) - _TOLD} more" if len(unused) > _TOLD else ""
            self.told.append(f"left unused: {', '.join(map(repr, unused[:_TOLD]))}{more}")

    # -- units -----------------------------------------------------------------------------------

    def _time_unit(self, time: tuple[int, ...]) -> str:
        if time and self._table.is_clock(time[0]):
            return "ns"
        if len(time) == 2:
            return "ns"
        return self._agreed("time_unit", time) or "auto"

    def _unit(self, position: tuple[int, ...]) -> tuple[str, bool]:
        """Unit of the position, and whether the file or an option states it."""
        unit = self._agreed("unit", position)
        if self._options.unit == "auto" and unit not in {"", "m"}:
            self.told.append(f"positions in {unit}, as the names say")
        return unit or "m", bool(unit)

    def _agreed(self, name: str, columns: Sequence[int]) -> str:
        """Unit that an option or the names of columns state; empty if neither does.

        Raises:
            ParameterError: The option and the names state different units.
        """
        wanted, choices = getattr(self._options, name), CHOICES[name]
        named = names.unit_of(self._table.names, columns)
        if named not in choices or wanted == named:
            return "" if wanted == "auto" else str(wanted)
        if wanted == "auto":
            return named
        listed = ", ".join(repr(self._table.names[column]) for column in columns)
        raise ParameterError(
            option(name),
            wanted,
            f"{named}, because the columns {listed} name this unit; if it is wrong, rename the columns",
        )

    # -- rows ------------------------------------------------------------------------------------

    @property
    def bad_rows(self) -> int:
        """Rows with too few or too many cells."""
        return self._table.bad_rows

    def presses(self) -> source.Presses | None:
        """None, because the buttons are in the rows."""
        return None

    def blocks(self) -> Iterator[source.Block]:
        """All rows in the order of the file.

        Raises:
            RecordingError: A cell is not a number, or the file is damaged.
        """
        c = self._columns
        order = [*c.time, *c.position, *c.orientation, *c.buttons.values(), *c.jaw]
        first, second = len(c.time), len(c.time) + 3
        for columns in self._episodes.blocks(order, self.has_time):
            turned = columns[second : second + len(c.orientation)]
            count = len(columns[first])
            rows = np.column_stack(turned) if turned else np.empty((count, 0))
            yield source.Block(
                _time(columns[:first], count),
                np.column_stack(columns[first:second]).astype(np.float64, copy=False),
                self.attitudes.quaternions(rows.astype(np.float64, copy=False)),
                self._pressed(columns[second + len(turned) : len(order) - len(c.jaw)], count),
                closing=self._closing(columns[len(order) - 1]) if c.jaw else None,
            )
        self.told += self._episodes.told()

    def _closing(self, column: tables.Numbers) -> Array:
        """How far the jaw is closed, 0 (open) to 1; values beyond both ends count as these."""
        opened, closed = self._options.jaw_ends
        return np.asarray(np.clip((column.astype(np.float64) - opened) / (closed - opened), 0.0, 1.0))

    def _pressed(self, columns: Sequence[tables.Numbers], count: int) -> NDArray[np.uint8] | None:
        if not columns:
            return None
        pressed = np.zeros((count, len(BUTTONS)), np.uint8)
        for button, column in zip(self._columns.buttons, columns, strict=True):
            # Guessed columns contain 0 or 1; the threshold applies only to columns named by an option.
            threshold = self._options.threshold if getattr(self._options, button) else 0.5
            pressed[:, BUTTONS.index(button)] = column > threshold
        return pressed

    def check(self, finite: Array) -> None:
        """Raise an error if a column contains no number.

        Args:
            finite: Number of finite values of x, y, z and the orientation (4,).

        Raises:
            RecordingError: A column contains no number; the message names all such columns.
        """
        at = [self._table.names[column] for column in self._columns.position]
        if empty := [name for name, count in zip(at, finite[:3], strict=True) if not count]:
            raise RecordingError(self.path, f"column {', '.join(empty)} holds no numbers")
        if not finite[3]:
            turned = ", ".join(self._table.names[column] for column in self._columns.orientation)
            reason = f"columns {turned} hold no orientation; give --orientation none"
            raise RecordingError(self.path, reason)


def _time(columns: Sequence[tables.Numbers], count: int) -> tables.Numbers:
    """Times of one column, or times [ns] from a column of seconds and one of nanoseconds; zeros without a column."""
    if not columns:
        return np.zeros(count)
    if len(columns) == 1:
        return columns[0]
    if all(np.isfinite(column).all() for column in columns):
        return times.nanoseconds(columns[0], "s") + times.nanoseconds(columns[1], "ns")
    return np.asarray(columns[0] * times.SECOND_NS + columns[1])
