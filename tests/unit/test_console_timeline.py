"""The strip of time: no peak, hole or fault is lost on the way to a page, and no request asks for too much."""

import json
import math
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from http import HTTPStatus
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import teleop_core as tc
from patience import wait_until
from teleop_console.curves import STRETCHES, TICKS, bands, thinned
from teleop_console.drivers import Drivers
from teleop_console.link import ArmView, ShownArm, View
from teleop_console.past import DELAY, ERROR, ROWS, Past, Rows, Views
from teleop_console.recorded import RecordedLink
from teleop_console.recorded_past import Recorded
from teleop_console.timeline import CURVES, FOUND, HELD, PIXELS, StripPage, Timeline
from teleop_core.bags.memory import MemoryBag
from teleop_core.bags.recording import MARKS
from teleop_core.bags.reports import report
from teleop_core.graph import topics
from teleop_core.graph.operation import State
from teleop_core.graph.topics import Topic
from teleop_core.kernels.geometry import Array
from teleop_core.robots import load_robot
from teleop_core.slave.operation import Fault

ARM = ShownArm("", load_robot("rcrt1"))
DRIVES, WATCHES = 0, 1
WHOLE = {"begin": ["0"], "end": ["6"], "pixels": ["500"]}


@pytest.fixture(scope="module")
def session(tmp_path_factory: pytest.TempPathFactory) -> tc.Recording:
    """Six seconds on a disk, beside another session of two."""
    folder = tmp_path_factory.mktemp("timeline")
    tc.run("coarse_box", duration=2.0, out=folder / "other")
    return tc.run("mode_switching", duration=6.0, out=folder / "session")


@pytest.fixture
def link(session: tc.Recording) -> RecordedLink:
    assert session.path is not None
    return RecordedLink(session.path)


@pytest.fixture
def strip(link: RecordedLink) -> StripPage:
    """Strip of a replay that one page plays and another watches."""
    drivers = Drivers()
    drivers.join(DRIVES)
    drivers.join(WATCHES)
    page = StripPage(drivers)
    page.shown = Timeline(link)
    return page


def read(ask: Callable[[], Any]) -> Any:
    """What is told once all of it has been read."""
    return wait_until(lambda: (found := ask()) is not None and found, "it is read", 60)


def ready(strip: StripPage, query: Any) -> Any:
    """Answer to a request for curves, once they have been read."""

    def ask() -> Any:
        status, told = strip.answer("/strip", query, WATCHES)
        assert status == HTTPStatus.OK, told
        is_known = not told["waits"] and not any(curve["waits"] for curve in told["curves"])  # type: ignore[index]
        return told if is_known else None

    return read(ask)


def numbers(values: list[Any]) -> Array:
    return np.array([math.nan if value is None else value for value in values])


series = st.lists(
    st.tuples(st.floats(0.0, 0.4), st.one_of(st.floats(-1e6, 1e6), st.just(math.nan), st.just(math.inf))),
    min_size=1,
    max_size=300,
)


@given(series, st.floats(-5.0, 60.0), st.floats(0.01, 100.0), st.integers(1, 60), st.booleans())
def test_no_peak_is_lost_in_what_is_drawn_and_no_more_is_told_than_pixels_show(
    samples: list[tuple[float, float]], begin: float, length: float, pixels: int, is_held: bool
) -> None:
    pair: Any = np.array(samples, np.float64).T
    times, values = np.cumsum(pair[0]), pair[1]
    end = begin + length
    told = thinned((times, values), begin, end, pixels, is_held=is_held)
    assert len(told["times"]) <= 2 * (pixels + 2)
    json.dumps(told, allow_nan=False)
    seen = values[(times >= begin) & (times <= end) & np.isfinite(values)]
    low, high = numbers(told["low"]), numbers(told["high"])
    if len(seen):
        assert np.nanmin(low) <= seen.min() + 1e-6 * abs(seen.min())
        assert np.nanmax(high) >= seen.max() - 1e-6 * abs(seen.max())
        drawn = values[np.isfinite(values)]
        assert np.nanmax(high) <= drawn.max() + 1e-6 * abs(drawn.max())


def test_one_sample_of_600000_that_is_wrong_is_seen_where_it_is() -> None:
    times = np.arange(600_000.0) * 1e-3
    values: Any = np.sin(times)
    values[432_101] = -50.0
    told = thinned((times, values), 0.0, 600.0, 1000)
    worst = int(np.nanargmin(numbers(told["low"])))
    assert told["low"][worst] == -50.0
    assert abs(numbers(told["times"])[worst] - 432.101) <= 0.6


@pytest.mark.parametrize("pixels", [3, 50, 5000])
def test_a_pause_is_a_gap_at_any_size_but_not_in_what_holds_its_value(pixels: int) -> None:
    times = np.concatenate([np.arange(0.0, 10.0, 0.01), np.arange(11.0, 20.0, 0.01)])
    for is_held in (False, True):
        told = thinned((times, np.ones(len(times))), 0.0, 20.0, pixels, is_held=is_held)
        assert told["times"].count(None) == (not is_held)


class Told(Past):
    """A past that says what a test gives it."""

    def __init__(self, operation: Array, marks: tuple[tuple[float, str], ...] = ()) -> None:
        super().__init__()
        self.joints, self._operation, self._marks = {"": ARM.robot.joint_names}, operation, marks

    def rows(self, topic: str) -> Any:
        times = np.arange(len(self._operation)) * 1e-3
        return (times, self._operation) if topic == topics.SLAVE_OPERATION.name else None

    def marks(self) -> tuple[tuple[float, str], ...]:
        return self._marks


def operation(*states: tuple[State, Fault]) -> Array:
    rows = np.zeros((len(states), len(topics.OPERATION)))
    rows[:, topics.OPERATION.index("state")] = [state for state, _ in states]
    rows[:, topics.OPERATION.index("fault")] = [fault for _, fault in states]
    rows[:, topics.OPERATION.index("fault_joint")] = -1.0
    return rows


def test_a_fault_of_one_tick_among_thousands_of_changes_is_told_with_its_words() -> None:
    calm, paused = (State.ENABLED, Fault.NONE), (State.PAUSED, Fault.NONE)
    states = [calm, paused] * 3000 + [(State.FAULT, Fault.STOP)] + [calm, paused] * 3000
    marks = tuple((1e-3 * i, f"mark {i}") for i in range(2 * TICKS))
    rows, ticks = bands(Told(operation(*states), marks), 0.0, 12.0)
    stretches: Any = rows[0]["stretches"]
    assert len(stretches) <= STRETCHES
    assert [text for _, _, text, meaning in stretches if meaning == "wrong"] == ["FAULT"]
    assert len(ticks) == TICKS
    (fault,) = (tick for tick in ticks if tick["meaning"] == "wrong")
    assert fault["time"] == pytest.approx(6.0)
    assert "emergency stop" in str(fault["text"])


def test_a_second_fault_before_the_first_is_reset_is_a_tick_of_its_own() -> None:
    states = [(State.FAULT, Fault.STOP)] * 5 + [(State.FAULT, Fault.TIP)] * 5
    _, ticks = bands(Told(operation(*states)), 0.0, 1.0)
    assert [tick["time"] for tick in ticks] == [0.0, 0.005]


def test_states_that_no_version_knows_are_shown_as_unknown() -> None:
    rows = operation((State.ENABLED, Fault.NONE), (State.ENABLED, Fault.NONE))
    rows[1, 0] = math.inf
    found, _ = bands(Told(rows), 0.0, 1.0)
    assert [text for _, _, text, _ in found[0]["stretches"]] == ["ENABLED", "unknown"]  # type: ignore[attr-defined]


def test_every_recorded_number_can_be_drawn_as_it_was_recorded(session: tc.Recording, link: RecordedLink) -> None:
    names = list(link.past.columns)
    for topic, column in (("slave/measured_cp", "y"), ("master/measured_cf", "fz"), ("slave/setpoint_js", "theta2")):
        times, values = read(partial(link.past.samples, f"{topic} {column}"))
        recorded = session[topic]
        np.testing.assert_allclose(values, recorded[column], rtol=1e-6, atol=1e-9)
        np.testing.assert_allclose(times, (recorded.log_ns - session.bag.start_ns) * 1e-9, atol=1e-9)
    for topic, info in session.bag.topics.items():
        if topic in topics.BY_NAME and topic != topics.DIAGNOSTICS.name and info.count:
            assert any(name.startswith(f"{topic} ") for name in names), topic
    _, gain = read(lambda: link.past.samples("teleop/state gain"))
    assert gain[-1] > 0.0


def test_the_tracking_error_is_that_of_the_score(session: tc.Recording, link: RecordedLink) -> None:
    times, error = read(lambda: link.past.samples(ERROR))
    spread = session.score().position_error_mm
    begins = session["slave/setpoint_js"]
    led_ns = begins.log_ns[np.flatnonzero(begins.stamp_ns > topics.NO_COMMAND_NS)[0]]
    is_led = (times >= (led_ns - session.bag.start_ns) * 1e-9) & ~np.isnan(error)
    led = 1e3 * error[is_led]
    assert np.sqrt(np.mean(led**2)) == pytest.approx(spread.rms, rel=1e-3)
    assert led.max() == pytest.approx(spread.max, rel=1e-5)  # drawn as float32


def test_columns_are_found_by_words_and_by_units(strip: StripPage) -> None:
    for words, column, unit in (
        ("measured_cf N", "master/measured_cf fx", "N"),
        ("MEASURED_JS rad/s theta1", "slave/measured_js theta1.velocity", "rad/s"),
        ("servo [m]", "slave/servo_cp x", "m"),
        ("error", ERROR, "m"),
    ):
        _, told = strip.answer("/timeline", {"find": [words]}, WATCHES)
        assert [column, unit] in told["found"]  # type: ignore[index]
    _, told = strip.answer("/timeline", {"find": [""]}, WATCHES)
    assert len(told["found"]) <= FOUND < told["count"]  # type: ignore[index]


def test_marks_that_were_set_are_ticks_with_their_texts(session: tc.Recording) -> None:
    bag: Any = session.bag
    tip = bag.read(topics.SLAVE_MEASURED_CP)
    at = bag.start_ns + 1_500_000_000
    marked = MemoryBag("marked", {topics.SLAVE_MEASURED_CP: tip}, {MARKS: [(at, report(at, "r", 0, "here", {}))]}, {})
    past = Recorded(marked)
    _, ticks = bands(past, 0.0, 6.0)
    assert [(tick["time"], tick["text"]) for tick in ticks] == [(pytest.approx(1.5), "here")]


def test_marks_of_a_live_session_are_ticks_and_two_arms_have_bands_of_their_own() -> None:
    arms = tuple(ShownArm(name, ARM.robot) for name in ("left", "right"))
    seen = Views(arms)
    for tick in range(30):
        told = {}
        for arm, state in zip(arms, (State.ENABLED, State.PAUSED), strict=True):
            numbers = dict.fromkeys(topics.OPERATION, 0.0) | {"state": float(state)}
            hand = dict.fromkeys(topics.TELEOP_STATE.columns, 0.0) | {"is_following": float(arm.name == "left")}
            told[arm.name] = ArmView(state=hand, operation=numbers)
        marks = ((0.5, "needle in"),) if tick > 15 else ()
        seen.add(View(time=tick / 30.0, arms=told, is_fresh=True, marks=marks))
    rows, ticks = bands(seen, 0.0, 1.0)
    assert [(tick["time"], tick["text"]) for tick in ticks] == [(0.5, "needle in")]
    said = {str(row["row"]): [stretch[2] for stretch in row["stretches"]] for row in rows}  # type: ignore[attr-defined]
    assert said["left state"] == ["ENABLED"]
    assert said["right state"] == ["PAUSED"]
    assert said["left hand"] == ["follows"]
    assert said["right hand"] == ["rests"]
    assert {"left/tracking error", "right/tracking error"} <= set(seen.columns)


def test_numbers_of_topics_that_no_stage_of_ours_has_are_columns_too(session: tc.Recording) -> None:
    bag: Any = session.bag
    tip = bag.read(topics.SLAVE_MEASURED_CP)
    foreign = Topic("camera/pose", topics.Kind.POSE)
    past = Recorded(MemoryBag("foreign", {topics.SLAVE_MEASURED_CP: tip, foreign: tip}, {}, {}))
    _, values = read(lambda: past.samples("camera/pose z"))
    np.testing.assert_allclose(values, tip.values[:, 2], atol=1e-7)


def test_time_is_moved_by_who_drives_and_seen_by_all(strip: StripPage, link: RecordedLink) -> None:
    assert strip.answer("/time", {"seek": ["2.5"]}, WATCHES) == (HTTPStatus.CONFLICT, "You watch. Take control first.")
    assert link.time == 0.0
    _, told = strip.answer("/time", {"seek": ["2.5"], "speed": ["2"], "loop": ["1"], "play": ["1"]}, DRIVES)
    assert (link.time, link.speed, link.loop, link.is_playing) == (2.5, 2.0, True, True)
    assert strip.answer("/timeline", {}, WATCHES)[1] == told


@pytest.mark.parametrize(
    ("path", "query"),
    [
        ("/time", {"seek": ["nan"]}),
        ("/time", {"seek": ["1e999"]}),
        ("/time", {"speed": ["0"]}),
        ("/time", {"speed": ["1e6"]}),
        ("/time", {"command": ["1"]}),
        ("/time", {"seek": ["0x10"]}),
        ("/strip", {}),
        ("/strip", WHOLE | {"end": ["0"]}),
        ("/strip", WHOLE | {"pixels": ["0"]}),
        ("/strip", WHOLE | {"pixels": [str(PIXELS + 1)]}),
        ("/strip", WHOLE | {"begin": ["-inf"]}),
        ("/strip", WHOLE | {"name": ["../../etc/passwd"]}),
        ("/strip", WHOLE | {"name": ["slave/measured_cp x"] * (CURVES + 1)}),
        ("/timeline", {"find": ["x" * 1000]}),
        ("/over", {"name": [".."]}),
        ("/over", {"name": ["/etc"]}),
        ("/over", {"name": ["session"]}),
        ("/over", {"align": ["end"]}),
    ],
)
def test_what_makes_no_sense_or_asks_for_too_much_is_refused_and_changes_nothing(
    strip: StripPage, link: RecordedLink, path: str, query: Any
) -> None:
    before = strip.answer("/timeline", {}, DRIVES)
    status, told = strip.answer(path, query, DRIVES)
    assert status == HTTPStatus.CONFLICT
    assert isinstance(told, str)
    assert strip.answer("/timeline", {}, DRIVES) == before


def test_an_answer_is_small_however_long_the_recording_and_however_much_is_asked(strip: StripPage) -> None:
    names = ["slave/measured_cp x", "slave/measured_cp y", "slave/servo_cp x", "master/measured_cp z"]
    told = ready(strip, WHOLE | {"name": [*names, *names[:2]], "pixels": ["1000"]})
    assert [curve["name"] for curve in told["curves"]] == names
    assert len(json.dumps(told, allow_nan=False)) < 250_000
    assert {row["row"] for row in told["bands"]} >= {"state", "hand", "mode"}


def test_a_second_recording_lies_over_the_first_from_its_start_or_from_where_it_follows(
    strip: StripPage, session: tc.Recording
) -> None:
    assert strip.answer("/over", {"name": ["other"]}, WATCHES)[0] == HTTPStatus.CONFLICT
    _, told = strip.answer("/over", {"name": ["other"]}, DRIVES)
    assert told["over"] == "other"  # type: ignore[index]
    query = WHOLE | {"name": ["slave/measured_cp x", "teleop/state is_following"], "pixels": ["4000"]}

    def begun(part: Any) -> float:
        return next(t for t, v in zip(part["times"], part["high"], strict=True) if v)

    def own_and_other() -> tuple[float, float]:
        curve = ready(strip, query)["curves"][1]
        return begun(curve), begun(curve["over"])

    own, other = own_and_other()
    assert abs(own - other) > 0.2
    strip.answer("/over", {"align": ["following"]}, DRIVES)
    assert own_and_other() == pytest.approx((own, own), abs=2e-3)
    strip.answer("/over", {"name": [""]}, DRIVES)
    assert "over" not in ready(strip, query)["curves"][0]


# -- live ------------------------------------------------------------------------------------------


def view(time: float, x: float = 0.0, *, is_fresh: bool = True) -> View:
    """What is known of an arm whose tip is wanted at 0 and is at x [m]."""
    turn = [1.0, 0.0, 0.0, 0.0]
    poses = {topics.SLAVE_SETPOINT_CP.name: [0.0, 0.0, 0.0, *turn], topics.SLAVE_MEASURED_CP.name: [x, 0.0, 0.0, *turn]}
    arm = ArmView(
        {name: np.array(pose) for name, pose in poses.items()}, operation=dict.fromkeys(topics.OPERATION, 0.0)
    )
    return View(time, {"": arm}, is_fresh=is_fresh, delay=(0.001, 0.002))


def known(seen: Views, name: str) -> Rows:
    """Samples of a column."""
    found = seen.samples(name)
    assert found is not None
    return found


def test_what_was_seen_is_kept_for_two_minutes_and_known_at_any_time_of_them() -> None:
    seen = Views((ARM,))
    for i in range(ROWS + 500):
        seen.add(view(i / 30.0, 1e-3 * i))
    begin, end = seen.span()
    assert end - begin == pytest.approx((ROWS - 1) / 30.0)
    assert end - begin > 120.0
    for time in (begin, 60.0, end):
        then = seen.view(time).arms[""]
        assert then.streams[topics.SLAVE_MEASURED_CP.name][0] == pytest.approx(1e-3 * math.floor(time * 30.0 + 1e-9))
        assert then.operation_text
    times, error = known(seen, ERROR)
    np.testing.assert_allclose(error, 0.03 * np.array(times), atol=1e-9)
    assert known(seen, DELAY)[1][-1] == 0.001


def test_what_was_not_known_is_no_number_and_silence_is_a_gap() -> None:
    seen = Views((ARM,))
    for i in range(100):
        seen.add(replace(view(i / 30.0), is_fresh=not 30 < i < 60))
    late = view(100 / 30.0)
    late.arms[""].streams[topics.MASTER_MEASURED_CF.name] = np.ones(6)
    seen.add(late)
    _, force = known(seen, "master/measured_cf fx")
    assert np.isnan(force[:-1]).all()
    assert force[-1] == 1.0
    assert thinned(known(seen, "slave/measured_cp x"), 0.0, 4.0, 1000)["times"].count(None) == 1
    assert topics.MASTER_MEASURED_CF.name not in seen.view(1.0).arms[""].streams


def test_a_time_that_goes_back_begins_anew_and_one_that_stands_still_adds_nothing() -> None:
    seen = Views((ARM,))
    for time in (5.0, 6.0, 2.0, 2.0):
        seen.add(view(time))
    assert seen.span() == (2.0, 2.0)


class Live:
    """A link to an arm that is led by a test."""

    title, is_live, arms = "live", True, (ARM,)


def test_a_live_scene_shows_what_was_only_while_it_is_asked_for_and_never_while_the_arms_are_stopped() -> None:
    now = [0.0]
    line = Timeline(Live(), lambda: now[0])  # type: ignore[arg-type]
    for i in range(100):
        line.shown(view(i / 30.0, 1e-3 * i))
    line.go({"seek": "1.0"})
    newest = view(3.4, 0.1)
    then = line.shown(newest)
    assert then.arms[""].streams[topics.SLAVE_MEASURED_CP.name][0] == pytest.approx(0.03)
    now[0] += HELD
    assert line.shown(newest) is newest
    line.go({"seek": "1.0"})
    assert line.shown(newest, is_stopped=True) is newest
    assert line.shown(newest) is newest
    line.go({"seek": "1.0"})
    line.go({"now": "1"})
    assert line.shown(newest) is newest


def test_nothing_is_told_while_nothing_is_shown() -> None:
    page = StripPage(Drivers())
    for path in StripPage.paths:
        assert page.answer(path, WHOLE, DRIVES) == (HTTPStatus.OK, {})
