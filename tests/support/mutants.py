"""Mutants: copies of the package with one safety broken, each of which the drill must find.

    python tests/support/mutants.py --list
    python tests/support/mutants.py stop_late braking_weak --composed
    python tests/support/mutants.py --search 27 stop_ignored   # at most 27 schedules of a search, none written for it
    python tests/support/mutants.py --search 27 --past         # for each fault of the past

A mutant is a copy of the package in a directory of its own with a few words of its source replaced, and comes first in
the path of the drill and of what it starts. The machine is a simulated one, so that what is found is found every time;
``--live`` takes this one. What a mutant compiles is kept in its own directory, and used again in the next run.
"""

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path

from broken_copies import MUTANTS, SOUND, Mutant, Schedule

ROOT = Path(__file__).parents[2]
PACKAGE = ROOT / "src/teleop_core/teleop_core"
PLACE = Path(os.environ.get("TELEOP_MUTANTS", ROOT / "out/mutants"))
"""Where the copies are."""
PRIORITY = "real_time.priority=30"
"""Of the loops and of the drill's own hand, where the system grants it: less noise."""


_SCRIPT = """
import json, sys
from teleop_drill.simulation.schedules import Fault
from teleop_drill.simulation.seeds import run_seed
seed, faults = json.loads(sys.argv[1])
found = run_seed(seed, [Fault(*one) for one in faults])
print(json.dumps([(one.law, one.text) for one in found.broken]))
"""
_SEARCH = """
import json, sys, tempfile
from itertools import islice
from pathlib import Path
from teleop_drill.simulation.search import search
from teleop_drill.simulation.store import Store
seed, most = map(int, sys.argv[1:])
with tempfile.TemporaryDirectory(prefix="mutant_") as folder:
    for count, (found, _) in enumerate(islice(search(Store(Path(folder)), seed, 1e9, 1), most), 1):
        if found.broken:
            break
    print(json.dumps([count, [(one.law, one.text) for one in found.broken]]), flush=True)
"""


def changed(mutant: Mutant) -> dict[str, str]:
    """Texts of the files of the package that a mutant changes.

    Raises:
        ValueError: A change does not fit the source: its text does not stand there once.
    """
    texts: dict[str, str] = {}
    for file, before, after in mutant.changes:
        text = texts.get(file) or source(file).read_text(encoding="utf-8")
        if (times := text.count(before)) != 1:
            reason = f"{before!r} stands {times} times in {file}, must once"
            raise ValueError(f"mutant {mutant.name}: {reason}; change it as the source has changed")
        texts[file] = text.replace(before, after)
    return texts


def source(file: str) -> Path:
    """File of the core, or of another distribution where its package stands first in the name."""
    package = file.partition("/")[0]
    return ROOT / "src" / package / file if package.startswith("teleop_") else PACKAGE / file


def tree(mutant: Mutant) -> Path:
    """Directory that holds the mutant's packages, made or brought up to date."""
    texts = {source(file): text for file, text in changed(mutant).items()}
    copy = PLACE / mutant.name
    for root in {PACKAGE.parent, *(ROOT / "src" / path.parts[len(ROOT.parts) + 1] for path in texts)}:
        for file in (root / root.name).rglob("*"):
            if not file.is_dir() and file.parent.name != "__pycache__":
                text = texts.get(file)
                data = file.read_bytes() if text is None else text.encode()
                _put(data, copy / file.relative_to(root))
    if not (config := copy / "config").exists():
        config.symlink_to(ROOT / "config")
    return copy


def _put(data: bytes, file: Path) -> None:
    """Write a file, if that changes it."""
    if file.exists() and file.read_bytes() == data:
        return
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_bytes(data)


def drilled(mutant: Mutant, rows: Sequence[str], *, is_composed: bool, is_live: bool = False) -> dict[str, list[str]]:
    """What the drill finds wrong with a mutant, by row."""
    with tempfile.TemporaryDirectory(prefix="mutant_") as folder:
        file = Path(folder) / "drill.json"
        command = [sys.executable, "-m", "teleop_core.commands.cli", "drill", *rows, "--json", str(file)]
        command += ["--set", PRIORITY] if is_live else ["--simulated"]
        command += ["--composed"] if is_composed else []
        env = os.environ | {"PYTHONPATH": str(tree(mutant))}
        done = subprocess.run(command, check=False, capture_output=True, text=True, env=env)
        if not file.exists():
            raise RuntimeError((done.stdout + done.stderr)[-2000:])
        found = json.loads(file.read_text(encoding="utf-8"))["faults"]
    return {one["fault"]: one["failures"] for one in found}


def scheduled(mutant: Mutant, schedule: Schedule) -> list[tuple[str, str]]:
    """Laws that a mutant breaks under a schedule, each with what happened."""
    env = os.environ | {"PYTHONPATH": str(tree(mutant))}
    given = json.dumps([schedule.seed, schedule.faults])
    command = [sys.executable, "-c", _SCRIPT, given]
    done = subprocess.run(command, check=False, capture_output=True, text=True, env=env)
    if done.returncode:
        raise RuntimeError((done.stdout + done.stderr)[-2000:])
    return [(law, text) for law, text in json.loads(done.stdout.splitlines()[-1])]


def searched(mutant: Mutant, most: int, seed: int) -> tuple[int, list[tuple[str, str]]]:
    """Number of schedules of a search until a mutant breaks a law, and the laws that it breaks; none if it never did.

    No schedule is written for the mutant: the search begins with an empty store, and ends after ``most`` schedules.
    """
    env = os.environ | {"PYTHONPATH": str(tree(mutant))}
    command = [sys.executable, "-c", _SEARCH, str(seed), str(most)]
    done = subprocess.run(command, check=False, capture_output=True, text=True, env=env)
    if done.returncode:
        raise RuntimeError((done.stdout + done.stderr)[-2000:])
    count, broken = json.loads(done.stdout.splitlines()[-1])
    return count, [(law, text) for law, text in broken]


def every() -> tuple[Mutant, ...]:
    """Mutants of the drill, and those of a quick test."""
    from code_mutants import CODE_MUTANTS

    return (*MUTANTS, *CODE_MUTANTS)


def search_all(mutants: Sequence[Mutant], most: int, seed: int) -> None:
    """Print a row of a table for each mutant: whether a search finds it, after how many schedules, by which law."""
    found = 0
    print("| broken copy | reported as | schedules | law |\n|---|---|---|---|", flush=True)
    for mutant in mutants:
        try:
            count, broken = searched(mutant, most, seed)
        except RuntimeError as error:  # a copy that starts no session is found at once
            count, broken = 0, [("starts", str(error).splitlines()[-1])]
        found += bool(broken)
        print("".join(f"{mutant.name}: {law}: {text}\n" for law, text in broken), end="", file=sys.stderr, flush=True)
        law = ", ".join(f"`{law}`" for law, _ in broken) or "not found"
        print(f"| `{mutant.name}`: {mutant.text} | {mutant.past} | {count} | {law} |", flush=True)
    print(f"\n{found} of {len(mutants)} found, at most {most} schedules for each, seed {seed}", flush=True)


def hunt(mutants: Sequence[Mutant], *, is_composed: bool, is_live: bool) -> list[str]:
    """Drill mutants; returns the names of those that were not found."""
    missed = []
    for mutant in mutants:
        rows = mutant.rows_of(is_composed=is_composed)
        schedule = None if is_composed or is_live else mutant.schedule
        if not (rows or schedule):
            continue
        begin = time.monotonic()
        try:
            found = {}
            if rows:
                found = drilled(mutant, rows, is_composed=is_composed, is_live=is_live)
            if schedule:
                broken = dict(scheduled(mutant, schedule))
                found[schedule.law] = [broken[schedule.law]] if schedule.law in broken else []
        except Exception as error:  # a session that does not start is not found by its rows
            found = {}
            print(f"  {type(error).__name__}: {error}", flush=True)
        failures = [f"{row}: {text}" for row, texts in found.items() for text in texts]
        if not failures or (schedule and not found.get(schedule.law)):
            missed.append(mutant.name)
        way, took = "composed" if is_composed else "processes", time.monotonic() - begin
        mark = "MISSED" if mutant.name in missed else "found"
        print(f"{mark} {mutant.name} ({way}, {took:.0f} s): {'; '.join(failures)}", flush=True)
    return missed


def check_sound(mutants: Sequence[Mutant], *, is_composed: bool, is_live: bool) -> list[str]:
    """Do the rows of all mutants with a copy that is sound; returns what they find all the same."""
    rows = {row: None for one in mutants for row in one.rows_of(is_composed=is_composed)}
    found = drilled(SOUND, tuple(rows), is_composed=is_composed, is_live=is_live)
    wrong = [f"{row}: {text}" for row, texts in found.items() for text in texts]
    way = "composed" if is_composed else "processes"
    print(f"sound ({way}): {len(found)} rows, {'; '.join(wrong) or 'none fails'}", flush=True)
    if len(found) < len(rows):
        wrong.append("not all rows were done")
    if not (is_composed or is_live):
        schedules = {one.schedule for one in mutants if one.schedule}
        broken = [one for schedule in schedules for one in scheduled(SOUND, schedule)]
        wrong += [f"{law}: {text}" for law, text in broken]
        print(f"sound: {len(schedules)} schedules, {len(broken)} laws broken", flush=True)
    return wrong


def main() -> int:
    """Drill the mutants that are named, or all, in both forms; 0 if each was found."""
    parser = argparse.ArgumentParser(description=main.__doc__)
    parser.add_argument("names", nargs="*", help="mutants (default: all, and the sound copy)")
    parser.add_argument("--composed", action="store_true", help="in one process only")
    parser.add_argument("--processes", action="store_true", help="in a process for each node only")
    parser.add_argument("--live", action="store_true", help="on this machine, not a simulated one")
    parser.add_argument("--list", action="store_true", dest="is_list")
    parser.add_argument("--past", action="store_true", help="those that are faults of the past, of us or of others")
    parser.add_argument("--search", type=int, metavar="SCHEDULES", help="search for each, without its schedule or rows")
    parser.add_argument("--seed", type=int, default=0, help="of the search")
    asked = parser.parse_args()
    found = every() if asked.search is not None or asked.past else MUTANTS
    chosen = [one for one in found if one.name in asked.names or (not asked.names and (one.past or not asked.past))]
    if unknown := set(asked.names) - {one.name for one in chosen}:
        parser.error(f"no mutant {', '.join(sorted(unknown))}; see --list")
    if asked.is_list:
        for one in chosen:
            laws = () if one.schedule is None else (f"law {one.schedule.law}",)
            print(f"{one.name:20} {one.text} ({', '.join((*one.rows, *laws))})")
        return 0
    if asked.search is not None:
        search_all(chosen, asked.search, asked.seed)
        return 0
    begin, wrong = time.monotonic(), []
    for is_composed in (False, True):
        if asked.processes if is_composed else asked.composed:
            continue
        if not asked.names:
            wrong += check_sound(chosen, is_composed=is_composed, is_live=asked.live)
        wrong += hunt(chosen, is_composed=is_composed, is_live=asked.live)
    minutes = (time.monotonic() - begin) / 60.0
    print(f"{len(chosen)} mutants, {minutes:.0f} minutes; {len(wrong)} not as they should be")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
