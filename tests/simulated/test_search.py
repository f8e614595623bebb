"""Search: it goes where it has met least, keeps what met something first, and every breach is run again by one line."""

import json
import os
import pickle
import shlex
import signal
import subprocess
import sys
from collections import Counter
from importlib import import_module
from itertools import islice
from pathlib import Path
from random import Random
from typing import Any

import pytest

from cluster import cluster
from teleop_core.base.errors import ParameterError, RecordingError, SessionError
from teleop_core.nodes.crews import Processes
from teleop_core.nodes.operation import StopInput
from teleop_drill.simulation import sometimes
from teleop_drill.simulation.branches import Branches
from teleop_drill.simulation.laws import Broken
from teleop_drill.simulation.planned import Schedule
from teleop_drill.simulation.schedules import END, KINDS, OF_PROCESS, draw
from teleop_drill.simulation.search import Search, search, switched_on
from teleop_drill.simulation.seeds import PROCESSES, Found
from teleop_drill.simulation.store import Store, kind_of

SIDES = PROCESSES[Processes.SIDES]
_MODULE = '''
"""A module with branches of each kind."""


def plain(values):
    """Go through all of them."""
    said = []
    for value in values:
        if value < 0:
            break
        elif value == 0:
            said.append("zero")
    while len(said) < 2:
        said.append("more")
    try:
        values[9]
    except IndexError:
        said.append("short")
    match values[0]:
        case 1:
            said.append("one")
        case _:
            said.append("other")
    return said


class Thing:
    """A class."""

    @property
    def big(self):
        """Whether it is big."""
        return [key for key in self.keys() if key]

    def keys(self):
        """Nothing yet."""
        if not self.__dict__:
            return []
        return list(self.__dict__)
'''


def met(schedule: Schedule, **counts: int) -> Found:
    """A result of a schedule that met events so often."""
    seen = Counter({name.replace("_", " "): count for name, count in counts.items()})
    found = Found(schedule.seed, schedule.faults, schedule.processes, schedule.breaks, schedule.depth, schedule.session)
    found.sometimes = seen
    return found


def chosen(store: Store, count: int, seed: int = 7) -> list[Schedule]:
    """What a search chooses where each fault met the arm ENABLED."""
    search, schedules = Search(store, seed), []
    for _ in range(count):
        schedules.append(search.choose())
        found = met(schedules[-1])
        found.sometimes.update(sometimes.met(one.kind, "ENABLED") for one in schedules[-1].faults)
        store.add(found)
    return schedules


# -- branches ------------------------------------------------------------------------------------


@pytest.fixture
def module(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Any:
    (folder := tmp_path / "marked_package").mkdir()
    (folder / "__init__.py").touch()
    (folder / "part.py").write_text(_MODULE, encoding="utf-8")
    monkeypatch.syspath_prepend(tmp_path)
    yield import_module("marked_package.part")
    for name in ("marked_package", "marked_package.part"):
        sys.modules.pop(name)


def test_branches_that_ran_are_named_by_line_and_side_and_marks_change_no_result(module: Any) -> None:
    before = [module.plain(values) for values in ([1, 0], [-1])]
    branches = Branches(("marked_package",))
    branches.begin()
    assert branches.ran() == []
    assert [module.plain(values) for values in ([1, 0], [-1])] == before
    lines = {int(name.split(":")[1].split()[0]) for name in branches.ran()}
    text = _MODULE.splitlines()
    assert {text[line - 1].split()[0] for line in lines} == {"for", "if", "elif", "while", "except", "case"}
    assert len(branches.names) == len(branches.ran()) + 2  # `Thing.keys` has not run
    assert module.Thing().big == []
    branches.begin()
    module.plain([1])
    ran = {name.split("/")[1] for name in branches.ran()}
    at = text.index("        if value < 0:") + 1
    assert f"part.py:{at} else" in ran
    assert f"part.py:{at}" not in ran


# -- a schedule as a text ------------------------------------------------------------------------


def test_a_schedule_is_the_same_after_it_was_written_and_read(tmp_path: Path) -> None:
    schedule = Schedule(11, draw(11, PROCESSES[Processes.ONE]), Processes.ONE, 0.0005, 3, "person")
    text = json.dumps(schedule.plain())
    (tmp_path / "one.json").write_text(text, encoding="utf-8")
    assert Schedule.of(text) == schedule
    assert Schedule.of(str(tmp_path / "one.json")) == schedule
    assert Schedule.of(shlex.split(schedule.command())[-1]) == schedule


@pytest.mark.parametrize(
    ("change", "needed"),
    [
        ({"version": 1}, "version of the schedule is 1, must be 2"),
        ({"seed": "today"}, "seed of the schedule is 'today', must be an integer"),
        ({"seed": True}, "an integer"),
        ({"nodes": "nodes"}, "of sides, one"),
        ({"breaks": 1.0}, "from 0 to 0.1"),
        ({"depth": 10}, "depth of the schedule is 10, must be an integer from 0 to 9"),
        ({"session": "opera"}, "session of the schedule is 'opera', must be of plain, visited"),
        ({"depth": True}, "an integer from 0 to 9"),
        ({"faults": None}, "a list"),
        ({"faults": [[1.0, "press", "", 0.5]]}, "[begin, kind, process, duration, amount]"),
        ({"faults": [[1.0, "storm", "", 0.5, 0.5]]}, "of buttons, clock drift"),
        ({"faults": [[1.0, "kill", "nobody", 0.5, 0.5]]}, "of hand_side, slave_side, recorder"),
        ({"faults": [[float("nan"), "press", "", 0.5, 0.5]]}, "the begin of a fault of the schedule is nan"),
        ({"faults": [[1.0, "press", "", 1e9, 0.5]]}, "from 0 to 60"),
        ({"faults": [[1.0, "press", "", 0.5, -0.1]]}, "from 0 to 1"),
    ],
)
def test_a_schedule_that_cannot_be_run_is_refused_by_the_value_that_is_wrong(change: Any, needed: str) -> None:
    with pytest.raises(ParameterError) as error:
        Schedule.of(json.dumps(Schedule(1, ()).plain() | change))
    assert needed in str(error.value)


# -- store ---------------------------------------------------------------------------------------


def test_a_store_keeps_what_met_something_first_and_goes_on_where_it_ended(tmp_path: Path) -> None:
    store = Store(tmp_path / "store")
    first, again, second = (Schedule(k, draw(k, SIDES)) for k in range(3))
    assert store.add(met(first, kill_in_FAULT=1), ["slave.py:1"]) == ("kill in FAULT", "slave.py:1")
    assert store.add(met(again, kill_in_FAULT=2, press_in_FAULT=0)) == ()
    found = met(second)
    found.pairs["kill", "press", "FAULT"] += 1
    assert store.add(found) == ("kill + press in FAULT",)
    assert [kind_of(name) for name in sorted(store.times)] == ["pairs", "events", "branches"]
    other = Store(tmp_path / "store")
    assert other.coverage == store.coverage
    assert other.times == store.times == Counter({"kill in FAULT": 2, "slave.py:1": 1, "kill + press in FAULT": 1})
    assert other.kept == store.kept
    assert [one.schedule for one in other.kept] == [first, second]
    assert Schedule.of(str(tmp_path / "store" / other.kept[1].file)) == second
    assert Search(store, 5).choose() == Search(other, 5).choose()


def test_a_schedule_that_broke_a_law_is_kept_though_it_met_nothing_new(tmp_path: Path) -> None:
    store = Store(tmp_path)
    found = met(Schedule(1, draw(1, SIDES)))
    found.broken = (Broken("stop", 1.0, "no stop"),)
    assert store.add(found) == ()
    assert Store(tmp_path).kept[0].broken == ("stop",)
    assert store.lines()[-1] == "schedule_000000.json breaks stop"


def nine() -> list[tuple[Found, list[str]]]:
    """Nine results, each with its branches; a third of them meets something first."""
    names = ("press_in_FAULT", "kill_in_PAUSED", "press_in_none")
    results = (met(Schedule(k, draw(k, SIDES)), kill_in_FAULT=1, **{names[k // 3]: 1}) for k in range(9))
    return [(found, [f"slave.py:{k // 3}"]) for k, found in enumerate(results)]


KILLED = """
import os, pickle, sys
from pathlib import Path
from teleop_drill.simulation.store import Store
folder = Path(sys.argv[1])
store = Store(folder, lambda: 0.0)
for found, branches in pickle.load(sys.stdin.buffer):
    store.add(found, branches)
with open(folder / "counts_since.jsonl", "a") as file:
    file.write('{"number": 9, "times"')
    file.flush()
    os.kill(os.getpid(), 9)
"""


def test_a_search_that_is_killed_loses_no_schedule_that_had_ended(tmp_path: Path) -> None:
    """All counts are written seldom; lines of the schedules since then stand beside them."""
    whole, folder = Store(tmp_path / "whole"), tmp_path / "killed"
    for found, branches in nine():
        whole.add(found, branches)
    whole.save()
    given = [sys.executable, "-c", KILLED, str(folder)]
    assert subprocess.run(given, check=False, input=pickle.dumps(nine())).returncode == -signal.SIGKILL
    assert json.loads((folder / "counts.json").read_text(encoding="utf-8"))["sessions"] == 1
    again = Store(folder)
    assert (again.coverage, again.times, again.kept) == (whole.coverage, whole.times, whole.kept)
    assert again.coverage.sessions == 9
    assert Search(again, 5).choose() == Search(whole, 5).choose()
    assert not (folder / "counts_since.jsonl").exists()
    assert Store(folder).coverage == again.coverage


@pytest.mark.parametrize(
    ("change", "needed"),
    [
        ({"code": "another"}, "give another folder"),
        ({"version": 9}, "version of the store"),
        ({"met": 3}, "counts of schedules"),
        ({"times": None}, "counts of schedules"),
    ],
)
def test_a_store_of_other_code_or_version_is_refused_in_one_line(
    change: Any, needed: str, tmp_path: Path, teleop_again: Any
) -> None:
    Store(tmp_path).add(met(Schedule(1, ()), kill_in_FAULT=1))
    counts = tmp_path / "counts.json"
    counts.write_text(json.dumps(json.loads(counts.read_text(encoding="utf-8")) | change), encoding="utf-8")
    done = teleop_again("drill", "--search", str(tmp_path), "--minutes", "0.01", code=2)
    assert needed in done.stderr
    assert len(done.stderr.strip().splitlines()) == 1


def test_a_folder_of_other_files_is_no_store(tmp_path: Path) -> None:
    (tmp_path / "thesis.tex").touch()
    with pytest.raises(RecordingError, match=r"no store of schedules"):
        Store(tmp_path)


# -- search --------------------------------------------------------------------------------------


def test_the_same_seed_and_the_same_results_give_the_same_schedules(tmp_path: Path) -> None:
    first, again, other = (chosen(Store(tmp_path / name), 20, seed) for name, seed in (("a", 7), ("b", 7), ("c", 8)))
    assert first == again
    assert not set(first) & set(other)


def test_every_chosen_schedule_can_be_given_as_a_text(tmp_path: Path) -> None:
    for schedule in chosen(Store(tmp_path), 60):
        assert Schedule.of(json.dumps(schedule.plain())) == schedule
        names = PROCESSES[schedule.processes]
        assert all(one.where in names if one.kind in OF_PROCESS else not one.where for one in schedule.faults)
        assert [one.at for one in schedule.faults] == sorted(one.at for one in schedule.faults)
        assert 1 <= len(schedule.faults) <= 30
        assert max(one.at for one in schedule.faults) <= END + 1.0


def test_about_half_of_the_kinds_are_off_in_a_schedule_and_all_come_in_many(tmp_path: Path) -> None:
    counts = [len(switched_on(Random(k))) for k in range(200)]
    assert 0.45 * len(KINDS) < sum(counts) / len(counts) < 0.55 * len(KINDS)
    search = Search(Store(tmp_path), 3)  # of an empty store: nothing can be bred yet
    assert {one.kind for _ in range(60) for one in search.choose().faults} == set(KINDS)


def test_priorities_of_threads_decide_in_a_part_of_the_schedules(tmp_path: Path) -> None:
    depths = Counter(schedule.depth for schedule in chosen(Store(tmp_path), 100))
    assert 10 < 100 - depths[0] < 50
    assert {0, 1, 2, 3} <= set(depths)


def test_what_was_never_met_is_aimed_at_more_often(tmp_path: Path) -> None:
    store = Store(tmp_path)
    known = [sometimes.met(kind, state) for kind in KINDS for state in sometimes.STATES if kind != "garbage"]
    store.times.update(dict.fromkeys(known, 50))
    search = Search(store, 1)
    kinds = Counter(one.kind for _ in range(60) for one in search.choose().faults)
    assert kinds["garbage"] > 3 * max(kinds[kind] for kind in ("buttons", "drive", "intruder", "hiccups"))


def test_others_are_bred_from_kept_schedules(tmp_path: Path) -> None:
    store = Store(tmp_path)
    for k in range(8):
        store.add(met(Schedule(k, draw(k, SIDES)), **{f"event_{k}": 1}))
    kept = {fault for one in store.kept for fault in one.schedule.faults if fault.kind not in {"command", "kill"}}
    short = {(one.kind, round(one.amount, 6)) for one in kept}
    search = Search(store, 1)
    shared = [sum((one.kind, one.amount) in short for one in search.choose().faults) for _ in range(60)]
    assert sum(map(bool, shared)) > 20


_MEASURED = """
import os, sys
from pathlib import Path
from teleop_drill.simulation.branches import Branches
from teleop_drill.simulation.planned import Schedule
branches = Branches()
for name in ("plain", "marked"):
    Path(name).mkdir()
    os.chdir(name)
    if name == "marked":
        branches.begin()
    found = Schedule.of(sys.argv[1]).run(Path("bags"))
    os.chdir("..")
print(len(branches.ran()))
"""


@pytest.mark.slow
def test_a_schedule_whose_branches_are_marked_has_the_same_bytes(tmp_path: Path) -> None:
    text = json.dumps(Schedule(4, draw(4, SIDES)[:2]).plain())
    done = subprocess.run(
        [sys.executable, "-c", _MEASURED, text], check=False, capture_output=True, text=True, cwd=tmp_path
    )
    assert done.returncode == 0, done.stderr
    assert int(done.stdout) > 400
    plain, marked = (
        [file.read_bytes() for file in sorted((tmp_path / name).rglob("*.mcap"))] for name in ("plain", "marked")
    )
    assert plain
    assert plain == marked


@pytest.mark.slow
def test_a_cluster_gives_the_schedules_and_results_of_this_machine_and_refuses_other_code(tmp_path: Path) -> None:
    """The third schedule is chosen when the first result is known."""
    stores = [Store(tmp_path / name) for name in ("here", "there")]
    here = list(islice(search(stores[0], 5, 1e3, 1, ahead=2), 3))

    def have_other_code() -> None:  # in here it travels as a value
        from teleop_drill.simulation import store

        vars(store)["code_digest"] = lambda: "other"

    with cluster(tmp_path / "dask") as client:
        assert list(islice(search(stores[1], 5, 1e3, client=client, ahead=2), 3)) == here
        assert stores[0].kept == stores[1].kept
        client.run(have_other_code)
        with pytest.raises(SessionError, match="has code other, must be ours"):
            next(search(stores[1], 5, 1e3, client=client))


@pytest.mark.soak
def test_a_broken_law_is_found_soon(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(StopInput, "take", lambda *_, **__: [])  # nobody hears a stop
    store = Store(tmp_path)
    search = Search(store, 40)
    for _ in range(8):
        store.add(search.choose().run())
    assert any("stop" in one.broken for one in store.kept)


@pytest.mark.slow
def test_a_search_tells_what_was_never_met_and_goes_on_in_its_store(tmp_path: Path) -> None:
    Store(tmp_path / "store").add(met(Schedule(1, ()), kill_in_FAULT=1))
    words = ["drill", "--search", "store", "--minutes", "0.01", "--seed", "60"]
    done = subprocess.run(
        [sys.executable, "-m", "teleop_core.commands.cli", *words],
        check=False, capture_output=True, text=True, cwd=tmp_path, env=os.environ,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout + done.stderr
    count = Store(tmp_path / "store").coverage.sessions
    assert count > 1
    assert "events were met; never: " in done.stdout
    assert "seeds from 6" in done.stdout
    assert f"{count} sessions" in done.stdout
    assert done.stdout.splitlines()[-1] == f"seeds from 61 to {59 + count}, chosen from --seed 60"
