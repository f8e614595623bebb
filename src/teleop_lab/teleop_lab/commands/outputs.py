"""Outputs: options and output files of commands that run or score many sessions."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from cyclopts import Parameter

from teleop_core.base.errors import ParameterError

_MOST_JOBS = 1000


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class Pages:
    """Files with results, which are written completely or not at all."""

    html: Path | None = None
    """Write a page with the results."""
    csv: Path | None = None
    """Write a table with a line for each session, trial or episode."""

    def check(self) -> None:
        """Check that the files can be written.

        Raises:
            TeleopError: A file cannot be written.
        """
        from teleop_core.evaluation.command import check_places

        check_places(self.html, self.csv)

    def write(self, csv: Callable[[], str], html: Callable[[], str]) -> None:
        """Write the requested files, and print their paths."""
        from teleop_core.evaluation.command import write_whole

        for name, place, text in (("numbers", self.csv, csv), ("page", self.html, html)):
            if place is not None:
                write_whole(place, text())
                print(f"{name}: {place}")


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class Outputs(Pages):
    """Files with results, and the number of processes that make them."""

    jobs: int | None = None
    """Number of processes; without it, one per processor."""

    def check(self) -> None:
        """Check that the number of processes is allowed, and that the files can be written.

        Raises:
            TeleopError: The number of processes is not allowed, or a file cannot be written.
        """
        if self.jobs is not None and not 1 <= self.jobs <= _MOST_JOBS:
            raise ParameterError("--jobs", self.jobs, f"1 to {_MOST_JOBS} processes")
        super().check()
