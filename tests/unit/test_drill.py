"""Drill: what it measures, what it does to a hand, and when it is not satisfied."""

import math
import re
from collections.abc import Callable, Mapping
from dataclasses import replace
from enum import Enum
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import ArrayLike
from scipy import signal

from broken_copies import MUTANTS
from code_mutants import CODE_MUTANTS
from mutants import ROOT, changed, every
from present import present
from teleop_core.bags import reader, reports
from teleop_core.bags.writer import BagWriter
from teleop_core.graph.operation import State
from teleop_core.graph.topics import DIAGNOSTICS, SLAVE_SETPOINT_JS, SLAVE_TRUE_CP
from teleop_core.kernels.geometry import Array
from teleop_core.robots import load_robot
from teleop_core.session import api
from teleop_core.slave.operation import Fault
from teleop_drill import drill
from teleop_drill.drill import hand, judging
from teleop_drill.drill.drill_table import drill_table, markdown, rows, summary
from teleop_drill.drill.exercise import Exercise
from teleop_drill.drill.numbers import Numbers, Scheduling
from teleop_drill.drill.outcome import FaultOutcome
from teleop_drill.drill.recordings import Recorded, check_recording, judge_recording, missing, told_lost
from teleop_drill.simulation.laws import LAWS

MS = 1_000_000
DT = 1e-3


def trace(values: ArrayLike, numbers: Any = None) -> Any:
    """One message a millisecond, from 1 s on."""
    values = np.asarray(values, dtype=float)
    numbers = np.arange(len(values)) if numbers is None else np.asarray(numbers)
    times = 1_000 * MS + present(numbers).astype(np.int64) * MS
    return drill.measure.Trace(times, present(numbers).astype(np.int64), values, times)


@pytest.mark.parametrize(
    ("places", "numbers", "ratio"),
    [
        ([0.0, 1e-3, 3e-3], None, 2.0),
        ([0.0, 5e-4, 0.0], None, 0.5),
        ([0.0, 3e-3], [0, 3], 1.0),  # messages that were lost
        ([0.0, 9.0], [500, 1], 0.0),  # another publisher
    ],
)
def test_the_ratio_is_that_of_the_largest_step_of_any_joint_in_a_tick(
    places: list[float], numbers: list[int] | None, ratio: float
) -> None:
    joints = np.column_stack((np.zeros(len(places)), places))
    assert drill.measure.step_ratio(trace(joints, numbers), np.array([9.0, 1.0]), DT) == pytest.approx(ratio)


@pytest.mark.parametrize("moving_for", [0, 1, 7])
def test_a_stop_is_over_with_the_first_setpoint_that_stands_still(moving_for: int) -> None:
    way = np.cumsum(np.ones(100 + moving_for))
    places = np.concatenate((way, np.full(50, way[-1])))[:, np.newaxis]
    since_ns = 1_000 * MS + 99 * MS  # that of the hundredth message
    assert drill.measure.stop_delay(trace(places), since_ns) == pytest.approx((moving_for + 1) * DT)


def test_a_tip_that_moves_on_never_rests_but_one_that_falls_silent_is_where_it_was() -> None:
    places = np.cumsum(np.full((300, 1), 1e-3), axis=0) * np.array([[1.0, 0.0, 0.0]])
    moving = trace(places)
    last_ns = int(moving.sent_ns[-1])
    since_ns = last_ns - 50_000_000
    rest = drill.measure.rest_delay
    assert np.isnan(rest(moving, since_ns, 0.01, last_ns + 20_000_000))
    assert rest(moving, since_ns, 0.01, last_ns + 500_000_000) == pytest.approx(0.05)


def test_who_never_stands_still_has_no_time_of_stopping() -> None:
    assert math.isnan(drill.measure.stop_delay(trace(np.arange(100.0)[:, None]), 1_050 * MS))


def test_travel_is_counted_from_the_last_place_before_the_fault_and_until_the_end() -> None:
    places = np.zeros((100, 3))
    places[:, 0] = 1e-3 * np.arange(100)
    found = drill.measure.travel(trace(places), 1_050 * MS, 1_060 * MS)
    assert found == pytest.approx(10e-3)


def test_braking_takes_the_square_of_the_speed_over_twice_the_deceleration() -> None:
    speed, braking = 0.5, 4.0
    turning = trace(speed * DT * np.arange(100)[:, None])
    jacobian = np.zeros((6, 1))
    jacobian[1, 0] = 0.3
    found = drill.measure.braking_way(turning, 1_099 * MS, jacobian, np.array([braking]))
    assert found == pytest.approx(0.3 * speed**2 / (2.0 * braking))


def test_the_bound_of_braking_holds_for_a_real_arm_that_brakes_all_joints() -> None:
    robot = load_robot("rcrt1")
    rng = np.random.default_rng(3)
    braking = np.full(robot.n, 20.0)
    for _ in range(20):
        q, speeds = robot.home.copy(), rng.uniform(-0.5, 0.5, robot.n)
        moving = trace(q + DT * np.arange(-50, 1)[:, None] * speeds)
        bound = drill.measure.braking_way(moving, 1_050 * MS + 1, robot.jacobian(q), braking)
        time = np.abs(speeds) / braking
        rest = q + 0.5 * speeds * time
        way = np.linalg.norm((robot.fk(rest) - robot.fk(q))[:3, 3])
        assert way <= 1.05 * bound


def test_the_hand_goes_round_at_constant_speed_once_it_has_set_in() -> None:
    times = np.arange(2.0, 6.0, drill.hand.PERIOD)
    places = np.array([drill.hand.circle(time)[:3] for time in times])
    speeds = np.linalg.norm(np.diff(places, axis=0), axis=1) / drill.hand.PERIOD
    assert speeds == pytest.approx(2.0 * math.pi * drill.hand.RADIUS / drill.hand.ROUND, rel=1e-4)
    assert np.linalg.norm(drill.hand.circle(drill.hand.PERIOD)[:3] - drill.hand.circle(0.0)[:3]) < 1e-6


def sent(distortion: Callable[..., Any], count: int = 100) -> list[hand.Sample]:
    """Samples that leave, of one every two milliseconds."""
    out = []
    for number in range(count):
        out += distortion(hand.Sample(number * 2 * MS, drill.hand.circle(2.0 + number * drill.hand.PERIOD)))
    return out


def test_what_is_lost_is_a_share_and_the_rest_is_untouched() -> None:
    left = sent(drill.hand.lossy(0.3), 2000)
    assert 0.65 < len(left) / 2000 < 0.75
    assert [s.stamp_ns for s in left] == sorted({s.stamp_ns for s in left})


def test_what_is_late_comes_in_order_and_so_many_samples_later() -> None:
    held = drill.hand.delayed(10)
    assert [len(held(hand.Sample(n, drill.hand.circle(0.0)))) for n in range(12)] == [0] * 10 + [1, 1]


def test_what_is_out_of_order_is_all_there() -> None:
    stamps = [s.stamp_ns for s in sent(drill.hand.reordered(5))]
    assert stamps[:5] == sorted(stamps[:5], reverse=True)
    assert sorted(stamps) == [n * 2 * MS for n in range(100)]


def test_stamps_are_changed_alone() -> None:
    frozen, zero = sent(drill.hand.frozen_stamps()), sent(drill.hand.stamped(lambda _: 0))
    assert {s.stamp_ns for s in frozen} == {0}
    assert {s.stamp_ns for s in zero} == {0}
    assert np.array_equal([s.pose for s in frozen], [s.pose for s in sent(drill.hand.faithful)])


@pytest.mark.parametrize("number", [math.nan, 1e308])
def test_what_a_hand_cannot_send_is_sent(number: float) -> None:
    for sample in sent(drill.hand.filled(number), 3):
        assert np.array_equal(sample.pose[:3], [number] * 3, equal_nan=True)


def outcome(**changed: object) -> drill.FaultOutcome:
    """One that is as expected, of an arm that was stopped."""
    good: dict[str, Any] = {
        "exercise": next(one for one in drill.EXERCISES if one.name == "stop_topic"),
        "state": State.FAULT,
        "fault": Fault.STOP,
        "measures": {"travel_m": judging.Measured("travel_m", "{0:.1f} mm, at most {1:.1f}", 1e-3, 2e-3)},
        "recording": "intact",
        "recovered": 0.2,
        "cure": drill.Cure.RESET,
        "detected": 1e-3,
    }
    return drill.FaultOutcome(**(good | changed))


@pytest.mark.parametrize(
    ("changed", "word"),
    [
        ({"state": State.ENABLED}, "ENABLED, not FAULT"),
        ({"state": None}, "gone"),
        ({"fault": Fault.SILENCE}, "silence"),
        ({"recording": "lost", "is_recorded": False}, "lost"),
        ({"recovered": math.nan}, "did not recover"),
        ({"cure": drill.Cure.NOTHING}, "by itself"),
    ],
)
def test_whatever_is_not_as_expected_fails_and_says_what(
    changed: Mapping[str, str | float | bool | Enum | None], word: str
) -> None:
    (failure,) = outcome(**changed).failures()
    assert word in failure
    assert rows([outcome(**changed)])[0][-1] == "✗"
    assert any(word in line for line in summary([outcome(**changed)]))


def test_a_number_outside_its_bounds_fails_and_says_both() -> None:
    far = judging.Measured("travel_m", "{0:.1f} mm, at most {1:.1f}", 2.5e-3, 2e-3)
    assert outcome(measures={"travel_m": far}).failures() == ["2.5 mm, at most 2.0"]
    slow = judging.Measured("path_m", "{0:.0f} mm, at least {1:.0f}", 1e-3, least=9e-3)
    assert outcome(measures={"path_m": slow}).failures() == ["1 mm, at least 9"]
    assert judging.Measured("told_s", "{0} {1}", math.inf, 1.0).failure
    assert not judging.Measured("told_s", "{0} {1}", math.nan, 1.0).failure


def test_what_is_not_recorded_fails_unless_the_fault_may_cost_it() -> None:
    one = outcome()
    one.note_loss(0.3)
    assert "0.30 s" in one.failures()[0]
    frozen = outcome(exercise=by_name("freeze_recorder"))
    frozen.note_loss(0.3)
    assert not any("0.30 s" in text for text in frozen.failures())


# -- judging: an arm that goes round as the hand does, and what may be wrong with it ---------------


def by_name(name: str) -> Exercise:
    return next(one for one in drill.EXERCISES if one.name == name)


NUMBERS = Numbers.of(api.configuration("free_motion"))


def test_drives_make_up_for_a_step_as_fast_as_their_triple_pole_answers_it() -> None:
    pole, step = NUMBERS.bandwidth, 0.01 * 0.05
    loop = signal.TransferFunction([3 * pole**2, pole**3], np.poly([-pole] * 3))
    times, answer = signal.step(loop, T=np.linspace(0.0, 10.0 / pole, 20_000))
    fastest = step * float(np.max(np.gradient(answer, times)))
    bound = 0.01 * (NUMBERS.catching_up(0.05, by_drives=True) - 1.0)
    assert 0.99 * bound < fastest < bound


ROBOT = NUMBERS.robot
BEGIN: Any = 1_500 * MS


def seen(joints: Array, lies: float = 1.0, told: Any = None, warned: Any = None, late: float = 0.0) -> judging.Tapped:
    """What a tap hears of an arm whose setpoint and measured joints are these, each millisecond."""
    joints = np.asarray(joints)
    measured = ROBOT.start + lies * (joints - ROBOT.start)
    tips = [np.append(ROBOT.fk(row)[:3, 3], [1.0, 0.0, 0.0, 0.0]) for row in joints]
    end = 1_000 * MS + len(joints) * MS
    heard = [trace(values) for values in (joints, measured, tips)]
    return judging.Tapped(BEGIN, end, heard[0], heard[1], heard[2], told, warned, Scheduling(late, late))


def round_and_round(speed: float = 1.0, count: int = 2000) -> Array:
    """Joints whose tip goes as fast as the hand: one joint there and back on a circle's arc."""
    pull = np.linalg.norm(ROBOT.jacobian(ROBOT.start)[:3, 0])
    rate = speed * NUMBERS.tip_speed / pull
    reach = 0.03 / pull
    way = np.abs((rate * DT * np.arange(count) + reach) % (2 * reach) - reach)
    return ROBOT.start + way[:, None] * np.eye(ROBOT.n)[0]


def stopping(after: float, braking: float = 1.0, count: int = 1500) -> Array:
    """Joints that go on for a time after the fault, then brake with a share of what they can."""
    rate = np.eye(ROBOT.n)[0] * NUMBERS.tip_speed
    rate /= np.linalg.norm(ROBOT.jacobian(ROBOT.start)[:3, 0])
    step = np.where(np.arange(count) < 500 + round(after / DT), 1.0, 0.0)[:, None] * rate * DT
    for k in range(1, count):
        less = braking * NUMBERS.braking * DT * DT
        step[k] = np.maximum(step[k], step[k - 1] - less)
    return ROBOT.start + np.cumsum(step, axis=0)


def wrong(name: str, found: judging.Tapped) -> list[str]:
    return [m.name for m in judging.judge(by_name(name), found, NUMBERS) if m.failure]


@pytest.mark.parametrize(
    ("joints", "names"),
    [
        (round_and_round(), []),
        (round_and_round(speed=2.8), ["tip_speed_m_s"]),
        (round_and_round(speed=0.3), ["path_m"]),
        (round_and_round(speed=0.0), ["path_m"]),
    ],
)
def test_an_arm_that_goes_on_goes_neither_faster_nor_slower_than_the_hand(joints: Array, names: list[str]) -> None:
    assert wrong("loss", seen(joints)) == names


def test_an_arm_follows_where_its_joints_go_and_not_where_its_setpoints_alone_do() -> None:
    wanted, limit = round_and_round()[:60], NUMBERS.speed_limit
    rng = np.random.default_rng(3)
    still = wanted[:1] + 1e-6 * limit * rng.standard_normal(wanted.shape)
    late = wanted - 40 * (wanted[1] - wanted[0])
    assert drill.measure.follows(wanted, late, limit)
    assert not drill.measure.follows(wanted, still, limit)
    assert not drill.measure.follows(still[:1].repeat(60, axis=0), wanted, limit)
    assert not drill.measure.follows(wanted, wanted[:20], limit)


def test_measured_joints_that_are_not_where_the_tip_is_are_found() -> None:
    assert wrong("loss", seen(round_and_round(), lies=0.5)) == ["apart_m"]


def test_an_arm_that_is_paused_in_time_and_brakes_as_its_drives_can_is_as_expected() -> None:
    found = seen(stopping(NUMBERS.command_timeout), told=BEGIN + round(1e9 * 2.0))
    assert wrong("master_silent", found) == []


@pytest.mark.parametrize(
    ("after", "braking", "told", "names"),
    [
        (0.6, 1.0, 2.0, ["travel_m", "still_s"]),
        (0.1, 0.1, 2.0, ["still_s", "braking_share"]),
        (0.1, 1.0, 2.5, ["told_s"]),
        (0.1, 1.0, None, ["told_s"]),
    ],
)
def test_an_arm_that_stops_late_or_softly_or_says_so_late_is_found(
    after: float, braking: float, told: float | None, names: list[str]
) -> None:
    told_ns = None if told is None else BEGIN + round(1e9 * told)
    found = wrong("master_silent", seen(stopping(after, braking), told=told_ns))
    assert set(names) <= set(found)
    assert found


def test_a_stop_that_comes_20_ms_late_is_found_and_one_in_the_next_tick_is_not() -> None:
    told = BEGIN + MS
    assert wrong("stop_topic", seen(stopping(DT, 1e9), told=told)) == []
    assert "still_s" in wrong("stop_topic", seen(stopping(0.02, 1e9), told=told))


def test_the_lateness_of_the_machine_is_granted_and_no_more() -> None:
    joints = stopping(NUMBERS.command_timeout + 0.03)
    told = BEGIN + round(1e9 * 2.0)
    assert wrong("master_silent", seen(joints, told=told, late=0.02)) == []
    assert "still_s" in wrong("master_silent", seen(joints, told=told, late=0.005))


def test_setpoints_beyond_a_limit_or_faster_than_a_drive_are_found_whatever_happens() -> None:
    joints = round_and_round()
    joints[1000:, 4] = ROBOT.upper[4] + 1e-6
    assert {"step_ratio", "beyond_limit"} <= set(wrong("loss", seen(joints)))


@pytest.mark.parametrize("kept", [0, 600])
@pytest.mark.parametrize("stream", ["true_cp", "measured_js"])
def test_an_arm_that_tells_no_more_where_it_is_is_found_though_its_setpoints_stand_still(
    stream: str, kept: int
) -> None:
    whole = seen(stopping(after=0.05), told=BEGIN + 50 * MS)
    heard = getattr(whole, stream)
    quiet = replace(whole, **{stream: heard.only(np.arange(len(heard)) < kept)})
    exercise = by_name("master_silent")
    assert "silent_s" in {m.name for m in judging.judge(exercise, quiet, NUMBERS) if m.failure}
    assert "silent_s" not in {m.name for m in judging.judge(exercise, whole, NUMBERS) if m.failure}


def test_a_fault_that_nobody_warns_of_is_found() -> None:
    assert "warned_s" in wrong("teleport", seen(round_and_round()))
    assert "warned_s" not in wrong("teleport", seen(round_and_round(), warned=BEGIN + 900 * MS))


@pytest.mark.parametrize("share", [1.0, 0.1])
def test_the_deceleration_is_read_off_the_last_steps(share: float) -> None:
    found = drill.measure.ramp(trace(stopping(0.1, share)), NUMBERS.braking, DT)
    assert found == pytest.approx(share, rel=1e-6)


def test_a_joint_that_creeps_after_its_reference_and_stops_at_once_is_no_ramp() -> None:
    creeping = np.cumsum(1e-4 * 0.99 ** np.arange(500))
    places = np.concatenate((creeping, np.full(100, creeping[-1])))[:, None]
    assert math.isnan(drill.measure.ramp(trace(places), np.array([50.0]), DT))


@pytest.mark.parametrize("recorded", [[], [5, 6, 9], [5, 5, 6, 9, 9, 9]])
def test_messages_that_are_not_recorded_are_counted_one_by_one(tmp_path: Path, recorded: list[int]) -> None:
    """Against a recording made by the writer itself; a stamp that comes again counts again."""
    heard = np.array([5, 5, 6, 7, 9, 9])
    names = ROBOT.joint_names
    with BagWriter(tmp_path / "bag", (SLAVE_SETPOINT_JS, SLAVE_TRUE_CP), names) as writer:
        stamps = np.array(recorded, np.int64)
        values = np.zeros((len(stamps), ROBOT.n))
        if len(stamps):
            writer.write_block({SLAVE_SETPOINT_JS: (stamps, values, stamps)})
        pose = np.array([[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0]])
        writer.write_block({SLAVE_TRUE_CP: (np.array([5]), pose, np.array([5]))})
    found = missing(reader.Bag(tmp_path / "bag"), SLAVE_SETPOINT_JS.name, (heard * 10, heard))
    left = list(recorded)
    expected = []
    for stamp in heard:
        left.remove(stamp) if stamp in left else expected.append(stamp * 10)
    assert sorted(found) == sorted(expected)


@pytest.mark.parametrize(("before", "losses"), [(1, (0.0, 0.001)), (20, (0.001, 0.0))])
def test_what_was_on_its_way_as_a_fault_began_is_lost_by_that_fault(
    tmp_path: Path, before: int, losses: tuple[float, float]
) -> None:
    """Of two faults, 100 ms apart, where one message is not recorded, sent so long before the second one [ms]."""
    sent = BEGIN + MS * np.arange(200)
    kept = np.delete(sent, 100 - before)
    with BagWriter(tmp_path / "bag", (SLAVE_SETPOINT_JS,), ROBOT.joint_names) as writer:
        writer.write_block({SLAVE_SETPOINT_JS: (kept, np.zeros((len(kept), ROBOT.n)), kept)})
    first, second = (FaultOutcome(exercise=one) for one in drill.chosen(("stop_topic", "flood"), is_composed=False))
    faults = [(BEGIN, first), (BEGIN + 100 * MS, second)]
    heard = {SLAVE_SETPOINT_JS.name: (sent, sent)}
    judge_recording(Recorded(tmp_path / "bag", faults, heard, int(sent[-1]), None), 0.001)
    assert (first.measures["lost_s"].value, second.measures["lost_s"].value) == losses


def test_every_exercise_says_what_is_expected_and_has_a_name_of_its_own_in_each_way() -> None:
    for is_composed in (False, True):
        names = [one.name for one in drill.chosen((), is_composed=is_composed)]
        assert len(names) == len(set(names))
        assert len(names) > 30
    for one in drill.EXERCISES:
        assert one.states
        assert one.cures
        assert one.motion is drill.AllowedMotion.RESTS or one.watch >= 0.0


def test_every_mutant_fits_the_source_and_names_rows_that_there_are() -> None:
    for mutant in MUTANTS:
        assert changed(mutant), mutant.name
        for is_composed in (False, True):
            rows = mutant.rows_of(is_composed=is_composed)
            assert {one.name for one in drill.chosen(rows, is_composed=is_composed)} >= set(rows), mutant.name


def test_forty_faults_of_the_past_have_a_mutant_and_a_row_of_the_page() -> None:
    """Among them are twelve that were reported of public stacks."""
    past = {one.name: one for one in every() if one.past}
    assert len(past) >= 40
    assert len(set(re.findall(r"[\w-]+ #\d+", " ".join(one.past for one in past.values())))) >= 12
    text = (ROOT / "docs/simulation.md").read_text(encoding="utf-8")
    section = text.partition("\n## Bugs of the past\n")[2].partition("\n## ")[0]
    rows = re.findall(r"^\| `(\w+)`: ([^|]*) \| ([^|]*) \| (\d+) \| ([^|]*) \|$", section, re.MULTILINE)
    assert {name: (what, where) for name, what, where, _, _ in rows} == {
        name: (one.text, one.past) for name, one in past.items()
    }
    found = [law for *_, law in rows if not law.startswith("not ")]
    assert {law.strip("`") for laws in found for law in laws.split(", ")} <= {*LAWS, "runs"}
    assert f"{len(found)} of {len(rows)} copies" in " ".join(section.split())


def test_every_code_mutant_fits_the_source_and_names_files_of_tests() -> None:
    for mutant in CODE_MUTANTS:
        assert changed(mutant), mutant.name
        assert mutant.rows, mutant.name
        for row in mutant.rows:
            file, _, test = row.partition("::")
            assert f"def {test}" in (ROOT / file).read_text(encoding="utf-8"), (mutant.name, row)


def test_the_tables_have_a_row_for_each_fault() -> None:
    found = [outcome(), outcome(measures={}), outcome(recovered=math.nan)]
    assert drill_table(found).row_count == 3
    assert len(markdown(found).splitlines()) == 5


def test_what_the_recorder_tells_that_it_lost_is_counted_by_topic_and_time(tmp_path: Path) -> None:
    second, name = 1_000_000_000, SLAVE_SETPOINT_JS.name
    with BagWriter(tmp_path / "bag", (DIAGNOSTICS,), {}) as writer:
        for at, lost in ((1, 5), (2, 5), (3, 40), (4, 40), (8, 90)):
            data = reports.report(at * second, "recorder", 1, "lost", {f"lost.{name}": str(lost)})
            writer.write(DIAGNOSTICS, at * second, data, at * second)
    told = partial(told_lost, reader.Bag(tmp_path / "bag"))
    assert told(name, 2 * second, 3 * second) == 35  # what was lost before does not count
    assert told(name, 1 * second, int(1.6 * second)) == 35  # told up to 1.5 s later
    assert told(name, 3 * second, 5 * second) == 0
    assert told(name, 0, 9 * second) == 90
    assert told(SLAVE_TRUE_CP.name, 0, 9 * second) == 0


def test_a_recording_that_is_none_is_not_intact(tmp_path: Path) -> None:
    assert not check_recording(tmp_path / "missing").is_good
    (tmp_path / "bag").mkdir()
    (tmp_path / "bag" / "bag_0.mcap").write_bytes(b"\x89MCAP0\r\n" + bytes(100))
    assert not check_recording(tmp_path / "bag").is_good
