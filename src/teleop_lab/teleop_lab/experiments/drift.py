"""Drift: offset between the hand's command and the slave's command over repeated contacts with a delay."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from teleop_core.coupling.passivity.port import IN, OUT
from teleop_core.evaluation.figure import FIRST, FIXTURE, SECOND, THIRD, Figure, axis, joined, level
from teleop_core.hand.operators.shapes import minimum_jerk
from teleop_core.kernels.geometry import Array
from teleop_lab.experiments import experiment, transmission
from teleop_lab.experiments.bench import Bench
from teleop_lab.experiments.comparison import Comparison, Findings, absolute

MATERIALS = ("tissue", "silicone", "steel")
PASSIVITIES = ("none", "tank", "tdpa", "wave")
ROUND_TRIPS = (0.2, 0.7)
"""Round-trip delays [s], half in each direction. The longer value is the longest delay of Coelho et al. 2019."""
CONTACTS = 10
GOAL_MM = 1.0
"""Largest allowed drift at the begin of the next contact [mm]; assumed."""
_READY = 4.0  # time at which the arm begins to follow in a session without network [s]
_APPROACH = 3.0  # duration of the hand's approach [s]; assumed
_PERIOD = 2.0  # duration of one down and up motion of the hand [s]; assumed
_REST = 1.0  # duration of the hand's rest after the last contact [s]; assumed
_WAY = 0.02  # displacement of the hand [m], 9 mm of it within the object of palpation; assumed
_TOUCH = 0.01  # force from which on the tip is in contact [N]
_STILL = 200  # ticks at the end over which a position is averaged

Job = tuple[str, str, float]
"""Material, passivity and round-trip delay [s]."""


@dataclass(frozen=True, eq=False)
class Drift:
    """Drift after ten contacts.

    Attributes:
        leaving: Drift at the end of each contact, when the tip leaves the object (N,) [m].
        left: Drift one period after the start of each contact, when the next contact may begin (N,) [m].
        peak: Largest drift [m].
        rest: Distance of the tip from the hand's command during the rest after the last contact [m].
        given: Energy that comes out of both ports minus the energy that goes into them [J].
        force: Largest force on the tip [N].
    """

    leaving: Array
    left: Array
    peak: float
    rest: float
    given: float
    force: float


def _motion(times: Array) -> Array:
    """Positions (N, 3) [m] of a hand that approaches the object, moves down and up ten times, and rests."""
    place = np.zeros((len(times), 3))
    place[:, 2] = 0.04 * minimum_jerk(times / _APPROACH)
    turns = np.clip((times - _APPROACH) / _PERIOD, 0.0, CONTACTS)
    place[:, 1] = -0.5 * _WAY * (1.0 - np.cos(2.0 * np.pi * turns))
    return place


def measure_drift(bench: Bench, job: Job) -> Drift:
    """Measure the drift over ten contacts of a hand that ignores the force.

    Args:
        bench: Bench on which the sessions run.
        job: Material, passivity and round-trip delay [s].
    """
    material, passivity, round_trip = job
    settings = {
        **transmission.far_settings(round_trip),
        "stages": ("network", "passivity"),
        "reflection.passivity": passivity,
        "world.material": material,
    }
    seconds = _READY + _APPROACH + CONTACTS * _PERIOD + round_trip + _REST
    rows = bench.signals("palpation", seconds, settings, _motion)
    wanted, given = (rows[f"{name}_servo_cp"][:, :3] for name in ("network", "passivity"))
    drift = np.linalg.norm(wanted - given, axis=1)
    force = np.linalg.norm(rows["slave_measured_cf"][:, :3], axis=1)
    leaving, left = [], []
    led = int(rows["teleop_state"][:, 0].argmax())  # the hand's motion begins when the arm begins to follow
    period, first = round(1e3 * _PERIOD), led + round(1e3 * (_APPROACH + 0.5 * round_trip))
    for begin in range(first, first + CONTACTS * period, period):
        touching = np.flatnonzero(force[begin : begin + period] > _TOUCH)
        if len(touching) and touching[-1] < period - 1:
            leaving.append(drift[begin + touching[-1] + 1])
            left.append(drift[begin + period - 1])
    off = rows["slave_measured_cp"][-_STILL:, :3].mean(0) - wanted[-_STILL:].mean(0)
    ports = rows["master_energy"][-1] + rows["slave_energy"][-1]
    return Drift(
        np.array(leaving),
        np.array(left),
        float(drift.max()),
        float(np.linalg.norm(off)),
        float(ports[OUT] - ports[IN]),
        float(force.max()),
    )


def _rows(found: Mapping[Job, Drift]) -> tuple[Comparison, ...]:
    rows = []
    for (material, passivity, round_trip), drift in found.items():
        group = f"{material}, passivity {passivity}, round trip {1e3 * round_trip:.0f} ms"
        ended = len(drift.left)
        rows.append(
            Comparison(
                quantity=f"contacts that ended, of {CONTACTS}",
                predicted=float(ended),
                note="" if ended == CONTACTS else "the arm was stopped",
                group=group,
            )
        )
        if ended == CONTACTS:
            rows += [
                Comparison(quantity="drift as the tip leaves", unit="mm", group=group,
                    predicted=1e3 * float(drift.leaving.mean()),
                    lowest=1e3 * float(drift.leaving.min()),
                    highest=1e3 * float(drift.leaving.max())),
                Comparison(quantity="drift before the next contact, worst", unit="mm", published=0.0,
                    basis="goal", predicted=1e3 * float(drift.left.max()),
                    within=absolute(GOAL_MM), group=group),
                Comparison(quantity="tip from the hand's command, at rest", unit="mm", published=0.0,
                    basis="goal", predicted=1e3 * drift.rest, within=absolute(GOAL_MM),
                    group=group),
            ]  # fmt: skip
        rows += [
            Comparison(quantity="drift, peak", unit="mm", predicted=1e3 * drift.peak, group=group),
            Comparison(
                quantity="energy out minus energy in, both ports", unit="mJ", predicted=1e3 * drift.given, group=group
            ),
            Comparison(quantity="force on the tip, peak", unit="N", predicted=drift.force, group=group),
        ]
    return tuple(rows)


def _figure(found: Mapping[Job, Drift]) -> Figure:
    traces = []
    for (material, passivity, round_trip), drift in found.items():
        if passivity in ("tdpa", "wave") and round_trip == ROUND_TRIPS[-1] and len(drift.left):
            number = np.arange(1.0, len(drift.left) + 1.0)
            color = _COLORS[material] if passivity == "tdpa" else _WAVE
            for values, when in ((drift.leaving, "leaving"), (drift.left, "before the next")):
                trace = joined(number, 1e3 * values, f"{material}, {passivity}, {when}", color)
                trace["line"]["dash"] = "dot" if when == "leaving" else "solid"
                traces.append(trace)
    shape, note = level(GOAL_MM, "goal")
    layout = {"xaxis": axis("contact"), "yaxis": axis("drift", "mm"), "shapes": [shape], "annotations": [note]}
    sentence = f"Drift over a round trip of {1e3 * ROUND_TRIPS[-1]:.0f} ms; dotted as the tip leaves."
    return Figure("Drift, contact after contact", sentence, traces, layout, 420)


_COLORS, _WAVE = {"tissue": FIRST, "silicone": SECOND, "steel": THIRD}, FIXTURE
_NOTES = (
    "Drift: from the command that arrives from the hand to the command that passivity gives the "
    "arm. Without passivity every command is given, so there is none; what that costs is the "
    "energy that comes out, and that an arm may be stopped.",
    "0 is what a compensator of drift is for (Coelho et al. 2019); within: our goal, which is "
    "assumed. Nothing of this is a published figure.",
    f"The hand goes down and up by {1e3 * _WAY:.0f} mm in {_PERIOD:g} s, {CONTACTS} times, and "
    "then rests, all assumed. Smallest and largest of a row are those of its contacts, not of "
    "seeds.",
)


def report(found: Mapping[Job, Drift]) -> Findings:
    """Rows and figure of the measured drifts."""
    return Findings(_rows(found), (_figure(found),), _NOTES)


def _measure(bench: Bench) -> Findings:
    jobs = [(material, passivity, late) for material in MATERIALS for passivity in PASSIVITIES for late in ROUND_TRIPS]
    return report(dict(zip(jobs, bench.map(measure_drift, jobs), strict=True)))


DRIFT = experiment.Experiment(
    "drift",
    "drift of the slave from its commands after delayed contacts, by material and passivity",
    "compensator of drift of Coelho, Ott, Singh, Lizarralde and Kondak 2019",
    _measure,
)
