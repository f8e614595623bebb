"""Episodes: a table that contains several recordings, as in data sets; an import reads one of them."""

from collections.abc import Iterator

import numpy as np

from teleop_core.base.errors import ParameterError, RecordingError, UnknownNameError
from teleop_exchange import names, tables

_LISTED = 8
_NEEDED = "left out: no column is called episode_index or the like"


class Episodes:
    """Rows of the wanted episode; all rows if the table contains only one episode.

    Args:
        table: The table.
        wanted: Number of the episode; None if the table must contain only one.

    Raises:
        ParameterError: A number of an episode is given, but no column contains the episode numbers.
    """

    def __init__(self, table: tables.Table, wanted: int | None) -> None:
        self._table, self._wanted, self._found = table, wanted, set[float]()
        self._column = _column(table)
        if wanted is not None and self._column is None:
            raise ParameterError("--episode", wanted, _NEEDED)

    def blocks(self, columns: list[int]) -> Iterator[list[tables.Numbers]]:
        """Some columns of the table, block by block.

        Raises:
            RecordingError: The table contains several episodes and no number is given, or the file is damaged.
            UnknownNameError: No episode has the given number.
        """
        if self._column is None:
            yield from self._table.blocks(columns)
            return
        for *block, episode in self._table.blocks([*columns, self._column]):
            self._found |= set(np.unique(episode[np.isfinite(episode)]).tolist())
            if self._wanted is None:
                yield block
            else:
                yield [column[episode == self._wanted] for column in block]
        self._check(self._column)

    def _check(self, column: int) -> None:
        listed = [f"{number:g}" for number in sorted(self._found)]
        if self._wanted is not None and self._wanted not in self._found:
            raise UnknownNameError("--episode", self._wanted, listed)
        if self._wanted is None and len(listed) > 1:
            few = ", ".join(listed) if len(listed) < _LISTED else f"{listed[0]} to {listed[-1]}"
            reason = f"holds {len(listed)} episodes (column {self._table.names[column]!r}: {few})"
            hint = "take one by --episode N, or each by --episode all"
            raise RecordingError(self._table.path, f"{reason}; {hint}")

    def told(self) -> list[str]:
        """Texts about the imported episode."""
        return [f"episode {self._wanted} of {len(self._found)}"] * (self._wanted is not None)


def numbers_of(table: tables.Table) -> list[int]:
    """Numbers of the episodes of a table.

    Raises:
        ParameterError: No column contains the episode numbers.
    """
    column = _column(table)
    if column is None:
        raise ParameterError("--episode", "all", _NEEDED)
    found: set[int] = set()
    for (block,) in table.blocks([column]):
        found |= set(np.unique(block[np.isfinite(block)]).astype(int).tolist())
    return sorted(found)


def _column(table: tables.Table) -> int | None:
    column = names.find_episode(table.names) if table.is_named else None
    is_number = column is not None and np.isfinite(table.sample(column)).all()
    return column if is_number else None
