"""UVA: times of a user study of fifteen people, predicted before its table was read.

``uva_prediction.csv`` contains the original prediction. ``docs/predicted_study.md`` describes when and how the
prediction was made.
"""

import csv
import math
from collections.abc import Iterable
from importlib.resources import files
from typing import NamedTuple

import numpy as np

from teleop_lab.experiments.bench import Bench
from teleop_lab.experiments.comparison import Comparison, Findings, absolute
from teleop_lab.experiments.experiment import Experiment

CYCLE = 0.325
"""Time of a look-move cycle of a person without any lag [s], identified from MacKenzie and Ware 1993. The formula MT =
2.7 (0.325 s + lag) fits their four lags within 2 %."""
_LEAST_TIME, _TIME_PER_BIT, _NOISE = 0.06, 0.02, 0.04  # of the operator, when the prediction was registered [s]
_PEOPLE, _MOST = 20_000, 60
LATENCY = 0.033 + 0.050
"""Latency of the operator's station [s]: two frames at 60 Hz, and 50 ms for encoding and decoding the video (Nankaku et
al. 2022)."""
TOTAL = 22.1
"""Printed mean time of a transfer without faults [s]. It is the only number of the study that the prediction uses."""


class Primitive(NamedTuple):
    """A motion primitive of a transfer, with its target."""

    name: str
    way: float  # [m]
    width: float  # width of the target [m]


PRIMITIVES = (
    Primitive("right reaches", 0.060, 0.006),
    Primitive("right grasps", 0.006, 0.002),
    Primitive("right lifts off", 0.017, 0.006),
    Primitive("both meet", 0.045, 0.004),
    Primitive("left grasps", 0.008, 0.002),
    Primitive("right releases", 0.004, 0.004),
    Primitive("right retreats", 0.025, 0.010),
    Primitive("left reaches the goal", 0.055, 0.004),
    Primitive("left releases", 0.015, 0.002),
)
"""Primitives of a transfer. Distances follow from the geometry of the board. Widths are assumed: 2 mm for fingers on a
block, 2 to 4 mm for a peg in its hole, 6 mm to be clear of a peg, 10 mm to be out of the other arm's path."""


class Level(NamedTuple):
    """A level of the study, which is defined by the faults of the network."""

    name: str
    delay: float = 0.0  # mean [s]
    loss: float = 0.0  # share of the increments that is lost
    outage: float = 0.0  # mean duration of an outage [s]
    pause: float = 0.0  # time between two outages [s]


LEVELS = (
    Level("normal"),
    Level("loss 10 %", loss=0.1),
    Level("loss 30 %", loss=0.3),
    Level("loss 50 %", loss=0.5),
    Level("delay 100 ms", delay=0.1),
    Level("delay 300 ms", delay=0.3),
    Level("delay 500 ms", delay=0.5),
    Level("outages 1", outage=1.5, pause=8.5),
    Level("outages 2", outage=0.5, pause=1.0),
    Level("outages 3", outage=1.0, pause=1.0),
)


def looks(way: float, width: float, passed: float = 1.0, seed: int = 1) -> float:
    """Mean number of submovements to a target, by the rules that the operator had when the prediction was registered.

    Args:
        way: Distance to the target [m].
        width: Width of the target in which the motion must end [m].
        passed: Share of each motion that the slave makes; it is below 1 if, for example, the network loses increments.
        seed: Seed of the hand's noise.
    """
    rng, off = np.random.default_rng(seed), np.full(_PEOPLE, way)
    count, tries = np.zeros(_PEOPLE), np.ones(_PEOPLE, bool)
    for _ in range(_MOST):
        lasts = _LEAST_TIME + _TIME_PER_BIT * np.log2(np.abs(off) / width + 1.0)
        noise = rng.standard_normal(_PEOPLE) * _NOISE * np.abs(off) / lasts
        off = np.where(tries, off - passed * off + noise, off)
        count += tries
        tries &= np.abs(off) > 0.5 * width
    return float(count.mean())


def _unscaled_time(primitive: Primitive, level: Level) -> float:
    """Time of a primitive at a level [s], before the common scale factor is applied.

    The time of a look is the sum of a cycle, the station's latency and the delay. Lost motion must be repeated. An
    outage costs its duration and the time of the look that it interrupts.
    """
    count = looks(primitive.way, primitive.width, 1.0 - level.loss)
    time = count * (CYCLE + LATENCY + level.delay)
    if level.pause > 0.0:
        time *= 1.0 + (level.outage + CYCLE + LATENCY) / level.pause
    return time


def _mackenzie(primitive: Primitive, level: Level) -> float:
    """Time of a primitive by the law of MacKenzie and Ware 1993: MT = 230 + (169 + 1.03 lag) ID ms."""
    bits = math.log2(primitive.way / primitive.width + 1.0)
    return 0.230 + (0.169 + 1.03 * (LATENCY + level.delay)) * bits


def predict() -> dict[str, dict[str, dict[str, float]]]:
    """Times [s] by model, level and primitive; without faults the total of each model is :data:`TOTAL`.

    ``looks`` is the prediction. ``constant`` multiplies every time by one factor: the mean of the printed totals,
    divided by the printed total without faults. ``mackenzie`` is the law for pointing, which considers only delays.
    """
    slower = sum((22.1, 24.4, 26.6, 36.2, 27.1, 34.1, 47.9, 28.9, 47.4, 64.3)) / 10.0 / TOTAL
    normal = LEVELS[0]
    models = {
        "looks": _unscaled_time,
        "constant": lambda p, level: _unscaled_time(p, normal) * (1.0 if level is normal else slower),
        "mackenzie": _mackenzie,
    }
    found = {}
    for name, model in models.items():
        scale = TOTAL / sum(model(p, normal) for p in PRIMITIVES)
        found[name] = {level.name: {p.name: scale * model(p, level) for p in PRIMITIVES} for level in LEVELS}
    return found


Table = dict[str, dict[str, float]]
"""Times [s] by level and primitive."""
PERSONS = 15
_T95 = 2.145
"""Factor of a two-sided 95 % confidence interval: Student's distribution with 14 degrees of freedom."""
_FOLDER = files("teleop_lab.experiments")


def registered() -> dict[str, Table]:
    """The stored original prediction, by model."""
    found: dict[str, Table] = {}
    for row in _lines("uva_prediction.csv"):
        levels = found.setdefault(row["model"], {})
        levels.setdefault(row["level"], {})[row["primitive"]] = float(row["seconds"])
    return found


def published() -> tuple[Table, Table]:
    """Printed means over the persons [s], and half widths of the 95 % intervals."""
    means: Table = {}
    halves: Table = {}
    for row in _lines("uva_published.csv"):
        means.setdefault(row["level"], {})[row["primitive"]] = float(row["mean"])
        half = _T95 * float(row["deviation"]) / math.sqrt(PERSONS)
        # The times are printed to 0.1 s, so smaller differences count as agreement.
        halves.setdefault(row["level"], {})[row["primitive"]] = half + 0.05
    return means, halves


def _lines(name: str) -> list[dict[str, str]]:
    return list(csv.DictReader(_FOLDER.joinpath(name).read_text("utf-8").splitlines()))


def from_normal(table: Table) -> Table:
    """Printed times without faults, multiplied by the predicted slowing of each level."""
    means, _ = published()
    begin = LEVELS[0].name
    return {
        level: {name: means[begin][name] * time / table[begin][name] for name, time in row.items()}
        for level, row in table.items()
    }


def inside(table: Table, levels: Iterable[Level] = LEVELS) -> int:
    """Number of times of a table that lie within the 95 % intervals of the persons."""
    means, halves = published()
    return sum(
        abs(table[level.name][p.name] - means[level.name][p.name]) <= halves[level.name][p.name]
        for level in levels
        for p in PRIMITIVES
    )


def _rows(table: Table, group: str, levels: Iterable[Level]) -> list[Comparison]:
    means, halves = published()
    return [
        Comparison(
            quantity=p.name,
            unit="s",
            published=means[level.name][p.name],
            predicted=table[level.name][p.name],
            within=absolute(halves[level.name][p.name]),
            group=f"{group}: {level.name}",
        )
        for level in levels
        for p in PRIMITIVES
    ]


def _measure(_: Bench) -> Findings:
    tables, faults = registered(), LEVELS[1:]
    slowed = {name: from_normal(table) for name, table in tables.items()}
    count = len(LEVELS) * len(PRIMITIVES)
    notes = [
        f"{name}: {inside(table)} of {count} inside as registered; with the printed times without "
        f"faults {inside(slowed[name], faults)} of {count - len(PRIMITIVES)}"
        for name, table in tables.items()
    ]
    notes.append(
        "inside: within the 95 % interval of fifteen persons. The prediction was committed before "
        "the table was opened (docs/predicted_study.md); the printed times without faults were "
        "taken for the second group afterwards."
    )
    rows = _rows(tables["looks"], "registered", LEVELS)
    rows += _rows(slowed["looks"], "slowing from the printed times without faults", faults)
    return Findings(tuple(rows), (), tuple(notes))


UVA = Experiment(
    "uva",
    "times of nine motion primitives of a peg transfer at ten levels of a bad line",
    "UVA-DSA telesurgery QoS analysis 2026 (arXiv 2603.06824), fifteen persons",
    _measure,
)
