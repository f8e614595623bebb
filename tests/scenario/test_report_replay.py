"""Replay of the report page: in a real browser the robot stands where the recording says."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any, cast

import numpy as np
import pytest
from numpy.typing import NDArray
from rich.console import Console

from browser import Tab
from headless import Headless
from recipes import START_NS, Recipe, state
from teleop_core.bags.writer import BagWriter
from teleop_core.evaluation.command import evaluate_bags
from teleop_core.evaluation.metrics import replay as metric
from teleop_core.evaluation.replay_figure import ROOM
from teleop_core.graph import topics
from teleop_core.kernels.geometry import Array, pose_from_transform
from teleop_core.robots import load_robot
from teleop_core.robots.robot import Robot

pytestmark = [pytest.mark.browser, pytest.mark.slow]

ROBOTS = ("scara", "stewart")  # of turning and sliding joints; of loops
RATE, DURATION = 200, 8.0  # 1/s, s
# Coordinates are rounded to 0.01 mm or mrad, and straight between moments 40 ms apart.
TOLERANCE_MM = 0.2
FIXTURE: dict[str, Any] = {
    "gain": 1.0,
    "fixture_size_x": 0.03,
    "fixture_size_y": 0.03,
    "fixture_size_z": 0.03,
}
FIXTURE_ON = (3.0, 5.0)
LARGEST_PAGE = 10_000_000
CARD = """[...document.querySelectorAll('figure.card')].filter((f) =>
    f.querySelector('h3').textContent === 'Replay')[{number}]"""


def joints_of(robot: Robot, times: Array) -> Any:
    """Joints (N, n) on slow sines about home, within the limits."""
    room = np.minimum(robot.home - robot.lower, robot.upper - robot.home)
    reach = np.where(np.isfinite(room), np.minimum(0.5 * room, 0.1), 0.1)
    phases = 0.7 * np.arange(robot.n)
    return robot.home + reach * np.sin(2.0 * np.pi * 0.25 * times[:, None] + phases)


def record(path: Path, name: str, duration: float = DURATION, rate: int = RATE) -> Any:
    """A recording of a robot whose joints move; returns times and places of the tip [mm]."""
    robot = load_robot(name)
    times = np.arange(int(duration * rate)) / rate
    q = joints_of(robot, times)
    poses = np.empty((len(q), 7))
    for row, pose in zip(q, poses, strict=True):
        pose_from_transform(robot.fk(row), pose)
    recipe = Recipe(1)
    stamps = START_NS + np.round(times * 1e9).astype(np.int64)
    states = np.concatenate((q, np.zeros((len(q), 2 * robot.n))), axis=1)
    rows = dict.fromkeys(
        (topics.SLAVE_SERVO_CP, topics.SLAVE_SETPOINT_CP, topics.SLAVE_MEASURED_CP), poses
    )
    rows[topics.SLAVE_MEASURED_JS] = states
    metadata = recipe.metadata | {"robot": name}
    with BagWriter(
        path, recipe.topics, robot.joint_names, metadata=metadata, start_ns=START_NS
    ) as writer:
        for at, is_on in ((0.0, 0.0), (FIXTURE_ON[0], 1.0), (FIXTURE_ON[1], 0.0)):
            stamp = START_NS + round(at * 1e9)
            center = dict(zip(("fixture_center_x", "fixture_center_y", "fixture_center_z"),
                              poses[0, :3], strict=True))  # fmt: skip
            told = state(stamp, is_fixture_on=is_on, **FIXTURE, **center)
            writer.write(topics.TELEOP_STATE, stamp, told)
        for i in range(0, len(q), 1000):
            part = slice(i, i + 1000)
            block = {
                topic: (stamps[part], values[part], stamps[part]) for topic, values in rows.items()
            }
            block[topics.SLAVE_MEASURED_JS] = (stamps[part], states[part], stamps[part])
            writer.write_block(block)
    return times, 1e3 * poses[:, :3]


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory) -> Any:
    """A page with one recording of each robot, and where their tips were."""
    folder = tmp_path_factory.mktemp("replays")
    tips = [record(folder / name, name) for name in ROBOTS]
    evaluate_bags(
        [folder / name for name in ROBOTS], None, folder / "page.html", cast(Console, _Silent())
    )
    return folder / "page.html", tips


@pytest.fixture(scope="module")
def tab(page: Any, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Headless]:
    with Tab(tmp_path_factory.mktemp("profile"), 1200) as opened:
        opened.open(page[0])
        assert opened.value("document.body.dataset.errors") is None
        yield opened


@pytest.fixture(autouse=True)
def _whole(tab: Any) -> Iterator[None]:
    tab.value("document.querySelectorAll('.times .all').forEach((button) => button.click())")
    tab.settled()
    yield
    assert not tab.faults()
    assert tab.value("document.body.dataset.errors") is None


def show(tab: Headless, number: int, time: float) -> Any:
    """Move the slider of a replay; returns what is drawn: tip, robot's last solid, fixture."""
    card = CARD.format(number=number)
    return tab.value(f"""(async () => {{
        const card = {card}, plot = card.querySelector('.plot');
        const slider = card.querySelector('.player input');
        slider.value = {time};
        slider.dispatchEvent(new Event('input'));
        while (Math.abs(Number(plot.dataset.time) - {time}) > 1e-6)
            await new Promise((done) => setTimeout(done, 5));
        const [robot, path, trail, ...fixtures] = plot.data;
        const mean = (values) => values.reduce((sum, v) => sum + v, 0) / values.length;
        const last = 84; // corners of the ball that is the tip
        return {{
            tip: ['x', 'y', 'z'].map((axis) => trail[axis].at(-1)),
            length: trail.x.length,
            ball: ['x', 'y', 'z'].map((axis) => mean(Array.from(robot[axis]).slice(-last))),
            isOn: fixtures.map((fixture) => Number.isFinite(fixture.x[0])),
            range: [Number(slider.min), Number(slider.max)],
        }};
    }})()""")


def recorded(tips: NDArray[np.int64], time: float | Array) -> Array:
    times, places = tips
    return np.array([np.interp(time, times, column) for column in places.T])


@pytest.mark.parametrize("number", range(len(ROBOTS)), ids=ROBOTS)
def test_tip_is_drawn_where_the_recording_says_at_any_time(
    tab: Headless, page: Any, number: int
) -> None:
    _, tips = page
    for time in (0.0, 2.3456, 5.0, 7.9):
        shown = show(tab, number, time)
        np.testing.assert_allclose(shown["tip"], recorded(tips[number], time), atol=TOLERANCE_MM)
    assert np.ptp(tips[number][1], axis=0).max() > 20 * TOLERANCE_MM  # it did move


def test_last_solid_is_where_the_tip_is(tab: Headless, page: Any) -> None:
    for time in (1.0, 6.5):
        shown = show(tab, 0, time)
        np.testing.assert_allclose(shown["ball"], shown["tip"], atol=TOLERANCE_MM)


def test_fixture_is_drawn_while_it_is_on(tab: Headless) -> None:
    shown = [show(tab, 0, time)["isOn"] for time in (1.0, 4.0, 6.0)]
    assert shown == [[False], [True], [False]]


def test_replay_is_of_the_visible_time_and_plays_to_its_end(tab: Headless, page: Any) -> None:
    tab.value("""(() => { const [from, to] = document.querySelectorAll('.times input');
        from.value = 2; to.value = 3; to.dispatchEvent(new Event('change')); })()""")
    tab.settled()
    shown = show(tab, 0, 2.0)
    assert shown["range"] == [2.0, 3.0]
    card = CARD.format(number=0)
    tab.value(f"{card}.querySelector('.player button').click()")
    tab.until(f"{card}.querySelector('.player button').ariaLabel === 'play' && "
              f"Number({card}.querySelector('.plot').dataset.time) === 3")  # fmt: skip
    trail = f"{card}.querySelector('.plot').data[2]"
    drawn = tab.value(f"['x', 'y', 'z'].map((axis) => {trail}[axis].at(-1))")
    np.testing.assert_allclose(drawn, recorded(page[1][0], 3.0), atol=TOLERANCE_MM)


def test_recording_without_joints_or_of_an_unknown_robot_has_no_replay(tmp_path: Path) -> None:
    for name, robot in (("still", "rcrt1"), ("foreign", "no such robot")):
        recipe = Recipe()
        recipe.metadata["robot"] = robot
        recipe.write(tmp_path / name)
        evaluate_bags([tmp_path / name], None, tmp_path / f"{name}.html", cast(Console, _Silent()))
        assert "<h3>Replay</h3>" not in (tmp_path / f"{name}.html").read_text()


def test_long_replay_stays_within_its_room(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(metric, "RATE", 250.0)  # as many moments as ten minutes have
    record(tmp_path / "long", "stewart", duration=20.0, rate=250)
    evaluate_bags([tmp_path / "long"], None, tmp_path / "page.html", cast(Console, _Silent()))
    page = tmp_path / "page.html"
    assert "<h3>Replay</h3>" in page.read_text()
    assert page.stat().st_size < 4_000_000 + ROOM


class _Silent:
    """A console without a screen."""

    width = 80

    def print(self, *things: object, **options: object) -> None:
        pass
