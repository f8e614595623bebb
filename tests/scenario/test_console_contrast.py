"""Contrast of the page as a browser shows it: every text, every control, the focus; by day, by night, on a phone."""

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("viser")

from desk import Desk, shown
from page_client import TOKEN
from teleop_console.app import choose
from teleop_console.recorded_arms import parameters_of
from teleop_console.server import ConsoleServer
from teleop_core.session import api

pytestmark = [pytest.mark.browser, pytest.mark.slow]

SIZES = {"desk": (1400, 900), "phone": (390, 844)}
STATES = ("Drive", "Settings", "Scores", "View", "stopped")
LOOK = """(() => {
    const pen = document.createElement('canvas').getContext('2d', { willReadFrequently: true });
    const rgba = (text) => {
        pen.clearRect(0, 0, 1, 1); pen.fillStyle = text; pen.fillRect(0, 0, 1, 1);
        const [r, g, b, a] = pen.getImageData(0, 0, 1, 1).data;
        return [r, g, b, a / 255];
    };
    const over = ([r, g, b, a], ground) => [r, g, b].map((part, i) => a * part + (1 - a) * ground[i]);
    const light = (color) => {
        const [r, g, b] = color.map((p) => (p / 255 <= 0.04045 ? p / 255 / 12.92 : ((p / 255 + 0.055) / 1.055) ** 2.4));
        return 0.2126 * r + 0.7152 * g + 0.0722 * b + 0.05;
    };
    const ratio = (one, other) => Math.max(light(one), light(other)) / Math.min(light(one), light(other));
    const page = { ground: rgba('white').slice(0, 3), behind: rgba('white').slice(0, 3), seen: (color) => color };
    // What is behind the content of an element, behind the element, and how a colour in it is seen.
    const painted = (element) => {
        if (!element) return page;
        const { backgroundColor, opacity } = getComputedStyle(element), around = painted(element.parentElement);
        const behind = around.ground, ground = over(rgba(backgroundColor), behind);
        return { ground, behind, seen: (color) => around.seen(over([...color, Number(opacity)], behind)) };
    };
    const read = (element, color) => {
        const { ground, seen } = painted(element);
        return ratio(seen(over(rgba(color), ground)), seen(ground));
    };
    const isActive = (e) => !e.closest(':disabled, [data-disabled=true], [aria-disabled=true]')
        && ![...(e.labels || [])].some((one) => one.querySelector(':disabled'));
    const isSeen = (e) => e.checkVisibility({ opacityProperty: true, visibilityProperty: true })
        && e.getClientRects().length && !e.closest('.t-spoken, canvas, noscript') && isActive(e);
    const all = [...document.querySelectorAll('body *')].filter(isSeen), found = [];
    const note = (element, what, is, least) => {
        if (is < least) found.push(`${what} ${is.toFixed(2)} < ${least}: ${element.outerHTML.slice(0, 160)}`);
    };
    let count = 0;
    for (const e of all) {
        const style = getComputedStyle(e), size = parseFloat(style.fontSize);
        const isLarge = size >= 24 || (size >= 18.66 && style.fontWeight >= 700);
        const says = [...e.childNodes].some((n) => n.nodeType === Node.TEXT_NODE && n.textContent.trim()) || e.value;
        if (says && !['OPTION', 'STYLE', 'SCRIPT'].includes(e.tagName) && e.type !== 'checkbox') {
            count += 1;
            note(e, 'text', read(e, style.color), isLarge ? 3 : 4.5);
        }
        if (e.placeholder && !e.value) note(e, 'hint', read(e, getComputedStyle(e, '::placeholder').color), 4.5);
        if (!e.matches('button, select, textarea, input:not([type=file], [type=range], [type=hidden])')) continue;
        const { ground, behind, seen } = painted(e), edge = rgba(style.borderTopColor);
        const hasEdge = parseFloat(style.borderTopWidth) > 0 && style.borderTopStyle !== 'none' && edge[3] > 0;
        const isFilled = rgba(style.backgroundColor)[3] > 0 && ratio(ground, behind) > 1.05;
        if (!hasEdge && !isFilled) continue; // its text or its sign is all there is of it
        const out = hasEdge ? over(edge, behind) : ground;
        note(e, 'edge', Math.max(ratio(seen(out), seen(behind)), ratio(seen(ground), seen(behind))), 3);
    }
    return [count, [...new Set(found)]];
})()"""
FOCUS = """(() => {
    const e = document.activeElement, style = getComputedStyle(e);
    return e === document.body ? '' : [style.outlineStyle, parseFloat(style.outlineWidth), e.outerHTML.slice(0, 160)];
})()"""
SLIDES = "document.getAnimations().some((one) => one instanceof CSSTransition)"
MOVES = """document.getAnimations({ subtree: true }).map((one) => one.effect.getComputedTiming())
    .filter((one) => one.endTime > 1).length"""


def media(tab: Any, **features: str) -> None:
    """What the person has asked the system for."""
    told = [{"name": name.replace("_", "-"), "value": value} for name, value in features.items()]
    tab.call("Emulation.setEmulatedMedia", features=told)


def check(tab: Any, least: int) -> None:
    """All texts and controls that are seen stand out as WCAG 2.2 AA asks; there are at least so many texts."""
    while tab.value(SLIDES):  # headless, what changes slowly does so only while it is pictured
        tab.call("Page.captureScreenshot")
    count, found = tab.value(LOOK)
    assert count >= least
    assert not found, "\n".join(found)


@contextmanager
def form(monkeypatch: pytest.MonkeyPatch, folder: Path) -> Iterator[str]:
    """Address of the form on which a session is chosen."""
    monkeypatch.chdir(folder)
    with ConsoleServer(0, token=TOKEN) as server:
        waiting = threading.Thread(target=choose, args=(server,))
        waiting.start()
        try:
            yield server.url
        finally:
            server.drivers.is_for_all = True
            server.answers.start.answer("/begin", {"operator": ["remote"]}, 0)
            waiting.join()


@contextmanager
def session() -> Iterator[tuple[ConsoleServer, Desk]]:
    """Page of a session whose settings are those of a real one."""
    desk = Desk(is_stoppable=True)
    desk.known = parameters_of(api.configuration(None, texts=()))
    with shown(desk, lambda texts: "", can_end=True) as (server, _):
        yield server, desk


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_texts_and_controls_of_the_form_stand_out(
    tab: Any, scheme: str, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    media(tab, prefers_color_scheme=scheme)
    with form(monkeypatch, tmp_path) as url:
        for size in SIZES.values():
            tab.resize(*size)
            tab.visit(url)
            tab.until("document.querySelector('#t-begin')?.disabled === false")
            check(tab, 15)
            tab.value("""(() => { const list = document.querySelector('[name=operator]');
                list.value = 'bag'; list.dispatchEvent(new Event('change')); })()""")
            tab.shows("Cannot start")
            check(tab, 15)


@pytest.mark.parametrize("size", SIZES)
def test_texts_and_controls_of_a_session_stand_out_by_day_and_by_night(tab: Any, size: str) -> None:
    with session() as (server, desk):
        tab.resize(*SIZES[size])
        tab.visit(server.url)
        tab.shows("ENABLED")
        tab.until("document.querySelector('#t-starting').hidden")
        for scheme in ("light", "dark"):
            for state in STATES:
                if state == "stopped":
                    desk.press(is_pressed=True)
                    tab.until("document.documentElement.classList.contains('t-stopped')")
                else:
                    tab.click(state)
                if state == "Settings":
                    tab.shows("most used")
                check(tab, 15)
            desk.view().arms[""].operation |= {"state": 1.0, "fault": 0.0, "is_stopped": 0.0}
            tab.until("!document.documentElement.classList.contains('t-stopped')")
            if scheme == "light":
                tab.click("View")
                tab.click("dark")
                tab.until("document.documentElement.dataset.mantineColorScheme === 'dark'")


@pytest.mark.soak
def test_focus_is_seen_wherever_the_tab_key_leads_in_a_session(tab: Any) -> None:
    with session() as (server, _):
        tab.resize(*SIZES["desk"])
        tab.visit(server.url)
        tab.shows("ENABLED")
        tab.until("document.querySelector('#t-starting').hidden")
        tab.until("document.querySelectorAll('button:not(:disabled)').length > 20")  # of the panel, once it is drawn
        seen = set()
        for _ in range(40):
            tab.key("Tab")
            if found := tab.value(FOCUS):
                kind, width, element = found
                assert (kind == "none", width >= 2) == (False, True), element
                seen.add(element)
        assert len(seen) > 15


def test_page_of_a_person_who_asks_for_less_motion_moves_nothing_but_the_arm(tab: Any) -> None:
    media(tab, prefers_reduced_motion="reduce")
    with session() as (server, _):
        tab.resize(*SIZES["desk"])
        tab.visit(server.url)
        tab.shows("ENABLED")
        for name in ("Settings", "View", "Drive"):
            tab.click(name)
            assert tab.value(MOVES) == 0
