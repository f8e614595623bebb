"""``teleop experiment``: lists, tables, JSON, one page, and one line for what is wrong."""

import json
import re
import subprocess
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

from headless import Headless
from teleop_lab import experiments
from teleop_lab.experiments.bench import Bench
from teleop_lab.experiments.results_page import experiments_page

if TYPE_CHECKING:
    from conftest import Run


def test_without_a_name_every_experiment_is_listed_in_a_line(teleop_again: "Run") -> None:
    lines = teleop_again("experiment").stdout.splitlines()
    assert [line.split()[0] for line in lines] == list(experiments.EXPERIMENTS.names())
    assert all(len(line.split()) > 3 for line in lines)


def test_experiment_prints_published_beside_predicted(teleop_again: "Run") -> None:
    shown = teleop_again("experiment", "resolution", "tendons").stdout
    assert re.search(r"tip, all axes.* 11\.355 +11\.3548 .* ✓", shown)
    assert re.search(r"motor 6 for joint 5 .* 1 +1\.39 .* ✗", shown)
    assert shown.splitlines()[-1].endswith("rows are not judged")


def test_help_teaches_what_a_mark_means(teleop_again: "Run") -> None:
    shown = " ".join(teleop_again("experiment", "--help").stdout.split())
    assert "teleop experiment all --html" in shown
    assert "not whether a number is small" in shown


def test_json_holds_every_number_exactly(teleop_again: "Run", tmp_path: Path) -> None:
    file = tmp_path / "found.json"
    teleop_again("experiment", "tendons", "resolution", "--json", file)
    found = json.loads(file.read_text(encoding="utf-8"))["experiments"]
    assert [entry["name"] for entry in found] == ["tendons", "resolution"]
    assert found == [experiments.run(name).to_json() for name in ("tendons", "resolution")]


def test_file_that_exists_is_kept_until_the_new_one_is_whole(teleop_again: "Run", tmp_path: Path) -> None:
    file = tmp_path / "found.json"
    file.write_text("before")
    teleop_again("experiment", "resolution", "nosuch", "--json", file, code=2)
    assert file.read_text() == "before"
    teleop_again("experiment", "resolution", "--json", file)
    assert json.loads(file.read_text())["experiments"]
    assert [path.name for path in tmp_path.iterdir()] == ["found.json"]


def test_files_are_written_although_nobody_reads_the_tables_to_their_end(tmp_path: Path) -> None:
    file = tmp_path / "found.json"
    command = [sys.executable, "-m", "teleop_core.commands.cli", "experiment", "poses", "--json", str(file)]
    reader = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE)
    assert reader.stdout is not None
    reader.stdout.close()
    reader.communicate(timeout=120)
    assert json.loads(file.read_text(encoding="utf-8"))["experiments"]


SHORT: dict[str, Any] = {"duration": 4.0, "approach_time": 1.0, "buttons.fixture": (1.5,)}


@pytest.fixture(scope="module")
def bench() -> Bench:
    """Sessions that are shorter than the source's, after the experiment ``master_slave``."""
    made = experiments.Bench(settings=SHORT)
    experiments.run("master_slave", bench=made)
    return made


@pytest.fixture(scope="module")
def runs(bench: Bench) -> int:
    """Sessions of ``master_slave`` alone; the bench has those of ``gravity`` too."""
    alone = bench.runs
    experiments.run("gravity", bench=bench)
    return alone


@pytest.mark.browser
@pytest.mark.slow
@pytest.mark.usefixtures("runs")
def test_page_draws_every_figure_and_is_as_wide_as_its_window(browser: str, bench: Bench, tmp_path: Path) -> None:
    names = ("resolution", "workspace", "master_slave", "gravity", "hybrid", "mma_frames")  # plots of every kind
    outcomes = experiments.run_several(names, bench=bench)
    page = tmp_path / "page.html"
    page.write_text(experiments_page(outcomes), encoding="utf-8")
    figures = sum(len(outcome.figures) for outcome in outcomes)
    with Headless(browser, tmp_path, width=500) as tab:
        tab.open(page)
        tab.until("document.body.dataset.finished === 'yes'")
        assert tab.value("document.body.dataset.errors || ''") == ""
        assert int(tab.value("document.body.dataset.drawn")) == figures
        for width in (500, 1200, 500):
            tab.resize(width, 900)
            tab.until(f"document.documentElement.scrollWidth <= {width}")
        marks = tab.value("document.querySelectorAll('td.met').length")
    assert marks >= sum(outcome.agreeing for outcome in outcomes)


@pytest.mark.slow
def test_sessions_that_several_experiments_need_run_once(bench: Bench, runs: int) -> None:
    # Without compensation only: two modes, three hands, under two controllers.
    assert bench.runs == runs + 12
    first, again = (experiments.run("master_slave", bench=bench).to_json() for _ in range(2))
    assert bench.runs == runs + 12
    assert first == again
