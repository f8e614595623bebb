"""Search beside dice: what both meet in the same processor time, and what marking branches costs.

    python benchmarks/search.py --minutes 5              # of processor time for each
    python benchmarks/search.py --cost 6                 # the same schedules with and without marks
    python benchmarks/search.py --unmet out/search       # branches that no schedule of a store met
    NUMBA_DISABLE_JIT=1 python benchmarks/search.py --unmet out/search --again 8    # and of kernels of slave/operation

Dice are schedules of successive seeds, the rarest of each three, as of ``teleop drill --seeds``. The first schedule of
a process loads the kernels and is not counted.
"""

import argparse
import os
import resource
import tempfile
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from teleop_core.base.workers import workers
from teleop_core.nodes.crews import Processes
from teleop_drill.simulation.branches import Branches
from teleop_drill.simulation.planned import Schedule
from teleop_drill.simulation.schedules import draw
from teleop_drill.simulation.search import Search, run_measured
from teleop_drill.simulation.seeds import PROCESSES, Starts, rarest, run_seed
from teleop_drill.simulation.store import Store, kind_of

WAYS = (Processes.SIDES, Processes.SIDES, Processes.ONE)
"""Distributions of the nodes, as often as the search draws them."""


def dice(store: Store, seed: int) -> Iterator[Schedule]:
    """Schedules of successive seeds."""
    for k in range(10**9):
        processes, first = WAYS[k % len(WAYS)], seed + 3 * k
        chosen = rarest(range(first, first + 3), store.coverage.met, processes)
        yield Schedule(chosen, draw(chosen, PROCESSES[processes]), processes)


def searched(store: Store, seed: int) -> Iterator[Schedule]:
    """Schedules of the search."""
    search = Search(store, seed)
    while True:
        yield search.choose()


def used_s() -> float:
    """Processor time of this process and of its copies that have ended [s]."""
    return sum(sum(resource.getrusage(who)[:2]) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))


def compare(ways: Sequence[str], minutes: float, seed: int) -> None:
    starts = Starts(Branches())
    for name in ways:
        make = dice if name == "dice" else searched
        with tempfile.TemporaryDirectory() as folder:
            store, used, marks = Store(Path(folder)), 0.0, 0
            for schedule in make(store, seed):
                begin = used_s()
                found, branches = schedule.run_in(starts)
                used += used_s() - begin
                store.add(found, branches)
                for one in found.broken:
                    print(f"{name} breaks `{one.law}` after {used / 60.0:.1f} min: {schedule.command()}", flush=True)
                if used >= 60.0 * minutes * (marks + 1) / 5.0:
                    marks += 1
                    kinds = [kind_of(one) for one in store.times]
                    each = ", ".join(f"{kinds.count(one)} {one}" for one in ("events", "pairs", "branches"))
                    text = f"{store.coverage.sessions} schedules, {store.coverage.seconds:.0f} simulated s"
                    print(f"{name} after {used / 60.0:.1f} min: {each}; {text}", flush=True)
                if marks == 5:
                    break


def cost(count: int, seed: int) -> None:
    """Processor time of the same schedules."""
    times: dict[bool, list[float]] = {False: [], True: []}
    for is_marked, starts in ((False, Starts()), (True, Starts(Branches()))):  # functions stay marked
        for k in (*range(4), *range(seed, seed + count)):  # the first are not counted: they make the starts
            begin = used_s()
            starts.run(k, None)
            times[is_marked].append(used_s() - begin)
        del times[is_marked][:4]
    ratio = np.array(times[True]) / np.array(times[False])
    print(f"marks: {100.0 * (np.median(ratio) - 1.0):.1f} % more processor time, median of {count} schedules")


def again(store: Store, count: int) -> None:
    """Add the branches of some kept schedules to a store's counts, in memory: without a compiler, those of kernels too.

    The schedules are those that met the most events first. Each takes about a minute without a compiler.
    """
    kept = sorted(store.kept, key=lambda one: -sum(kind_of(name) == "events" for name in one.new))[:count]
    with workers(len(os.sched_getaffinity(0))) as pool:
        for _, branches in pool.map(run_measured, [one.schedule for one in kept]):
            store.times.update(branches)


def unmet(folder: Path, count: int) -> None:
    """Branches that no schedule of a store met: a line for each file."""
    branches, store = Branches(), Store(folder)
    run_seed(0, ())
    branches.begin()
    if count:
        again(store, count)
    total: dict[str, list[str]] = {}
    for name in branches.names:
        file, _, place = name.partition(":")
        total.setdefault(file, []).append(place)
    count = missed = 0
    print("| file | met | of | not met |\n|---|---|---|---|")
    for file, places in sorted(total.items()):
        left = [place for place in places if not store.times[f"{file}:{place}"]]
        count, missed = count + len(places), missed + len(left)
        text = "all: no simulated session runs it" if len(left) == len(places) else ", ".join(left)
        print(f"| {file} | {len(places) - len(left)} | {len(places)} | {text} |")
    print(f"\n{count - missed} of {count} branches met in {store.coverage.sessions} schedules")


def main() -> None:
    parser = argparse.ArgumentParser(description="Search beside dice.")
    parser.add_argument("ways", nargs="*", help="of dice and search; without one, both", default=["dice", "search"])
    parser.add_argument("--minutes", type=float, default=5.0, help="processor time of each")
    parser.add_argument("--seed", type=int, default=0, help="first seed")
    parser.add_argument("--cost", type=int, default=0, help="schedules with and without marks, in place of the search")
    parser.add_argument("--unmet", type=Path, metavar="STORE", help="branches that no schedule of a store met")
    parser.add_argument("--again", type=int, default=0, metavar="N", help="with --unmet: run N kept schedules again")
    given = parser.parse_args()
    if given.unmet is not None:
        unmet(given.unmet, given.again)
        return
    run_seed(given.seed, ())
    if given.cost:
        cost(given.cost, given.seed)
    else:
        compare(given.ways, given.minutes, given.seed)


if __name__ == "__main__":
    main()
