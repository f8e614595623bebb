"""Pages of files in a real browser: one look, readable on a phone and in the dark, and no plot lies on another one."""

import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

import teleop_core as tc
from headless import Headless
from teleop_core.commands.cli import main

pytestmark = pytest.mark.browser

PAGES = ("report", "reach", "study", "tune", "grade", "workspace")
OVERLAPS = """(() => [...document.querySelectorAll('.js-plotly-plot')].flatMap(({ _fullLayout: all }) => {
    const domain = (name) => all[name.replace(/^[xy]/, '$&axis')]?.domain || [0, 1];
    const boxes = Object.entries(all).filter(([key, one]) => /^yaxis/.test(key) && one.visible && !one.overlaying)
        .map(([, one]) => [one.domain, domain(one.anchor)]);
    const meet = ([a, b], [c, d]) => a < d - 1e-6 && c < b - 1e-6;
    return boxes.flatMap(([y, x], i) => boxes.slice(i + 1).filter(([v, u]) => meet(y, v) && meet(x, u)));
}).length)()"""
LIGHTS = """(() => {
    const light = (color) => { const [r, g, b] = color.match(/[0-9.]+/g).map(Number).map((v) => (v / 255) ** 2.2);
        return 0.2126 * r + 0.7152 * g + 0.0722 * b; };
    const of = (selector) => document.querySelector(selector);
    const plot = of('.js-plotly-plot');
    return { page: light(getComputedStyle(document.body).backgroundColor),
        card: light(getComputedStyle(of('.card')).backgroundColor), text: light(getComputedStyle(of('h1')).color),
        paper: plot ? plot._fullLayout.paper_bgcolor : 'rgba(0, 0, 0, 0)',
        ink: plot ? light(getComputedStyle(of('.xtick text, .js-plotly-plot text')).fill) : null };
})()"""
DRAWN = "document.querySelectorAll('.plot').length === document.querySelectorAll('.js-plotly-plot').length"


@pytest.fixture(scope="module")
def pages(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    folder = tmp_path_factory.mktemp("pages")
    tc.run("coarse_box", duration=2.0, out=folder / "hand", operator="human")
    text = (Path(__file__).parents[2] / "config/studies/delay.yaml").read_text(encoding="utf-8")
    study = folder / "delay.yaml"
    study.write_text(text.replace("duration: 20.0", "duration: 1.0").replace("seeds: 5", "seeds: 2"), encoding="utf-8")
    search = folder / "scale.yaml"
    search.write_text(
        "scenario: coarse_box\nduration: 0.3\ntune: {coarse_gain: {low: 0.5, high: 1.0, log: true}}\n"
        "minimize: position_error_mm.rms\n",
        encoding="utf-8",
    )
    rows = [
        f"{e},{n / 30},{0.03 * math.sin(n / 9 + e)},{0.02 * math.cos(n / 7)},0" for e in range(4) for n in range(150)
    ]
    (folder / "hands.csv").write_text("\n".join(["episode_index,timestamp,x,y,z", *rows]), encoding="utf-8")
    made = {name: folder / f"{name}.html" for name in PAGES}
    hand = str(folder / "hand")
    assert main(["evaluate", hand, "--html", str(made["report"])]) == 0
    assert main(["reach", hand, "--robot", "puma560", "--html", str(made["reach"])]) == 0
    assert main(["study", str(study), "--jobs", "1", "--html", str(made["study"])]) == 0
    assert main(["tune", str(search), "--trials", "2", "--jobs", "1", "--html", str(made["tune"])]) == 0
    assert main(["grade", str(folder / "hands.csv"), "--html", str(made["grade"])]) == 0
    assert main(["workspace", "rcrt1", "--samples", "500", "--html", str(made["workspace"])]) == 0
    return made


@pytest.fixture(scope="module")
def tab(request: pytest.FixtureRequest) -> Iterator[Headless]:
    shared: Any = request.getfixturevalue("_browser")
    yield shared
    shared.call("Emulation.setEmulatedMedia", features=[])


def visit(tab: Any, page: Path, width: int, scheme: str) -> None:
    tab.clear(width, 900)
    tab.call("Emulation.setEmulatedMedia", features=[{"name": "prefers-color-scheme", "value": scheme}])
    tab.call("Page.navigate", url=page.as_uri())
    tab.until(f"document.readyState === 'complete' && document.querySelector('.card') && {DRAWN}", 120)
    assert not tab.faults()


@pytest.mark.slow
@pytest.mark.parametrize("name", PAGES)
def test_page_has_one_look_and_is_readable_on_a_phone_and_in_the_dark(
    tab: Any, pages: dict[str, Path], name: str
) -> None:
    for width, scheme in ((1400, "light"), (390, "dark"), (390, "light")):
        visit(tab, pages[name], width, scheme)
        assert tab.value("document.documentElement.scrollWidth") <= width
        assert tab.value(OVERLAPS) == 0
        lights = tab.value(LIGHTS)
        assert lights["paper"].replace(" ", "") == "rgba(0,0,0,0)"
        if scheme == "dark":
            assert max(lights["page"], lights["card"]) < 0.05
            assert lights["text"] > 0.5
            assert lights["ink"] is None or lights["ink"] > 0.5
        else:
            assert min(lights["page"], lights["card"]) > 0.85
            assert lights["text"] < 0.1


@pytest.mark.slow
def test_plots_of_a_hand_that_is_followed_throughout_do_not_lie_on_each_other(tab: Any, pages: dict[str, Path]) -> None:
    assert "100.0% followed" in pages["reach"].read_text(encoding="utf-8")
    visit(tab, pages["reach"], 1400, "light")
    assert tab.value(OVERLAPS) == 0
    axes = "Object.entries(document.querySelectorAll('.plot')[1]._fullLayout).filter(([k]) => /^yaxis/.test(k))"
    domains = tab.value(f"{axes}.map(([, axis]) => axis.domain)")
    assert len(domains) >= 2
    assert all(high - low < 0.6 for low, high in domains)


@pytest.mark.slow
def test_a_click_in_the_legend_shows_the_single_sessions_of_a_study(tab: Any, pages: dict[str, Path]) -> None:
    visit(tab, pages["study"], 1400, "light")
    traces = "document.querySelector('.plot').data.filter((one) => one.name === 'single sessions')"
    shown = f"{traces}.filter((one) => one.visible === true)"
    items = "[...document.querySelectorAll('.plot .legend .traces')]"
    toggle = f"{items}.find((one) => one.textContent.includes('single')).querySelector('.legendtoggle')"
    assert tab.value(f"{shown}.length") == 0
    box = f"(() => {{ {toggle}.scrollIntoView({{ block: 'center' }}); return {toggle}.getBoundingClientRect(); }})()"
    place = tab.value(f"(({{ x, y, width, height }}) => [x + width / 2, y + height / 2])({box})")
    for kind in ("mouseMoved", "mousePressed", "mouseReleased"):
        tab.mouse(kind, *place)
    tab.until(f"{shown}.length === 2", 20)
