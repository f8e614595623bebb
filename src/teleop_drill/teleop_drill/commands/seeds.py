"""``teleop drill --seeds``, ``--search`` and ``--schedule``: run schedules of faults, and check the laws in each."""

import json
import math
import time
from pathlib import Path
from typing import TYPE_CHECKING

from teleop_core.bags.finding import check_new
from teleop_core.base.cluster import connect
from teleop_core.base.errors import ParameterError
from teleop_core.commands.options import ros_module
from teleop_core.nodes.crews import Processes
from teleop_drill.commands.options import Options

if TYPE_CHECKING:
    from rich.console import Console

    from teleop_drill.simulation.planned import Schedule
    from teleop_drill.simulation.report import Coverage
    from teleop_drill.simulation.seeds import Found

_EVERY = 20.0  # time between two lines of progress [s]


def run_schedules(names: tuple[str, ...], options: Options) -> int:
    """Run the schedules; returns 1 if a law was broken, or an event that must happen sometimes never did.

    Raises:
        ParameterError: Arguments contradict each other.
        RecordingError: The folder for recordings exists already.
    """
    _check(names, options)
    check_new(options.out)
    ros_module("seeds", "teleop_drill.simulation")
    processes = Processes.ONE if options.composed else Processes.SIDES
    if options.schedule is not None:
        from teleop_drill.simulation.planned import Schedule

        return _run_one(Schedule.of(options.schedule), options.out)
    if options.search is not None:
        coverage = _search(options.search, options)
    elif options.seeds == 1:
        return _run_one(_drawn(options.seed, processes, options.breaks), options.out)
    else:
        coverage = _run_many(options.seed, options.seeds or 1, options.json, processes, options.breaks)
    return 1 if coverage.broken or (options.sometimes and coverage.never()) else 0


def _check(names: tuple[str, ...], options: Options) -> None:
    """Check that the options of schedules agree."""
    ways = {"--seeds": options.seeds, "--search": options.search, "--schedule": options.schedule}
    (way, value), *others = [(name, value) for name, value in ways.items() if value is not None]
    if names or options.short or options.drives or others:
        raise ParameterError(
            way, value, "given without names, --short, --drives and " + " or ".join(one for one in ways if one != way)
        )
    if way != "--seeds" and (options.composed or options.breaks):
        raise ParameterError(way, value, "given without --composed and --breaks, which a schedule contains")
    if options.out is not None and way != "--schedule" and options.seeds != 1:
        raise ParameterError("--out", options.out, "given with --schedule or --seeds 1")
    if options.scheduler is not None and way != "--search":
        raise ParameterError("--scheduler", options.scheduler, "given with --search")
    if not 0.0 <= options.breaks <= 0.1:
        raise ParameterError("--breaks", options.breaks, "from 0 to 0.1")
    if not (0.0 < options.minutes < math.inf):
        raise ParameterError("--minutes", options.minutes, "above 0 and finite")


def _drawn(seed: int, processes: Processes, breaks: float) -> "Schedule":
    from teleop_drill.simulation.planned import Schedule
    from teleop_drill.simulation.schedules import draw
    from teleop_drill.simulation.seeds import PROCESSES

    return Schedule(seed, draw(seed, PROCESSES[processes]), processes, breaks)


def _run_one(schedule: "Schedule", out: Path | None) -> int:
    if out is not None:
        out.mkdir(parents=True)
    found = schedule.run(out)
    for fault in found.faults:
        print(fault.text())
    for one in found.broken:
        print(f"✗ {one.law}, {one.at:.3f} s after the arm followed: {one.text}")
    print(f"again, or with other faults: {schedule.command()}")
    print(f"{'✗' if found.broken else '✓'} seed {found.seed}, {found.seconds:.1f} s")
    return 1 if found.broken else 0


def _search(folder: Path, options: Options) -> "Coverage":
    from rich.console import Console

    from teleop_drill.simulation.search import search
    from teleop_drill.simulation.store import Store

    client = connect(options.scheduler) if options.scheduler else None
    store, console, begin, last, laws = Store(folder), Console(), time.monotonic(), -math.inf, set[str]()
    first = options.seed + store.coverage.sessions
    print(f"{store.coverage.sessions} schedules so far; seeds from {first} on", flush=True)
    for found, new in search(store, options.seed, 60.0 * options.minutes, client=client):
        _write(options.json, store.coverage)
        passed = time.monotonic() - begin
        if passed - last > _EVERY:
            last, left = passed, len(store.coverage.never())
            text = (
                f"{passed / 60.0:.1f} min: {store.coverage.sessions} schedules, {len(store.kept)} kept, {left} events"
            )
            print(f"{text} unmet; seed {found.seed} met {len(new)} new", flush=True)
        _tell_broken(console, found, laws)
    _show(console, store.coverage)
    for line in store.lines():
        print(line)
    print(f"seeds from {first} to {options.seed + store.coverage.sessions - 1}, chosen from --seed {options.seed}")
    return store.coverage


def _run_many(first: int, count: int, json_file: Path | None, processes: Processes, breaks: float) -> "Coverage":
    from rich.console import Console
    from rich.progress import track

    from teleop_drill.simulation.report import Coverage
    from teleop_drill.simulation.seeds import run_seeds

    console, coverage, laws = Console(), Coverage(), set[str]()
    runs = run_seeds(first, count, None, processes, breaks)
    for found in track(runs, "schedules", count, console=console):
        coverage.add(found)
        _write(json_file, coverage)
        _tell_broken(console, found, laws)
    _show(console, coverage)
    for line in coverage.lines():
        print(line)
    return coverage


def _write(json_file: Path | None, coverage: "Coverage") -> None:
    """Write all counts; this happens after each schedule, because a run of an hour may be interrupted."""
    if json_file is not None:
        json_file.write_text(json.dumps(coverage.plain(), indent=2) + "\n", encoding="utf-8")


def _tell_broken(console: "Console", found: "Found", laws: set[str]) -> None:
    """Print each breach of a law with its command; the first one of each law is cut down to the faults it needs."""
    from teleop_drill.simulation.report import told
    from teleop_drill.simulation.seeds import shrink

    for one in found.broken:
        shortest = found if one.law in laws else shrink(found, one.law)
        laws.add(one.law)
        for line in told(found, shortest, one.law):
            console.print(line, highlight=False, markup=False, soft_wrap=True)


def _show(console: "Console", coverage: "Coverage") -> None:
    """Print the tables of faults by states, and of faults by laws."""
    from rich.table import Column, Table

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


def _short(count: str) -> str:
    """Text of a count for a narrow column; thousands are written as k."""
    return count if len(count) < 4 else f"{int(count) // 1000}k"
