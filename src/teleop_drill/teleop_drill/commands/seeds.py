"""``teleop drill --seeds``: runs random schedules of faults, and checks the laws in each of them."""

import json
from pathlib import Path
from typing import TYPE_CHECKING

from teleop_core.bags.finding import check_new
from teleop_core.base.errors import ParameterError
from teleop_core.commands.options import ros_module
from teleop_core.nodes.crews import Processes
from teleop_drill.commands.options import Options

if TYPE_CHECKING:
    from teleop_drill.simulation.report import Coverage


def run_schedules(names: tuple[str, ...], options: Options) -> int:
    """Run the schedules; returns 1 if a law was broken, or an event that must happen sometimes never did.

    Raises:
        ParameterError: Arguments contradict each other.
        RecordingError: The folder for recordings exists already.
    """
    count, first, out = options.seeds or 1, options.seed, options.out
    if names or options.short or options.drives:
        raise ParameterError("--seeds", count, "given without names, --short and --drives")
    if (options.faults is not None or out is not None) and count != 1:
        raise ParameterError("--seeds", count, "1 with --faults and --out")
    if not 0.0 <= options.breaks <= 0.1:
        raise ParameterError("--breaks", options.breaks, "from 0 to 0.1")
    check_new(out)
    ros_module("seeds", "teleop_drill.simulation")
    processes = Processes.ONE if options.composed else Processes.SIDES
    if count == 1:
        return _run_one(first, options.faults, out, processes, options.breaks)
    coverage = _run_many(first, count, options.json, processes, options.breaks)
    return 1 if coverage.broken or (options.sometimes and coverage.never()) else 0


def _run_one(seed: int, chosen: str | None, out: Path | None, processes: Processes, breaks: float) -> int:
    from teleop_drill.simulation.schedules import draw
    from teleop_drill.simulation.seeds import PROCESSES, run_seed

    faults = draw(seed, PROCESSES[processes])
    if chosen is not None:
        numbers = [] if chosen == "-" else chosen.split(",")
        known = [str(index) for index in range(len(faults))]
        if wrong := [number for number in numbers if number not in known]:
            raise ParameterError("--faults", wrong[0], f"of {', '.join(known)} in this schedule")
        faults = tuple(faults[int(number)] for number in numbers)
    if out is not None:
        out.mkdir(parents=True)
    found = run_seed(seed, faults, out, processes, breaks)
    for fault in found.faults:
        print(fault.text())
    for one in found.broken:
        print(f"✗ {one.law}, {one.at:.3f} s after the arm followed: {one.text}")
    print(f"{'✗' if found.broken else '✓'} seed {seed}, {found.seconds:.1f} s")
    return 1 if found.broken else 0


def _run_many(first: int, count: int, json_file: Path | None, processes: Processes, breaks: float) -> "Coverage":
    from rich.console import Console
    from rich.progress import track
    from rich.table import Column, Table

    from teleop_drill.simulation.report import Coverage, told
    from teleop_drill.simulation.seeds import run_seeds, shrink

    console, coverage = Console(), Coverage()
    runs = run_seeds(first, count, None, processes, breaks)
    for found in track(runs, "schedules", count, console=console):
        coverage.add(found)
        if json_file is not None:  # written after each schedule, because a run of an hour may be interrupted
            json_file.write_text(json.dumps(coverage.plain(), indent=2) + "\n", encoding="utf-8")
        for one in found.broken:
            for line in told(found, shrink(found, one.law), one.law):
                console.print(line, highlight=False, markup=False, soft_wrap=True)
    for title, (head, *rows) in (
        ("number of times that a fault happened in a state of the arm", coverage.table()),
        ("number of checks of a law under a fault", coverage.laws()),
    ):
        columns = [Column(name, overflow="fold", justify="right") for name in head[1:]]
        faults = Column(head[0], no_wrap=True)
        table = Table(faults, *columns, title=title, box=None, padding=(0, 2, 0, 0))
        for kind, *counts in rows:
            table.add_row(kind, *map(_short, counts))
        console.print(table)
    for line in coverage.lines():
        print(line)
    return coverage


def _short(count: str) -> str:
    """Text of a count for a narrow column; thousands are written as k."""
    return count if len(count) < 4 else f"{int(count) // 1000}k"
