"""Console: what a page that is open costs the session that it shows, in one run.

    python benchmarks/console.py --seconds 20 --rounds 3

Rounds of a composed session alone, of one with the page's server, and of one with a real browser
on it: first a browser that draws in what the session leaves, which tells what being watched costs,
then one of equal rank. A browser without a graphics processor draws with the processors that the
session needs, small as the page is here. With --priority the session has a real-time priority, and
the browser of equal rank is tried again. Ratios count.
"""

import argparse
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from enum import Enum
from functools import partial
from pathlib import Path

import numpy as np
import psutil

from live import _score

BROWSERS = ("chromium", "chromium-browser", "google-chrome")
FLAGS = (
    "--headless", "--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader",
    "--no-first-run", "--disable-background-networking", "--disable-component-update",
    "--disable-sync", "--window-size=400,300", "--remote-debugging-port=0",
)  # fmt: skip
SETTINGS = ("--scenario", "coarse_box", "--set", "operator=random")
PORT = 8087
_START = 6.0  # after the first status line, until everything has settled [s]


class Rank(Enum):
    """What a browser gets of the processors."""

    IDLE = "what the session leaves"
    EQUAL = "as much as the session"


def alone(seconds: float, folder: Path, *settings: str) -> dict[str, float]:
    """A composed session without a page."""
    bag = folder / "alone"
    command = ["live", "--composed", "--out", str(bag), *SETTINGS, *settings]
    command += [f"teleop.duration={seconds + _START + 2.0}"]
    return {**_watched(command, seconds), **_score(bag)}


def shown(
    seconds: float, folder: Path, rank: Rank | None = None, *settings: str
) -> dict[str, float]:
    """The same behind a page, which a browser of a rank shows if there is one."""
    bag = folder / "shown"
    command = ["console", "--no-browser", "--port", str(PORT), "--out", str(bag), *SETTINGS]
    command += [*settings, f"teleop.duration={seconds + _START + 2.0}"]
    return {**_watched(command, seconds, rank), **_score(bag)}


def _watched(command: list[str], seconds: float, rank: Rank | None = None) -> dict[str, float]:
    """Run a command; processor share [%] of all its processes, in the middle of it."""
    process = subprocess.Popen(
        [sys.executable, "-m", "teleop_core.cli", *command], stdout=subprocess.PIPE, text=True
    )
    assert process.stdout is not None
    for line in process.stdout:
        if "haptic_master is ready" in line:
            break
    page = _open(rank) if rank else None
    time.sleep(_START)
    family = _family(process.pid)
    begin, before = time.monotonic(), sum(sum(one.cpu_times()[:2]) for one in family)
    time.sleep(seconds)
    used = sum(sum(one.cpu_times()[:2]) for one in family) - before
    share = 100.0 * used / (time.monotonic() - begin)
    process.stdout.read()
    if process.wait():
        raise SystemExit(f"teleop {command[0]} failed")
    if page is not None:
        for one in _family(page.pid):
            one.kill()
        page.wait()
    return {"cpu": share}


def _family(pid: int) -> list[psutil.Process]:
    return [psutil.Process(pid), *psutil.Process(pid).children(recursive=True)]


def _open(rank: Rank) -> "subprocess.Popen[bytes]":
    browser = next(filter(None, map(shutil.which, BROWSERS)), None)
    if browser is None:
        raise SystemExit(f"no browser to open the page with; install one of {', '.join(BROWSERS)}")
    # Processors are shared among sessions of processes first, then within each.
    is_idle = rank is Rank.IDLE
    first = ["chrt", "--idle", "0"] if is_idle else []
    command = [*first, browser, *FLAGS, f"--user-data-dir={tempfile.mkdtemp()}"]
    return subprocess.Popen(
        [*command, f"http://127.0.0.1:{PORT}/"], start_new_session=not is_idle,
        stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
    )  # fmt: skip


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=20.0, help="length of each part")
    parser.add_argument("--rounds", type=int, default=3, help="how often each is run")
    parser.add_argument("--priority", action="store_true", help="also with real-time priority")
    arguments = parser.parse_args()
    kinds: dict[str, Callable[[float, Path], dict[str, float]]] = {
        "composed session alone": alone,
        "with the page's server": shown,
        "with a browser, idle rank": partial(shown, rank=Rank.IDLE),
        "with a browser, equal rank": partial(shown, rank=Rank.EQUAL),
    }
    if arguments.priority:
        high = "real_time.priority=50"
        kinds |= {
            "with priority, alone": lambda s, f: alone(s, f, high),
            "with priority and a browser": lambda s, f: shown(s, f, Rank.EQUAL, high),
        }
    found: dict[str, list[dict[str, float]]] = {name: [] for name in kinds}
    for number in range(arguments.rounds):
        for name, run in kinds.items():
            with tempfile.TemporaryDirectory() as folder:
                found[name].append(run(arguments.seconds, Path(folder)))
                print(f"{number + 1}/{arguments.rounds} {name}: {found[name][-1]}", flush=True)
    print(f"\nmedians of {arguments.rounds} rounds of {arguments.seconds:g} s")
    print(f"{'':28}{'median ms':>10}{'p99 ms':>8}{'CPU %':>7}{'steps/s':>9}{'p99 ratio':>10}")
    first = 0.0
    for name, rows in found.items():
        middle = {key: float(np.median([row[key] for row in rows])) for key in rows[0]}
        first = first or middle["p99"]
        print(
            f"{name:28}{middle['median']:10.3f}{middle['p99']:8.3f}{middle['cpu']:7.0f}"
            f"{middle['steps']:9.2f}{middle['p99'] / first:10.2f}"
        )


if __name__ == "__main__":
    main()
