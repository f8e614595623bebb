"""Endurance: many live sessions are started and ended on a busy machine, and all end well.

    python benchmarks/endurance.py --count 100

Each session is the command ``teleop live`` with all its processes, alternately with one process
for each node and with one for all. A session ends well if the exit code is 0, the recording is
closed and readable, no process is left and no temporary file. Several sessions at once are the
load of each other; processes that compute for nothing can be added (``--busy``). The exit code is
1 if any session ended otherwise; its output is printed.
"""

import argparse
import os
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor, as_completed
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import psutil

from teleop_core.bags.reader import Bag
from teleop_core.base.errors import TeleopError

KINDS = {"five processes": (), "composed": ("--composed",)}
_BUSY = "while True: pass"
_PATIENCE = 300.0


@dataclass(frozen=True)
class End:
    """How one session ended: what is wrong with it, empty if nothing is, and its time [s]."""

    kind: str
    wrong: str
    seconds: float
    output: str
    folder: Path


def run_session(kind: str, folder: Path, duration: float) -> End:
    """Run one session of some seconds in a directory of its own."""
    temporary = folder / "tmp"
    temporary.mkdir(parents=True)
    command = [sys.executable, "-m", "teleop_core.commands.cli", "live", "--out", str(folder / "bag")]
    command += ["--duration", f"{duration}", "--set", "operator.approach_time=0.1"]
    command += ["--set", "operator.patience=0.0", *KINDS[kind]]
    begin = time.monotonic()
    done = subprocess.run(
        command, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
        env=os.environ | {"TMPDIR": str(temporary)}, timeout=_PATIENCE, check=False, text=True,
    )  # fmt: skip
    wrong = _wrong(done.returncode, folder / "bag", temporary)
    return End(kind, wrong, time.monotonic() - begin, done.stdout, folder)


def _wrong(code: int, bag: Path, temporary: Path) -> str:
    """What is wrong with the end of a session; empty if nothing is."""
    found = [f"exit code {code}"] if code else []
    try:
        if not (bag / "metadata.yaml").exists():
            found.append("recording not closed")
        elif not Bag(bag).topics["slave/measured_js"].count:
            found.append("recording empty")
    except (TeleopError, KeyError) as error:
        found.append(f"recording not readable: {error}")
    left = [path.name for path in temporary.rglob("*") if not path.is_dir()]
    found += [f"left {name}" for name in left]
    return ", ".join(found + [f"process {pid} is left" for pid in _left(temporary)])


def _left(temporary: Path) -> list[int]:
    """Processes of a session that still run; they know its temporary directory."""
    found = []
    for process in psutil.process_iter():
        try:
            if process.environ().get("TMPDIR") == str(temporary):
                found.append(process.pid)
        except psutil.Error:
            continue
    return found


@contextmanager
def busy(count: int) -> Iterator[None]:
    """Processes that use all the time they get."""
    processes = [subprocess.Popen([sys.executable, "-c", _BUSY]) for _ in range(count)]
    try:
        yield
    finally:
        for process in processes:
            process.kill()
            process.wait()


def _table(ends: list[End]) -> str:
    lines = ["| sessions | number | ended well | time, median | time, longest |"]
    lines += ["|---|---|---|---|---|"]
    for kind in dict.fromkeys(end.kind for end in ends):
        own = [end for end in ends if end.kind == kind]
        well = sum(not end.wrong for end in own)
        seconds = np.array([end.seconds for end in own])
        lines.append(f"| {kind} | {len(own)} | {well} | {np.median(seconds):.1f} s | {seconds.max():.1f} s |")
    return "\n".join(lines)


def main() -> int:
    """Run the sessions and print the table."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--count", type=int, default=100, help="sessions of each kind")
    parser.add_argument("--seconds", type=float, default=0.5, help="duration of each, at work")
    parser.add_argument("--jobs", type=int, default=4, help="sessions at once")
    parser.add_argument("--busy", type=int, default=0, help="busy processes beside")
    parser.add_argument("--only", choices=tuple(KINDS), help="one kind alone")
    given = parser.parse_args()
    kinds = [given.only] if given.only else list(KINDS)
    ends: list[End] = []
    total = given.count * len(kinds)
    with (
        tempfile.TemporaryDirectory(prefix="endurance_") as folder,
        busy(given.busy),
        ThreadPoolExecutor(given.jobs) as pool,
    ):
        runs = [
            pool.submit(run_session, kinds[number % len(kinds)], Path(folder) / str(number), given.seconds)
            for number in range(total)
        ]
        for run in as_completed(runs):
            ends.append(end := run.result())
            print(f"{len(ends)}/{total}", end="\r", file=sys.stderr, flush=True)
            if end.wrong:
                print(f"{end.kind}: {end.wrong}\n{end.output}", flush=True)
            else:
                shutil.rmtree(end.folder)
    print(_table(ends))
    return int(any(end.wrong for end in ends))


if __name__ == "__main__":
    sys.exit(main())
