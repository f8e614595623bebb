"""Experiments: what the sources printed comes out, misprints do not, sessions run once."""

from typing import Any, cast

import numpy as np
import pytest
from scipy.signal import dlti, dstep

from present import present
from teleop_core.base.errors import ParameterError, PartError, TeleopError, UnknownNameError
from teleop_core.hand.operators.tour import tour
from teleop_core.kernels.geometry import Array
from teleop_core.robots import load_robot
from teleop_core.session import configuration, recording
from teleop_lab import experiments
from teleop_lab.experiments import Bench, Comparison, Experiment, Findings, accuracy, points24, reference_filter
from teleop_lab.experiments.responses import response

# Experiments of formulas alone, each with what its source is known to have misprinted.
MISPRINTS = {
    "resolution": set(),
    "tendons": {"motor 6 for joint 5"},
    "poses": {"x", "z"},  # home of table 6.1
    "workspace": set(),
    "mma_frames": set(),
    "mma_balance": {"total mass"},
    "hybrid": set(),
    "parallel_robots": set(),
}


LEAST = {"workspace": 1}


@pytest.mark.parametrize("name", MISPRINTS)
def test_everything_that_was_printed_comes_out_but_what_is_misprinted_and_figures_have_numbers_and_words(
    name: str,
) -> None:
    outcome = experiments.run(name)
    assert sum(row.agrees is not None for row in outcome.rows) >= LEAST.get(name, 4)
    failed = [row for row in outcome.rows if row.agrees is False]
    assert {row.quantity for row in failed} == MISPRINTS[name]
    if name == "poses":
        assert {row.group for row in failed} == {"home, table 6.1 against the joints of table 6.2"}
    for figure in outcome.figures:
        assert figure.traces
        assert figure.title
        assert figure.sentence.endswith(".")
        for trace in figure.traces:
            assert np.isfinite(np.asarray(trace["x"], dtype=float)).any()


def test_every_experiment_is_listed_with_one_line_and_a_source() -> None:
    titles = experiments.list_experiments()
    assert {*MISPRINTS, "accuracy", "filter", "master_slave", "gravity", "points24"} <= set(titles)
    for name, title in titles.items():
        assert "\n" not in title
        assert len(title) < 100
        assert experiments.EXPERIMENTS.find(name).name == name
        assert experiments.EXPERIMENTS.find(name).source


def test_unknown_experiment_is_refused_before_any_runs() -> None:
    ran = []
    with pytest.raises(UnknownNameError) as caught:
        experiments.run_several(["resolution", "nosuch"], began=lambda *told: ran.append(told))
    assert not ran
    assert "resolution" in caught.value.alternatives


def test_several_experiments_run_in_the_order_given_each_once() -> None:
    told = []
    names = ["tendons", "resolution", "tendons"]
    outcomes = experiments.run_several(names, began=lambda *each: told.append(each))
    assert [outcome.name for outcome in outcomes] == ["tendons", "resolution"]
    assert told == [("tendons", 0, 2), ("resolution", 1, 2)]


def test_own_experiment_is_run_by_its_name() -> None:
    def measure(bench: Bench) -> Findings:
        return Findings((Comparison(quantity="seed", predicted=float(bench.seed)),))

    experiments.register_experiment("seeds", Experiment("seeds", "its seed", "me", measure))
    try:
        assert experiments.run("seeds", seed=7).row("seed").predicted == 7.0
        assert "seeds" in experiments.list_experiments()
    finally:
        experiments.EXPERIMENTS.remove("seeds")
    with pytest.raises(PartError):
        experiments.register_experiment("mine", lambda bench: None)  # type: ignore[arg-type]


# -- bench -----------------------------------------------------------------------------------------

SHORT: dict[str, Any] = {"duration": 3.0, "approach_time": 0.5, "buttons.fixture": (0.6,)}


def test_bench_runs_the_same_session_once_and_another_seed_or_setting_anew() -> None:
    bench = Bench(seed=2)
    first = bench.session("coarse_box", settings=SHORT)
    assert bench.session("coarse_box", 2, SHORT) is first
    assert bench.runs == 1
    other = bench.session("coarse_box", 3, SHORT)
    free = bench.session("coarse_box", settings={**SHORT, "gravity_compensation": "none"})
    assert bench.runs == 3
    for session in (other, free):
        measured = session["slave/measured_cp"].values
        assert not np.array_equal(measured, first["slave/measured_cp"].values)


def test_bench_of_the_same_seed_gives_the_same_bits() -> None:
    first, second = (Bench(5).session("fine_box", settings=SHORT, is_scored=is_scored) for is_scored in (True, False))
    for topic, stream in first.streams.items():
        assert np.array_equal(stream.values, second[topic].values, equal_nan=True), topic
    assert first.score.to_json() == second.score.to_json()


def test_streams_of_an_old_session_come_back_with_the_same_bits(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("teleop_lab.experiments.bench._WHOLE", 1)
    bench = Bench()
    old = bench.session("coarse_box", settings=SHORT)
    before = old["slave/measured_cp"]
    bench.session("coarse_box", 9, SHORT)
    again = old["slave/measured_cp"]
    assert again is not before
    assert np.array_equal(again.values, before.values)
    assert bench.runs == 2


def test_bench_refuses_a_negative_seed_and_names_topics_that_it_keeps() -> None:
    with pytest.raises(ParameterError, match="seed"):
        Bench(-1)
    session = Bench().session("coarse_box", settings=SHORT)
    with pytest.raises(UnknownNameError, match="slave/servo_jp"):
        session["slave/nosuch"]


def test_bench_settings_hold_for_sessions_and_for_moves_of_the_slave() -> None:
    bench = Bench(settings={"plant": "ideal", "controller": "pd"})
    assert bench.slave().controller.kind.kind == "pd"
    assert bench.slave({"controller": "pid"}).controller.kind.kind == "pid"


# -- accuracy --------------------------------------------------------------------------------------


def rms(values: Array) -> float:
    return float(np.sqrt(np.mean(np.square(values))))


def left(offset_mm: float) -> float:
    """Readings less what a ruler says of an arm with an offset in d3, RMS [mm]."""
    robot = load_robot("rcrt1")
    expected = [
        accuracy.readings(robot, which, accuracy.longer_d3(robot, offset_mm)) for which in accuracy.AXES.values()
    ]
    return rms(np.concatenate([w.read_mm for w in accuracy.AXES.values()]) - np.concatenate(expected))


def test_offset_of_five_and_a_half_millimetres_halves_what_the_ruler_saw() -> None:
    # Derived from the tables: 0.744 mm without it, 0.352 mm with it.
    assert left(0.0) == pytest.approx(0.744, abs=5e-4)
    assert left(5.5) == pytest.approx(0.352, abs=1e-3)
    offsets = np.arange(3.0, 8.01, 0.25)
    best = offsets[np.argmin([left(offset) for offset in offsets])]
    assert abs(best - 5.5) <= 0.25


@pytest.mark.parametrize("name", accuracy.AXES)
def test_arm_without_errors_moves_as_asked(name: str) -> None:
    robot = load_robot("rcrt1")
    exact = accuracy.readings(robot, accuracy.AXES[name], accuracy.longer_d3(robot, 0.0))
    assert np.abs(accuracy.moved(exact, accuracy.AXES[name].escape_mm) - accuracy.DESIRED_MM).max() < 1e-9


def published_errors(which: accuracy.Axis) -> Array:
    """Desired less measured (10,), of the ruler's readings [mm]."""
    return accuracy.DESIRED_MM - accuracy.moved(np.array(which.read_mm), which.escape_mm)


@pytest.mark.parametrize("name", accuracy.AXES)
def test_readings_have_the_printed_statistics_and_are_steps_of_the_ruler(name: str) -> None:
    which = accuracy.AXES[name]
    error = published_errors(which)
    # Printed to 0.01 mm, of y from ways that were rounded so too.
    assert rms(error) == pytest.approx(which.rms, abs=6e-3)
    assert np.std(error, ddof=1) == pytest.approx(which.deviation, abs=6e-3)
    assert np.abs(error).max() == pytest.approx(which.largest, abs=6e-3)
    assert np.array_equal(accuracy.as_read(np.array(which.read_mm), which.step_mm), which.read_mm)


def test_errors_of_the_accuracy_test_are_those_that_its_tables_print() -> None:
    assert accuracy.AXES["y"].error_mm[0] == 0.39
    assert [accuracy.AXES["y"].error_mm[k] for k in (5, 9)] == [-1.03, -1.15]
    for which in accuracy.AXES.values():  # within the rounding of their own readings
        assert np.abs(which.error_mm - published_errors(which)).max() < 0.012


# -- filter ----------------------------------------------------------------------------------------


def test_step_and_gain_of_the_filter_are_scipys_of_the_printed_transfer_function() -> None:
    # Forward Euler of 0.1 (s + 100)/(s + 10) at 1 ms, sign corrected.
    system = dlti([0.1, -0.09], [1.0, -0.99], dt=1e-3)
    _, (expected,) = dstep(system, n=500)
    assert np.abs(reference_filter.step_response(500) - expected[:, 0]).max() < 1e-12
    frequency = np.array([0.1, 1.0, 10.0, 50.0, 400.0])
    _, response = system.freqresp(2.0 * np.pi * frequency * 1e-3)
    assert np.allclose(reference_filter.gain_at(frequency), np.abs(response), rtol=1e-12)


# -- points ----------------------------------------------------------------------------------------


class Perfect:
    """A session whose tip is where the points are, or off by a known way."""

    def __init__(self, off_mm: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> None:
        made = configuration.configure("points24").group("operator")
        self.p, self.center = made.kind.parameters, np.array(made.center)
        self.approach = made.approach_time
        self.time = np.arange(0.0, 50.0, 1e-2)
        hand = self.center + tour(self.p, np.maximum(self.time - self.approach, 0.0))
        axes = np.array([[0, 0, -1], [-1, 0, 0], [0, 1, 0]])  # x = -z, y = -x, z = y of the master
        self.start = np.array([0.25, -0.2, -0.06])
        self.path = 1e3 * (self.start + hand @ axes.T) + off_mm
        self.path[0] = 1e3 * self.start
        self.is_followed = np.ones(len(self.time), bool)

    def places_mm(self, topic: str) -> Array:
        return self.path

    def __getitem__(self, topic: str) -> recording.Stream:
        ns = np.round(self.time * 1e9).astype(np.int64)
        return recording.Stream(topic, ("x", "y", "z"), ns, ns, self.path * 1e-3, 0)

    def visits(self) -> points24.Visits:
        return points24.visits_of(cast(Any, self), self.p, self.center, self.approach)


def test_tip_that_is_where_the_points_are_misses_none() -> None:
    visits = Perfect().visits()
    assert visits.off_mm.max() < 1e-9
    # Between samples of the line, 10 ms apart.
    assert visits.line_mm.max() < 0.05


def test_tip_that_is_off_misses_by_as_much_in_the_plane_of_the_board() -> None:
    visits = Perfect((0.3, 0.4, 7.0)).visits()
    assert np.allclose(visits.off_mm, 0.5, atol=1e-9)
    assert np.allclose(visits.missed_mm, (0.3, 0.4, 7.0), atol=1e-9)


def test_session_that_is_over_before_its_tour_is_told() -> None:
    bench = Bench(settings={"duration": 12.0})
    with pytest.raises(TeleopError, match="give it more time"):
        experiments.run("points24", bench=bench)


# -- responses -------------------------------------------------------------------------------------


def test_move_ends_at_its_target_and_begins_at_home() -> None:
    robot = load_robot("rcrt1")
    target = np.array([0.3, 1.9, 0.40, 0.4, 0.5, -0.3])
    found = response(Bench(settings={"plant": "ideal", "controller": "pid"}).slave(), target)
    assert np.abs(found.reference[0] - robot.home).max() < 1e-5
    assert np.abs(found.reference[-1] - target).max() < 1e-5
    # The ideal plant under integral action rests within an encoder count or two.
    assert (np.abs(found.measured[-1] - target) < 2.5 * present(robot.drives).encoder_step).all()
    assert np.allclose(found.reached_mm[-1], 1e3 * robot.fk(found.measured[-1])[:3, 3], atol=1e-9)


def test_friction_that_sticks_keeps_the_tip_off_where_the_ideal_arm_rests() -> None:
    target = np.array([0.3, 1.9, 0.40, 0.4, 0.5, -0.3])
    off = {
        plant: np.linalg.norm(
            response(Bench(settings={"plant": plant, "controller": "source_pid"}).slave(), target).error_mm[-1]
        )
        for plant in ("ideal", "hardware")
    }
    assert off["hardware"] > 0.05
    assert off["hardware"] > 3.0 * off["ideal"]
