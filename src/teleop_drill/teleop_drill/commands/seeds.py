"""``teleop drill --seeds``: random schedules of faults, and the laws that must hold in each."""

import argparse
import json
from pathlib import Path
from typing import TYPE_CHECKING

from teleop_core.base.errors import ParameterError, RecordingError
from teleop_core.commands.arguments import ros_module
from teleop_core.nodes.crews import Processes

if TYPE_CHECKING:
    from teleop_drill.simulation.report import Coverage


def run_schedules(arguments: argparse.Namespace) -> int:
    """Run them; 1 if a law was broken.

    Raises:
        ParameterError: Arguments do not go together.
        RecordingError: The folder for recordings exists already.
    """
    count, first, out = arguments.seeds or 1, arguments.seed, arguments.out
    if arguments.names or arguments.short or arguments.drives:
        raise ParameterError("--seeds", count, "without names, --short and --drives")
    if (arguments.faults is not None or out is not None) and count != 1:
        raise ParameterError("--seeds", count, "1 with --faults and --out")
    if out is not None and out.exists():
        raise RecordingError(out, "exists already; choose another --out")
    ros_module("seeds", "teleop_drill.simulation")
    processes = Processes.ONE if arguments.composed else Processes.SIDES
    if count == 1:
        return _run_one(first, arguments.faults, out, processes)
    return _run_many(range(first, first + count), arguments.json, processes)


def _run_one(seed: int, chosen: str | None, out: Path | None, processes: Processes) -> int:
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
    found = run_seed(seed, faults, out, processes)
    for fault in found.faults:
        print(fault.text())
    for one in found.broken:
        print(f"✗ {one.law}, {one.at:.3f} s after the arm followed: {one.text}")
    print(f"{'✗' if found.broken else '✓'} seed {seed}, {found.seconds:.1f} s")
    return 1 if found.broken else 0


def _run_many(seeds: range, json_file: Path | None, processes: Processes) -> int:
    from rich.console import Console
    from rich.progress import track
    from rich.table import Table

    from teleop_drill.simulation.report import Coverage, told
    from teleop_drill.simulation.seeds import run_seeds, shrink

    console, coverage = Console(), Coverage()
    for found in track(run_seeds(seeds, None, processes), "schedules", len(seeds), console=console):
        coverage.add(found)
        for one in found.broken:
            for line in told(found, shrink(found, one.law), one.law):
                console.print(line, highlight=False, markup=False, soft_wrap=True)
    head, *rows = coverage.table()
    table = Table(*head, title="how often a fault met a state of the arm")
    for row in rows:
        table.add_row(*row)
    console.print(table)
    for line in coverage.lines():
        print(line)
    if json_file is not None:
        json_file.write_text(json.dumps(_plain(coverage), indent=2) + "\n", encoding="utf-8")
    return 1 if coverage.broken else 0


def _plain(coverage: "Coverage") -> dict[str, object]:
    met: dict[str, dict[str, int]] = {}
    for (kind, state), count in sorted(coverage.met.items()):
        met.setdefault(kind, {})[state] = count
    return {
        "sessions": coverage.sessions, "seconds": coverage.seconds, "met": met,
        "looks": dict(coverage.looks), "broken": dict(coverage.broken),
    }  # fmt: skip
