"""Point: one session of a study, its key, and its result."""

import hashlib
import json
import time
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from functools import cache, partial
from importlib.metadata import entry_points
from importlib.util import find_spec
from pathlib import Path
from types import CodeType

import teleop_core
from teleop_core.bags.memory import LeftOutError
from teleop_core.base.errors import TeleopError
from teleop_core.base.own_parts import own_files
from teleop_core.evaluation.scoring import measure, streams_of
from teleop_core.session import api, configuration


@dataclass(frozen=True)
class PointKey:
    """Digests of everything that a result depends on: the parameters and the code."""

    recipe: str
    code: str


@dataclass(frozen=True)
class Point:
    """One session of a study.

    Attributes:
        place: Value of the point in every dimension.
        scenario: Scenario of the study.
        settings: All given parameters.
        seed: Seed of the session.
        length: Duration of the hand's motion [s].
        key: Digests of everything that the result depends on.
    """

    place: Mapping[str, api.Setting]
    scenario: str | None
    settings: Mapping[str, api.Setting]
    seed: int
    length: float
    key: PointKey

    @property
    def name(self) -> str:
        """Name of the point's result; it depends only on ``place``."""
        text = json.dumps({name: repr(value) for name, value in self.place.items()}, sort_keys=True)
        return hashlib.sha256(text.encode()).hexdigest()[:20]


@dataclass(frozen=True)
class PointResult:
    """Result of a point: scores, or an error.

    Attributes:
        name: Name of the point.
        key: Key of the point.
        scores: Numbers by key of a score; None for a score that does not apply.
        error: Text of the error; empty if the session succeeded.
        seconds: Time that the session took [s].
    """

    name: str
    key: PointKey
    scores: Mapping[str, float | None]
    error: str
    seconds: float

    def to_json(self) -> str:
        """Return the result as a text; :meth:`from_json` restores each number exactly."""
        return json.dumps(asdict(self))

    @staticmethod
    def from_json(text: str) -> "PointResult":
        """Return the result that :meth:`to_json` converted to a text.

        Raises:
            ValueError: The text does not contain a result.
        """
        found = json.loads(text)
        try:
            key = PointKey(**found.pop("key"))
            return PointResult(key=key, **found)
        except (AttributeError, KeyError, TypeError) as error:
            raise ValueError(str(error)) from error


def recipe_of(made: configuration.Configuration) -> str:
    """Digest of a whole configuration without its seed."""
    lines = [line for line in made.text().splitlines() if line.strip().partition(":")[0] != "seed"]
    return hashlib.sha256("\n".join(lines).encode()).hexdigest()[:20]


def point_key(recipe: str, seed: int, metrics: Sequence[str], code: str) -> PointKey:
    """Key of a point; any change of parameters, seed, scores or code changes the key."""
    text = json.dumps([recipe, seed, sorted(metrics)])
    return PointKey(hashlib.sha256(text.encode()).hexdigest()[:20], code)


@cache
def code_digest() -> str:
    """Digest of the code of ``teleop_core`` and installed parts, because changed code may change the numbers."""
    groups = entry_points()
    names = {"teleop_core"}
    for group in groups.groups - _NO_PARTS:
        if group.startswith("teleop_core."):
            names.update(entry.module.partition(".")[0] for entry in groups.select(group=group))
    files = [file for name in sorted(names) for file in _sources(name)]
    return f"{teleop_core.__version__}-{files_digest(files)}"


def own_digest() -> str:
    """Digest of the code of a user's own parts: of their files and all files in the same folders.

    Empty without own parts.
    """
    found = [(path.name, path) for path in own_files()]
    return f"+{files_digest(found)}" if found else ""


def _sources(package: str) -> list[tuple[str, Path]]:
    spec = find_spec(package)
    if spec is None or not spec.submodule_search_locations:
        return [(package, Path(spec.origin))] if spec is not None and spec.origin else []
    root = Path(spec.submodule_search_locations[0])
    return [(f"{package}/{path.relative_to(root).as_posix()}", path) for path in sorted(root.rglob("*.py"))]


def files_digest(files: Iterable[tuple[str, Path]]) -> str:
    """Digest of named Python files. It ignores comments, docstrings and layout, but depends on Python's version."""
    found = hashlib.sha256()
    for name, path in files:
        code = compile(path.read_bytes(), "", "exec", dont_inherit=True, optimize=2)
        found.update(f"{name}\0{_done_by(code)}".encode())
    return found.hexdigest()[:16]


def _done_by(code: CodeType) -> str:
    """Content of compiled code, independent of its line numbers."""
    constants = [
        _done_by(one) if isinstance(one, CodeType) else sorted(map(repr, one)) if isinstance(one, frozenset) else one
        for one in code.co_consts
    ]
    names = (code.co_names, code.co_varnames, code.co_freevars, code.co_cellvars)
    counts = (code.co_argcount, code.co_posonlyargcount, code.co_kwonlyargcount, code.co_flags)
    return repr((code.co_name, code.co_code, code.co_exceptiontable, constants, names, counts))


_NO_PARTS = {"teleop_core.commands", "teleop_core.pages", "teleop_core.readers"}
_READ_MORE: set[tuple[str, ...]] = set()
"""Sets of scores whose sessions must keep all streams in memory."""


def _kept(metrics: tuple[str, ...]) -> frozenset[str] | None:
    """Streams that the given scores need; None if they need all streams."""
    return None if metrics in _READ_MORE else streams_of(metrics)


def compute(point: Point, metrics: Sequence[str], recordings: Path | None) -> PointResult:
    """Run a point's session and score it; if the session fails, the result contains the error."""
    begin = time.monotonic()
    scores: dict[str, float | None] = {}
    error = ""
    try:
        out = recordings / point.name if recordings is not None else None
        run = partial(api.run, point.scenario, seed=point.seed, settings=point.settings, out=out)
        try:
            scores = measure(run(keep=_kept(tuple(metrics))).bag, metrics)
        except LeftOutError:  # a metric reads a stream that it does not declare
            _READ_MORE.add(tuple(metrics))
            scores = measure(run().bag, metrics)
    except TeleopError as raised:
        error = " ".join(str(raised).split())
    except Exception as raised:  # a user's part may raise any error; the result records it, and the study continues
        error = f"{type(raised).__name__}: {' '.join(str(raised).split())}"
    return PointResult(point.name, point.key, scores, error, time.monotonic() - begin)
