"""Virtual time: speed, memory and size of recorded sessions, and what they score.

Run with ``make bench``; prints ratios to real time, and the published figures beside ours.
"""

import argparse
import json
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

_RUN = """
import json, resource, sys, time
from teleop_core.commands import cli
begin = time.perf_counter()
code = cli.main(sys.argv[1:])
used = resource.getrusage(resource.RUSAGE_SELF)
print(json.dumps([code, time.perf_counter() - begin, used.ru_maxrss / 1024]), file=sys.stderr)
"""


def run(*arguments: str) -> tuple[float, float]:
    """Run one teleop command in a process of its own; seconds and largest memory [MiB]."""
    command = [sys.executable, "-c", _RUN, *arguments]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    code, seconds, mebibytes = json.loads(done.stderr.strip().splitlines()[-1])
    if code:
        raise SystemExit(done.stderr)
    return seconds, mebibytes


def measure(folder: Path, minutes: float) -> dict[str, float]:
    """Simulate, record and score coarse_box for some minutes."""
    bag = folder / f"m{minutes:g}"
    seconds = 60.0 * minutes
    sim, sim_memory = run("sim", "--scenario", "coarse_box", "--duration", str(seconds), "--out", str(bag))
    score, score_memory = run("evaluate", str(bag), "--json", str(folder / "score.json"))
    size = sum(file.stat().st_size for file in bag.iterdir()) / 2**20
    return {
        "simulated [s]": seconds, "sim and record [s]": sim, "score [s]": score,
        "times real time, recorded": seconds / sim,
        "times real time, recorded and scored": seconds / (sim + score),
        "memory sim [MiB]": sim_memory, "memory score [MiB]": score_memory,
        "size per minute [MiB]": size / minutes,
    }  # fmt: skip


def print_speed(folder: Path, long_minutes: float) -> None:
    """Print a one-minute and a long run side by side."""
    run("sim", "--duration", "1", "--out", str(folder / "warm"))  # compile once
    run("evaluate", str(folder / "warm"))
    one, many = measure(folder, 1.0), measure(folder, long_minutes)
    print(f"\nvirtual time, twelve topics at 1 kHz{'1 min':>18}{long_minutes:>8g} min    ratio")
    for name, value in one.items():
        print(f"  {name:40}{value:12.2f}{many[name]:12.2f}{many[name] / value:9.2f}")


def print_scores(folder: Path) -> None:
    """Print the scores of both published experiments, all seeds, worst first."""
    bags = []
    for scenario in ("coarse_box", "fine_box"):
        bags.append(str(folder / scenario))
        run("sim", "--scenario", scenario, "--out", bags[-1])
    subprocess.run([sys.executable, "-m", "teleop_core.commands.cli", "evaluate", *bags], check=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--minutes", type=float, default=10.0, help="length of the long run")
    arguments = parser.parse_args()
    begin = time.perf_counter()
    with tempfile.TemporaryDirectory() as folder:
        print_speed(Path(folder), arguments.minutes)
        print_scores(Path(folder))
    children = resource.getrusage(resource.RUSAGE_CHILDREN)
    print(f"(took {time.perf_counter() - begin:.0f} s, {children.ru_utime:.0f} s of processor)")


if __name__ == "__main__":
    main()
