"""Drive: a person's drive by script, in a real browser on the page of a session.

    python benchmarks/drive.py --minutes 10

The stylus is taken by an arrow and pulled to and fro. The table says how long after the mouse each
part of the chain has come equally far, and how much memory session and page had at the begin and
at the end. A browser without a graphics processor draws with the processors of the session: so the
page is a small one, and how long a picture takes is said apart. 90 ms are the slave's own: they are
the published reference filter, which --set reference_filter.is_on=false leaves out.
"""

import argparse
import signal
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
import psutil

sys.path.append(str(Path(__file__).parents[1] / "tests" / "support"))  # the page is used as tests use it
from browser import VIEWER, Tab
from console_process import ConsoleProcess
from teleop_core.bags.reader import Bag
from teleop_core.graph.topics import MASTER_MEASURED_CP, SLAVE_MEASURED_CP, SLAVE_SERVO_CP
from teleop_core.kernels.geometry import Array

SIZE = (800, 450)  # px
GRIP, TIP, ARROW, WAY = "/arm/master/grip", "/arm/robot/tip", 0.07, 0.012  # m
LASTS, SETTLES = 0.8, 1.0  # of a pull, and of the rest after it [s]
LEVELS = np.linspace(0.5, 0.9, 9)
"""Shares of the way at which a part is compared with the mouse."""
STREAMS = (MASTER_MEASURED_CP, SLAVE_SERVO_CP, SLAVE_MEASURED_CP)
# Times since 1970 [ms] at which the mouse moved, and at which a picture had the tip at a place.
WATCH = f"""(() => {{
    window.moved = []; window.drawn = [];
    const viewer = {VIEWER};
    addEventListener('pointermove', (e) => moved.push(
        [performance.timeOrigin + e.timeStamp, e.clientX, e.clientY]), true);
    const look = () => {{
        const tip = viewer.nodeRefFromName['{TIP}'];
        drawn.push([performance.timeOrigin + performance.now(), ...tip.position.toArray()]);
        requestAnimationFrame(look);
    }};
    requestAnimationFrame(look);
}})()"""
TAKE = "(() => { const all = [moved, drawn]; moved = []; drawn = []; return all; })()"


def pull(tab: Tab, way: float) -> tuple[Array, Array]:
    """Pull an arrow along itself and let it go; times and places of mouse and drawn tip."""
    begin, end = (np.array(tab.seen_at(GRIP, [at, 0.0, 0.0]), dtype=float) for at in (ARROW, ARROW + way))
    tab.mouse("mouseMoved", *begin)
    tab.value("new Promise((done) => setTimeout(done, 300))")
    tab.value(TAKE)
    tab.mouse("mousePressed", *begin)
    since = time.monotonic()
    while (now := time.monotonic() - since) < LASTS + SETTLES:
        tab.mouse("mouseMoved", *(begin + min(now / LASTS, 1.0) * (end - begin)))
        time.sleep(0.01)
    moved, drawn = (np.array(rows) for rows in tab.value(TAKE))
    tab.mouse("mouseReleased", *end)
    return moved, drawn


def passed(times: Array, places: Array) -> Array:
    """When the levels of the way from the first to the last place were passed, in ``times``."""
    way = places[-1] - places[0]
    share = (places - places[0]) @ way / (way @ way)
    return np.array([times[np.argmax(share >= level)] for level in LEVELS])


def behind(pulls: list[tuple[Array, Array]], bag: Path) -> dict[str, Array]:
    """Times from the mouse to each part of the chain [ms], of all pulls and levels."""
    streams = Bag(bag).read_many(STREAMS)
    found: dict[str, list[Array]] = {}
    for moved, drawn in pulls:
        mouse = passed(moved[:, 0], moved[:, 1:])
        parts = {}
        for topic in STREAMS:
            series = streams[topic.name]
            times = series.log_ns * 1e-6
            is_in = (times > moved[0, 0]) & (times < moved[-1, 0])
            parts[topic.name] = passed(times[is_in], series.values[is_in, :3])
        parts["tip in the picture"] = passed(drawn[:, 0], drawn[:, 1:])
        for name, times in parts.items():
            found.setdefault(name, []).append(times - mouse)
    return {name: np.concatenate(rows) for name, rows in found.items()}


def memory(tab: Tab, console: ConsoleProcess) -> dict[str, float]:
    """Memory of the processes, and what the page holds after its garbage is gone [MB]."""
    server = psutil.Process(console.process.pid)
    nodes = sum(one.memory_info().rss for one in server.children(recursive=True))
    tab.call("HeapProfiler.collectGarbage")
    held = tab.call("Runtime.getHeapUsage")["usedSize"]
    sizes = {"nodes": nodes, "page's server": server.memory_info().rss, "page": held}
    return {name: size / 1e6 for name, size in sizes.items()}


Pulls = list[tuple[Array, Array]]


def drive(tab: Tab, console: ConsoleProcess, minutes: float) -> tuple[Pulls, list[dict[str, float]]]:
    """Pull to and fro for a time; all pulls, and the memory once a minute."""
    pulls: Pulls = []
    begin = time.monotonic()
    held = [memory(tab, console)]
    sign = 1.0
    while (now := time.monotonic() - begin) < 60.0 * minutes:
        pulls.append(pull(tab, sign * WAY))
        sign = -sign
        if tab.value("document.body.innerText.includes('PAUSED')"):
            tab.click("Start")
            pulls.pop()
        if now > 60.0 * len(held):
            held.append(memory(tab, console))
            told = ", ".join(f"{name} {size:.1f} MB" for name, size in held[-1].items())
            print(f"{len(held) - 1} min: {len(pulls)} pulls, {told}", flush=True)
    return pulls, [*held, memory(tab, console)]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--minutes", type=float, default=1.0, help="how long to drive")
    parser.add_argument("--set", nargs="*", default=[], help="settings of the session")
    arguments = parser.parse_args()
    # Where a shell runs this in the background, Ctrl-C would be ignored by what is started here.
    signal.signal(signal.SIGINT, signal.default_int_handler)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        bag = folder / "session"
        given = ["--set", *arguments.set] if arguments.set else []
        console = ConsoleProcess(folder, "--out", bag, *given)
        # os.sched_setscheduler(0, os.SCHED_IDLE, os.sched_param(0))  # and of all that it starts
        with Tab(folder / "browser", *SIZE) as tab:
            tab.visit(console.url)
            tab.shows("ENABLED", 180)
            tab.shows("drives")
            tab.value(WATCH)
            pull(tab, WAY)
            pulls, held = drive(tab, console, arguments.minutes)
            faults = tab.faults()
        if console.end():
            raise SystemExit(console.text)
        print(f"\n{len(pulls)} pulls, errors of the page: {faults or 'none'}")
        pictures = np.concatenate([np.diff(drawn[:, 0]) for _, drawn in pulls])
        print(f"a picture every {np.median(pictures):.0f} ms")
        print(f"\n{'behind the mouse, ms':28}{'median':>8}{'p95':>8}")
        for part, times in behind(pulls, bag).items():
            print(f"{part:28}{np.median(times):8.0f}{np.percentile(times, 95):8.0f}")
        print(f"\n{'memory, MB':28}{'begin':>8}{'middle':>8}{'end':>8}")
        for part in held[0]:
            sizes = [row[part] for row in held]
            print(f"{part:28}{sizes[0]:8.1f}{sizes[len(sizes) // 2]:8.1f}{sizes[-1]:8.1f}")


if __name__ == "__main__":
    main()
