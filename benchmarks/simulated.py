"""Speed of the simulated machine: simulated seconds in each second of processor time, and where the time goes.

    python benchmarks/simulated.py --count 20            # the median of 20 random schedules, by side and composed
    python benchmarks/simulated.py --count 1 --parts     # one schedule of each, with the share of each part

Schedules share the starts of their sessions, as those of ``teleop drill --seeds`` and ``--search`` do; the starts and
what loads the kernels are not counted. ``--alone`` starts a session for each schedule. ``--parts`` does so too, and
looks at the running code once in a millisecond of processor time, first by kind of work, then by function.
"""

import argparse
import resource
import signal
from collections import Counter
from contextlib import nullcontext
from pathlib import Path
from types import FrameType

import numpy as np

from teleop_core.nodes.crews import Processes
from teleop_drill.simulation.seeds import STARTS, Starts, run_seed

_PARTS = 30  # parts that are listed
_SAMPLE = 1e-3  # processor time between two samples [s]
_STARTS = {"start", "launch", "close", "on_configure", "on_activate", "on_deactivate", "on_cleanup", "on_shutdown"}
KINDS = {
    "laws": ("simulation/laws", "simulation/owner", "simulation/drilled_session", "simulation/sometimes"),
    "scheduler and bus": ("simulation/", "middleware/"),
    "recorder": (
        "nodes/recorder",
        "nodes/feed",
        "nodes/model",
        "nodes/markers",
        "nodes/display",
        "nodes/newest",
        "bags/",
    ),
    "messages of nodes": ("nodes/streams", "nodes/ports", "nodes/wire", "nodes/sender"),
    "steps of stages": ("graph/stage",),
    "reports": ("nodes/diagnostics", "nodes/observer"),
    "turns of nodes": ("nodes/", "slave/", "hand/"),
}
"""Modules of each kind of work, by the begins of their names; the first kind that fits counts."""


def speeds(first: int, count: int, processes: Processes, starts: Starts | None) -> list[tuple[float, float]]:
    """Simulated seconds in each second of processor time, and processor time [s], of each schedule."""
    found = []
    for seed in range(first, first + count):
        begin = used_s()
        if starts is None:
            seconds = run_seed(seed, processes=processes).seconds
        else:
            seconds = starts.run(seed, None, processes)[0].seconds
        took = used_s() - begin
        found.append((seconds / took, took))
    return found


def used_s() -> float:
    """Processor time of this process and of its copies that have ended [s]."""
    return sum(sum(resource.getrusage(who)[:2]) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))


class Sampler:
    """Counts, at each ms of processor time, the kind of work of the present code.

    A sample belongs to ``start`` if a function that starts something is among the callers, else to the kind of the
    innermost module of :data:`KINDS`. So a kernel belongs to the module that calls it.
    """

    def __init__(self) -> None:
        self.counts: Counter[str] = Counter()
        self.places: Counter[str] = Counter()

    def __enter__(self) -> "Sampler":
        signal.signal(signal.SIGPROF, self._look)
        signal.setitimer(signal.ITIMER_PROF, _SAMPLE, _SAMPLE)
        return self

    def __exit__(self, *_: object) -> None:
        signal.setitimer(signal.ITIMER_PROF, 0.0)

    def _look(self, _: int, frame: FrameType | None) -> None:
        kind, place = "", ""
        while frame is not None:
            code = frame.f_code
            if code.co_name in _STARTS:
                kind = "start and end of processes"
            if not kind:
                path = Path(code.co_filename)
                name = f"{path.parent.name}/{path.stem}"
                kind = next((kind for kind, names in KINDS.items() if any(map(name.startswith, names))), "")
                place = place or f"{name} {code.co_name}"
            frame = frame.f_back
        self.counts[kind or "other"] += 1
        self.places[place] += 1


def main() -> None:
    parser = argparse.ArgumentParser(description="Speed of the simulated machine.")
    parser.add_argument("--seed", type=int, default=0, help="first seed")
    parser.add_argument("--count", type=int, default=5, help="schedules of each distribution of the nodes")
    parser.add_argument("--parts", action="store_true", help="print the share of each part in the processor time")
    parser.add_argument("--alone", action="store_true", help="start a session for each schedule")
    given = parser.parse_args()
    for processes in (Processes.SIDES, Processes.ONE):
        run_seed(given.seed, (), processes=processes)
        starts = None if given.parts or given.alone else Starts()
        if starts is not None:
            for seed in range(given.seed, given.seed + STARTS):
                starts.run(seed, (), processes)
        with Sampler() if given.parts else nullcontext() as sampler:
            found = speeds(given.seed, given.count, processes, starts)
        low, middle, high = np.percentile([speed for speed, _ in found], [25, 50, 75])
        took = np.median([took for _, took in found])
        text = f"{processes.value}: {middle:.2f} simulated s per processor s, quartiles {low:.2f} to {high:.2f}"
        print(f"{text}; {took:.2f} processor s each", flush=True)
        for counts in (sampler.counts, sampler.places) if sampler is not None else ():
            for name, count in counts.most_common(_PARTS):
                share = count / counts.total()
                print(f"  {100.0 * share:4.1f} %  {1e3 * share / middle:6.1f} ms per simulated s  {name}")


if __name__ == "__main__":
    main()
