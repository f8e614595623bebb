"""Studies: named values, keys, what is run again and why, and the same numbers wherever it runs."""

import json
import os
import signal
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

import teleop_core as tc
from cluster import cluster
from patience import is_alive, wait_until
from teleop_core.graph.layers import config_folder
from teleop_lab import Study, read_study, sweep
from teleop_lab.studies import point, summary

if TYPE_CHECKING:
    import xarray

Found = tuple[Path, "xarray.Dataset"]
METRICS = ["position_error_mm.rms", "task.attempts"]


def study(**changes: Any) -> Study:
    whole = Study("point", {"display.latency": (0.0, 0.1)}, (1, 2), METRICS, {"teleop.duration": 1.0})
    return replace(whole, **changes)


@pytest.fixture(scope="module")
def found(tmp_path_factory: pytest.TempPathFactory) -> Found:
    """A study of four sessions with its store."""
    store = tmp_path_factory.mktemp("studies") / "one"
    return store, study().run(store, jobs=1)


def test_each_parameter_is_a_dimension_and_each_score_a_variable(found: Found) -> None:
    _, data = found
    assert data.sizes == {"display.latency": 2, "seed": 2}
    assert set(METRICS) < set(data.data_vars)
    assert data["position_error_mm.rms"].attrs["units"] == "mm"
    assert list(data["seed"].values) == [1, 2]


def test_a_point_has_the_numbers_of_the_same_session_alone(found: Found) -> None:
    _, data = found
    score = tc.run("point", duration=1.0, seed=2, display__latency=0.1).score()
    here = data.sel({"display.latency": 0.1, "seed": 2})
    assert float(here["position_error_mm.rms"]) == score.value("position_error_mm.rms")


def test_a_score_of_more_streams_than_it_declares_is_that_of_the_whole_session() -> None:
    metrics = ["ticks.executed", "latency_ms.total.median", "position_error_mm.rms"]
    found = study(metrics=metrics, swept={}, seeds=(1,)).run(jobs=1)
    score = tc.run("point", duration=1.0, seed=1).score()
    assert [float(found[metric].values[0]) for metric in metrics] == [score.value(metric) for metric in metrics]


def test_nothing_is_run_twice(found: Found) -> None:
    store, data = found
    explained = study().explain(store)
    assert (explained.sessions, explained.to_run) == (4, 0)
    again = study().run(store, jobs=1)
    assert again["seconds"].values.tolist() == data["seconds"].values.tolist()


def test_what_is_missing_failed_or_changed_is_run_and_named(found: Found, tmp_path: Path) -> None:
    store, _ = found
    kept = study().store(store)
    points = study().points()
    one = kept.result(points[0])
    assert one is not None
    for change, reason in (
        (replace(one, error="broken"), "failed"),
        (replace(one, key=replace(one.key, code="older")), "changed code"),
        (replace(one, key=replace(one.key, recipe="other")), "changed parameters"),
    ):
        kept._results[one.name] = change  # as a file from before would be
        assert kept.reason(points[0]) == reason
    assert study().store(tmp_path / "new").reason(points[0]) == "missing"
    wider = study(seeds=(1, 2, 3)).explain(store)
    assert (wider.to_run, wider.why) == (2, {"missing": 2})
    longer = study(settings={"teleop.duration": 2.0}).explain(store)
    assert longer.why == {"changed parameters": 4}


def test_a_result_that_is_cut_off_counts_as_missing(found: Found, tmp_path: Path) -> None:
    store, _ = found
    file = next(store.glob("*/*.json"))
    text = file.read_text()
    file.write_text(text[: len(text) // 2])
    try:
        assert study().explain(store).why == {"missing": 1}
    finally:
        file.write_text(text)
    assert point.PointResult.from_json(text).to_json() == text


def test_a_session_that_fails_is_a_point_with_its_error(own_parts: None, tmp_path: Path) -> None:
    parts = tmp_path / "bad.py"
    parts.write_text(
        "import teleop_core as tc\n"
        "def motion(times):\n"
        "    raise ValueError('tired')\n"
        "tc.register_operator('tired', motion)\n"
    )
    data = sweep(
        None,
        metrics=["position_error_mm.rms"],
        settings={"operator.kind": ["tired", "hold"]},
        parts=[parts],
        jobs=1,
        teleop__duration=0.5,
    )
    errors = data["error"].values.ravel()
    assert "tired" in errors[0]
    assert not errors[1]
    assert np.isnan(data["position_error_mm.rms"].values.ravel()[0])


def test_a_store_of_another_study_is_refused(found: Found, tmp_path: Path) -> None:
    store, _ = found
    with pytest.raises(tc.TeleopError, match="another study"):
        study(swept={"coarse_gain": (0.5,)}).explain(store)
    (tmp_path / "thesis.txt").write_text("important")
    with pytest.raises(tc.TeleopError, match="other files"):
        study().explain(tmp_path)
    about = json.loads((store / "study.json").read_text())
    newer = tmp_path / "newer"
    newer.mkdir()
    (newer / "study.json").write_text(json.dumps(about | {"format": 99}))
    with pytest.raises(tc.TeleopError, match="newer version"):
        study().explain(newer)


def test_a_file_says_the_same_as_a_call(tmp_path: Path, found: Found) -> None:
    file = tmp_path / "delay.yaml"
    file.write_text(
        "scenario: point\nduration: 1.0\nseeds: 2\nsweep: {display.latency: [0.0, 0.1]}\n"
        f"metrics: {json.dumps(METRICS)}\n"
    )
    assert read_study(file).explain(found[0]).to_run == 0
    for text, said in (("seds: 1", "seeds"), ("sweep: {a: 1}", "a list of values"), ("[", "is not YAML")):
        file.write_text(text)
        with pytest.raises(tc.TeleopError, match=said):
            read_study(file)


def test_differences_are_by_pairs_and_intervals_hold_their_mean(found: Found) -> None:
    _, data = found
    whole = study()
    change = summary.differences(whole, data, METRICS[0])["display.latency"][0]
    late, early = (data[METRICS[0]].sel({"display.latency": v}).values for v in (0.1, 0.0))
    assert change.value == pytest.approx((late - early).mean())
    mean = summary.mean_of(np.arange(20.0))
    assert mean.low < mean.value == 9.5 < mean.high
    assert METRICS[0] in summary.study_table(whole, data)


HALVES = """
import teleop_core as tc
from teleop_core.evaluation.metric import figure
from teleop_core.graph.topics import SLAVE_SETPOINT_CP

class Halves(tc.Metric):
    "{words}"

    name, topics = "halves", (SLAVE_SETPOINT_CP,)
    share = figure("1", "of a whole")

    def add(self, window):
        self.share = {share}  # {words}

tc.register_metric(Halves)
"""


@pytest.fixture
def halves(own_parts: None, tmp_path: Path) -> Any:
    """Study of a measure of one's own, and what writes its file anew."""
    file = tmp_path / "halves.py"

    def write(share: float, words: str = "Halves.") -> None:
        file.write_text(HALVES.format(share=share, words=words))

    write(0.5)
    return lambda: study(swept={}, metrics=["halves.share"], parts=(file,)), write


def test_a_measure_of_ones_own_that_was_changed_is_measured_again(halves: Any, tmp_path: Path) -> None:
    made, write = halves
    store = tmp_path / "store"
    first = made().run(store, jobs=1)
    assert set(first["error"].values.ravel()) == {""}
    assert set(first["halves.share"].values.ravel()) == {0.5}
    write(0.5, "Other words for the same.")
    assert made().explain(store).to_run == 0
    write(0.25)
    assert made().explain(store).why == {"changed code": 2}
    assert set(made().run(store, jobs=1)["halves.share"].values.ravel()) == {0.25}
    write(0.125)
    assert set(made().run(store, jobs=2)["halves.share"].values.ravel()) == {0.125}


@pytest.mark.slow
def test_processes_of_a_study_end_when_it_is_killed(tmp_path: Path) -> None:
    script = tmp_path / "long.py"
    script.write_text(_KILLED.format(folder=str(Path(__file__).parent)).replace("study()", "study(seeds=range(99))"))
    whole = subprocess.Popen([sys.executable, script, tmp_path / "store"])
    wait_until(lambda: len(list(tmp_path.glob("store/*/*.json"))) > 1, "its first results", 120)
    processes = [int(pid) for pid in Path(f"/proc/{whole.pid}/task/{whole.pid}/children").read_text().split()]
    assert len(processes) >= 2
    whole.kill()
    whole.wait()
    wait_until(lambda: not any(map(is_alive, processes)), "their end", 60)


@pytest.mark.slow
def test_a_program_that_each_process_would_run_again_is_told_so_in_a_line(tmp_path: Path) -> None:
    script = tmp_path / "plain.py"
    script.write_text(
        _KILLED.format(folder=str(Path(__file__).parent)).replace('if __name__ == "__main__":', "if True:")
    )
    done = subprocess.run([sys.executable, script, tmp_path / "store"], capture_output=True, text=True, check=False)
    assert done.returncode == 1
    assert done.stderr.count("Traceback") == 1
    assert done.stderr.splitlines()[-1].endswith("call the study below `if __name__ == '__main__':`, in a file")


_KILLED = """
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any
sys.path[:0] = [{folder!r}, {folder!r} + "/../support"]
from test_studies import study
if __name__ == "__main__":
    study().run(Path(sys.argv[1]), jobs=2)
"""


@pytest.mark.slow
def test_a_study_that_is_killed_goes_on_to_the_same_bits(found: Found, tmp_path: Path) -> None:
    _, data = found
    script, store = tmp_path / "killed.py", tmp_path / "store"
    script.write_text(_KILLED.format(folder=str(Path(__file__).parent)))
    for _ in range(6):
        process = subprocess.Popen([sys.executable, script, store], start_new_session=True)
        count = len(list(store.glob("*/*.json")))
        while process.poll() is None and len(list(store.glob("*/*.json"))) == count:
            try:
                process.wait(0.05)
            except subprocess.TimeoutExpired:
                continue
        if process.poll() is None:
            os.killpg(process.pid, signal.SIGKILL)
        process.wait()
        if study().explain(store).to_run == 0:
            break
    again = study().run(store, jobs=1)
    for metric in METRICS:
        assert np.array_equal(again[metric].values, data[metric].values, equal_nan=True)


@pytest.mark.slow
def test_dask_workers_give_the_same_bits_with_parts_of_ones_own_and_whoever_comes_later(
    found: Found, halves: Any, tmp_path: Path
) -> None:
    _, data = found
    made, write = halves
    theirs = tmp_path / "theirs.py"
    theirs.write_text("")
    with cluster(tmp_path / "dask") as client:
        client.run(lambda: os.environ.update(TELEOP_PARTS=str(theirs)))
        again = study().run(client=client)
        for share in (0.5, 0.25):
            write(share)
            assert set(made().run(client=client)["halves.share"].values.ravel()) == {share}
        named = client.run(os.getenv, "TELEOP_PARTS").values()
        assert all(text.split(os.pathsep)[0] == str(theirs) for text in named)  # whoever runs the workers chose it
        assert any(text.count("halves.py") == 1 for text in named)
        late = next(iter(client.run(os.getpid)))

        def have_other_code() -> None:  # in here it travels as a value
            from teleop_lab.studies import point, workers

            for module in (workers, point):
                vars(module)["code_digest"] = lambda: "other"

        def progress(done: int, _: int) -> None:
            if done == 1:  # a worker with other code, that nobody asked
                client.run(have_other_code, workers=[late])

        mixed = study(seeds=tuple(range(1, 9))).run(client=client, progress=progress)
        assert set(mixed["error"].values.ravel()) == {""}
        with pytest.raises(tc.TeleopError, match="has code other, must be ours"):
            study().run(client=client)
    for metric in METRICS:
        assert np.array_equal(again[metric].values, data[metric].values, equal_nan=True)
        assert np.array_equal(mixed[metric].values[:, :2], data[metric].values, equal_nan=True)


@pytest.mark.parametrize(
    ("name", "sessions"),
    [
        ("uva", 1080 // 6), ("ten_thousand", 10_000), ("picture", 96), ("picture_gaps", 96), ("force", 48),
        ("force_scale", 32),
    ],
)  # fmt: skip
def test_sessions_and_scores_of_a_long_study_can_be(name: str, sessions: int) -> None:
    assert read_study(config_folder() / "studies" / f"{name}.yaml").explain().sessions == sessions
