"""Console: what a page that is open costs the session that it shows, in one run.

    python benchmarks/console.py --seconds 20 --rounds 3

Rounds of a composed session alone, of one with the page's server, and of one with a real browser
on it. A browser without a graphics processor draws with the processors that the session needs,
small as the page is here. Where the system grants it, the console's session has a real-time
priority; so there are rounds without it, and of a session alone with it. Ratios count.
"""

import argparse
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np
import psutil

from live import score

BROWSERS = ("chromium", "chromium-browser", "google-chrome")
FLAGS = (
    "--headless", "--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader",
    "--no-first-run", "--disable-background-networking", "--disable-component-update",
    "--disable-sync", "--window-size=400,300", "--remote-debugging-port=0",
)  # fmt: skip
SETTINGS = ("--scenario", "coarse_box", "--set", "operator=random")
PORT = 8087
TOKEN = "benchmark"
_START = 6.0  # after the first status line, until everything has settled [s]


def alone(seconds: float, folder: Path, *settings: str) -> dict[str, float]:
    """A composed session without a page."""
    bag = folder / "alone"
    command = ["live", "--composed", "--out", str(bag), *SETTINGS, *settings]
    command += [f"teleop.duration={seconds + _START + 2.0}"]
    share, window_ns = _watched(command, seconds)
    return {"cpu": share, **score(bag, *window_ns)}


def shown(seconds: float, folder: Path, *settings: str, has_browser: bool = True) -> dict[str, float]:
    """The same behind a page, which a browser shows."""
    bag = folder / "shown"
    command = ["console", "--no-browser", "--port", str(PORT), "--token", TOKEN, "--out", str(bag), *SETTINGS]
    command += [*settings, f"teleop.duration={seconds + _START + 2.0}"]
    share, window_ns = _watched(command, seconds, has_browser=has_browser)
    return {"cpu": share, **score(bag, *window_ns)}


def _watched(command: list[str], seconds: float, *, has_browser: bool = False) -> tuple[float, tuple[int, int]]:
    """Run a command; processor share [%] of its processes in the middle of it, and when [ns]."""
    process = subprocess.Popen(
        [sys.executable, "-m", "teleop_core.commands.cli", *command], stdout=subprocess.PIPE, text=True
    )
    assert process.stdout is not None
    for line in process.stdout:
        if "operator is ready" in line:
            break
    page = _open() if has_browser else None
    time.sleep(_START)
    family = _family(process.pid)
    begin_ns, before = time.time_ns(), sum(sum(one.cpu_times()[:2]) for one in family)
    time.sleep(seconds)
    used = sum(sum(one.cpu_times()[:2]) for one in family) - before
    end_ns = time.time_ns()
    process.stdout.read()
    if process.wait():
        raise SystemExit(f"teleop {command[0]} failed")
    if page is not None:
        for one in _family(page.pid):
            one.kill()
        page.wait()
    return 1e11 * used / (end_ns - begin_ns), (begin_ns, end_ns)


def _family(pid: int) -> list[psutil.Process]:
    return [psutil.Process(pid), *psutil.Process(pid).children(recursive=True)]


def _open() -> "subprocess.Popen[bytes]":
    browser = next(filter(None, map(shutil.which, BROWSERS)), None)
    if browser is None:
        raise SystemExit(f"no browser to open the page with; install one of {', '.join(BROWSERS)}")
    profile = f"--user-data-dir={tempfile.mkdtemp()}"
    return subprocess.Popen(  # a session of processes of its own, as the browser of a desktop is
        [browser, *FLAGS, profile, f"http://127.0.0.1:{PORT}/?token={TOKEN}"], start_new_session=True,
        stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
    )  # fmt: skip


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=20.0, help="length of each part")
    parser.add_argument("--rounds", type=int, default=3, help="how often each is run")
    arguments = parser.parse_args()
    first, fair = "real_time.priority=20", "real_time.priority=0"
    kinds: dict[str, Callable[[float, Path], dict[str, float]]] = {
        "composed session alone": alone,
        "alone, with priority": lambda s, f: alone(s, f, first),
        "with the page's server": partial(shown, has_browser=False),
        "with a browser": shown,
        "with a browser, no priority": lambda s, f: shown(s, f, fair),
    }
    found: dict[str, list[dict[str, float]]] = {name: [] for name in kinds}
    for number in range(arguments.rounds):
        for name, run in kinds.items():
            with tempfile.TemporaryDirectory() as folder:
                found[name].append(run(arguments.seconds, Path(folder)))
                print(f"{number + 1}/{arguments.rounds} {name}: {found[name][-1]}", flush=True)
    print(f"\nmedians of {arguments.rounds} rounds of {arguments.seconds:g} s")
    print(f"{'':28}{'median ms':>10}{'p99 ms':>8}{'CPU %':>7}{'steps/s':>9}{'p99 ratio':>10}")
    whole = 0.0
    for name, rows in found.items():
        middle = {key: float(np.median([row[key] for row in rows])) for key in rows[0]}
        whole = whole or middle["p99"]
        print(
            f"{name:28}{middle['median']:10.3f}{middle['p99']:8.3f}{middle['cpu']:7.0f}"
            f"{middle['steps']:9.2f}{middle['p99'] / whole:10.2f}"
        )


if __name__ == "__main__":
    main()
