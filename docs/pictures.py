"""Take the console's pictures in the documents anew, in a Chromium of this machine.

python docs/pictures.py            half a minute; look at them before they are committed
"""

import base64
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import teleop_core as tc

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "tests"))

from browser import VIEWER, Tab  # noqa: E402
from console_process import ConsoleProcess  # noqa: E402

IMAGES = ROOT / "docs" / "images"
SCENARIO = "coarse_box"
AT_A_WALL = f"{VIEWER}.nodeRefFromName['/arm/master/force'].visible"
NOTICE = "document.querySelector('.mantine-Notification-closeButton')?.click()"  # of the renderer
SETTLE = 4.0  # the page fades and slides [s]


def toggle_dark(tab: Tab) -> None:
    """Make a light page dark, or the other way round: it is the page's, whoever looks."""
    tab.click("View")
    tab.click("dark")


def keep(tab: Tab, name: str, when: str = "true") -> None:
    """Write what is seen as soon as an expression is true, without the notice of the renderer."""
    tab.value(NOTICE)
    end = time.monotonic() + SETTLE
    while time.monotonic() < end:  # headless, what slides moves only while it is pictured
        tab.call("Page.captureScreenshot")
    tab.until(when, 60)
    shot = tab.call("Page.captureScreenshot")
    (IMAGES / name).write_bytes(base64.b64decode(shot["data"]))
    assert not tab.faults()
    print(IMAGES / name)


@contextmanager
def served(folder: Path, *arguments: object) -> Iterator[ConsoleProcess]:
    """Run the command, and end it whatever happens."""
    console = ConsoleProcess(folder, *arguments)
    try:
        yield console
    finally:
        code = console.end()
    assert code == 0, console.text


def live(folder: Path) -> None:
    """Take the page of a session: wide and light at a wall, wide and dark, narrow with plots."""
    arguments = ("--scenario", SCENARIO, "--out", folder / "session", "--set", "operator=human")
    with served(folder, *arguments) as console:
        wide_and_narrow(console.url, folder)


def wide_and_narrow(url: str, folder: Path) -> None:
    """Take the three."""
    with Tab(folder / "wide", 1400, 900) as tab:
        tab.visit(url)
        tab.shows("follows · box on", 180)
        keep(tab, "console.png", AT_A_WALL)
        toggle_dark(tab)
        tab.click("Settings")
        keep(tab, "console_dark.png")
    with Tab(folder / "narrow", 800, 900) as tab:
        tab.visit(url)
        tab.shows("ENABLED", 60)
        toggle_dark(tab)
        tab.click("Plots")
        keep(tab, "console_800.png")


def replay(folder: Path) -> None:
    """Take the page of a recording of two arms, narrow and dark."""
    settings = {"right/robot": "puma560", "right/haptic_master.seed": 2}
    out = folder / "two_arms"
    tc.run(SCENARIO, duration=12.0, out=out, arms=["left", "right"], settings=settings)
    with served(folder, out) as console, Tab(folder / "replay", 800, 900) as tab:
        tab.visit(console.url)
        tab.shows("Play", 120)
        toggle_dark(tab)
        tab.fill("time", "9.5")
        tab.key("Enter")
        tab.click("Plots")
        keep(tab, "console_replay.png")


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as place:
        live(Path(place))
        replay(Path(place))
