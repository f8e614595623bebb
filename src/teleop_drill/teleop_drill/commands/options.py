"""Options of ``teleop drill``."""

import shlex
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

from cyclopts import Parameter

from teleop_core.base.errors import ParameterError


def _split(_: object, tokens: Any) -> tuple[str, ...]:
    return tuple(shlex.split(tokens[0].value))


Command = Annotated[tuple[str, ...], Parameter(converter=_split, n_tokens=1, consume_multiple=False, metavar="COMMAND")]


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class Options:
    """Options of a drill."""

    composed: bool = False
    """All nodes in one process."""
    short: bool = False
    """Run only five faults that show the most."""
    simulated: bool = False
    """Simulate processes, clocks, disk and middleware, with random numbers from --seed."""
    seed: int = 0
    """Seed of the simulated machine."""
    seeds: int | None = None
    """Run this number of random schedules of faults on the simulated machine; their seeds begin at --seed."""
    sometimes: bool = False
    """With --seeds or --search: fail if an event that must happen sometimes never did."""
    search: Annotated[Path | None, Parameter(metavar="STORE")] = None
    """Search with random schedules for what none has met, and keep those that met it in this directory."""
    scheduler: str | None = None
    """With --search: address of a Dask scheduler, to run on its workers."""
    minutes: float = 3.0
    """Duration of --search [min]."""
    breaks: float = 0.0
    """In schedules, share of clock readings after which another thread runs; try 0.0005."""
    schedule: Annotated[str | None, Parameter(metavar="FILE|TEXT")] = None
    """Run one given schedule of faults: a file of a store, or its text."""
    list_: Annotated[bool, Parameter(name="--list")] = False
    """List the faults."""
    json: Path | None = None
    """Write all numbers as JSON."""
    markdown: Path | None = None
    """Write the table as Markdown."""
    drives: Command = ()
    """Command that starts drives; they replace the simulated ones."""
    arm: Command = ()
    """Command that starts the arm that the drives of --drives move; the drill does not disturb it."""
    out: Path | None = None
    """Directory that keeps the recordings; it must not exist yet."""

    def check(self) -> None:
        """Check that the options of a drill agree.

        Raises:
            ParameterError: An option needs another one, or must be left out beside another one.
        """
        if self.drives and self.composed:
            raise ParameterError("--drives", shlex.join(self.drives), "given without --composed")
        if self.simulated and self.drives:
            raise ParameterError("--drives", shlex.join(self.drives), "given without --simulated")
        if self.seed and not self.simulated:
            raise ParameterError("--seed", self.seed, "given with --simulated only")
        if self.arm and not self.drives:
            raise ParameterError("--arm", shlex.join(self.arm), "given with --drives only, whose drives move the arm")
