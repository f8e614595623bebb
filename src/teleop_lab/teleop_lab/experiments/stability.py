"""Stability: largest stable stiffness of an object by delay, grip and architecture."""

import math
from collections.abc import Mapping

import numpy as np

from teleop_core.evaluation.figure import DARK, FIRST, FIXTURE, PUBLISHED, SECOND, THIRD, Figure, axis, joined, line
from teleop_core.graph.signals import DT
from teleop_core.hand.master.device import DeviceParameters
from teleop_lab.experiments import experiment, one_axis, transmission
from teleop_lab.experiments.bench import Bench, Settings
from teleop_lab.experiments.comparison import Comparison, Findings, percent

GRIPS: Mapping[str, one_axis.Grip] = {
    "loose": one_axis.Grip(0.25, 100.0, 5.0),
    "medium": one_axis.Grip(0.25, 300.0, 12.0),
    "firm": one_axis.Grip(0.25, 1000.0, 25.0),
}
"""Models of hands: mass including the device, stiffness and damping; assumed."""
DELAYS = (0.0, 0.02, 0.05, 0.1, 0.2)
"""Delays of the force [s]."""
SOFTEST = 20.0
"""Smallest stiffness of an object that is tried [N/m]; tissue is stiffer."""
STIFFEST = 50_000.0
"""Largest stiffness of an object that is tried [N/m]: steel."""
_WAYS: tuple[transmission.Way, ...] = (
    ("position_force", "none"),
    ("position_force", "tank"),
    ("position_position", "none"),
    ("position_force", "tdpa"),
)
_TWO_PORTS = ("tdpa",)
"""Passivities that need the slave's port."""
_ROUNDS = 8
_SECONDS = 8.0  # duration of each session: two touches [s]
_TOUCH = 2000  # ticks until the tip follows its path
_WINDOW = 20  # ticks over which a speed is measured; the motion in this time is much larger than an encoder step
_THROWN = 2.0
"""A hand counts as thrown if its speed exceeds this multiple of its speed without an object."""
_COLORS = (FIRST, SECOND, FIXTURE)
_APPARENT_MASS = DeviceParameters().apparent_mass


def _settings(grip: one_axis.Grip, delay: float, stiffness: float, way: transmission.Way) -> Settings:
    architecture, passivity = way
    channels, ports = transmission.CHANNELS[architecture], ("passivity",) if passivity in _TWO_PORTS else ()
    late = [f"slave/measured_{kind}@motion_scaling={delay + 1e-3}" for kind in ("cf", "cp")]
    late += [f"slave/energy@motion_scaling={delay + 1e-3}" for _ in ports]
    return {
        "world.material": "own",
        "world.stiffness": stiffness,
        "world.damping": 0.0,
        "world.friction_coefficient": 0.0,
        "reflection.max_force": 10.0,
        "feedback_timeout": 1.0,
        "reflection.architecture": channels.architecture or architecture,
        "reflection.passivity": passivity,
        "hand.mass": grip.mass - _APPARENT_MASS,
        "hand.stiffness": grip.stiffness,
        "hand.damping": grip.damping,
        # The fault of an arm that presses into steel is only reported. If the fault stopped the arm, the arm would
        # look stable.
        "operation.reported": ("effort",),
        "delays": tuple(late),
        "stages": (*channels.stages, *ports),
    }


def fastest(bench: Bench, grip: one_axis.Grip, delay: float, stiffness: float, way: transmission.Way) -> float:
    """Largest speed of the hand [m/s] in ``palpation``, with an object without damper and friction.

    Args:
        bench: Bench on which the sessions run.
        grip: The hand.
        delay: Delay of the force [s].
        stiffness: Stiffness of the object [N/m].
        way: Architecture and passivity.
    """
    rows = bench.signals("palpation", _SECONDS, _settings(grip, delay, stiffness, way))
    place = rows["master_measured_cp"][_TOUCH:, :3]
    ways = np.linalg.norm(place[_WINDOW:] - place[:-_WINDOW], axis=1)
    return float(ways.max()) / (_WINDOW * 1e-3)


def calm_speed(bench: Bench, grip: one_axis.Grip) -> float:
    """Largest speed [m/s] of a hand that is not thrown, computed from its speed at the softest object without delay."""
    return _THROWN * fastest(bench, grip, 0.0, SOFTEST, _WAYS[0])


def chain_boundary(bench: Bench, grip: one_axis.Grip, delay: float, way: transmission.Way, calm: float) -> float:
    """Largest stiffness [N/m] at which the hand is stable with the whole chain, from 20 to 50 000 N/m.

    The simulation includes the device's friction and encoder steps, the arm's lag and the reference filter.

    Args:
        bench: Bench on which the sessions run.
        grip: The hand.
        delay: Delay of the force [s].
        way: Architecture and passivity.
        calm: Speed of the hand up to which it counts as stable [m/s], from :func:`calm_speed`.
    """

    def is_calm(stiffness: float) -> bool:
        return fastest(bench, grip, delay, stiffness, way) <= calm

    if is_calm(STIFFEST):
        return STIFFEST
    low, high = SOFTEST, STIFFEST
    for _ in range(_ROUNDS):
        middle = math.sqrt(low * high)
        low, high = (middle, high) if is_calm(middle) else (low, middle)
    return low


def _measure(bench: Bench) -> Findings:
    rows, found = [], {}
    total, done = len(GRIPS) * len(DELAYS), 0
    for name, grip in GRIPS.items():
        calm = calm_speed(bench, grip)
        for delay in DELAYS:
            told = f"force {1e3 * delay:.0f} ms later"
            exact = one_axis.exact_boundary(grip, delay + DT)
            rows.append(
                Comparison(
                    quantity=told,
                    unit="N/m",
                    published=exact,
                    basis="law",
                    predicted=one_axis.found_boundary(grip, delay),
                    within=percent(2.0),
                    group=f"one axis before a spring, {name} grip",
                )
            )
            found[name, delay] = tuple(chain_boundary(bench, grip, delay, way, calm) for way in _WAYS)
            done += 1
            bench.progress(done, total)
    for k, (architecture, passivity) in enumerate(_WAYS):
        rows += [
            Comparison(
                quantity=f"force {1e3 * delay:.0f} ms later",
                unit="N/m",
                predicted=found[name, delay][k],
                group=f"whole chain, {name} grip, {architecture}, passivity {passivity}",
                note=_note(found, name, delay, k),
            )
            for name in GRIPS
            for delay in DELAYS
        ]
    return Findings(tuple(rows), (_figure(found),), _NOTES)


def _note(found: Mapping[tuple[str, float], tuple[float, ...]], grip: str, delay: float, way: int) -> str:
    """What limits a boundary of the whole chain: the range of the search, or the length of a session."""
    here = found[grip, delay][way]
    if here == STIFFEST:
        return "stiffest tried"
    sooner = [found[grip, other][way] for other in DELAYS if other < delay]
    return "no boundary: session too short" if any(here > one for one in sooner) else ""


def _judged(found: Mapping[tuple[str, float], tuple[float, ...]], grip: str, delay: float, way: int) -> float:
    """Boundary of the whole chain; NaN if the session was too short to find it."""
    return math.nan if _note(found, grip, delay, way).startswith("no boundary") else found[grip, delay][way]


_NOTES = (
    "One axis, published: the exact boundary of a mass on spring and damper before a spring whose "
    "force comes late, by a tick of the graph and half a tick for its hold besides; predicted: our "
    "hand, device without friction or steps, and mapping.",
    f"Whole chain: stiffness up to which the hand in palpation gets no more than {_THROWN:g} times "
    "as fast as where force comes from the softest object without delay. Slow swinging takes "
    f"longer to grow than the {_SECONDS:g} s of a session, so long delays read high. A stiffness above that of a "
    "shorter delay is marked: more delay makes no hand more stable, so the session was too short to show the growth.",
    "The object is a spring alone. Grips are assumed.",
)


def _figure(found: Mapping[tuple[str, float], tuple[float, ...]]) -> Figure:
    delays = 1e3 * np.array(DELAYS)
    smooth = np.linspace(0.0, DELAYS[-1], 101)
    traces = []
    for (name, grip), color in zip(GRIPS.items(), _COLORS, strict=True):
        exact = np.array([one_axis.exact_boundary(grip, delay + DT) for delay in smooth])
        judged = [[_judged(found, name, delay, k) for k in range(len(_WAYS))] for delay in DELAYS]
        whole, tank, spring, tdpa = np.array(judged).T
        traces += [
            {
                **line(1e3 * smooth, exact, f"{name}, one exact axis", color, 1.2, "N/m"),
                "line": {"color": color, "width": 1.2, "dash": "dot"},
            },
            joined(delays, whole, f"{name}, whole chain", color, "N/m"),
        ]
        if name == "medium":
            traces.append(joined(delays, tank, "with a tank, stiffest tried", PUBLISHED, "N/m"))
            traces.append(joined(delays, tdpa, "with TDPA, stiffest tried", DARK, "N/m"))
            traces.append(joined(delays, spring, "medium, position_position", THIRD, "N/m"))
    layout = {"xaxis": axis("the force comes later by", "ms"), "yaxis": axis("stiffness", "N/m", type="log")}
    sentence = "Below its line a hand is stable; above the line the delayed force throws the hand."
    return Figure("Largest stable stiffness of an object", sentence, traces, layout, 460)


STABILITY = experiment.Experiment(
    "stability",
    "largest stable stiffness of an object whose force is delayed, by grip, architecture and passivity",
    "exact boundary of one axis",
    _measure,
)
