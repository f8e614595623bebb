"""Glass to glass: how old a camera's picture is when a browser shows it, by the number of the tick drawn into it.

    python benchmarks/glass.py                 on a quiet machine, a minute; 60 pictures
    python benchmarks/glass.py --pictures 20

A session with the scene cubes.xml runs by side, a camera of 640 x 480 draws at 30 Hz in a process of its own, and the
console's page shows it in a headless Chromium, all on this machine and without a graphics card. The age of a picture is
the time at which its corner is read back from the page, minus the time of the tick in its corner.
"""

import argparse
import base64
import io
import os
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
from PIL import Image

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests" / "support"))

from browser import Tab
from console_process import STARTS, ConsoleProcess
from teleop_scene.camera import read_marker

DOMAIN = "79"
TELEOP = str(Path(sys.executable).with_name("teleop"))
SHOWN = "[...document.querySelectorAll('img')].find((one) => one.naturalWidth === 640)"
CORNER = f"""(() => {{ const page = document.createElement('canvas'), shown = {SHOWN};
    page.width = 96; page.height = 32; page.getContext('2d').drawImage(shown, 0, 0);
    return page.toDataURL('image/png').split(',')[1]; }})()"""
"""Corner of the picture as the page shows it, with the marker."""


def ages(tab: Tab, count: int) -> list[float]:
    """Ages of the pictures that the page shows [s], one for each new picture."""
    found: dict[int, float] = {}
    while len(found) < count:
        picture = Image.open(io.BytesIO(base64.b64decode(tab.value(CORNER))))
        tick = read_marker(np.asarray(picture.convert("RGB")))
        found.setdefault(tick, time.time() - 1e-3 * tick)
    return list(found.values())


def main() -> None:
    """Print median and 99th percentile."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--pictures", type=int, default=60)
    given = parser.parse_args()
    os.environ["ROS_DOMAIN_ID"] = DOMAIN
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        camera = subprocess.Popen([TELEOP, "camera", "cubes.xml", "front", "--marker"], stdout=subprocess.DEVNULL)
        console = ConsoleProcess(folder, "--set", "robot=cubes.xml", "operator=human", "scene.rate=60")
        try:
            with Tab(folder, 1400, 900) as tab:
                tab.visit(console.url)
                tab.shows("ENABLED", STARTS)
                tab.click("View")
                tab.until(f"{SHOWN} !== undefined", STARTS)
                found = 1e3 * np.array(ages(tab, given.pictures))
        finally:
            camera.send_signal(signal.SIGINT)
            console.end()
            camera.wait(30)
    print(f"from a tick to the browser, {len(found)} pictures, load {os.getloadavg()[0]:.1f}:", end=" ")
    print(f"median {np.median(found):.0f} ms, p99 {np.percentile(found, 99.0):.0f} ms")


if __name__ == "__main__":
    main()
