"""Time of the report page: driven in a real browser, its plots share one visible time."""

import json
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rich.console import Console

from headless import Headless
from recipes import START_NS, Recipe, state
from teleop_core.evaluation.command import evaluate_bags
from teleop_core.graph import TICK_NS, topics
from teleop_core.kernels.geometry import Array

pytestmark = [pytest.mark.browser, pytest.mark.slow]

LONG, SHORT = 600_000, 20_000
LARGEST_PAGE = 20_000_000
# Curves are rounded to less than this.
ROUNDING_MM, ROUNDING_N = 1e-3, 1e-3
LIMITED = ((4.0, 6.5, topics.Limit.JOINT), (9.0, 9.25, topics.Limit.SPEED), (12.0, 15.0, topics.Limit.JOINT))
# Plots of a recording with a time axis, by their titles.
POSITION, ERROR, FORCE = "Position against time", "Tracking error", "Force on the hand"
PLOTS = """
((hasTraces) => {
  const isTime = ([key, axis]) => /^xaxis/.test(key) && axis.uirevision === 'time';
  const numbers = (values) => values && Array.from(values, (v) => (Number.isNaN(v) ? null : v));
  const traceOf = ({ name, type, mode, meta, x, y, customdata }) => ({
    name, type, mode, isWhole: Boolean(meta?.whole), times: numbers(customdata),
    x: type === 'heatmap' ? null : numbers(x), y: type === 'heatmap' ? null : numbers(y),
  });
  const plotOf = (plot) => ({
    id: plot.id, width: plot.clientWidth, right: plot.getBoundingClientRect().right,
    times: Object.entries(plot._fullLayout).filter(isTime).map(([, axis]) => axis.range),
    shapes: (plot._fullLayout.shapes || []).map(({ name, path }) => ({ name, path })),
    traces: hasTraces ? plot.data.map(traceOf) : [],
  });
  const nameOf = (figure) => ['h2', 'h3'].map((tag, i) =>
    (i ? figure : figure.closest('section')).querySelector(tag).textContent).join('/');
  return Object.fromEntries([...document.querySelectorAll('figure.card')].map((figure) =>
    [nameOf(figure), plotOf(figure.querySelector('.js-plotly-plot'))]));
})
"""
WIDE_AS_THEIR_PLACES = """
[...document.querySelectorAll('.js-plotly-plot')]
  .every(({ _fullLayout, clientWidth }) => Math.abs(_fullLayout.width - clientWidth) < 2)
"""
PLANE_COLUMNS = """
[...document.querySelectorAll('figure.card')]
  .find((figure) => figure.textContent.includes('Path per plane'))
  .querySelector('.js-plotly-plot')._fullLayout.grid?.columns
"""


def noisy(count: int, seed: int) -> Recipe:
    """A recording with a moving, noisy tip and a force; limits and a clutch on the way."""
    recipe, rng = Recipe(count), np.random.default_rng(seed)
    t = np.arange(count) * 1e-3
    curve = 0.02 * np.stack((np.sin(0.7 * t), np.sin(1.3 * t + seed), np.cos(1.1 * t)), axis=1)
    for topic, scale in (
        (topics.SLAVE_SERVO_CP, 0.0),
        (topics.SLAVE_SETPOINT_CP, 1e-6),
        (topics.SLAVE_MEASURED_CP, 2e-5),
    ):
        recipe.values(topic)[:, :3] += curve + rng.normal(scale=scale, size=(count, 3))
    force = np.zeros((count, 6))
    force[:, :3] = np.maximum(np.sin(0.9 * t), 0.0)[:, None] * (0.0, 1.0, 0.2)
    recipe.rows[topics.MASTER_MEASURED_CF] = (recipe.stamps, force, recipe.stamps)
    for begin, end, limit in LIMITED:
        for at, cause in ((begin, limit), (end, topics.Limit.NONE)):
            stamp_ns = START_NS + round(at * 1e3) * TICK_NS
            recipe.singles.append((topics.TELEOP_STATE, stamp_ns, state(stamp_ns, limit=cause, limited_joint=2)))
    return recipe


@pytest.fixture(scope="module")
def short(tmp_path_factory: pytest.TempPathFactory) -> Any:
    """Two recordings on one page."""
    folder = tmp_path_factory.mktemp("short")
    recipes = {name: noisy(SHORT, seed) for seed, name in enumerate(("one", "two"))}
    for name, recipe in recipes.items():
        recipe.write(folder / name)
    evaluate_bags([folder / name for name in recipes], None, folder / "page.html", Console(quiet=True))
    return folder / "page.html", recipes


@pytest.fixture(scope="module")
def long(tmp_path_factory: pytest.TempPathFactory) -> Any:
    """Ten minutes at 1 kHz with more noise than a device has."""
    folder = tmp_path_factory.mktemp("long")
    recipe = noisy(LONG, 3)
    recipe.values(topics.SLAVE_MEASURED_CP)[432_100, :3] += 0.004  # a single sample
    recipe.write(folder / "long")
    evaluate_bags([folder / "long"], None, folder / "page.html", Console(quiet=True))
    return folder / "page.html", recipe


@pytest.fixture(scope="module")
def tabs() -> Iterator[dict[Any, Any]]:
    """Tabs by page and width; drawing a page takes seconds."""
    found: dict[Any, Any] = {}
    yield found
    for tab in found.values():
        tab.__exit__()


@pytest.fixture
def opened(
    browser: str, tabs: dict[tuple[Path, int], Headless], tmp_path_factory: pytest.TempPathFactory
) -> Iterator[Callable[..., Any]]:
    """Opens a page at a width; whatever goes wrong in it fails the test."""
    used = []

    def open_page(page: Any, width: int = 1200) -> Any:
        if (page, width) not in tabs:
            tabs[page, width] = Headless(browser, tmp_path_factory.mktemp("profile"), width)
            tabs[page, width].open(page)
        tab = tabs[page, width]
        tab.value("document.querySelectorAll('.times .all').forEach((button) => button.click())")
        tab.settled()
        used.append(tab)
        return tab

    yield open_page
    for tab in used:
        assert tab.value("document.body.dataset.errors || ''") == ""
        assert not tab.said


def plots(tab: Any, *, has_traces: bool = True) -> Any:
    """What each plot shows, by the names of its recording and its own; traces of a whole page take a second."""
    tab.settled()
    return tab.value(f"{PLOTS}({json.dumps(has_traces)})")


def ranges(tab: object, recording: str) -> list[Any]:
    """Visible times of all plots against time of a recording, each once."""
    found = {
        (round(begin, 6), round(end, 6))
        for name, plot in plots(tab, has_traces=False).items()
        if name.startswith(f"{recording}/")
        for begin, end in plot["times"]
    }
    return sorted(found)


def show(tab: Any, begin: float, end: float, recording: int = 0) -> None:
    """Choose the visible time with the fields of a recording."""
    tab.value(
        f"""(() => {{ const bar = document.getElementById('times-{recording}');
        bar.querySelector('.from').value = {begin}; const to = bar.querySelector('.to');
        to.value = {end}; to.dispatchEvent(new Event('change')); }})()"""
    )
    tab.settled()


def area(tab: Any, selector: str) -> Any:
    """Left, top, width and height of an element that is brought into the window, [px]."""
    return tab.value(
        f"""(() => {{ const part = document.querySelector({json.dumps(selector)});
        part.scrollIntoView({{ block: 'center' }}); const box = part.getBoundingClientRect();
        return [box.left, box.top, box.width, box.height]; }})()"""
    )


def drag(tab: Any, selector: Any, begin: Sequence[float] | Array, end: Any) -> None:
    """Drag over shares of the width and height of an element."""
    left, top, width, height = area(tab, selector)
    tab.drag(*((left + x * width, top + y * height) for x, y in (begin, end)))
    tab.value("new Promise((done) => setTimeout(done, 60))")  # the plot tells it a moment later
    tab.settled()


def curve(tab: object, title: str, name: str, recording: str = "one") -> Any:
    (trace,) = [t for t in plots(tab)[f"{recording}/{title}"]["traces"] if t["name"] == name]
    return np.array(trace["x"], float), np.array(trace["y"], float), trace["mode"]


# -- linked ----------------------------------------------------------------------------------------


def test_zooming_one_plot_moves_all_of_that_recording_and_no_other(opened: Callable[..., Any], short: Any) -> None:
    tab = opened(short[0])
    whole = ranges(tab, "two")
    plot = plots(tab, has_traces=False)[f"one/{ERROR}"]["id"]
    drag(tab, f"#{plot} .nsewdrag", (0.25, 0.5), (0.5, 0.52))
    ((begin, end),) = ranges(tab, "one")
    assert np.allclose((begin, end), (5.0, 10.0), atol=0.05)
    assert ranges(tab, "two") == whole == [(0.0, 19.999)]
    fields = tab.value("['from', 'to'].map((n) => document.querySelector(`#times-0 .${n}`).value)")
    assert np.allclose([float(field) for field in fields], (begin, end), atol=1e-3)


def test_panning_one_plot_moves_all(opened: Callable[..., Any], short: Any) -> None:
    tab = opened(short[0])
    show(tab, 8.0, 12.0)
    plot = plots(tab, has_traces=False)[f"one/{POSITION}"]["id"]
    mode = f"Plotly.relayout('{plot}', {{ dragmode: '%s' }}).then(() => 0)"
    tab.value(mode % "pan")
    drag(tab, f"#{plot} .nsewdrag", (0.5, 0.5), (0.25, 0.5))
    tab.value(mode % "zoom")
    ((begin, end),) = ranges(tab, "one")
    assert np.allclose((begin, end), (9.0, 13.0), atol=0.05)


def test_double_click_on_any_plot_shows_the_whole_recording(opened: Callable[..., Any], short: Any) -> None:
    tab = opened(short[0])
    show(tab, 8.0, 12.0)
    plot = plots(tab, has_traces=False)[f"one/{FORCE}"]["id"]
    left, top, width, height = area(tab, f"#{plot} .nsewdrag")
    place = (left + 0.5 * width, top + 0.5 * height)
    for _ in range(10):  # a busy machine may take the second click for a first one
        for clicks in (1, 2):
            tab.mouse("mousePressed", *place, clicks)
            tab.mouse("mouseReleased", *place, clicks)
        tab.value("new Promise((done) => setTimeout(done, 700))")
        if ranges(tab, "one") != [(8.0, 12.0)]:
            break
    assert ranges(tab, "one") == [(0.0, 19.999)]


def test_strip_selects_moves_and_resizes_the_visible_time(opened: Callable[..., Any], short: Any) -> None:
    tab = opened(short[0])
    strip = "#times-0 .strip"
    for begin, end, expected in (
        (0.25, 0.5, (5.0, 10.0)),  # of the whole, a part is selected
        (0.35, 0.6, (10.0, 15.0)),  # the part is moved
        (0.75, 0.65, (10.0, 13.0)),  # its end is moved
        (0.5, 0.55, (11.0, 13.0)),  # its begin
    ):
        drag(tab, strip, (begin, 0.5), (end, 0.5))
        ((first, last),) = ranges(tab, "one")
        assert np.allclose((first, last), expected, atol=0.1)


def test_keys_and_buttons_move_the_visible_time(opened: Callable[..., Any], short: Any) -> None:
    tab = opened(short[0])
    show(tab, 8.0, 12.0)
    for act, expected in (
        ("later", (11.2, 15.2)),
        ("earlier", (8.0, 12.0)),
        ("closer", (9.2, 10.8)),
        ("further", (8.0, 12.0)),
        ("all", (0.0, 19.999)),
    ):
        tab.value(f"document.querySelector('#times-0 .{act}').click()")
        assert np.allclose(ranges(tab, "one"), [expected], atol=1e-6), act
    tab.value("document.querySelector('#times-0 .strip').focus()")
    show(tab, 8.0, 12.0)
    tab.value("""document.querySelector('#times-0 .strip').dispatchEvent(
        new KeyboardEvent('keydown', { key: 'ArrowRight', bubbles: true }))""")
    assert np.allclose(ranges(tab, "one"), [(8.4, 12.4)], atol=1e-6)


def test_range_beyond_the_recording_is_cut_to_it(opened: Callable[..., object], short: Any) -> None:
    tab = opened(short[0])
    for begin, end, expected in (
        (-5.0, 5.0, (0.0, 10.0)),
        (15.0, 99.0, (0.0, 19.999)),
        (7.0, 7.0, (0.0, 19.999)),
        (19.99, 30.0, (9.989, 19.999)),
        (3.0, 3.0001, (3.0, 3.002)),
    ):
        show(tab, begin, end)
        assert np.allclose(ranges(tab, "one"), [expected], atol=1e-6), (begin, end)


# -- samples ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("count", [SHORT, LONG])
def test_zooming_in_shows_every_sample(opened: Callable[..., Any], short: Any, long: Any, count: Any) -> None:
    (page, recipe), name = (long, "long") if count == LONG else ((short[0], short[1]["one"]), "one")
    tab = opened(page)
    first, last = count - 5000, count - 4900
    show(tab, first * 1e-3, last * 1e-3)
    # One more on each side, so that lines reach the ends.
    rows = slice(first - 1, last + 2)
    measured = recipe.values(topics.SLAVE_MEASURED_CP)[rows, :3] * 1e3
    setpoint = recipe.values(topics.SLAVE_SETPOINT_CP)[rows, :3] * 1e3
    force = recipe.rows[topics.MASTER_MEASURED_CF][1][rows, :3]
    expected = {
        (ERROR, "against filtered reference"): (np.linalg.norm(measured - setpoint, axis=1), ROUNDING_MM),
        (FORCE, "magnitude"): (np.linalg.norm(force, axis=1), ROUNDING_N),
    }
    for (title, curve_name), (values, rounding) in expected.items():
        x, y, mode = curve(tab, title, curve_name, name)
        inside = (x > first * 1e-3 - 0.0015) & (x < last * 1e-3 + 0.0015)
        assert inside.sum() >= 101
        at = np.round(x * 1e3).astype(int) - (first - 1)
        assert np.allclose(x * 1e3, np.round(x * 1e3), atol=0.02)
        assert np.abs(y - values[at]).max() < rounding, title
        assert mode == "lines+markers"
    x, _, _ = curve(tab, ERROR, "against filtered reference", name)
    assert "every sample, 1 ms apart" in tab.value("document.querySelector('.told').textContent")
    for axis, trace in enumerate(t for t in plots(tab)[f"{name}/{POSITION}"]["traces"] if t["name"] == "measured"):
        at = np.round(np.array(trace["x"]) * 1e3).astype(int) - (first - 1)
        assert np.abs(np.array(trace["y"]) - measured[at, axis]).max() < ROUNDING_MM


def test_page_of_ten_minutes_is_small_and_shows_a_single_peak(opened: Callable[..., Any], long: Any) -> None:
    page, _ = long
    assert page.stat().st_size < LARGEST_PAGE
    tab = opened(page)
    x, y, _ = curve(tab, ERROR, "against filtered reference", "long")
    assert len(x) < 3000, "as many points as there are pixels"
    assert np.isclose(x[y.argmax()], 432.1, atol=1e-4)
    assert np.isclose(y.max(), 4.0 * np.sqrt(3.0), atol=0.2)
    told = tab.value("document.querySelector('.told').textContent")
    assert "smallest and largest of each" in told


# -- bands -----------------------------------------------------------------------------------------


def bounds(shape: Any) -> list[Any]:
    """Begins and ends of a band's stretches."""
    corners = shape["path"].replace("Z", "").split("M")[1:]
    places = [[float(corner.split(",")[0]) for corner in part.split("L")] for part in corners]
    return [[part[0], part[1]] for part in places]


def test_every_plot_against_time_has_the_bands_of_the_state(opened: Callable[..., Any], short: Any) -> None:
    tab = opened(short[0])
    timed = {name: plot for name, plot in plots(tab, has_traces=False).items() if plot["times"]}
    assert len(timed) >= 8
    for name, plot in timed.items():
        found = {shape["name"]: bounds(shape) for shape in plot["shapes"] if shape["name"]}
        assert set(found) == {"joint limit (joint 3)", "speed limit"}, name
        assert np.allclose(found["joint limit (joint 3)"], [[4.0, 6.5], [12.0, 15.0]], atol=1e-6)
        assert np.allclose(found["speed limit"], [[9.0, 9.25]], atol=1e-6)
    legend = tab.value("document.querySelector('.bands').textContent")
    assert "joint limit (joint 3)" in legend
    assert "speed limit" in legend


# -- paths -----------------------------------------------------------------------------------------


@pytest.mark.parametrize("title", ["Path in space", "Path per plane"])
def test_paths_show_the_visible_time(opened: Callable[..., object], short: Any, title: str) -> None:
    tab = opened(short[0])
    show(tab, 5.0, 7.0)
    traces = [t for t in plots(tab)[f"one/{title}"]["traces"] if t["times"]]
    parts = [t for t in traces if not t["isWhole"]]
    assert {t["name"] for t in parts} == {"reference", "measured"}
    for trace in parts:
        times = np.array([time for time in trace["times"] if time is not None])
        assert np.isclose(times.min(), 5.0, atol=1e-4)
        assert np.isclose(times.max(), 7.0, atol=1e-4)
        assert len(times) == 2001
    for trace in traces:
        if trace["isWhole"]:
            known = [time for time in trace["times"] if time is not None]
            assert np.allclose((min(known), max(known)), (0.0, 19.999), atol=1e-4)


def test_long_path_in_a_plane_becomes_the_time_that_was_spent(opened: Callable[..., object], long: Any) -> None:
    tab = opened(long[0])
    kinds = {trace["type"] for trace in plots(tab)["long/Path per plane"]["traces"]}
    assert kinds == {"heatmap", "scatter"}


# -- narrow, without scripts -----------------------------------------------------------------------


@pytest.mark.parametrize(("width", "columns"), [(500, 1), (1200, 2)])
def test_page_fits_into_the_window(opened: Callable[..., Any], short: Any, width: int, columns: int) -> None:
    tab = opened(short[0], width)
    assert tab.value("document.documentElement.scrollWidth") <= width
    for name, plot in plots(tab, has_traces=False).items():
        assert plot["width"] > 0.8 * width / columns, name
        assert plot["right"] <= width, name


def test_page_follows_a_window_that_becomes_narrow_and_wide_again(opened: Callable[..., Any], short: Any) -> None:
    tab = opened(short[0])
    for width, columns in ((500, 1), (1200, 3)):
        tab.resize(width, 900)
        tab.until(f"({PLANE_COLUMNS}) === {columns}")
        tab.until(WIDE_AS_THEIR_PLACES)
        assert tab.value("document.documentElement.scrollWidth") <= width


def test_without_scripts_there_are_tables_and_a_word(browser: str, short: Any, tmp_path: Path) -> None:
    with Headless(browser, tmp_path) as tab:
        tab.call("Emulation.setScriptExecutionDisabled", value=True)
        tab.call("Page.navigate", url=Path(short[0]).as_uri())
        while tab.value("document.readyState") != "complete":
            pass
        text = tab.value("document.body.innerText")
        assert "JavaScript, which is off here" in text
        assert "position, RMS" in text
        assert tab.value("document.querySelector('.times').clientHeight") == 0


def test_table_is_folded_where_scripts_run(opened: Callable[..., Any], short: Any) -> None:
    tab = opened(short[0])
    assert tab.value("document.querySelectorAll('details.table[open]').length") == 0
    assert "position, RMS" not in tab.value("document.body.innerText")


def test_page_in_a_browser_that_cannot_unpack_says_so(browser: str, short: Any, tmp_path: Path) -> None:
    with Headless(browser, tmp_path) as tab:
        source = "delete window.DecompressionStream"
        tab.call("Page.addScriptToEvaluateOnNewDocument", source=source)
        tab.open(Path(short[0]))
        assert "one of 2023 or later can" in tab.value("document.getElementById('errors').textContent")
