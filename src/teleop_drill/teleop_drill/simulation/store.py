"""Store: schedules that a search keeps, one file each, and the counts of all schedules that it ran.

The counts of all schedules are written every few seconds. The counts of each later schedule are a line of another file,
so that a search that is killed loses no schedule that has ended.
"""

import json
import time
from collections import Counter
from collections.abc import Callable, Collection
from dataclasses import dataclass
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from teleop_core.base.errors import ParameterError, RecordingError
from teleop_core.evaluation.command import write_whole
from teleop_core.kernels.dependencies import hexdigest, source_digest
from teleop_drill.simulation.planned import VERSION, Schedule, check_version, json_object, read
from teleop_drill.simulation.report import Coverage
from teleop_drill.simulation.seeds import Found

_COUNTS, _SINCE = "counts.json", "counts_since.jsonl"
_EVERY = 5.0
"""Shortest time between two writings of all counts [s]."""
_PACKAGES = ("teleop_core", "teleop_machines", "teleop_drill")


@dataclass(frozen=True)
class Kept:
    """A schedule that met something first, or broke a law.

    Attributes:
        schedule: The schedule.
        new: What no earlier schedule had met: events, pairs of faults in a state, and branches.
        broken: Names of the laws that it broke.
        file: Name of its file in the store.
    """

    schedule: Schedule
    new: tuple[str, ...]
    broken: tuple[str, ...]
    file: str


class Store:
    """Folder of a search; a search in the same folder goes on where the last one ended.

    Args:
        folder: The folder; it is created if it does not exist.
        clock: Time of a clock that never goes back [s].

    Raises:
        ParameterError: The folder belongs to other code or another version, or a file in it is damaged.
        RecordingError: The folder is no store, or a file cannot be read or written.

    Attributes:
        coverage: Counts of all schedules that were run.
        kept: Kept schedules, in their order.
        times: Number of schedules that met each event, each pair of faults in a state, and each branch.
    """

    def __init__(self, folder: Path, clock: Callable[[], float] = time.monotonic) -> None:
        self._folder, self.coverage, self._clock = folder, Coverage(), clock
        self._saved, self._saved_at = 0, -_EVERY
        self.kept: list[Kept] = []
        self.times: Counter[str] = Counter()
        counts = folder / _COUNTS
        if counts.exists():
            self._open(counts)
            return
        try:
            folder.mkdir(parents=True, exist_ok=True)
            is_empty = not any(folder.iterdir())
        except OSError as error:
            raise RecordingError(folder, f"cannot be a store: {error.strerror}") from error
        if not is_empty:
            raise RecordingError(folder, f"is no store of schedules: it has files, but no {_COUNTS}")

    def _open(self, counts: Path) -> None:
        plain = json_object(read(counts), str(counts))
        check_version(plain, f"the store {self._folder}")
        if plain.get("code") != code_digest():
            needed = f"{code_digest()}, the code that runs; give another folder"
            raise ParameterError(f"code of the store {self._folder}", plain.get("code"), needed)
        try:
            self.coverage, self.times = Coverage.of(plain), Counter(dict(plain["times"]))
            self._add_lines()
        except (AttributeError, KeyError, TypeError, ValueError) as error:
            raise ParameterError(str(counts), type(error).__name__, f"counts of schedules ({error})") from error
        for file in sorted(self._folder.glob("schedule_*.json")):
            if file.name >= _name(self.coverage.sessions):  # killed before it was counted; it is run again
                continue
            found = json_object(read(file), str(file))
            new, broken = (tuple(map(str, found.get(name) or ())) for name in ("new", "broken"))
            self.kept.append(Kept(Schedule.of(str(file)), new, broken, file.name))
        if self.coverage.sessions > self._saved:
            self.save()

    def _add_lines(self) -> None:
        """Add the counts of schedules that ended after all counts were written last."""
        self._saved = self.coverage.sessions
        file = self._folder / _SINCE
        lines = read(file).splitlines(keepends=True) if file.exists() else []
        for line in lines:
            if not line.endswith("\n"):  # killed while it wrote
                break
            one = json.loads(line)
            if one["number"] == self.coverage.sessions:
                self.coverage.merge(Coverage.of(one))
                self.times.update(one["times"])

    def add(self, found: Found, branches: Collection[str] = ()) -> tuple[str, ...]:
        """Count the result of a schedule, and keep the schedule if it met something first or broke a law.

        Args:
            found: Result of the schedule.
            branches: Branches that it ran.

        Returns:
            What no earlier schedule had met.
        """
        number = self.coverage.sessions
        self.coverage.add(found)
        met = events(found) | set(branches)
        new = tuple(sorted(met - self.times.keys()))
        self.times.update(met)
        if new or found.broken:
            schedule = Schedule.of_found(found)
            kept = Kept(schedule, new, tuple(one.law for one in found.broken), _name(number))
            self._write(kept.file, schedule.plain() | {"new": new, "broken": kept.broken})
            self.kept.append(kept)
        if self._clock() - self._saved_at >= _EVERY:
            self.save()
        else:
            self._append(number, found, met)
        return new

    def save(self) -> None:
        """Write all counts. A search that ends calls this; :meth:`add` calls it every few seconds."""
        if self.coverage.sessions:
            self._write(
                _COUNTS, {"version": VERSION} | self.coverage.plain() | {"times": dict(sorted(self.times.items()))}
            )
            (self._folder / _SINCE).unlink(missing_ok=True)
        self._saved, self._saved_at = self.coverage.sessions, self._clock()

    def _append(self, number: int, found: Found, met: Collection[str]) -> None:
        """Write the counts of a schedule as a line of its own."""
        one = Coverage()
        one.add(found)
        plain = {"number": number} | one.plain() | {"sometimes": +found.sometimes, "times": sorted(met)}
        with (self._folder / _SINCE).open("a", encoding="utf-8") as file:
            file.write(json.dumps(plain) + "\n")

    def _write(self, name: str, plain: dict[str, Any]) -> None:
        text = json.dumps(plain | {"code": code_digest()}, indent=1)
        write_whole(self._folder / name, text + "\n")

    def lines(self) -> list[str]:
        """Lines that summarize the search."""
        count = Counter(kind_of(name) for name in self.times)
        each = ", ".join(f"{count[one]} {one}" for one in ("events", "pairs", "branches"))
        broken = [f"{one.file} breaks {', '.join(one.broken)}" for one in self.kept if one.broken]
        return [*self.coverage.lines(), f"{len(self.kept)} schedules are kept in {self._folder}: {each}", *broken]


def _name(number: int) -> str:
    """Name of the file of a schedule, by the number of schedules before it."""
    return f"schedule_{number:06}.json"


def events(found: Found) -> set[str]:
    """Events of the catalogue, and pairs of faults in a state, that a schedule met."""
    return {name for name, n in found.sometimes.items() if n} | {
        f"{other} + {kind} in {state}" for other, kind, state in found.pairs
    }


def kind_of(name: str) -> str:
    """Whether something that was met is one of the ``events``, ``pairs`` or ``branches``."""
    return "branches" if ".py:" in name else "pairs" if " + " in name else "events"


@cache
def code_digest() -> str:
    """Digest of the code on which a schedule's result depends."""
    places = [spec.submodule_search_locations for name in _PACKAGES if (spec := find_spec(name)) is not None]
    files = [file for place in places for root in place or () for file in sorted(Path(root).rglob("*.py"))]
    return hexdigest(source_digest(str(file)) or "" for file in files)[:16]
