"""Tremor filters: what trembles goes, what is meant stays, and nothing jumps, rings or is lost."""

import math
from collections.abc import Callable, Mapping
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.linalg import block_diag, expm, solve_discrete_are
from scipy.signal import butter, freqz, iirnotch, sosfreqz

import teleop_core as tc
from forgotten_parts import own_parts  # noqa: F401
from present import present
from teleop_core.base import NoParameters, ParameterError, PartError, build
from teleop_core.coupling.filters import LONGEST_NS, MEMORY, TREMOR_FILTERS, tremor_filter
from teleop_core.coupling.filters.wflc import RATE
from teleop_core.coupling.mapping import gains, motion_scaling
from teleop_core.evaluation.metrics.tremor_filter import passage
from teleop_core.evaluation.motion_measures import RATE as SAMPLED
from teleop_core.evaluation.motion_measures import tremor_power, velocities
from teleop_core.graph import build_graph, topics
from teleop_core.kernels import Array, kernel
from teleop_core.session import configuration, virtual

MS = 1_000_000
KINDS = ("notch", "band_stop", "kalman", "wflc")
periods = st.sampled_from([5e-4, 1e-3, 2e-3, 1 / 300, 0.01])


def numbers_of(kind: str, **given: float) -> Array:
    part = TREMOR_FILTERS.find(kind)
    return part.numbers(build(part.parameters, given))


def filtered(kind: str, values: Any, period: float = 1e-3, **given: float) -> tuple[Array, Array]:
    """A coordinate behind a filter that begins at its first value, and what it remembers then."""
    part, memory = TREMOR_FILTERS.find(kind), np.zeros(MEMORY)
    numbers = numbers_of(kind, **given)
    out = [part.filter(numbers, memory, float(v - values[0]), period) for v in values[1:]]
    return np.append(0.0, out) + values[0], memory


def response(kind: str, count: int, period: float, **given: float) -> Array:
    """Answer (count,) to one sample of 1 after a sample of 0."""
    values = np.zeros(count + 1)
    values[1] = 1.0
    return filtered(kind, values, period, **given)[0][1:]


def amplitude_and_delay(values: Array, times: Any, frequency: float) -> tuple[float, float]:
    """Of the line of a frequency [Hz] in a signal: its length, and its delay to a sine [s]."""
    wave = 2.0 * np.exp(-2j * np.pi * frequency * times)
    line = (values * wave).mean()
    return abs(line), -np.angle(line * 1j) / (2.0 * np.pi * frequency)


# -- the filters -----------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", KINDS)
@settings(max_examples=20, deadline=None)
@given(place=st.floats(-1.0, 1.0), period=periods)
def test_a_hand_that_rests_passes_to_the_bit(kind: str, place: float, period: float) -> None:
    out, _ = filtered(kind, np.full(200, place), period)
    assert (out == place).all()


@pytest.mark.parametrize("kind", KINDS)
def test_a_step_is_followed_to_its_end(kind: str) -> None:
    values = np.full(8000, 0.05)
    values[0] = 0.0
    out, _ = filtered(kind, values)
    assert out[-1] == pytest.approx(0.05, abs=1e-10)


def exact(kind: str, given: dict[str, float], frequencies: Array, period: float) -> NDArray[np.complex128]:
    """What scipy says of a filter at some frequencies [Hz]."""
    rate = 1.0 / period
    if kind == "notch":
        design = iirnotch(given["frequency"], given["quality"], rate)
        return freqz(*design, frequencies, fs=rate)[1]
    edges = given["low"], given["high"]
    return sosfreqz(butter(2, edges, "bandstop", output="sos", fs=rate), frequencies, fs=rate)[1]


def measured(kind: str, given: dict[str, float], frequencies: Array, period: float) -> Any:
    """The same of ours, from its answer to a single sample."""
    answer = response(kind, round(6.0 / period), period, **given)
    times = period * np.arange(len(answer))
    return np.exp(-2j * np.pi * np.outer(frequencies, times)) @ answer


@pytest.mark.parametrize("period", [1e-3, 1 / 300, 0.01])
@pytest.mark.parametrize(
    ("kind", "given"),
    [
        ("notch", {"frequency": 10.0, "quality": 1.0}),
        ("notch", {"frequency": 8.5, "quality": 3.0}),
        ("band_stop", {"low": 8.0, "high": 12.0}),
        ("band_stop", {"low": 5.0, "high": 15.0}),
    ],
)
def test_the_frequency_response_is_that_of_scipy(kind: str, given: dict[str, float], period: float) -> None:
    frequencies = np.array([0.1, 0.5, 1.0, 2.0, 5.0, 7.9, 9.8, 10.0, 12.5, 20.0, 40.0])
    expected = exact(kind, given, frequencies, period)
    np.testing.assert_allclose(measured(kind, given, frequencies, period), expected, atol=1e-9)


def steady_gain(numbers: Array, period: float) -> Array:
    """Gain (4,) of the filter that is optimal for ever, by scipy."""
    q, spread = numbers[0] ** 2, numbers[1] ** 2 / period
    rate, damping, tremor = 2.0 * np.pi * numbers[2], 2.0 * np.pi * numbers[3], numbers[4] ** 2
    square = rate**2 + damping**2
    swing = np.array([[0.0, 1.0], [-square, -2.0 * damping]])
    moves = block_diag([[0.0, 1.0], [0.0, 0.0]], swing)
    # Van Loan 1978: what white noise adds within a period.
    pushed = np.diag([0.0, q, 0.0, 4.0 * damping * square * tremor])
    both = expm(period * np.block([[-moves, pushed], [np.zeros((4, 4)), moves.T]]))
    transition = both[4:, 4:].T
    noise = transition @ both[:4, 4:]
    # In units in which all are of one size.
    unit, seen = np.diag([1e5, 1e3, 1e5, 1e3]), np.array([[1.0, 0.0, 1.0, 0.0]])
    back = np.linalg.inv(unit)
    covariance = solve_discrete_are(
        back @ transition.T @ unit, 1e5 * back @ seen.T, unit @ noise @ unit, np.array([[1e10 * spread]])
    )
    predicted = back @ covariance @ back
    shared = predicted @ seen[0]
    return shared / (seen[0] @ shared + spread)


@pytest.mark.parametrize("period", [1e-3, 0.01])
@pytest.mark.parametrize("given", [{}, {"acceleration_noise": 1.0, "reading_noise": 1e-4}])
def test_the_gain_of_the_kalman_filter_becomes_that_of_the_riccati_equation(
    given: dict[str, float], period: float
) -> None:
    numbers = numbers_of("kalman", **given)
    values = np.zeros(round(8.0 / period))
    _, memory = filtered("kalman", values, period, **given)
    part = TREMOR_FILTERS.find("kalman")
    before = memory[:4].copy()
    part.filter(numbers, memory, 1.0, period)
    gain = memory[:4] - before
    expected = steady_gain(numbers, period)
    np.testing.assert_allclose(gain, expected, rtol=1e-5, atol=1e-6 * abs(expected).max())


def test_the_kalman_filter_follows_a_hand_that_begins_at_speed_at_once() -> None:
    times = np.arange(500) * 1e-3
    out, _ = filtered("kalman", 0.2 * times)
    assert np.abs(out - 0.2 * times).max() < 2e-4
    assert np.abs(out - 0.2 * times)[100:].max() < 1e-6


def cosine_filter(kind: str) -> Callable[[float, float], tuple[float, float]]:
    """Response of a filter at some frequencies [Hz]: measured, for the one that learns too."""
    times = 1e-3 * np.arange(40_000)

    def at(frequency: float, size: float) -> tuple[float, float]:
        out, _ = filtered(kind, size * np.sin(2.0 * np.pi * frequency * times))
        return amplitude_and_delay(out[20_000:], times[20_000:], frequency)

    return at


LEFT = {"notch": 0.01, "band_stop": 0.02, "kalman": 0.34, "wflc": 0.01}
"""Most that is left of 10 Hz."""
DELAY_MS = {"notch": 15.9, "band_stop": 9.4, "kalman": 0.0, "wflc": 0.3}
"""Delay of 0.5 Hz."""


@pytest.mark.parametrize("kind", KINDS)
def test_a_tremor_of_10_hz_is_taken_out_as_far_as_stated(kind: str) -> None:
    left, _ = cosine_filter(kind)(10.0, 1e-4)
    assert left <= 1e-4 * LEFT[kind]


@pytest.mark.parametrize("kind", KINDS)
def test_slow_motion_passes_as_large_as_it_is_with_the_delay_stated(kind: str) -> None:
    size, delay = cosine_filter(kind)(0.5, 0.02)
    assert size == pytest.approx(0.02, rel=0.02)
    assert 1e3 * delay == pytest.approx(DELAY_MS[kind], abs=0.3)


@pytest.mark.parametrize("frequency", [8.2, 9.0, 10.0, 11.0, 11.8])
@pytest.mark.parametrize("period", [1e-3, 0.005])
def test_the_learning_filter_finds_a_tremor_of_any_frequency_in_its_band_and_subtracts_it(
    frequency: float, period: float
) -> None:
    times = period * np.arange(round(20.0 / period))
    out, memory = filtered("wflc", 1e-4 * np.sin(2.0 * np.pi * frequency * times), period)
    assert 10.0 + memory[RATE] / (2.0 * np.pi) == pytest.approx(frequency, abs=0.05)
    assert np.abs(out[-round(2.0 / period) :]).max() < 2e-6


@pytest.mark.parametrize(("frequency", "within"), [(1.0, 0.01), (2.0, 0.025), (6.0, 0.05)])
def test_the_learning_filter_lets_a_steady_motion_beside_its_band_pass_as_large_as_it_is(
    frequency: float, within: float
) -> None:
    size, _ = cosine_filter("wflc")(frequency, 1e-3)
    assert size == pytest.approx(1e-3, rel=within)


def test_the_learning_filter_subtracts_a_tremor_whose_frequency_changes() -> None:
    times = 1e-3 * np.arange(30_000)
    phase = 2.0 * np.pi * (9.0 * times + 0.5 * 0.1 * times**2)  # from 9 to 12 Hz
    out, _ = filtered("wflc", 1e-4 * np.sin(phase))
    kept, _ = filtered("wflc", 1e-4 * np.sin(phase), frequency_rate=0.0, frequency=9.0)
    assert out[-5000:].std() < 0.5 * kept[-5000:].std()
    assert out[10_000:].std() < 0.4 * 1e-4 * math.sqrt(0.5)


# -- the stage -------------------------------------------------------------------------------------


def stage(kind: str = "band_stop", **given: object) -> tremor_filter.RunningTremorFilter:
    """The stage at work; double underscores in names stand for dots."""
    named = {name.replace("__", "."): value for name, value in given.items()}
    return tremor_filter.RunningTremorFilter(build(tremor_filter.TremorFilterParameters, {"kind": kind, **named}))


def through(runner: tremor_filter.RunningTremorFilter, places: Any, period_ns: int = MS, first_ns: int = MS) -> Array:
    """Filtered places (N, 3) of a master that is at places (N, 3), sample by sample."""
    row, found = runner.signals, []
    for i, place in enumerate(places):
        row["master_measured_cp"][:3] = place
        row["master_measured_cp_ns"] = first_ns + i * period_ns
        runner.step()
        found.append(row["master_filtered_cp"][:3].copy())
    return np.array(found)


def hand(count: int, period: float = 1e-3, seed: int = 1) -> Array:
    """Places (count, 3) [m] of a hand that moves and trembles."""
    times, rng = period * np.arange(count), np.random.default_rng(seed)
    phases = rng.uniform(0.0, 6.0, (2, 3))
    meant = 0.02 * np.sin(2.0 * np.pi * 0.6 * times[:, None] + phases[0])
    return meant + 1e-4 * np.sin(2.0 * np.pi * 9.7 * times[:, None] + phases[1])


@pytest.mark.parametrize("kind", KINDS)
def test_each_coordinate_is_filtered_by_itself_from_its_first_reading_on(kind: str) -> None:
    places = hand(2000)
    out = through(stage(kind), places)
    for axis in range(3):
        alone, _ = filtered(kind, places[:, axis])
        np.testing.assert_allclose(out[:, axis], alone, atol=1e-12)
    assert (out[0] == places[0]).all()
    moved = through(stage(kind), places + 0.3)
    np.testing.assert_allclose(moved, out + 0.3, atol=1e-9)


def test_the_orientation_passes() -> None:
    runner = stage()
    row, rng = runner.signals, np.random.default_rng(3)
    for tick in range(1, 50):
        turn = np.array([1.0, *rng.normal(0.0, 1e-3, 3)])
        row["master_measured_cp"][3:] = turn / math.sqrt((turn * turn).sum())
        row["master_measured_cp_ns"] = tick * MS
        runner.step()
        assert (row["master_filtered_cp"][3:] == row["master_measured_cp"][3:]).all()


@pytest.mark.parametrize("kind", KINDS)
def test_samples_of_any_period_are_filtered_alike(kind: str) -> None:
    often, seldom = hand(6000), hand(1200, 0.005)
    fine, coarse = through(stage(kind), often), through(stage(kind), seldom, 5 * MS)
    assert np.abs(coarse - fine[::5])[600:].max() < 5e-5


@pytest.mark.parametrize("kind", KINDS)
def test_a_longer_period_is_split_on_a_straight_line(kind: str) -> None:
    assert LONGEST_NS == 10 * MS
    places = hand(100, 0.04)
    split = [places[0]]
    for before, after in pairwise(places):
        split += [before + (after - before) * k / 4 for k in range(1, 5)]
    out = through(stage(kind), places, 40 * MS)
    np.testing.assert_allclose(out, through(stage(kind), split, 10 * MS)[::4], atol=1e-12)
    assert np.isfinite(out).all()


@pytest.mark.parametrize("kind", KINDS)
def test_a_pause_begins_anew_at_the_reading_and_a_shorter_one_does_not(kind: str) -> None:
    places, runner = hand(2000), stage(kind)
    through(runner, places)
    after = through(runner, places[:500] + 0.01, first_ns=2301 * MS)
    fresh = through(stage(kind), places[:500] + 0.01)
    np.testing.assert_array_equal(after, fresh)
    assert runner.state["begun"] == 2
    through(runner, places[500:510] + 0.01, first_ns=(2301 + 499 + 200) * MS)
    assert runner.state["begun"] == 2


@pytest.mark.parametrize("kind", KINDS)
@settings(max_examples=15, deadline=None)
@given(far=st.floats(0.004, 0.5), ticks=st.integers(1, 40))
def test_a_teleport_passes_as_it_is_and_nothing_rings_after_it(kind: str, far: float, ticks: int) -> None:
    """There and back: each jump is that of the readings, and each beginning a fresh one."""
    places = np.zeros((300, 3))
    places[100 : 100 + ticks, 1] = far
    runner = stage(kind)
    out = through(runner, places)
    np.testing.assert_array_equal(out, places)
    assert runner.state["begun"] == 3 if ticks > 1 else runner.state["begun"] >= 3
    assert runner.concerns() == [
        f"restarted at {int(runner.state['implausible'])} samples of the master that are implausible for a hand"
    ]
    assert runner.concerns() == []


def commands(runner: tremor_filter.RunningTremorFilter, places: Array) -> Array:
    """What the mapping commands (N, 3) behind a filter, with a slave that is where it is led."""
    scaling = motion_scaling.MOTION_SCALING.run(gains.MotionScalingParameters())
    row, found = scaling.signals, []
    row["slave_setpoint_cp"] = [0.3, 0.0, 0.2, 1.0, 0.0, 0.0, 0.0]
    for i, place in enumerate(places):
        now_ns = (1000 + i) * MS
        row["master_measured_cp"][:3] = through(runner, [place], first_ns=now_ns)[0]
        for name in ("now_ns", "master_measured_cp_ns", "master_buttons_ns"):
            row[name] = now_ns
        scaling.step()
        row["slave_setpoint_cp"] = row["slave_servo_cp"]
        row["slave_setpoint_cp_ns"] = now_ns
        found.append(row["slave_servo_cp"][:3].copy())
    return np.array(found)


@pytest.mark.parametrize("kind", KINDS)
def test_a_teleport_of_a_hand_that_moves_shifts_the_command_by_no_more_than_its_lag(kind: str) -> None:
    """The slave goes on as if nothing had been, from where it is."""
    places = hand(2000)
    thrown = places.copy()
    thrown[1000:] += [0.2, 0.0, 0.1]
    calm, found = commands(stage(kind), places), commands(stage(kind), thrown)
    assert np.abs(np.diff(found, axis=0)).max() < 1e-4
    assert np.abs(found - calm).max() < 2e-3


@pytest.mark.parametrize("kind", KINDS)
@settings(max_examples=30, deadline=None)
@given(
    places=st.lists(st.tuples(*[st.floats()] * 3), min_size=1, max_size=20),
    period_ns=st.sampled_from([0, -MS, MS, 40 * MS, 2**40]),
)
def test_wild_samples_at_any_times_leave_numbers_and_no_trace(
    kind: str, places: list[tuple[float, float, float]], period_ns: int
) -> None:
    runner = stage(kind)
    assert np.isfinite(through(runner, places, period_ns, 2**50)).all()
    runner.reset()
    np.testing.assert_array_equal(through(runner, hand(50)), through(stage(kind), hand(50)))


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("bad", [math.nan, -math.inf])
def test_what_is_not_finite_never_comes_out_and_changes_nothing(kind: str, bad: float) -> None:
    places = hand(600)
    broken = places.copy()
    broken[300, 1] = bad
    broken[400:403] = bad
    out, clean = through(stage(kind), broken), through(stage(kind), places)
    assert np.isfinite(out).all()
    assert (out[300] == out[299]).all()
    assert (out[:300] == clean[:300]).all()
    assert np.abs(out - clean)[301:].max() < 3e-4
    first = through(stage(kind), np.array([[bad, 0, 0], [0.1, 0.2, 0.3]]))
    assert first.tolist() == [[0, 0, 0], [0.1, 0.2, 0.3]]


def test_a_reading_of_the_same_stamp_changes_nothing_and_an_older_one_begins_anew() -> None:
    runner, places = stage(), hand(500)
    before = through(runner, places)[-1]
    again = through(runner, places[-1:] + 1e-3, first_ns=500 * MS)
    assert (again[0] == before).all()
    back = through(runner, places[:1], first_ns=100 * MS)
    assert (back[0] == places[0]).all()


@pytest.mark.parametrize("other", [{"kind": "notch", "notch.quality": 3.0}, {"kind": "kalman"}])
def test_new_parameters_take_over_without_a_jump_and_then_act_alone(other: Mapping[str, str | float]) -> None:
    runner, places = stage("notch"), hand(4000)
    out = [through(runner, places[:500])]
    runner.retune(build(tremor_filter.TremorFilterParameters, {"kind": "notch"}))
    out.append(through(runner, places[500:1000], first_ns=501 * MS))
    np.testing.assert_array_equal(np.concatenate(out), through(stage("notch"), places[:1000]))  # the same again
    runner.retune(build(tremor_filter.TremorFilterParameters, other))
    out.append(through(runner, places[1000:], first_ns=1001 * MS))
    joined = np.concatenate(out)
    assert np.abs(np.diff(joined, axis=0)).max() < 1.5e-4
    fresh = tremor_filter.RunningTremorFilter(build(tremor_filter.TremorFilterParameters, other))
    np.testing.assert_allclose(joined[3000:], through(fresh, places)[3000:], atol=2e-6)


# -- in a session ----------------------------------------------------------------------------------


def test_the_mapping_reads_the_filtered_stylus_and_the_operator_the_stylus_itself() -> None:
    assert tremor_filter.TREMOR_FILTER.name not in {stage.name for stage in build_graph().stages}  # unless asked for
    graph = build_graph(stages=["tremor_filter"])
    at_port = {link.reader.name: link.topic.name for link in graph.links if link.port.name == "master/measured_cp"}
    assert at_port == {
        "operator": "master/measured_cp",
        "tremor_filter": "master/measured_cp",
        "motion_scaling": "master/filtered_cp",
    }
    assert not graph.notes
    way = [name for name, _ in graph.chain()]
    assert way[:3] == ["haptic_master", "tremor_filter", "motion_scaling"]


@pytest.mark.parametrize(("frequency", "period"), [(3.0, 1e-3), (15.0, 6e-3), (15.0, 0.01), (25.0, 8e-3)])
def test_the_widest_notch_that_is_taken_comes_to_rest_at_any_period(frequency: float, period: float) -> None:
    least = max(0.3, frequency * 1e-9 * LONGEST_NS / 0.45)
    with pytest.raises(ParameterError, match="quality"):
        build(TREMOR_FILTERS.find("notch").parameters, {"frequency": frequency, "quality": 0.99 * least})
    answer = response("notch", 4000, period, frequency=frequency, quality=1.0001 * least)
    assert np.abs(answer).max() < 3.0
    assert np.abs(answer[-100:]).max() < 1e-9


def session(*given: str, scenario: str = "human") -> virtual.VirtualTime:
    return virtual.VirtualTime(configuration.configure(scenario, settings=["teleop.stages=[tremor_filter]", *given]))


@pytest.fixture(scope="module")
def humans() -> dict[str, tc.Recording]:
    """Sessions of a hand that trembles, by filter."""
    return {
        kind: tc.run("human", duration=20.0, stages=["tremor_filter"], settings={"tremor_filter.kind": kind})
        for kind in KINDS
    }


def places_of(recording: tc.Recording, name: str) -> Array:
    """Places of a stream (12 000, 3) [m], sample by sample, after the approach."""
    return recording[name].values[-12_000:, :3]


@pytest.mark.parametrize("kind", KINDS)
def test_the_slave_trembles_less(kind: str, humans: dict[str, tc.Recording]) -> None:
    streams = (places_of(humans[kind], f"master/{name}_cp") for name in ("measured", "filtered"))
    trembling, calm = (tremor_power(places[::5], 200.0) for places in streams)
    assert calm < (0.6 if kind == "wflc" else 0.4) * trembling


def test_the_filter_that_is_the_default_leads_the_slave_nearer_to_what_the_hand_means(
    humans: dict[str, tc.Recording],
) -> None:
    """Against intention: others are late, which costs more than tremor does."""
    assert tremor_filter.TremorFilterParameters().kind.kind == "wflc"
    off = {}
    for kind, found in humans.items():
        score = found.score()
        before, after = (present(score.value(f"tremor_filter.intention_{name}_um")) for name in ("before", "after"))
        measured, tremor = places_of(found, "master/measured_cp"), places_of(found, "hand/tremor")
        rms = [
            1e6 * float(np.sqrt(((places - measured + tremor) ** 2).sum(axis=1).mean()))
            for places in (measured, places_of(found, "master/filtered_cp"))
        ]
        assert (before, after) == pytest.approx(rms, rel=0.1)
        off[kind] = after / before
    assert off["wflc"] < 0.95
    assert off["kalman"] < 0.8
    assert min(off["band_stop"], off["notch"]) > 2.0


def touches(scenario: str, seconds: float, *given: Any) -> Any:
    """Energies of the contacts of a session: shares given back."""
    rows = session(*given, scenario=scenario).run(round(1000 * seconds))
    contact = rows["master_contact"]
    taken, returned = (contact[:, topics.MASTER_CONTACT.columns.index(n)] for n in ("taken", "returned"))
    ends = np.flatnonzero(np.diff(contact[:, 0], append=-1.0))
    counts = taken[ends] > 1e-6
    return returned[ends][counts] / taken[ends][counts]


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_a_wall_gives_back_no_more_than_it_took_whatever_filters_the_slave(kind: str) -> None:
    shares = touches("fine_box", 30.0, f"tremor_filter.kind={kind}")
    assert len(shares) >= 5
    assert shares.max() < 1.0


@pytest.mark.slow
def test_a_tank_pays_by_the_way_of_the_stylus_itself() -> None:
    tissue = ("world.material=silicone", "reflection.passivity=tank")
    shares = touches("palpation", 24.0, *tissue)
    assert len(shares) >= 2
    assert shares.max() < 1.06  # a tank that goes by the filtered stylus gives back 3.8


def test_a_filter_of_ones_own_is_one_call_and_a_wrong_one_is_refused(own_parts: None) -> None:  # noqa: F811
    @kernel
    def half(numbers: Any, memory: Any, value: Any, period: Any) -> Any:
        memory[0] += 0.5 * (value - memory[0])
        return memory[0]

    tc.register_tremor_filter(tc.TremorFilter("half", NoParameters, half))
    out = through(stage("half"), np.array([[0, 0, 0], [1e-4, 0, 0], [1e-4, 0, 0]]))
    np.testing.assert_allclose(out[:, 0], [0.0, 0.5e-4, 0.75e-4])
    wrong = {
        "not finite": lambda n, m, v, t: math.nan if v else 0.0,
        "not at rest": lambda n, m, v, t: v + 1.0,
        "raises": lambda n, m, v, t: {}["none"],  # type: ignore[index]
        "writes": lambda n, m, v, t: m[40],
    }
    for name, broken in wrong.items():
        with pytest.raises(PartError):
            tc.register_tremor_filter(tc.TremorFilter(name.replace(" ", "_"), NoParameters, broken))


def test_a_filter_of_ones_own_that_runs_away_begins_anew(own_parts: None) -> None:  # noqa: F811
    def runs_away(numbers: Array, memory: Array, value: float, period: float) -> float:
        memory[0] += 1.0
        return math.inf if memory[0] > 100.0 else value

    tc.register_tremor_filter(tc.TremorFilter("runs_away", NoParameters, runs_away))
    places = hand(400)
    np.testing.assert_allclose(through(stage("runs_away"), places), places, atol=1e-15)


# -- the score -------------------------------------------------------------------------------------


@pytest.mark.parametrize(("delay", "gain"), [(-0.02, 1.0), (0.0, 0.9), (0.0123, 1.0), (0.08, 1.1)])
def test_the_score_finds_a_delay_and_a_gain(delay: float, gain: float) -> None:
    rng = np.random.default_rng(6)
    rates, phases = rng.uniform(0.5, 12.0, 40), rng.uniform(0.0, 6.0, (40, 3))
    times = np.arange(2000) / SAMPLED

    def at(moments: Array) -> Array:
        return np.sin(moments[:, None, None] * rates[:, None] + phases).sum(axis=1)

    found = passage(velocities(at(times)), gain * velocities(at(times - delay)))
    assert found == pytest.approx((delay, gain), abs=1e-3)


def test_without_motion_there_is_no_delay() -> None:
    assert passage(np.zeros((600, 3)), np.zeros((600, 3))) is None
    assert passage(np.ones((20, 3)), np.ones((20, 3))) is None


def test_the_score_says_what_the_stage_did_and_nothing_without_it(humans: dict[str, tc.Recording]) -> None:
    score = humans["band_stop"].score()
    assert 40.0 < present(score.value("tremor_filter.before_um")) < 80.0
    assert 0.2 < present(score.value("tremor_filter.left_share")) < 0.5
    after = present(score.value("tremor_filter.before_um")) * present(score.value("tremor_filter.left_share"))
    assert score.value("tremor_filter.after_um") == pytest.approx(after)
    assert score.value("tremor_filter.delay_ms") == pytest.approx(9.5, abs=0.5)
    assert score.value("tremor_filter.gain") == pytest.approx(1.0, abs=0.01)
    rows = {row.label for result in score.results for row in result.rows if row.group == "tremor filter"}
    assert rows == {
        "tremor before",
        "tremor after",
        "tremor left",
        "delay below 2 Hz",
        "gain below 2 Hz",
        "stylus against intention, RMS",
        "filtered against intention, RMS",
    }
    plain = tc.run("human", duration=3.0).score()
    assert plain.value("tremor_filter.left_share") is None
    assert plain.value("tremor_filter.delay_ms") is None
