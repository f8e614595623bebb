"""Console: what a page that is open costs the session that it shows, in one run.

    python benchmarks/console.py --seconds 20 --rounds 3

Rounds of a composed session alone, of one with the page's server, and of one with a real browser on
it. A browser without a graphics processor draws with the processor that the session needs; so the
page is drawn small here, in what the session leaves, and is not counted. Ratios count.
"""

import argparse
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import time
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


def alone(seconds: float, folder: Path) -> dict[str, float]:
    """A composed session without a page."""
    bag = folder / "alone"
    command = ["live", "--composed", "--out", str(bag), *SETTINGS]
    command += [f"teleop.duration={seconds + _START + 2.0}"]
    return {**_watched(command, seconds), **_score(bag)}


def shown(seconds: float, folder: Path, browser: str) -> dict[str, float]:
    """The same behind a page, which a browser shows if there is one named."""
    bag = folder / f"shown{bool(browser)}"
    command = ["console", "--no-browser", "--port", str(PORT), "--out", str(bag), *SETTINGS]
    command += [f"teleop.duration={seconds + _START + 2.0}"]
    return {**_watched(command, seconds, browser), **_score(bag)}


def _watched(command: list[str], seconds: float, browser: str = "") -> dict[str, float]:
    """Run a command; processor share [%] of all its processes, in the middle of it."""
    process = subprocess.Popen(
        [sys.executable, "-m", "teleop_core.cli", *command], stdout=subprocess.PIPE, text=True
    )
    assert process.stdout is not None
    for line in process.stdout:
        if "haptic_master is ready" in line:
            break
    page = _open(browser) if browser else None
    time.sleep(_START)
    family = [psutil.Process(process.pid), *psutil.Process(process.pid).children(recursive=True)]
    begin, before = time.monotonic(), sum(sum(one.cpu_times()[:2]) for one in family)
    time.sleep(seconds)
    used = sum(sum(one.cpu_times()[:2]) for one in family) - before
    share = 100.0 * used / (time.monotonic() - begin)
    process.stdout.read()
    if process.wait():
        raise SystemExit(f"teleop {command[0]} failed")
    if page is not None:
        os.killpg(page.pid, signal.SIGKILL)
        page.wait()
    return {"cpu": share}


def _open(browser: str) -> "subprocess.Popen[bytes]":
    profile = tempfile.mkdtemp()
    return subprocess.Popen(
        ["nice", "-n", "15", browser, *FLAGS, f"--user-data-dir={profile}", f"http://127.0.0.1:{PORT}/"],
        stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True,
    )  # fmt: skip


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=20.0, help="length of each part")
    parser.add_argument("--rounds", type=int, default=3, help="how often each is run")
    arguments = parser.parse_args()
    browser = next(filter(None, map(shutil.which, BROWSERS)), "")
    kinds = {
        "composed session alone": alone,
        "with the page's server": lambda s, f: shown(s, f, ""),
        "with a browser on the page": lambda s, f: shown(s, f, browser),
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
