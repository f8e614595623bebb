"""Store: results of a study on disk, each written completely as soon as it is computed."""

import json
import os
from collections.abc import Sequence
from pathlib import Path

from teleop_core.base.errors import SessionError
from teleop_lab.studies.point import Point, PointResult

FORMAT = 1
_ABOUT = "study.json"


class Store:
    """Results by the names of their points.

    Args:
        folder: Folder of the results; None: the results stay in memory.
    """

    def __init__(self, folder: Path | None) -> None:
        self.folder = folder
        self._results: dict[str, PointResult] = {}

    @staticmethod
    def open(folder: Path | str | None, scenario: str | None, names: Sequence[str]) -> "Store":
        """Open the store of a study; a missing store is created.

        Args:
            folder: Where the results are kept; None: in memory.
            scenario: Scenario of the study.
            names: Names of the study's dimensions.

        Raises:
            SessionError: The store belongs to another study or a newer version, or cannot be written.
        """
        store = Store(None if folder is None else Path(folder))
        if store.folder is not None:
            store._prepare({"format": FORMAT, "scenario": scenario, "dimensions": list(names)})
        return store

    def _prepare(self, about: dict[str, object]) -> None:
        assert self.folder is not None
        file = self.folder / _ABOUT
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            if not file.exists():
                if any(self.folder.iterdir()):
                    raise SessionError(f"{self.folder} contains other files; choose another folder")
                write_whole(file, json.dumps(about))
            found = json.loads(file.read_text("utf-8"))
        except (OSError, ValueError) as error:
            raise SessionError(f"{self.folder} cannot be used as a store: {error}") from error
        if found.get("format", 0) > FORMAT:
            raise SessionError(f"{self.folder} is a store of a newer version ({found['format']})")
        for name, value in about.items():
            if found.get(name) != value:
                text = f"{self.folder} is a store of another study: its {name}"
                raise SessionError(f"{text} is {found.get(name)!r}, not {value!r}")
        for path in self.folder.glob("*/*.json"):
            try:
                result = PointResult.from_json(path.read_text("utf-8"))
            except (OSError, ValueError):
                continue  # an incomplete file counts as missing
            self._results[result.name] = result

    def result(self, point: Point) -> PointResult | None:
        """Result of a point; None if it is missing."""
        return self._results.get(point.name)

    def reason(self, point: Point) -> str:
        """Reason why a point must be run; empty if the stored result is valid."""
        found = self.result(point)
        if found is None:
            return "missing"
        if found.key.code != point.key.code:
            return "changed code"
        if found.key.recipe != point.key.recipe:
            return "changed parameters"
        return "failed" if found.error else ""

    def take(self, result: PointResult) -> None:
        """Store a result.

        Raises:
            SessionError: The result cannot be written; earlier results stay unchanged.
        """
        self._results[result.name] = result
        if self.folder is not None:
            write_result(self.folder, result)


def write_result(folder: Path, result: PointResult) -> None:
    """Write a result completely or not at all; writing it again changes nothing.

    Raises:
        SessionError: The result cannot be written.
    """
    place = folder / result.name[:2]
    try:
        place.mkdir(exist_ok=True)
        write_whole(place / f"{result.name}.json", result.to_json())
    except OSError as error:
        text = f"{folder} cannot be written: {error.strerror}; results of finished sessions are kept"
        raise SessionError(f"{text}; run the same command again to continue") from error


def write_whole(path: Path, text: str) -> None:
    """Write a file under a temporary name, then rename it, so that no reader sees an incomplete file."""
    half = path.with_name(f".{path.name}.{os.getpid()}")
    try:
        half.write_text(text, "utf-8")
    except OSError:
        half.unlink(missing_ok=True)
        raise
    half.replace(path)
