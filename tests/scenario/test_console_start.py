"""Start page in a real browser: a session is chosen, begun and repeated, on a desk and a phone."""

import json
import shutil
import socket
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from headless import Headless

pytest.importorskip("viser")

from browser import both, opened, until
from page_client import TOKEN, PageClient, ask
from teleop_console.app import choose
from teleop_console.server import ConsoleServer
from teleop_console.start import Wish

EXAMPLE = Path(__file__).parents[2] / "bags" / "example"
URDF = EXAMPLE.parents[1] / "examples" / "any_arm.urdf"
READY = "!document.querySelector('#t-start').hidden && !document.querySelector('#t-begin').disabled"
WIDE = "document.querySelector('#t-start').scrollWidth <= innerWidth"
STOP_AND_START = """['#t-stop', '#t-begin'].every((name) => {
    const box = document.querySelector(name).getBoundingClientRect();
    const found = document.elementFromPoint(box.x + box.width / 2, box.y + box.height / 2);
    return box.height >= 36 && box.left >= 0 && box.right <= innerWidth
        && found === document.querySelector(name);
})"""
UNNAMED = """[...document.querySelectorAll('#t-start :is(select, input, button)')].filter(
    (e) => !e.hidden && !(e.labels?.[0]?.innerText || e.innerText || e.ariaLabel)).length"""
browser = pytest.mark.browser


@pytest.fixture(scope="module", params=both())
def tab(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Headless]:
    if request.param == "Tab":  # the browser that tests of pages share
        shared = request.getfixturevalue("_browser")
        shared.clear()
        shared.call("Emulation.setEmulatedMedia", features=[])
        yield shared
        return
    with opened(request.param, tmp_path_factory.mktemp("start")) as browser:
        yield browser


@pytest.fixture(autouse=True)
def _clean(tab: Any) -> None:
    """Each test begins with an empty tab and with no memory of errors."""
    tab.clear()


@contextmanager
def chosen(wishes: list[Wish], count: int) -> Iterator[ConsoleServer]:
    """Server of a start page that is shown until some wishes have come."""
    with ConsoleServer(0, token=TOKEN) as server:

        def work() -> None:
            while len(wishes) < count:
                wishes.append(choose(server))

        waiting = threading.Thread(target=work)
        waiting.start()
        try:
            yield server
        finally:
            server.drivers.is_for_all = True
            while waiting.is_alive():
                server.answers.start.answer("/begin", {"operator": ["remote"]}, 0)
                waiting.join(0.1)


@contextmanager
def form(tab: Any, count: int, size: tuple[int, int] = (1400, 900)) -> Iterator[list[Wish]]:
    """The form in a tab of a size, and the wishes that come from there."""
    wishes = list[Wish]()
    tab.resize(*size)
    with chosen(wishes, count) as server:
        tab.visit(server.url)
        tab.until(READY)
        yield wishes
        assert not tab.faults()


@pytest.fixture
def _run_1(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A folder with a recording."""
    shutil.copytree(EXAMPLE, tmp_path / "bags" / "run_1")
    monkeypatch.chdir(tmp_path)


def pick(tab: Any, label: str, word: str) -> None:
    """Choose a word in the list behind a label, as the keyboard does."""
    tab.value(f"""(() => {{
        const row = [...document.querySelectorAll('.t-field')].find(
            (e) => e.firstChild.textContent === '{label}');
        const select = row.querySelector('select');
        select.value = '{word}';
        select.dispatchEvent(new Event('change', {{bubbles: true}}));
    }})()""")


AT_CONNECTION = """Object.defineProperty(window, 'teleopPage', { configurable: true,
    get() { return this.t_page; },
    set(name) { this.t_page = name; window.t_loads ??= document.querySelector('#t-starting').innerText; } })"""


@browser
def test_tab_has_the_name_of_the_console_and_an_empty_scene_is_never_bare(tab: Any) -> None:
    with ConsoleServer(0, token=TOKEN) as server:
        script = tab.call("Page.addScriptToEvaluateOnNewDocument", source=AT_CONNECTION)
        tab.visit(server.url)
        tab.until("window.t_loads !== undefined")
        tab.call("Page.removeScriptToEvaluateOnNewDocument", identifier=script["identifier"])
        assert "loading the scene" in tab.value("window.t_loads")
        tab.until("document.querySelector('#t-starting').hidden")
        assert tab.value("document.title") == "Teleoperation console"
        tab.until("!document.body.innerText.includes('Software WebGL')")


@browser
@pytest.mark.usefixtures("_run_1")
def test_form_says_that_it_loads_until_it_has_its_words(tab: Any) -> None:
    with chosen([], 1) as server:
        tab.call("Network.setBlockedURLs", urls=["*/start?*"])
        tab.visit(server.url)
        tab.shows("Loading the form")
        assert tab.value("getComputedStyle(document.querySelector('#t-begin')).visibility") == "hidden"
        tab.call("Network.setBlockedURLs", urls=[])
        tab.until(READY)
        tab.until("document.querySelector('.t-loads').hidden")
        assert tab.value("getComputedStyle(document.querySelector('#t-begin')).visibility") == "visible"


@browser
@pytest.mark.usefixtures("_run_1")
def test_next_robot_of_the_form_does_not_keep_the_tip_of_a_urdf(tab: Any) -> None:
    Path("robots").mkdir()
    shutil.copy(URDF, "robots/arm.urdf")
    wishes = list[Wish]()
    with chosen(wishes, 2) as server:
        server.answers.start._last = {"operator": "remote", "robot": "robots/arm.urdf", "tip": "tool0"}
        tab.visit(server.url)
        tab.until(f"{READY} && document.querySelector('#t-tips option')")
        tab.shows("tip=tool0")
        pick(tab, "Robot", "rcrt1")
        tab.until(READY)
        tab.until("!document.body.innerText.includes('tip=tool0')")
        assert tab.value("[...document.querySelectorAll('[name=robot] option')].every((e) => !e.disabled)")
        tab.click("Start")
        until(lambda: wishes, "it is begun")
    assert wishes[0].chosen == {"operator": "remote", "robot": "rcrt1"}


@browser
@pytest.mark.slow
@pytest.mark.parametrize("size", [(1400, 900), (390, 844)])
@pytest.mark.usefixtures("_run_1")
def test_session_is_chosen_begun_and_repeated(tab: Any, size: tuple[int, int]) -> None:
    with form(tab, 3, size) as wishes:
        tab.until(f"{WIDE} && {STOP_AND_START}")
        assert tab.value(UNNAMED) == 0
        pick(tab, "Scenario", "wall")
        pick(tab, "Network", "delay_300")
        tab.shows("--scenario wall --set 'teleop.stages=[network]' network.preset=delay_300")
        observer = "document.querySelector('option[value=observer]')"
        tab.until(f"{observer}.disabled && {observer}.textContent.includes('stage task')")
        tab.click("Start")
        until(lambda: wishes, "it is begun")
        told = {"scenario": "wall", "operator": "remote", "network": "delay_300"}
        assert wishes[0].chosen == told
        tab.click("Repeat")
        until(lambda: len(wishes) == 2, "it is begun again")
        assert wishes[1] == wishes[0]
        tab.shows("run_1")
        tab.until("document.querySelector('.t-list input')")
        tab.value("document.querySelector('.t-list input').click()")
        tab.click("Replay")
        until(lambda: len(wishes) == 3, "it is shown")
        assert wishes[2].recording == Path("bags/run_1")


@browser
@pytest.mark.slow
@pytest.mark.parametrize("size", [(1400, 900), (390, 844)])
@pytest.mark.usefixtures("_run_1")
def test_form_is_filled_and_a_recording_is_scored_and_replayed_by_keys_alone(tab: Any, size: tuple[int, int]) -> None:
    with form(tab, 2, size) as wishes:
        tab.until("document.querySelector('.t-list input')")
        tab.tab_to("[name=network]")
        tab.key("ArrowDown")
        tab.until("document.querySelector('[name=network]').value !== ''")
        word = tab.value("document.querySelector('[name=network]').value")
        tab.until(f"{READY} && document.querySelector('.t-command').innerText.includes('network.preset={word}')")
        tab.tab_to("#t-begin")
        tab.key("Enter")
        until(lambda: wishes, "it is begun")
        assert wishes[0].chosen == {"operator": "remote", "network": word}
        tab.until(f"{READY} && document.querySelector('.t-list input')")
        tab.tab_to(".t-list input")
        tab.key("Enter")
        tab.tab_to("[data-act=score]")
        tab.key("Enter")
        tab.until("document.querySelector('.t-told').innerText.includes('tracking error')", 120)
        tab.until("!document.querySelector('[data-act=replay]').disabled")
        tab.tab_to("[data-act=replay]")
        tab.key("Enter")
        until(lambda: len(wishes) == 2, "it is shown")
        assert wishes[1].recording == Path("bags/run_1")


@browser
@pytest.mark.slow
def test_urdf_that_is_dropped_on_the_form_is_the_robot(
    tab: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    with form(tab, 1) as wishes:
        tab.value(f"""(() => {{
            const dropped = new DataTransfer();
            dropped.items.add(new File([{json.dumps(URDF.read_text())}], 'any_arm.urdf'));
            document.querySelector('#t-start').dispatchEvent(
                new DragEvent('drop', {{dataTransfer: dropped, bubbles: true, cancelable: true}}));
        }})()""")
        tab.shows("robot=robots/any_arm.urdf")
        tab.fill("Tip", "tool0")
        assert tab.value("[...document.querySelector('#t-tips').options].map((o) => o.value)") == ["camera", "tool0"]
        tab.key("Tab")
        if not tab.has_focus:
            tab.value("document.querySelector('[list]').dispatchEvent(new Event('change'))")
        tab.shows("'geometry=[tip=tool0]'")
        tab.until(READY)
        tab.click("Start")
        until(lambda: wishes, "it is begun")
    told = {"operator": "remote", "robot": "robots/any_arm.urdf", "tip": "tool0"}
    assert wishes == [Wish(told)]


@browser
@pytest.mark.slow
def test_page_that_watches_the_form_sees_it_and_begins_nothing_before_it_has_control(
    tab: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    wishes = list[Wish]()
    tab.resize(1400, 900)
    with chosen(wishes, 1) as server, PageClient(server.port) as driver:
        until(lambda: server.drivers.driver is not None, "it drives")
        tab.visit(server.url)
        tab.shows("You watch: another page has control.")
        assert tab.value("document.querySelector('#t-begin').disabled")
        assert driver.ask("/alive")[1]["drives"]
        tab.click("Take control")
        tab.until(READY)
        tab.click("Start")
        until(lambda: wishes, "it is begun")
    assert wishes == [Wish({"operator": "remote"})]


def test_stop_is_answered_while_the_form_works_and_no_stranger_begins_a_session(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    wishes, pressed = list[Wish](), threading.Event()
    with chosen(wishes, 1) as server, PageClient(server.port) as driver:
        server.answers.stop = pressed.set
        until(lambda: driver.ask("/start")[0] == 200, "the form is there")
        assert ask(server.port, "/begin?operator=remote")[0] == 403  # not of our page
        assert ask(server.port, "/begin?operator=remote", Teleop_Page="new")[0] == 409
        foreign = {"Teleop_Page": driver.name, "Origin": "http://example.org"}
        assert ask(server.port, "/begin?operator=remote", **foreign)[0] == 403
        head = f"POST /robot?name=arm.urdf HTTP/1.1\r\nHost: 127.0.0.1:{server.port}\r\n"
        head += f"Cookie: teleop_console_{server.port}={TOKEN}\r\n"
        slow = f"{head}Teleop-Page: {driver.name}\r\nContent-Length: 1000\r\n\r\n<"
        with socket.create_connection(("127.0.0.1", server.port)) as one:
            one.sendall(slow.encode())  # and then nothing
            asking = threading.Thread(target=driver.ask, args=("/start",))
            asking.start()
            assert ask(server.port, "/stop", Teleop_Page="new")[0] == 204
            assert pressed.is_set()
            assert asking.is_alive()
        asking.join()
        assert not wishes
