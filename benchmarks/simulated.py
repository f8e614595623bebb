"""Speed of the simulated machine: simulated seconds in each second of processor time, and where the time goes.

    python benchmarks/simulated.py --count 20            # the median of 20 random schedules, by side and composed
    python benchmarks/simulated.py --count 1 --parts     # one schedule of each, with the share of each part

The first schedule of a process loads the kernels and is not counted. With ``--parts`` the profiler makes the schedules
several times slower, and counts calls of Python functions as longer than they are.
"""

import argparse
import cProfile
import pstats
import time
from collections import Counter
from pathlib import Path

import numpy as np

from teleop_core.nodes.crews import Processes
from teleop_drill.simulation.seeds import run_seed

_PARTS = 12  # parts that are listed


def speeds(first: int, count: int, processes: Processes) -> list[float]:
    """Simulated seconds in each second of processor time, of each schedule."""
    found = []
    for seed in range(first, first + count):
        begin = time.process_time()
        seconds = run_seed(seed, processes=processes).seconds
        found.append(seconds / (time.process_time() - begin))
    return found


def parts(profile: cProfile.Profile) -> Counter[str]:
    """Own time of all functions [s], by module of this repository or by library."""
    found: Counter[str] = Counter()
    for (path, _, name), (_, _, own, *_) in pstats.Stats(profile).stats.items():  # type: ignore[attr-defined]
        is_ours = "site-packages" not in path and "teleop_" in path
        found["/".join(Path(path).with_suffix("").parts[-2:]) if is_ours else f"library: {name}"] += own
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description="Speed of the simulated machine.")
    parser.add_argument("--seed", type=int, default=0, help="first seed")
    parser.add_argument("--count", type=int, default=5, help="schedules of each distribution of the nodes")
    parser.add_argument("--parts", action="store_true", help="print the share of each part in the processor time")
    given = parser.parse_args()
    for processes in (Processes.SIDES, Processes.ONE):
        run_seed(given.seed, (), processes=processes)
        profile = cProfile.Profile(time.process_time)
        if given.parts:
            profile.enable()
        found = speeds(given.seed, given.count, processes)
        profile.disable()
        low, middle, high = np.percentile(found, [25, 50, 75])
        text = f"{processes.value}: {middle:.2f} simulated s per processor s, quartiles {low:.2f} to {high:.2f}"
        print(text, flush=True)
        if given.parts:
            own = parts(profile)
            for name, seconds in own.most_common(_PARTS):
                print(f"  {100.0 * seconds / own.total():4.1f} %  {name}")


if __name__ == "__main__":
    main()
