"""Replay on the console's page: a real browser shows a recording as it was at any time."""

import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from headless import Headless
from teleop_core.kernels.geometry import Array

pytest.importorskip("viser")

from browser import both, opened
from console_process import STARTS, ConsoleProcess
from teleop_core.bags.reader import Bag
from teleop_core.graph.topics import SLAVE_MEASURED_CP

pytestmark = [pytest.mark.browser, pytest.mark.slow]

TIP = "/arm/robot/tip"
SHOWN = "/([0-9.]+) s of [0-9.]+ s/.exec(document.body.innerText)?.[1]"
PICTURES = "[...document.querySelectorAll('img')].map((e) => e.src).filter((e) => !/svg/.test(e))"
KEY = "document.querySelector('.t-key').innerText"
RANGE = "(({begin, end}) => [+begin, +end])(document.querySelector('#t-strip canvas').dataset)"
IN_VIEW = """[...document.querySelectorAll('#t-strip :is(button, select, input, canvas)')].every((e) => {
    const box = e.getBoundingClientRect();
    return !box.width || (box.left >= 0 && box.right <= innerWidth + 1 && box.bottom <= innerHeight + 1);
})"""
INK = """(() => {  // columns of the strip left of its curves in which something is drawn
    const strip = document.querySelector('#t-strip canvas'), left = +strip.dataset.left;
    const {data} = strip.getContext('2d').getImageData(0, 20, left, strip.height - 20);
    return [...Array(Math.floor(left)).keys()].filter((x) => {
        for (let at = 3 + 4 * x; at < data.length; at += 4 * Math.floor(left)) if (data[at] > 60) return true;
        return false;
    });
})()"""
STILL = 3e-5  # poses that differ less from what is drawn are not sent [m]


@pytest.fixture(scope="module", params=both())
def page(
    request: pytest.FixtureRequest, recording: Path, tmp_path_factory: pytest.TempPathFactory
) -> Iterator[Headless]:
    """Page of a recording in a browser."""
    folder = tmp_path_factory.mktemp("console")
    for name in ("session", "other"):
        shutil.copytree(recording, folder / "bags" / name)
    console = ConsoleProcess(folder, folder / "bags" / "session")
    try:
        with opened(request.param, tmp_path_factory.mktemp("browser"), 1000, 700) as tab:
            tab.visit(console.url)
            tab.shows("Play", STARTS)
            yield tab
    finally:
        assert console.end() == 0, console.text


def go_to(page: Any, time: float) -> None:
    """Let the strip ask for a time [s]."""
    page.value(f"fetch('time?seek={time}', {{headers: {{'Teleop-Page': window.teleopPage}}}})")
    page.until(f"{SHOWN} === '{time:.2f}'")


def drives(page: Any) -> None:
    """Wait until the page may move time: after a reload it does once its former self is known to be gone."""
    page.value("""new Promise((done, fail) => {
        const end = performance.now() + 60000, headers = {'Teleop-Page': window.teleopPage};
        const ask = async () => (await fetch('time?seek=1', {headers})).ok ? done()
            : performance.now() > end ? fail(new Error('waited in vain')) : setTimeout(ask, 50);
        ask();
    })""")


def at_time(page: Any, time: float) -> Any:
    """Where the strip has a time [px]."""
    page.value("document.querySelector('#t-strip canvas').scrollIntoView()")
    return page.value(f"""(() => {{
        const strip = document.querySelector('#t-strip canvas'), box = strip.getBoundingClientRect();
        const {{ begin, end, left, wide }} = strip.dataset;
        return [box.x + +left + ({time} - begin) / (end - begin) * wide, box.y + 30];
    }})()""")


def add_curve(page: Any, words: str, name: str) -> None:
    """Search for a column by the keyboard, and draw the first that is found."""
    page.value("document.querySelector('#t-strip [type=search]').focus()")
    page.call("Input.insertText", text=words)
    page.until(f"document.querySelector('#t-found [aria-selected=true]')?.innerText.startsWith('{name}')")
    page.key("Enter")
    page.until(f"{KEY}.includes('{name}') && !{KEY}.includes('is being read')")


def measured(recording: Path, time: float) -> Array:
    """Where the tip was last measured by a time since the begin [m], as the recording says."""
    bag = Bag(recording)
    series = bag.read(SLAVE_MEASURED_CP)
    at = series.at(bag.start_ns + round(time * 1e9)) + 1  # told a tick after its joints
    return series.values[at, :3]


@pytest.mark.parametrize("time", [9.5, 4.25, 11.0])
def test_tip_is_shown_where_the_recording_says_at_a_time(page: Any, recording: Path, time: float) -> None:
    go_to(page, time)
    wanted = measured(recording, time)
    page.until(f"""{page.place_of(TIP)}.every((x, i) => Math.abs(
        x - {wanted.tolist()}[i]) < {2 * STILL})""")
    assert not page.faults()


def test_replay_plays_pauses_and_steps(page: Any) -> None:
    go_to(page, 2.0)
    page.click("Play")
    page.shows("Pause")
    page.until(f"{SHOWN} > 2.5")
    page.click("Pause")
    page.shows("Play")
    held = float(page.value(SHOWN))
    page.value("document.querySelector('#t-strip canvas').focus()")
    page.key("ArrowRight")
    page.until(f"{SHOWN} > {held}")
    page.key("ArrowLeft")
    page.until(f"Math.abs({SHOWN} - {held}) < 0.011")
    page.key("End")
    page.until(f"{SHOWN} > 15")
    page.key("Home")
    page.until(f"{SHOWN} === '0.00'")
    page.value("document.activeElement.blur()")
    page.key("p")
    page.shows("Pause")
    page.until(f"{SHOWN} > 0.3")
    page.key("p")
    page.until("!document.body.innerText.includes('Pause')")  # or the time is written over


def test_recording_cannot_be_driven_from_the_page(page: Headless) -> None:
    assert not page.value("document.body.innerText.includes('EMERGENCY STOP')")
    assert not page.value("document.body.innerText.includes('Initialize')")


def test_pictures_from_tool_and_microscope_show_the_scene(page: Any) -> None:
    go_to(page, 6.0)
    page.click("View")
    page.click("show")
    page.shows("microscope")
    page.until(f"{PICTURES}.length === 2")
    blank = page.value(PICTURES)
    page.until(f"{PICTURES}.every((seen, i) => seen !== {blank}[i])")
    page.click("show")
    page.until(f"{PICTURES}.length === 0")


@pytest.mark.parametrize("size", [(1400, 900), (390, 844)])
def test_strip_is_scrubbed_zoomed_and_shows_any_column_beside_another_recording(
    page: Any, recording: Path, size: tuple[int, int]
) -> None:
    page.resize(*size)
    page.reload()
    page.shows("Play")
    page.until(f"{IN_VIEW} && document.documentElement.scrollWidth <= innerWidth")
    if page.value("document.querySelector('#t-strip').classList.contains('t-folded')"):
        page.click("Unfold")
    page.until(f"{KEY}.includes('tracking error') && {IN_VIEW}")
    drives(page)
    page.pull(at_time(page, 3.0), at_time(page, 9.0))
    page.mouse("mouseReleased", *at_time(page, 9.0))
    page.until(f"Math.abs({SHOWN} - 9) < 0.1")
    wanted = measured(recording, float(page.value("+document.querySelector('#t-strip canvas').ariaValueNow")))
    page.until(f"{page.place_of(TIP)}.every((x, i) => Math.abs(x - {wanted.tolist()}[i]) < 5e-4)")
    add_curve(page, "setpoint_js rad theta1", "slave/setpoint_js theta1")
    page.until(f"{KEY}.includes('−')")  # it is negative here
    ink = page.value(INK)
    assert ink
    assert ink[0] >= 1, "a number is clipped at the left"
    whole = page.value(RANGE)
    x, y = at_time(page, 6.0)
    page.call("Input.dispatchMouseEvent", type="mouseWheel", x=x, y=y, deltaX=0, deltaY=-300)
    page.until(f"{RANGE}[1] - {RANGE}[0] < {0.7 * (whole[1] - whole[0])}")
    assert page.value(RANGE)[0] < 6.0 < page.value(RANGE)[1]
    for count in (1, 2):
        for kind in ("mousePressed", "mouseReleased"):
            page.call("Input.dispatchMouseEvent", type=kind, x=x, y=y, button="left", clickCount=count)
    page.until(f"{RANGE}[1] - {RANGE}[0] === {whole[1] - whole[0]}")
    for kind, apart in (("touchStart", 20), ("touchMove", 60), ("touchMove", 120)):
        fingers = [{"x": x - apart / 2, "y": y, "id": 0}, {"x": x + apart / 2, "y": y, "id": 1}]
        page.call("Input.dispatchTouchEvent", type=kind, touchPoints=fingers)
    page.call("Input.dispatchTouchEvent", type="touchEnd", touchPoints=[])
    page.until(f"{RANGE}[1] - {RANGE}[0] < {0.4 * (whole[1] - whole[0])}")
    page.click("Whole")
    page.value("""(() => { const over = document.querySelector('.t-over');
        over.value = 'other'; over.dispatchEvent(new Event('change')); })()""")
    page.until(f"/tracking error .*, dashed /.test({KEY})")
    page.value("""(() => { const over = document.querySelector('.t-over');
        over.value = ''; over.dispatchEvent(new Event('change')); })()""")
    page.until(f"!{KEY}.includes('dashed')")
    page.value("document.querySelector('[data-drop*=theta1]').click()")
    page.until(f"!{KEY}.includes('theta1')")
    assert not page.faults()
