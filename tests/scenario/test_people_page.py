"""Pages of a study with people in a real browser: by keys alone, on a phone, a desk and a large screen."""

import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("viser")

from browser import until
from page_client import TOKEN, PageClient, ask
from teleop_console.answers import Situation
from teleop_console.server import ConsoleServer
from teleop_lab.people.conduct import serve
from teleop_lab.people.journal import DONE, Journal
from teleop_lab.people.people_page import PeoplePage
from teleop_lab.people.plan import TLX, Plan, read_plan

FILE = Path(__file__).parents[2] / "config" / "studies" / "people_on_a_late_screen.yaml"
SIZES = [(390, 844), (1400, 900), (3840, 2160)]
# Everything that can be reached is in the window, has a name, and is wide enough for a finger.
SOUND = """[...document.querySelectorAll('#t-start :is(select, input, button)')].every((e) => {
    const box = e.getBoundingClientRect();
    return box.left >= 0 && box.right <= innerWidth && box.height >= 24
        && (e.labels?.[0]?.innerText || e.innerText || e.ariaLabel);
}) && document.documentElement.scrollWidth <= innerWidth"""
READY = "!document.querySelector('#t-begin').disabled"
browser = pytest.mark.browser


@pytest.fixture(scope="module")
def plan() -> Plan:
    return read_plan(FILE)


@pytest.fixture
def served(plan: Plan, tmp_path: Path) -> Iterator[tuple[ConsoleServer, PeoplePage, Journal]]:
    """Pages of a study whose trials are over as soon as they have begun."""
    journal = Journal(tmp_path / "store", plan)
    server, page = serve(plan, journal, 0, "127.0.0.1", TOKEN)
    ends = threading.Event()

    def work() -> None:
        while not ends.is_set():
            code, trial = page.wait()
            if not ends.is_set():
                page.close(DONE, "", f"trial_{trial.number:02d}")
                journal.score(code, trial.number, {"task.time_s": 1.25}, "nothing stands out")

    server.answers.situation = Situation(can_stop=False, chooses=True)
    working = threading.Thread(target=work)
    working.start()
    try:
        yield server, page, journal
    finally:
        ends.set()
        page._wishes.put(("p01", plan.trials("p01")[0]))
        working.join()
        server.close()


@browser
@pytest.mark.slow
@pytest.mark.parametrize("size", [*SIZES[:2], pytest.param(SIZES[2], marks=pytest.mark.soak)])
def test_participant_gets_to_the_questions_and_answers_by_keys_alone(
    tab: Any, served: tuple[ConsoleServer, PeoplePage, Journal], size: tuple[int, int]
) -> None:
    server, _, journal = served
    tab.resize(*size)
    tab.visit(server.url)
    for text in ("I agree and take part", "Trial 1 of 6 · practice", "Trial 2 of 6", "Trial 3 of 6"):
        tab.shows(text)
        tab.until(SOUND)
        # A screen reader says what is new. A trial that runs shows the same words, and has no button.
        tab.until("document.activeElement.matches('.t-text') && document.querySelector('#t-begin')")
        tab.until(READY)
        tab.tab_to("#t-begin")
        tab.key("Enter")
    tab.until("document.querySelectorAll('.t-scale').length === 6")
    assert tab.value("document.querySelector('#t-begin').disabled")
    assert tab.value(SOUND)
    tab.reload()  # which loses nothing that was done
    tab.until("document.querySelectorAll('.t-scale').length === 6")
    for question in TLX:
        tab.tab_to(f"[name={question.name}]")
        tab.key("ArrowRight")
    tab.until(READY)
    tab.tab_to("#t-begin")
    tab.key("Enter")
    tab.shows("Trial 4 of 6 · practice")
    assert journal.answers("p01", 3) == {question.name: 55.0 for question in TLX}
    assert not tab.faults()


@browser
@pytest.mark.slow
def test_what_is_new_has_the_focus_also_after_the_page_was_hidden_or_moved(
    tab: Any, served: tuple[ConsoleServer, PeoplePage, Journal]
) -> None:
    server, _, _ = served
    tab.visit(server.url)
    tab.shows("I agree and take part")
    new = "document.activeElement.matches('.t-text')"
    tab.until(new)
    for loses in (
        "dispatchEvent(new CustomEvent('teleop', { detail: { chooses: false } }))",
        "dispatchEvent(new Event('DOMContentLoaded'))",
        "document.body.append(document.querySelector('#t-start')); dispatchEvent(new Event('DOMContentLoaded'))",
    ):
        tab.value(loses)
        tab.until(new)
    assert not tab.faults()


@browser
@pytest.mark.slow
@pytest.mark.parametrize("size", SIZES)
def test_conductor_sees_scores_repeats_with_a_reason_pauses_and_chooses_who_is_next(
    tab: Any, served: tuple[ConsoleServer, PeoplePage, Journal], size: tuple[int, int]
) -> None:
    server, page, journal = served
    journal.agree("p01")
    journal.note("p01", 1, DONE, bag="trial_01")
    journal.score("p01", 1, {"task.time_s": 1.25}, "nothing stands out")
    tab.resize(*size)
    tab.call("Page.navigate", url=page.link(server.url))
    tab.until("document.body && document.querySelectorAll('tbody tr').length === 6")
    for text in ("nothing stands out", "1.250", "p01 – 1 of 6", "✓ done"):
        tab.shows(text)
    assert tab.value("document.querySelector('main').scrollWidth <= innerWidth")
    tab.value("window.prompt = () => 'the mouse was lost'")
    tab.tab_to("[aria-label='Repeat trial 1']")
    tab.key("Enter")
    tab.shows("the mouse was lost")
    assert journal.event("p01", 1)["state"] == "again"
    tab.click("Pause")
    tab.shows("PAUSED")
    tab.value("""(() => { const chosen = document.querySelector('select'); chosen.value = 'p02';
        chosen.dispatchEvent(new Event('change')); })()""")
    tab.shows("p02: consent")
    assert journal.now == "p02"
    assert not tab.faults()


def test_pages_of_other_origins_and_those_that_are_not_open_get_nowhere(
    served: tuple[ConsoleServer, PeoplePage, Journal],
) -> None:
    server, page, journal = served
    with PageClient(server.port) as driver:
        until(lambda: server.drivers.driver is not None, "it drives")
        for path in ("/go?step=consent&at=", f"/act?what=skip&trial=1&reason=a&key={page.key}", "/people"):
            foreign = {"Teleop_Page": driver.name, "Origin": "http://example.org"}
            assert ask(server.port, path, **foreign)[0] == 403
            assert ask(server.port, path)[0] == 403  # not of our page
        assert ask(server.port, "/go?step=consent&at=", Teleop_Page="new")[0] == 409
        assert ask(server.port, "/act?what=skip&trial=1&reason=a&key=x", Teleop_Page="new")[0] == 403
        assert ask(server.port, "/conduct", token="guess", Host="example.org")[0] == 403
        assert page.key.encode() not in ask(server.port, "/conduct")[1] + ask(server.port, "/teleop.js")[1]
        assert not journal.rows()
        assert driver.ask("/go?step=consent&at=")[1]["step"] == "begin"
        pressed: list[float] = []
        server.answers.jaw = pressed.append
        assert ask(server.port, "/jaw?closed=1", Teleop_Page="new")[0] == 403
        for word in ("", "2", "nan", "1&closed=0"):
            assert driver.ask(f"/jaw?closed={word}")[0] == 409
        assert driver.ask("/jaw?closed=1")[0] == 204
        assert pressed == [1.0]
