"""Puncture: overshoot of the tip behind a membrane until the hand, which feels the puncture, stops."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial

import numpy as np

from teleop_core.evaluation.figure import FIRST, FIXTURE, MEASURED, PUBLISHED, SECOND, THIRD, Figure, axis, joined
from teleop_core.hand.operators.human import HumanParameters
from teleop_core.hand.operators.shapes import minimum_jerk
from teleop_core.kernels.geometry import Array
from teleop_lab.experiments.bench import Bench, Settings
from teleop_lab.experiments.comparison import Comparison, Findings, absolute
from teleop_lab.experiments.experiment import Experiment
from teleop_lab.experiments.transmission import CHANNELS, Way, far_settings

WAYS: tuple[Way, ...] = (
    ("position_force", "none"),
    ("position_force", "tank"),
    ("position_force", "tdpa"),
    ("position_force", "wave"),
    ("position_position", "none"),
    ("impedance", "none"),
    ("three_channel", "none"),
    ("four_channel", "none"),
)
"""Architectures with passivities, as in the experiment ``transparency``."""
ROUND_TRIPS = (0.0, 0.1, 0.2, 0.4)
"""Round-trip delays [s], half in each direction."""
SPEED = 0.01
"""Speed with which the hand pushes [m/s]; assumed."""
NOTICED = 0.1
"""The hand notices a puncture when its force has fallen by this share of the largest force; assumed."""
_TICKS_MS = 10.0  # time [ms] in which the stages transmit a fall of the force and the hand notices the fall; assumed
_REACTION = HumanParameters().reaction_time
_FELL = 0.1  # smallest fall of the force on the tip within a tick that counts as a puncture [N]
_WITHIN = 0.2  # time in which a fall of the force counts as the hand's fall [s]; assumed
_READY = 4.0  # time until the arm follows [s]
_APPROACH = 2.0  # duration of the hand's approach [s]
_PUSH = 2.5  # duration of the hand's push [s]
Job = tuple[Way, float]
"""Architecture with passivity, and round-trip delay [s]."""


@dataclass(frozen=True)
class Puncture:
    """Reaction of a hand to a puncture; times are infinite if the hand does not notice it, NaN without a puncture.

    Attributes:
        tip_drop: Largest fall of the force on the tip from tick to tick [N].
        hand_drop: Largest fall of the force at the hand within 0.2 s after the puncture can be felt [N].
        notice: Time from the puncture until the hand notices it [s].
        overshoot: Distance that the tip moves beyond the puncture point, if the hand stops one reaction time after it
            noticed the puncture [m].
    """

    tip_drop: float
    hand_drop: float
    notice: float
    overshoot: float


def _motion(times: Array, stop: float = math.inf) -> Array:
    """Positions (N, 3) [m] of a hand that moves to the block, then pushes until ``stop`` [s]."""
    place = np.zeros((len(times), 3))
    place[:, 2] = 0.04 * minimum_jerk(times / _APPROACH)
    place[:, 1] = -SPEED * np.clip(times - _APPROACH, 0.0, min(stop - _APPROACH, _PUSH))
    return place


def _settings(way: Way, round_trip: float) -> Settings:
    architecture, passivity = way
    channels = CHANNELS[architecture]
    ports = ("passivity",) if passivity in ("tdpa", "wave") else ()
    return {
        **far_settings(round_trip),
        "coarse_gain": 1.0,
        "tremor_amplitude": 0.0,
        "stages": ("network", *channels.stages, *ports),
        "reflection.architecture": channels.architecture or architecture,
        "reflection.passivity": passivity,
    }


def measure_puncture(bench: Bench, job: Job) -> Puncture:
    """Measure a puncture with two sessions: in the first the hand continues to push, in the second it stops.

    Args:
        bench: Bench on which the sessions run.
        job: Architecture with passivity, and round-trip delay [s].
    """
    settings, late = _settings(*job), job[1]
    seconds = _READY + _APPROACH + _PUSH + late
    rows = bench.signals("puncture", seconds, settings, _motion)
    force = np.linalg.norm(rows["slave_measured_cf"][:, :3], axis=1)
    falls = force[:-1] - force[1:]
    begin = int(falls.argmax())
    if falls[begin] < _FELL:  # the tip never punctured the membrane
        return Puncture(float(falls[begin]), math.nan, math.nan, math.nan)
    hears = begin + round(0.5e3 * late)  # the force before this time cannot show the puncture
    led = int(rows["teleop_state"][:, 0].argmax())  # the hand's motion begins when the arm begins to follow
    end = led + round(1e3 * (_APPROACH + _PUSH))  # at this sample the push ends, so the force falls without a puncture
    push = np.linalg.norm(rows["master_servo_cf"][hears:end, :3], axis=1)
    most = np.maximum.accumulate(push)
    fell = np.flatnonzero(push < (1.0 - NOTICED) * most)
    drop = float((most - push)[: round(1e3 * _WITHIN)].max())
    if not len(fell):
        return Puncture(float(falls[begin]), drop, math.inf, math.inf)
    noticed = hears + int(fell[0])
    stop = 1e-3 * (noticed - led) + _REACTION
    stopped = bench.signals("puncture", seconds + _REACTION + late, settings, partial(_motion, stop=stop))
    height = stopped["slave_true_cp"][:, 2]
    deepest = float(height[begin] - height[begin:].min())
    return Puncture(float(falls[begin]), drop, 1e-3 * (noticed - begin), deepest)


def _rows(found: Mapping[Job, Puncture]) -> tuple[Comparison, ...]:
    rows = []
    for ((architecture, passivity), late), each in found.items():
        group, told = f"{architecture}, passivity {passivity}", f", {1e3 * late:.0f} ms"
        if math.isnan(each.notice):
            rows.append(
                Comparison(
                    quantity=f"fall of the force on the tip{told}",
                    unit="N",
                    group=group,
                    predicted=each.tip_drop,
                    note="the membrane holds",
                )
            )
            continue
        is_noticed = math.isfinite(each.notice)
        rows.append(
            Comparison(
                quantity=f"fall of the force at the hand{told}",
                unit="N",
                group=group,
                published=each.tip_drop,
                predicted=each.hand_drop,
                note="" if is_noticed else "the hand does not notice",
            )
        )
        if not is_noticed:
            continue
        rows += [
            Comparison(quantity=f"noticed after{told}", unit="ms", group=group, published=500.0 * late,
                basis="law", predicted=1e3 * each.notice, within=absolute(_TICKS_MS)),
            Comparison(quantity=f"overshoot{told}", unit="mm", group=group,
                published=1e3 * least_overshoot(late), predicted=1e3 * each.overshoot),
        ]  # fmt: skip
    return tuple(rows)


def least_overshoot(round_trip: float) -> float:
    """Smallest possible overshoot [m]: the hand's speed times the sum of round-trip delay and reaction time.

    The force needs half of the round trip to the hand, and the hand's stop needs the other half to the tip.
    """
    return SPEED * (round_trip + _REACTION)


def _figure(found: Mapping[Job, Puncture]) -> Figure:
    late = 1e3 * np.array(ROUND_TRIPS)
    least = 1e3 * np.array([least_overshoot(each) for each in ROUND_TRIPS])
    traces = [joined(late, least, "least", PUBLISHED, "mm")]
    for way, color in _COLORS.items():
        kept = [
            (1e3 * job[1], 1e3 * each.overshoot)
            for job, each in found.items()
            if job[0] == way and math.isfinite(each.overshoot)
        ]
        if kept:
            trips, overshoots = np.array(kept).T
            traces.append(joined(trips, overshoots, f"{way[0]}, {way[1]}", color, "mm"))
    layout = {"xaxis": axis("round trip", "ms"), "yaxis": axis("overshoot", "mm")}
    sentence = "Distance of the tip behind the membrane when the hand, after it felt the puncture, has stopped."
    return Figure("Overshoot of a puncture", sentence, traces, layout, 420)


_COLORS = {
    ("position_force", "none"): FIRST,
    ("position_force", "wave"): SECOND,
    ("position_position", "none"): FIXTURE,
    ("impedance", "none"): MEASURED,
    ("four_channel", "none"): THIRD,
}
_NOTES = (
    f"The hand pushes on with {1e3 * SPEED:g} mm/s through the membrane of the scenario puncture. "
    f"It notices when its force fell by {100.0 * NOTICED:g} % and stops {1e3 * _REACTION:g} ms "
    "later (Keele and Posner 1968). Speed and threshold are assumed.",
    "Published: of the force at the hand, the fall on the tip; of the time until it is noticed, "
    "the way of the news, half a round trip; of the overshoot, speed times round trip and "
    "reaction. These are laws; no number that a source measured is here.",
    "An overshoot is larger than the least one, for hand and tissue spring forward as the membrane gives way.",
    "Where the membrane holds, passivity holds the arm back before it.",
)


def report(found: Mapping[Job, Puncture]) -> Findings:
    """Rows and figure of the measured punctures."""
    return Findings(_rows(found), (_figure(found),), _NOTES)


def _measure(bench: Bench) -> Findings:
    jobs = [(way, late) for way in WAYS for late in ROUND_TRIPS]
    return report(dict(zip(jobs, bench.map(measure_puncture, jobs), strict=True)))


PUNCTURE = Experiment(
    "puncture",
    "force of a puncture at the hand, and overshoot of the tip, by architecture and delay",
    "membrane of Okamura, Simone and O'Leary 2004; reaction of Keele and Posner 1968",
    _measure,
)
