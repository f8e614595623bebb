"""Page: how soon the console's page is there, how smooth it is, and how soon its stop is heard, by one command.

    python benchmarks/page.py                    on a quiet machine, some minutes
    python benchmarks/page.py --starts 1 --seconds 2 --presses 20

A browser of 1400 x 900 pixels draws with software. The first start compiles and is not counted. The stop is pressed
beside sixteen pages without the token, which ask for everything again and again, and four pages with it, which do what
tests know of attacks. What an open page costs the loop of
the session is measured by `benchmarks/console.py`.
"""

import argparse
import logging
import random
import sys
import tempfile
import threading
import time
from contextlib import suppress
from multiprocessing import get_context
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests" / "support"))

import hostile
from browser import Tab
from console_process import STARTS, ConsoleProcess
from page_client import PageClient, ask
from present import present

READY = "!document.querySelector('#t-start')?.hidden && document.querySelector('#t-begin')?.disabled === false"
PAINT = "performance.getEntriesByName('first-contentful-paint')[0]?.startTime"
FRAMES = """new Promise((done) => { const begin = performance.now(); let frames = 0;
    const frame = () => { frames += 1; const passed = performance.now() - begin;
        passed < SECONDS * 1000 ? requestAnimationFrame(frame) : done(1000 * frames / passed); };
    requestAnimationFrame(frame); })"""
STRANGERS, HOSTILE, PAGES = 16, 4, 4  # pages without a token, and with it; how many share a process


def opened(tab: Any, url: str) -> tuple[float, float]:
    """First paint of the form, and when a session can be chosen [ms after the request]."""
    tab.call("Page.navigate", url="about:blank")
    tab.call("Page.navigate", url=url)
    tab.until(READY, STARTS)
    usable = float(tab.value("performance.now()"))
    return float(tab.value(PAINT)), usable


def started(tab: Any) -> float:
    """Time from a press of Start until the arm is drawn and enabled [ms]."""
    tab.until(READY, STARTS)
    begin = time.monotonic()
    tab.value("document.querySelector('#t-begin').click()")
    tab.until("document.querySelector('#t-starting').hidden && document.querySelector('#t-start').hidden", STARTS)
    tab.shows("ENABLED", STARTS)
    return 1e3 * (time.monotonic() - begin)


def ended(tab: Any) -> None:
    """Lead back to the form."""
    tab.until("!document.querySelector('#t-end').hidden", STARTS)
    tab.value("document.querySelector('#t-end').click()")
    tab.until("!document.querySelector('#t-start').hidden", STARTS)


def stops(port: int, presses: int) -> list[float]:
    """Times from a press until it was answered, which is when the stop was said [ms], beside hostile pages.

    The pages have processes of their own: in this one they would keep the clock waiting.
    """
    logging.getLogger("websockets").setLevel(logging.CRITICAL)  # what is killed says no goodbye
    context, found = get_context("spawn"), list[float]()
    others = [context.Process(target=attackers, args=(port, range(HOSTILE)), daemon=True)]
    others += [context.Process(target=strangers, args=(port,), daemon=True) for _ in range(0, STRANGERS, PAGES)]
    with PageClient(port):
        for one in others:
            one.start()
        time.sleep(5.0)  # until all of them are at work
        for _ in range(presses):
            begin = time.monotonic()
            assert ask(port, "/stop", Teleop_Page="new")[0] == 204
            found.append(1e3 * (time.monotonic() - begin))
            time.sleep(0.02)
        for one in others:
            one.kill()
    return found


def attackers(port: int, seeds: range) -> None:
    """Be some hostile pages, until this process is killed."""
    attacks = sorted(set(hostile.HOSTILE) - set(hostile.STOPPING), key=lambda attack: attack.__name__)

    logging.getLogger("websockets").setLevel(logging.CRITICAL)

    def attack(seed: int, driver: PageClient) -> None:
        chosen = random.Random(seed)
        while True:
            with suppress(Exception), PageClient(port, comes_up=False) as watcher:  # it is cut off, or refused
                chosen.choice(attacks)(watcher, driver)

    with PageClient(port) as driver:
        pages = [threading.Thread(target=attack, args=(seed, driver)) for seed in seeds]
        for page in pages:
            page.start()
        pages[0].join()


def strangers(port: int) -> None:
    """Be some pages without the token, until this process is killed."""
    logging.getLogger("websockets").setLevel(logging.CRITICAL)

    def asks() -> None:
        while True:
            with suppress(Exception):
                for path in ("/stop", "/alive", "/"):
                    ask(port, path, token="guess", Teleop_Page="new")
                PageClient(port, comes_up=False, token="guess")

    pages = [threading.Thread(target=asks) for _ in range(PAGES)]
    for page in pages:
        page.start()
    pages[0].join()


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--starts", type=int, default=5, help="starts that are counted")
    parser.add_argument("--seconds", type=float, default=10.0, help="for which frames are counted")
    parser.add_argument("--presses", type=int, default=500, help="of the stop")
    told = parser.parse_args()
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        console = ConsoleProcess(folder)
        try:
            with Tab(folder / "browser", 1400, 900) as tab:
                opened(tab, console.url)
                loads = np.median([opened(tab, console.url) for _ in range(told.starts)], axis=0)
                started(tab)
                starts = []
                for _ in range(told.starts):
                    ended(tab)
                    starts.append(started(tab))
                frames = float(tab.value(FRAMES.replace("SECONDS", str(told.seconds))))
            heard = stops(present(urlsplit(console.url).port), told.presses)
        finally:
            console.end()
    for name, value, wanted in (
        ("first paint", f"{loads[0]:.0f} ms", "1000 ms"),
        ("choice usable", f"{loads[1]:.0f} ms", "2000 ms"),
        ("Start to drawn, warm", f"{np.median(starts):.0f} ms", "4000 ms"),
        ("frames a second, software", f"{frames:.1f}", "at least 30"),
        (f"stop beside {STRANGERS} + {HOSTILE} pages, median", f"{np.median(heard):.1f} ms", ""),
        ("  99 of 100", f"{np.percentile(heard, 99):.1f} ms", "50 ms"),
    ):
        print(f"{name:42}{value:>12}   {wanted}")


if __name__ == "__main__":
    main()
