"""Random schedules: laws that hold in all of them, and what is told where one does not."""

import json
import os
import shlex
import subprocess
import sys
from collections import Counter
from contextlib import closing
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from teleop_core.graph.operation import State
from teleop_core.nodes.crews import Processes
from teleop_core.nodes.operation import StopInput
from teleop_drill.simulation import seeds, sometimes
from teleop_drill.simulation.planned import Schedule
from teleop_drill.simulation.report import told
from teleop_drill.simulation.schedules import KINDS, Fault, draw
from teleop_drill.simulation.seeds import PROCESSES, Starts, run_seed, shrink

pytestmark = pytest.mark.slow
SIDES = PROCESSES[Processes.SIDES]
PROCESSORS: tuple[dict[str, str], ...] = (
    {},
    {"OPENBLAS_CORETYPE": "Haswell", "NPY_DISABLE_CPU_FEATURES": "X86_V3,X86_V4,AVX512_ICL,AVX512_SPR"},
)
"""What makes NumPy and OpenBLAS compute as on this processor and as on an older one."""


@pytest.mark.parametrize("seed", range(2))
def test_all_laws_hold_under_a_random_schedule(seed: Any) -> None:
    found = run_seed(seed)
    assert found.broken == ()
    assert found.seconds > 9.0
    assert {"speed", "motion", "told", "ends", "queues", "recovery"} <= set(found.looks)
    assert set(found.sometimes) <= set(sometimes.catalogue(KINDS))


def test_what_a_schedule_meets_is_counted_by_the_names_of_the_catalogue() -> None:
    faults = [
        Fault(1.0, "kill", "slave_side", 0.2, 0.0),
        Fault(1.05, "press", "", 3.0, 0.25),  # the button 0, before the slave is back
        Fault(2.0, "full disk", "", 1.0, 0.5),
        Fault(3.0, "press", "", 0.2, 0.000001),  # the button 1
    ]
    seen, every = run_seed(1, faults).sometimes, sometimes.catalogue(KINDS)
    assert len(set(every)) == len(every) >= 150
    assert set(seen) <= set(every)
    expected = {
        "kill in ENABLED", "press during another fault", "recovery after full disk", "FAULT becomes DISABLED",
        "enable asked in DISABLED", "fault stop", "a command is FRESH",
        sometimes.UNKNOWN_STOP, sometimes.BOTH_STOPS, sometimes.DISK_ENDS,
    }  # fmt: skip
    assert {name for name in expected if not seen[name]} == set()
    assert set(sometimes.never(seen, KINDS)) == {name for name in every if not seen[name]}


def test_schedules_are_drawn_from_their_seed_and_all_kinds_come() -> None:
    drawn = [draw(seed, SIDES) for seed in range(300)]
    assert drawn == [draw(seed, SIDES) for seed in range(300)]
    assert {fault.kind for faults in drawn for fault in faults} == set(KINDS)
    assert {len(faults) for faults in drawn} == set(range(1, 11))


def test_a_schedule_that_breaks_a_law_is_cut_down_to_what_does_it_and_its_line_breaks_it_again(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(StopInput, "take", lambda *_, **__: [])  # nobody hears a stop
    found = run_seed(
        0,
        [
            Fault(1.0, "clock drift", "", 1.0, 0.3),
            Fault(1.5, "press", "", 0.5, 0.4),
            Fault(2.0, "garbage", "", 0.5, 0.6),
        ],
    )
    assert [one.law for one in found.broken] == ["stop"]
    shortest = shrink(found, "stop")
    assert [fault.kind for fault in shortest.faults] == ["press"]
    (line,) = [line for line in told(found, shortest, "stop") if "again: " in line]
    words = shlex.split(line.partition("again: ")[2])
    assert words[:3] == ["teleop", "drill", "--schedule"]
    assert Schedule.of(words[3]).run().broken == shortest.broken


def test_one_schedule_is_run_again_by_its_text_on_processors_that_round_otherwise(tmp_path: Path) -> None:
    """Its recording has the same bytes wherever NumPy and OpenBLAS compute in other orders."""
    recordings, text = set(), json.dumps(Schedule(3, draw(3, SIDES)[:1]).plain())
    for k, processor in enumerate(PROCESSORS):
        (folder := tmp_path / str(k)).mkdir()
        words = ["drill", "--schedule", text, "--out", "bags"]  # which is recorded
        done = subprocess.run(
            [sys.executable, "-m", "teleop_core.commands.cli", *words],
            check=False, capture_output=True, text=True, env=os.environ | processor, cwd=folder,
        )  # fmt: skip
        assert done.returncode == 0, done.stdout + done.stderr
        assert draw(3, SIDES)[0].text() in done.stdout
        assert (folder / "bags/recording_1/metadata.yaml").exists()
        recordings.add((folder / "bags/recording_1/recording_1_0.mcap").read_bytes())
    assert len(recordings) == 1


def test_many_schedules_are_told_as_a_table_of_faults_and_states(tmp_path: Path) -> None:
    file = tmp_path / "seeds.json"
    words = ["drill", "--seeds", "2", "--seed", "10", "--sometimes", "--json", str(file)]
    done = subprocess.run(
        [sys.executable, "-m", "teleop_core.commands.cli", *words], check=False, capture_output=True, text=True
    )
    assert done.returncode == 1, done.stdout + done.stderr  # two schedules do not meet everything
    found = json.loads(file.read_text(encoding="utf-8"))
    assert f"{sum(map(bool, found['sometimes'].values()))} of {len(found['sometimes'])} events were met" in done.stdout
    assert found["sessions"] == 2
    assert found["broken"] == {}
    drawn = [fault.kind for seed in (10, 13) for fault in draw(seed, SIDES)]  # nothing is known yet
    assert sum(found["met"].values()) == len(drawn)
    assert {name.split(" / ")[0] for name in found["under"]} <= set(drawn)


@pytest.mark.soak
def test_of_three_seeds_the_one_is_run_whose_faults_have_met_least(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(seeds, "_ROUND", 1)
    ran = [found.seed for found in seeds.run_seeds(30, 2, 1)]
    assert ran[0] == 30
    assert all(33 + 3 * k <= seed < 36 + 3 * k for k, seed in enumerate(ran[1:]))


def test_a_seed_is_known_once_each_of_its_faults_has_met_every_state() -> None:
    met = Counter((one.kind, "ENABLED") for one in draw(30, SIDES))
    assert seeds._known(30, met, Processes.SIDES) == 0.0  # in other states they met nothing
    for state in State:
        met.update((one.kind, state.name) for one in draw(30, SIDES))
    assert seeds._known(30, met, Processes.SIDES) >= 1.0


def test_a_schedule_has_the_same_result_alone_and_after_the_start_of_another_one() -> None:
    faults = [
        (Fault(0.5, "command", "", 0.1, 0.28), Fault(0.7, "kill", "slave_side", 0.3, 0.5)),
        (Fault(0.2, "full disk", "", 0.5, 0.5), Fault(0.7, "loss", "hand_side", 0.3, 0.5)),
    ]
    with closing(Starts()) as starts:
        shared = [starts.run(4 + 4 * k, one, Processes.SIDES, 0.0)[0] for k, one in enumerate((*faults, *faults))]
    assert shared == [run_seed(4 + 4 * k, one) for k, one in enumerate((*faults, *faults))]
    assert [found.looks["recorded"] for found in shared] == [1, 1, 1, 1]
    assert not any(found.broken for found in shared)
    assert replace(shared[0], seed=12) != shared[2]  # the same start and the same faults, but other random numbers


def test_a_recording_has_the_same_bytes_in_whichever_folder_it_lies(tmp_path: Path) -> None:
    files = []
    for folder in (tmp_path / "a", tmp_path / "a longer name" / "in another folder"):
        run_seed(5, (), folder)
        files.append((folder / "recording_1" / "recording_1_0.mcap").read_bytes())
    assert files[0] == files[1]


def test_a_schedule_in_which_priorities_decide_has_the_same_result_again() -> None:
    schedule = Schedule(8, draw(8, SIDES)[:1], depth=3)
    with closing(Starts()) as starts:
        assert schedule.run_in(starts)[0] == schedule.run() != replace(schedule, depth=2).run()
