"""Report page: opened in a real browser, it draws every plot and asks nobody for anything."""

import json
import re
import subprocess
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from rich.console import Console

from present import present
from recipes import Recipe, pose_rows, state
from teleop_core.bags.reader import Bag
from teleop_core.evaluation.command import evaluate_bags
from teleop_core.evaluation.scoring import studies, study
from teleop_core.graph import topics

if TYPE_CHECKING:
    from conftest import Run

FLAGS = (
    "--headless", "--no-sandbox", "--disable-gpu", "--enable-unsafe-swiftshader", "--disable-quic",
    "--no-first-run", "--disable-background-networking", "--disable-component-update",
    "--disable-sync", "--disable-extensions", "--enable-logging=stderr", "--v=0",
    "--host-resolver-rules=MAP * ~NOTFOUND", "--virtual-time-budget=120000",
)  # fmt: skip
# Who started a request that no page started, in Chromium's log of the network.
BROWSER_ITSELF = "not an origin"
# What Chromium says about the speed of software rendering; nothing is wrong then.
ADVICE = ("GL Driver Message", "Canvas2D: Multiple readback")
LARGEST_PAGE = 4_000_000
# A fixture of 30 mm around the middle of the path.
FIXTURE = {
    "gain": 1.0,
    "is_fixture_on": 1.0,
    "fixture_center_x": 0.4,
    "fixture_size_x": 0.03,
    "fixture_size_y": 0.03,
    "fixture_size_z": 0.03,
}


def record(path: Path, seed: int, fixture: dict[str, str] | None = None, count: int = 6000) -> Path:
    """A live-looking recording: a tip on a curve through a fixture, with delays and a noisy hand.

    ``fixture`` are names and texts that describe it; None for a box, as older recordings have it.
    """
    rng, recipe = np.random.default_rng(seed), Recipe(count)
    t = np.arange(count) * 1e-3
    curve = 0.0155 * np.stack((np.sin(2.1 * t), np.sin(1.3 * t), np.cos(1.7 * t)), axis=1)
    poses, joints, force = pose_rows(count, (0.4, 0.0, 0.0)), np.zeros((count, 6)), np.zeros((count, 6))
    poses[:, :3] += curve
    measured = poses.copy()
    measured[:, :3] += rng.normal(scale=5e-5, size=(count, 3))
    force[:, :3] = -1000.0 * np.sign(curve) * np.maximum(np.abs(curve) - 0.015, 0.0)
    rows = {
        topics.MASTER_MEASURED_CP: poses,
        topics.SLAVE_SERVO_CP: poses,
        topics.SLAVE_SERVO_JP: joints,
        topics.SLAVE_SETPOINT_JS: joints,
        topics.SLAVE_SETPOINT_CP: poses,
        topics.SLAVE_MEASURED_CP: measured,
        topics.MASTER_MEASURED_CF: force,
    }
    late = np.sort(rng.integers(100_000, 900_000, (len(rows), count)), axis=0)
    for link, (topic, values) in enumerate(rows.items()):
        recipe.rows[topic] = (recipe.stamps, values, np.maximum.accumulate(recipe.stamps + late[link]))
    at = recipe.stamps[500]
    recipe.singles = [(topics.TELEOP_STATE, at, state(at, fixture, **FIXTURE))]
    recipe.metadata = {"scenario": '<curve> & "box" \'</script>', "robot": "rcrt1", "seed": str(seed)}
    recipe.write(path)
    return path


def opened(browser: str, page: Path, folder: Path) -> Any:
    """The page's body attributes after its scripts have run, console lines and requested URLs."""
    log = folder / "net.json"
    command = [
        browser,
        *FLAGS,
        f"--user-data-dir={folder / 'profile'}",
        f"--log-net-log={log}",
        "--dump-dom",
        page.as_uri(),
    ]
    done = subprocess.run(command, capture_output=True, text=True, timeout=240, check=True)
    body = re.search(r"<body([^>]*)>", done.stdout)
    assert body, "the browser showed no page:\n" + done.stderr[-2000:]
    attributes = dict(re.findall(r'data-([a-z]+)="([^"]*)"', body.group(1)))
    said = [line for line in done.stderr.splitlines() if "CONSOLE" in line]
    return attributes, said, requested(log)


def requested(log: Any) -> set[Any]:
    """URLs for which a page asked the network, from Chromium's log of it."""
    # One event per line; whether the end is written depends on how the browser ends.
    lines = [line.rstrip(",") for line in log.read_text(errors="replace").splitlines()]
    events = [json.loads(line) for line in lines if line.startswith('{"params"')]
    started = [event["params"] for event in events if "initiator" in event["params"]]
    return {
        entry["url"]
        for entry in started
        if entry["initiator"] != BROWSER_ITSELF and not entry["url"].startswith(("file:", "data:"))
    }


@pytest.mark.browser
@pytest.mark.slow
def test_page_of_three_recordings_draws_everything_without_asking_the_network(browser: str, tmp_path: Path) -> None:
    bags = [
        record(tmp_path / "box", 1),
        record(tmp_path / "sphere", 2, {"fixture": "sphere", "fixture.radius": "0.015"}),
        record(tmp_path / "cone", 3, {"fixture": "cone"}),  # which is not installed
    ]
    expected = sum(len(study(Bag(path)).figures()) for path in bags)
    assert expected == 27  # nine of each
    page = tmp_path / "report.html"
    evaluate_bags(bags, None, page, Console(quiet=True))
    assert page.stat().st_size < LARGEST_PAGE
    attributes, said, urls = opened(browser, page, tmp_path)
    assert attributes.get("errors", "") == ""
    assert attributes.get("finished") == "yes"
    assert int(attributes["drawn"]) == expected
    assert not [line for line in said if not any(advice in line for advice in ADVICE)]
    assert not urls


@pytest.mark.browser
@pytest.mark.slow
def test_page_of_a_session_shows_both_arms_with_their_fixtures(
    browser: str, teleop_again: "Run", tmp_path: Path
) -> None:
    bag, page = tmp_path / "two", tmp_path / "report.html"
    arms = ("arms=[left,right]", "right/robot=puma560", "right/seed=2", "right/fixture=sphere")
    teleop_again("sim", "--scenario", "coarse_box", "--duration", 6, "--out", bag, "--set", *arms)
    teleop_again("evaluate", bag, "--html", page)
    attributes, _, _ = opened(browser, page, tmp_path)
    assert attributes.get("errors", "") == ""
    assert int(attributes["drawn"]) == sum(
        bool(figure.traces) for found in studies(Bag(bag)) for figure in found.figures()
    )
    text = page.read_text()
    for shown in ("two · right", "two · left", "box on for", "sphere on for", "arm right", "arm left", "robot puma560"):
        assert shown in text, shown


@pytest.mark.browser
@pytest.mark.slow
def test_page_tells_when_a_plot_cannot_be_drawn(browser: str, tmp_path: Path) -> None:
    page = tmp_path / "report.html"
    evaluate_bags([record(tmp_path / "live", 1)], None, page, Console(quiet=True))
    text = page.read_text()
    data = present(re.search(r'id="page-data" type="application/json">(.*?)</script>', text, re.DOTALL))
    broken = json.loads(data.group(1))
    broken["figures"][2]["id"] = "nowhere"
    page.write_text(text.replace(data.group(1), json.dumps(broken)))
    attributes, _, _ = opened(browser, page, tmp_path)
    assert "nowhere" in attributes["errors"]
    assert int(attributes["drawn"]) == len(broken["figures"]) - 1
