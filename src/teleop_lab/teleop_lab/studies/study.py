"""Study: the points of a comparison, and how their sessions are run."""

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import product
from os import sched_getaffinity
from pathlib import Path
from typing import TYPE_CHECKING, Any

from teleop_core.base.errors import ParameterError, UnknownNameError
from teleop_core.base.own_parts import load_own_parts
from teleop_core.base.plain_yaml import load
from teleop_core.evaluation.score import SESSION_KEYS, keys
from teleop_core.graph.layers import SESSION
from teleop_core.session import api, runner
from teleop_lab.studies.checks import insist_on_reach, insist_on_scores
from teleop_lab.studies.point import Point, code_digest, own_digest, point_key, recipe_of
from teleop_lab.studies.printed import Printed, read_printed
from teleop_lab.studies.store import Store

if TYPE_CHECKING:
    import xarray
    from distributed import Client

SEED = "seed"
_KEYS = ("scenario", "seeds", "set", "sweep", "metrics", "parts", "duration", "people", "printed")
_SPEED = 25.0
"""Simulated seconds per second that one process computes, scoring included; measured on a busy machine."""
_BEGIN = 0.1  # time to begin a session [s]
_START = 4.0  # time to start the processes [s]
MOST_SESSIONS = 1_000_000
"""Largest number of sessions of a study; each takes half a kilobyte of memory, and a file."""
_RESULT = 4096
"""Size of a stored result on the disk [bytes]: one block."""
_SECOND = 200_000
"""Compressed size of one second of a recording [bytes]."""


@dataclass(frozen=True)
class Explained:
    """Cost of a study, estimated without running it.

    Attributes:
        sessions: Number of all sessions.
        to_run: Number of sessions that are missing, failed or changed.
        why: Number of these sessions by reason: missing, failed, changed code, changed parameters.
        simulated: Simulated time of the sessions to run [s].
        wall: Estimated duration of these sessions with the given number of processes [s].
        stored: Bytes of all results.
        recorded: Bytes of the recordings of all sessions, if recordings are made.
    """

    sessions: int
    to_run: int
    why: Mapping[str, int]
    simulated: float
    wall: float
    stored: int
    recorded: int

    def __str__(self) -> str:
        reasons = ", ".join(f"{count} {reason}" for reason, count in self.why.items())
        return (
            f"{self.sessions} sessions, {self.to_run} to run ({reasons or 'all are there'}): "
            f"{self.simulated:.0f} s simulated, about {self.wall:.0f} s; "
            f"{self.stored / 1e6:.3g} MB of results, {self.recorded / 1e9:.3g} GB of recordings "
            "if they are kept"
        )


@dataclass(frozen=True)
class Study:
    """Sessions over named values of parameters and seeds.

    Attributes:
        scenario: One of ``teleop scenarios``; None for the defaults.
        swept: Values of each parameter, named as on the command line; each parameter is a dimension.
        seeds: Seeds of the sessions; they are the last dimension.
        metrics: Keys of scores, such as ``task.time_s``; each score is a variable of the results.
        settings: Parameters that are the same in all sessions.
        parts: Files that register parts of your own.
        printed: What people did, as a source printed it.

    Raises:
        TeleopError: A parameter, value, key of a score or part is wrong; no session was run.
    """

    scenario: str | None
    swept: Mapping[str, Sequence[api.Setting]]
    seeds: Sequence[int]
    metrics: Sequence[str]
    settings: Mapping[str, api.Setting] = field(default_factory=dict)
    parts: Sequence[Path] = ()
    printed: Printed | None = None

    def __post_init__(self) -> None:
        load_own_parts(self.parts)
        for name, values in self.swept.items():
            if not len(values):
                raise ParameterError(f"sweep of {name}", (), "at least one value")
            if len({repr(value) for value in values}) < len(values):
                raise ParameterError(f"sweep of {name}", tuple(values), "values that differ")
        count = math.prod(map(len, self.swept.values())) * len(self.seeds)
        if count > MOST_SESSIONS:
            raise ParameterError("sessions of a study", count, f"at most {MOST_SESSIONS}; use fewer values or seeds")
        is_told = len(self.seeds) and len(set(self.seeds)) == len(self.seeds)
        if not is_told or min(self.seeds) < 0 or max(self.seeds) >= 10**18:
            raise ParameterError("seed", tuple(self.seeds), "whole numbers >= 0 of at most 18 digits that differ")
        if not len(self.metrics):
            raise ParameterError("metrics", (), "at least one key of a score, for example task.time_s")
        measured = [key for key in keys() if key not in SESSION_KEYS]
        for metric in self.metrics:
            if not any(key.covers(tuple(metric.split("."))) for key in measured):
                raise UnknownNameError("key of a score", metric, [name for key in measured for name in key.names()])

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the dimensions, seed last."""
        return (*self.swept, SEED)

    def points(self) -> list[Point]:
        """Return all points, in the order of the dimensions, after a check of each configuration.

        Raises:
            TeleopError: A point cannot run; the text names the wrong value.
        """
        found = []
        for values in product(*self.swept.values()):
            found += self.points_at(dict(zip(self.swept, values, strict=True)))
        return found

    def points_at(self, chosen: Mapping[str, api.Setting]) -> list[Point]:
        """Return the points of all seeds for one value of each swept parameter.

        The value need not be one of the study's.

        Raises:
            TeleopError: Some points cannot run; the text names the wrong value.
        """
        found, code = [], _code()
        given = {**self.settings, **chosen}
        made = api.configuration(self.scenario, settings=given)
        insist_on_scores(made, self.metrics)
        insist_on_reach(made)
        recipe, length = recipe_of(made), float(made.session.duration)
        for seed in self.seeds:
            place = {**chosen, SEED: int(seed)}
            key = point_key(recipe, int(seed), self.metrics, code)
            found.append(Point(place, self.scenario, given, int(seed), length, key))
        return found

    def explain(self, store: Path | str | None = None, jobs: int | None = None) -> Explained:
        """Estimate number, duration and storage of the sessions, without running one.

        Args:
            store: Store with earlier results.
            jobs: Processes; None: as many as processors.

        Raises:
            TeleopError: The reasons of :meth:`points`, or the store belongs to another study.
        """
        points = self.points()
        kept = self.store(store) if store is not None else None
        why: dict[str, int] = {}
        left = 0.0
        for point in points:
            reason = "missing" if kept is None else kept.reason(point)
            if reason:
                why[reason] = why.get(reason, 0) + 1
                left += point.length
        count = sum(why.values())
        wall = (left / _SPEED + _BEGIN * count) / (jobs or len(sched_getaffinity(0))) + _START * bool(count)
        total = sum(point.length for point in points)
        return Explained(len(points), count, why, left, wall, _RESULT * len(points), round(_SECOND * total))

    def run(
        self,
        store: Path | str | None = None,
        *,
        jobs: int | None = None,
        client: "Client | None" = None,
        recordings: Path | str | None = None,
        progress: Callable[[int, int], None] = runner.silent,
    ) -> "xarray.Dataset":
        """Run the sessions that are missing, failed or changed, and return all results.

        Each result is written as soon as it is computed. If a call is killed, the next call with the same store
        continues the study. The result of a failed session contains the error.

        Args:
            store: Directory of the results, made if it is missing; None keeps them in memory.
            jobs: Number of processes, each with one session at a time; None: as many as processors.
            client: A Dask client whose workers run the sessions instead of local processes; only values are sent.
            recordings: Directory for a recording of each session; None: sessions are not recorded.
            progress: Called with the number of finished points, and the number of all.

        Raises:
            TeleopError: The reasons of :meth:`explain`; raised before the first session.
        """
        from teleop_lab.studies.dataset import dataset_of, swept_coordinates
        from teleop_lab.studies.workers import in_processes, on_dask

        points = self.points()
        kept = self.store(store)
        to_run = [point for point in points if kept.reason(point)]
        done = len(points) - len(to_run)
        progress(done, len(points))
        if client is not None:
            results = on_dask(client, to_run, self.metrics, self.parts)
        else:
            results = in_processes(to_run, self.metrics, self.parts, jobs, kept.folder, recordings)
        for result in results:
            kept.take(result)
            done += 1
            progress(done, len(points))
        about = {
            "scenario": self.scenario or "",
            "code": _code(),
            "settings": str(dict(self.settings)),
            "sessions": len(points),
        }
        coordinates = {**swept_coordinates(self.swept), SEED: list(self.seeds)}
        return dataset_of(coordinates, self.metrics, [kept.result(point) for point in points], about)

    def store(self, folder: Path | str | None) -> Store:
        """Open the store of the study's results; a missing store is created.

        Raises:
            SessionError: The store belongs to another study or a newer version, or cannot be written.
        """
        return Store.open(folder, self.scenario, self.names)


def _code() -> str:
    """Digest of the code that computes the scores, including the user's own parts."""
    return code_digest() + own_digest()


def sweep(
    scenario: str | None = None,
    *,
    metrics: Sequence[str],
    seed: Iterable[int] = range(1, 2),
    settings: Mapping[str, api.Setting | Sequence[api.Setting]] | None = None,
    parts: Sequence[Path | str] = (),
    store: Path | str | None = None,
    jobs: int | None = None,
    client: "Client | None" = None,
    progress: Callable[[int, int], None] = runner.silent,
    **parameters: api.Setting | Sequence[api.Setting],
) -> "xarray.Dataset":
    """Return scores over named values of parameters. Each parameter is a dimension, and so is the seed.

    Args:
        scenario: One of ``teleop scenarios``.
        metrics: Keys of scores; each score is a variable.
        seed: Seeds.
        settings: Parameters by name; the values of a list are swept, any other value applies to all sessions.
        parts: Files that register parts of your own.
        store: As in :meth:`Study.run`.
        jobs: As in :meth:`Study.run`.
        client: As in :meth:`Study.run`.
        progress: As in :meth:`Study.run`.
        **parameters: Parameters like ``settings``, with ``__`` for each dot: ``display__latency=[0.0, 0.3]``.

    Raises:
        TeleopError: A name or value is wrong; no session was run.
    """
    named = {name.replace("__", "."): value for name, value in parameters.items()}
    study = _study(scenario, list(seed), metrics, dict(settings or {}) | named, parts)
    return study.run(store, jobs=jobs, client=client, progress=progress)


def _study(
    scenario: str | None,
    seeds: Sequence[int],
    metrics: Sequence[str],
    given: Mapping[str, Any],
    parts: Iterable[Path | str],
) -> Study:
    swept = {name: tuple(v) for name, v in given.items() if isinstance(v, list | range)}
    fixed = {name: value for name, value in given.items() if name not in swept}
    return Study(scenario, swept, tuple(seeds), tuple(metrics), fixed, tuple(Path(part) for part in parts))


def read_study(path: Path | str) -> Study:
    """Read a study from a YAML file with the entries scenario, set, sweep, seeds, metrics, parts, duration and printed.

    ``seeds`` is a list, or the number of seeds, which then begin with 1. ``parts`` are files in the folder of the YAML
    file. Entries below ``people`` are for :mod:`teleop_lab.people`; for ``printed`` see :func:`read_printed`.

    Raises:
        TeleopError: The file cannot be read, or does not describe a study.
    """
    content = read_entries(path)
    swept = named(content, "sweep")
    for name, values in swept.items():
        if not isinstance(values, list):
            raise ParameterError(f"sweep of {name}", values, "a list of values")
    metrics = tuple(map(str, listed(content, "metrics")))
    return Study(
        swept={name: tuple(values) for name, values in swept.items()},
        metrics=metrics,
        printed=read_printed(named(content, "printed"), metrics, math.prod(map(len, swept.values()))),
        **common(content, Path(path)),
    )


def read_entries(path: Path | str, known: Sequence[str] = _KEYS) -> dict[str, Any]:
    """Entries of a YAML file of a study.

    Raises:
        TeleopError: The file cannot be read, or contains an unknown entry.
    """
    content = load(Path(path))
    if not isinstance(content, dict):
        raise ParameterError("study", str(path), f"a YAML file with {', '.join(known)}")
    for key in content:
        if key not in known:
            raise UnknownNameError(f"entry of {Path(path).name}", str(key), known)
    return content


def common(content: Mapping[str, Any], path: Path) -> dict[str, Any]:
    """Scenario, seeds, settings and parts of a file."""
    seeds, fixed = content.get("seeds", 1), named(content, "set")
    is_count = isinstance(seeds, int) and 0 < seeds <= MOST_SESSIONS
    if not is_count and not (isinstance(seeds, list) and all(isinstance(s, int) for s in seeds)):
        text = f"a number of seeds, at most {MOST_SESSIONS}, or a list of whole numbers"
        raise ParameterError("seeds", seeds, text)
    if "duration" in content:
        fixed = {f"{SESSION}.duration": content["duration"], **fixed}
    return {
        "scenario": content.get("scenario"),
        "settings": fixed,
        "seeds": tuple(range(1, seeds + 1)) if is_count else tuple(seeds),
        "parts": tuple(path.parent / str(part) for part in listed(content, "parts")),
    }


def listed(content: Mapping[str, Any], name: str) -> list[Any]:
    """Return an entry that must be a list."""
    found = content.get(name, [])
    if not isinstance(found, list):
        raise ParameterError(name, found, "a list")
    return found


def named(content: Mapping[str, Any], name: str) -> dict[str, Any]:
    """Return an entry that must map names to values."""
    found = content.get(name) or {}
    if not isinstance(found, dict):
        raise ParameterError(name, found, "parameters by name, each with its value")
    return {str(key): value for key, value in found.items()}


def is_number(value: object) -> bool:
    """Whether a value of a parameter is a finite number, so that an axis of a plot can show it."""
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)
