"""Take the console's pictures in the documents anew, in a Chromium of this machine.

python docs/pictures.py            all of them, some minutes; look at them before they are committed
python docs/pictures.py --moving   the moving one alone
python docs/pictures.py --scene    that of a scene alone
python docs/pictures.py --states   twenty states at a desk, on a phone and on a wall, to look at, in out/states
"""

import base64
import io
import json
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from PIL import Image

import teleop_core as tc

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "tests" / "support"))

from browser import VIEWER, Tab  # noqa: E402
from console_process import ConsoleProcess  # noqa: E402

IMAGES = ROOT / "docs" / "images"
SCENARIO = "coarse_box"
AT_A_WALL = f"{VIEWER}.nodeRefFromName['/arm/master/force'].visible"
NOTICE = "document.querySelector('.mantine-Notification-closeButton')?.click()"  # of the renderer
SETTLE = 4.0  # the page fades and slides [s]
SHARP = "&fixedDpr=2"  # smooth edges, which software does not draw for people
TAKEN = IMAGES / "taken.json"
FROM, TO, FRAME_TIME = 5.0, 14.0, 0.1  # of the moving picture [s]
LARGE = {"robot": "puma560", "motion_scaling.coarse_gain": 3.0}
"""What makes motion of the arm large on the page."""


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
    (IMAGES / name).write_bytes(shot(tab))
    assert not tab.faults()
    told(name)


def shot(tab: Tab) -> bytes:
    """What is seen now, as a PNG."""
    return base64.b64decode(tab.call("Page.captureScreenshot")["data"])


def told(name: str) -> None:
    """Note the version that a picture shows, for its mark on the site."""
    versions = json.loads(TAKEN.read_text(encoding="utf-8")) | {name: tc.__version__}
    TAKEN.write_text(json.dumps(versions, indent=1, sort_keys=True) + "\n", encoding="utf-8")
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


def start(folder: Path) -> None:
    """Take the form on which a session is chosen, beside two recordings."""
    for name, scenario in (("fine", "fine_box"), ("push", "wall")):
        tc.run(scenario, duration=8.0, out=folder / "bags" / name)
    with served(folder) as console, Tab(folder / "start", 1400, 900) as tab:
        tab.visit(console.url)
        tab.until("document.querySelectorAll('.t-list :is(.t-good, .t-held)').length === 2", 120)
        keep(tab, "console_start.png")


def live(folder: Path) -> None:
    """Take the page of a session: wide and light at a wall, wide and dark, narrow with plots."""
    arguments = ("--scenario", SCENARIO, "--out", folder / "session", "--set", "operator=human")
    with served(folder, *arguments) as console:
        wide_and_narrow(console.url, folder)


def wide_and_narrow(url: str, folder: Path) -> None:
    """Take the three."""
    with Tab(folder / "wide", 1400, 900) as tab:
        tab.visit(url + SHARP)
        tab.shows("follows · fixture on", 180)
        keep(tab, "console.png", AT_A_WALL)
        toggle_dark(tab)
        tab.click("Settings")
        keep(tab, "console_dark.png")
    with Tab(folder / "narrow", 800, 900) as tab:
        tab.visit(url + SHARP)
        tab.shows("ENABLED", 60)
        toggle_dark(tab)
        keep(tab, "console_800.png")


def replay(folder: Path) -> None:
    """Take the page of a recording, dark, with curves and another recording laid over it."""
    for name, seed in (("session", 1), ("second", 2)):
        buttons = {"buttons.clutch": [4.0, 5.0], "buttons.mode": [6.0, 9.0], "buttons.fixture": [2.0, 11.0]}
        settings = {"haptic_master.seed": seed, "path.approach_time": float(seed), **buttons}
        tc.run("mode_switching", duration=12.0, out=folder / "bags" / name, settings=settings)
    with served(folder, folder / "bags" / "session") as console, Tab(folder / "replay", 1100, 900) as tab:
        tab.visit(console.url + SHARP)
        tab.shows("Play", 120)
        toggle_dark(tab)
        seek(tab, 9.5)
        for words in ("master/measured_cf fx", "slave/setpoint_js theta1"):
            tab.value("document.querySelector('#t-strip [type=search]').focus()")
            tab.call("Input.insertText", text=words)
            found = "[...document.querySelectorAll('#t-found li')].map((e) => e.innerText).join()"
            tab.until(f"{found}.includes({json.dumps(words)})")
            tab.key("Enter")
        tab.value("""(() => { const over = document.querySelector('.t-over');
            over.value = 'second'; over.dispatchEvent(new Event('change')); })()""")
        keep(tab, "console_replay.png", "/theta1 .*, dashed /.test(document.querySelector('.t-key').innerText)")


def seek(tab: Tab, moment: float) -> None:
    """Go to a time of the recording [s]."""
    tab.value(f"fetch('time?seek={moment}', {{headers: {{'Teleop-Page': window.teleopPage}}}})")
    tab.shows(f"{moment:.2f} s of")


def scene(folder: Path) -> None:
    """Take the page of a recording of a scene, whose bodies it draws."""
    recorded = folder / "cubes"
    tc.run(SCENARIO, duration=6.0, out=recorded, settings={"robot": "cubes.xml"})
    with served(folder, recorded) as console, Tab(folder / "scene", 1100, 700) as tab:
        tab.visit(console.url + SHARP)
        tab.shows("Play", 120)
        seek(tab, 4.0)
        keep(tab, "console_scene.png")


def moving(folder: Path) -> None:
    """Take a recorded session frame by frame, each at its time of the replay, and join them."""
    recorded = folder / "moved"
    tc.run(SCENARIO, duration=TO, out=recorded, settings=LARGE)
    with served(folder, recorded) as console, Tab(folder / "moving", 900, 540) as tab:
        tab.visit(console.url + SHARP)
        tab.shows("Play", 120)
        tab.value(NOTICE)
        for _ in range(2):  # nearer
            turn = {"x": 330, "y": 270, "deltaX": 0, "deltaY": -200}
            tab.call("Input.dispatchMouseEvent", type="mouseWheel", **turn)
        count = round((TO - FROM) / FRAME_TIME)
        frames = [frame(tab, FROM + k * FRAME_TIME) for k in range(count)]
        assert not tab.faults()
    options = {"duration": round(1e3 * FRAME_TIME), "loop": 0, "quality": 70, "method": 6}
    frames[0].save(IMAGES / "console.webp", save_all=True, append_images=frames[1:], **options)
    told("console.webp")


def frame(tab: Tab, moment: float) -> Image.Image:
    """Picture of a replay at a time of the recording [s]."""
    seek(tab, moment)
    for _ in range(4):  # headless, the page is drawn only while it is pictured
        picture = shot(tab)
    return Image.open(io.BytesIO(picture)).convert("RGB")


SIZES = {"desk": (1400, 900), "phone": (390, 844), "wall": (3840, 2160)}
STATES = ROOT / "out" / "states"
LISTED = "document.querySelectorAll('.t-list :is(.t-good, .t-held)').length === 2"
SLIDES = "document.getAnimations().some((one) => one instanceof CSSTransition)"
STARTS = 240.0  # patience with a session, whose kernels may have to be compiled [s]


def states(folder: Path) -> None:
    """Take the page's states as small pictures, which only are looked at."""
    STATES.mkdir(parents=True, exist_ok=True)
    for name, scenario in (("fine", "fine_box"), ("push", "wall")):
        tc.run(scenario, duration=8.0, out=folder / "bags" / name)
    with served(folder) as console, Tab(folder / "states", *SIZES["desk"]) as tab:
        tab.visit(console.url)
        tab.until(LISTED, 120)
        state(tab, "form", "desk", "phone", "wall")
        choose(tab, "operator", "bag")
        tab.shows("Cannot start")
        state(tab, "form_refuses", "desk", "phone")
        choose(tab, "operator", "remote")  # who leads without an end: a simulated one works for a minute
        choose(tab, "task", "reach")
        tab.until("document.querySelector('#t-begin').disabled === false")
        tab.click("Start")
        state(tab, "starting", "desk")
        tab.shows("ENABLED", STARTS)
        state(tab, "task", "desk", "phone", "wall")
        tab.click("Pause")
        tab.shows("PAUSED")
        state(tab, "paused", "desk")
        state(tab, "settings", "desk", "phone", opens="Settings")
        state(tab, "view", "desk", opens="View")
        with Tab(folder / "second", *SIZES["desk"]) as second:
            second.visit(console.url)
            second.shows("you watch", STARTS)
            state(second, "watches", "desk")
        tab.click("EMERGENCY STOP")
        tab.shows("All arms are stopped")
        state(tab, "stopped", "desk", "phone")
        tab.click("End session")
        tab.shows("Repeat", STARTS)
        state(tab, "form_repeats", "desk")
        tab.value("[...document.querySelectorAll('.t-list input')].at(-1).click()")
        tab.click("Replay")
        tab.shows("Play", STARTS)
        state(tab, "replay", "desk", "phone")
    with Tab(folder / "lost", *SIZES["desk"]) as tab:
        with served(folder, folder / "bags" / "fine") as console:
            tab.visit(console.url)
            tab.shows("Play", 120)
        tab.shows("NO CONNECTION")
        state(tab, "no_connection", "desk")


def choose(tab: Tab, name: str, word: str) -> None:
    """Choose a word in a list of the form."""
    tab.value(f"""(() => {{
        const list = document.querySelector('#t-start select[name={name}]');
        list.value = '{word}'; list.dispatchEvent(new Event('change'));
    }})()""")


def state(tab: Tab, name: str, *sizes: str, opens: str = "") -> None:
    """Keep what is seen now, at some sizes, with a tab of the panel opened: on a phone it has tabs of its own."""
    tab.value(NOTICE)
    for size in sizes:
        width, height = SIZES[size]
        tab.call(
            "Emulation.setDeviceMetricsOverride",
            width=width,
            height=height,
            deviceScaleFactor=1,
            mobile=size == "phone",
        )
        if opens:
            tab.click(opens)
        end = time.monotonic() + SETTLE
        while time.monotonic() < end or tab.value(SLIDES):
            picture = shot(tab)
        file = STATES / f"{name}_{size}.webp"
        Image.open(io.BytesIO(picture)).convert("RGB").save(file, quality=60, method=6)
        print(file)
    width, height = SIZES["desk"]
    tab.call("Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=1, mobile=False)


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as place:
        if "--states" in sys.argv:
            states(Path(place))
            sys.exit()
        if "--scene" in sys.argv:
            scene(Path(place))
            sys.exit()
        moving(Path(place))
        if "--moving" not in sys.argv:
            start(Path(place))
            live(Path(place))
            replay(Path(place))
            scene(Path(place))
