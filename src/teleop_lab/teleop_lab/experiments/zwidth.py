"""Z-width: the largest stiffness of a fixture that our device renders, by three laws and through our own stage."""

from collections.abc import Mapping
from dataclasses import replace
from itertools import count

import numpy as np

from teleop_core.evaluation.figure import FIRST, FIXTURE, SECOND, Figure, Trace, axis, level, line, points
from teleop_core.graph.signals import DT
from teleop_core.hand.master.device import DeviceParameters
from teleop_lab.experiments import experiment, one_axis, sampled_wall, stability
from teleop_lab.experiments.bench import Bench
from teleop_lab.experiments.comparison import Comparison, Findings, absolute, percent

BARE = one_axis.Grip(0.045, 1.0, 2.0)
"""Grip of the loosest hand that the parameters allow, with the mass and an assumed viscous friction of our device."""
LATE = (0, 1, 2, 3, 5, 10)
"""Delays of the wall's force, as numbers of periods of 1 ms."""
WALL_DAMPINGS = (0.0, 5.0)
"""Dampings of the walls [N·s/m]; assumed."""
DAMPINGS = ((2.0, 0.0), (5.0, 2.0), (5.0, 5.0))
"""Pairs of the device's viscous friction and the wall's damping [N·s/m] for which the energy is computed."""
PRESSES = (1, 2, 5, 20, 50)
"""Lengths of the presses, as the number of periods in each direction."""
SPEEDS = (0.005, 0.1)
"""Speeds of the presses [m/s]."""
_OWN = DeviceParameters()
DEVICES = (
    (_OWN.friction, _OWN.position_resolution),
    (0.5 * _OWN.friction, _OWN.position_resolution),
    (_OWN.friction, 0.5 * _OWN.position_resolution),
)
"""Pairs of dry friction [N] and encoder step [m] that are tried, made of our device's values and half of them."""
_WITHIN, _EXACT = percent(10.0), percent(2.0)
_NONE = absolute(10.0)  # [N/m]; used if a law allows no stiffness, because a relative difference is then undefined
_CASES = tuple((b, late) for b in WALL_DAMPINGS for late in LATE)
_COLORS = (FIRST, SECOND)
Boundaries = Mapping[tuple[float, int], float]
"""Stiffness [N/m] by the wall's damping and the delay in periods."""
Bounds = Mapping[tuple[float, float, int], float]
"""Stiffness [N/m] by the device's damping, the wall's damping and the length of the press."""


def linear_law(damping: float, wall_damping: float, delay: float) -> float:
    """Largest stable stiffness [N/m] of a wall, for a heavy device with little damping.

    Args:
        damping: Viscous friction of the device [N·s/m].
        wall_damping: Damping of the wall [N·s/m].
        delay: Delay of the force [s], without the half period of the hold.

    Source:
        Gil et al. 2009, K < (b + B) / (T / 2 + td).
    """
    return (damping + wall_damping) / (0.5 * DT + delay)


def passive_law(damping: float, wall_damping: float) -> float:
    """Stiffness [N/m] up to which a wall is passive for any motion of the hand.

    Source:
        Colgate and Schenkel 1997, b > K T / 2 + |B|.
    """
    return max(damping - abs(wall_damping), 0.0) / (0.5 * DT)


def press_law(damping: float, wall_damping: float, length: int) -> float:
    """Stiffness [N/m] above which the hand gains energy in a press, if it moves in and out at the same speed.

    In each period, in units of the squared speed, the spring gives K T / 2, the device takes b and the damper takes B.
    But in the period after each of the two reversals the damper gives B. The shortest press (one period in each
    direction) leads to :func:`passive_law`, the longest to :func:`linear_law`.

    Args:
        damping: Viscous friction of the device [N·s/m].
        wall_damping: Damping of the wall [N·s/m].
        length: Number of periods of the motion into the wall, equal to that of the motion out of the wall.
    """
    return (damping + wall_damping * (1.0 - 2.0 / length)) / (0.5 * DT)


def quiet_law(friction: float, resolution: float) -> float:
    """Stiffness [N/m] up to which dry friction [N] keeps the device at rest between two encoder steps [m].

    Source:
        Abbott and Okamura 2005, K <= 2 f / Delta; Diolaiti et al. 2006.
    """
    return 2.0 * friction / resolution


def _stability(found: Boundaries) -> list[Comparison]:
    """Rows that compare our device with the linear law for every damping, then with the exact one-axis solution."""
    laws, exact = [], []
    for (wall_damping, late), predicted in found.items():
        axis_ = one_axis.sampled_boundary(BARE, late, wall_damping)
        law = linear_law(BARE.damping, wall_damping, 1e-3 * late)
        where = f"B = {wall_damping:g} N·s/m"
        row = Comparison(
            quantity=f"force {late} ms later",
            unit="N/m",
            published=round(law, 1),
            basis="law",
            predicted=predicted,
            within=_WITHIN,
            group=f"stable, linear law of Gil 2009, {where}",
            note=f"exact {axis_:.0f}",
        )
        laws.append(row)
        group = f"stable, exact sampled axis, {where}"
        exact.append(replace(row, published=round(axis_, 1), within=_EXACT, group=group, note=""))
    return [*laws, *exact]


def _energy(found: Bounds) -> list[Comparison]:
    rows = []
    for damping, wall_damping in DAMPINGS:
        bounds = {n: found[damping, wall_damping, n] for n in PRESSES}
        worst, longest = min(bounds.values()), max(PRESSES)
        law, text = passive_law(damping, wall_damping), f"b = {damping:g}, B = {wall_damping:g}"
        rows += [
            Comparison(quantity=f"{text} N·s/m, worst press", unit="N/m", published=law, predicted=worst,
                basis="law", within=_WITHIN if law else _NONE,
                group="passive, Colgate and Schenkel 1997"),
            Comparison(quantity=f"{text} N·s/m, press of {longest} ms", unit="N/m",
                published=press_law(damping, wall_damping, longest), predicted=bounds[longest],
                basis="law", within=_WITHIN, group="gives no energy in a long press"),
        ]  # fmt: skip
    return sorted(rows, key=lambda row: row.group, reverse=True)


def _divergence() -> Comparison:
    grip = stability.GRIPS["loose"]  # the grip has a damping of 5 N·s/m and a mass of 0.25 kg
    return Comparison(
        quantity="b = B = 5 N·s/m, 0.25 kg",
        unit="N/m",
        published=round(one_axis.sampled_boundary(grip, 0, grip.damping), 1),
        basis="law",
        predicted=sampled_wall.wall_boundary(grip, grip.damping, 0),
        within=_EXACT,
        group="diverges, exact sampled axis",
        note="passive: 0",
    )


def _quiet(friction: float, resolution: float) -> Comparison:
    return Comparison(
        quantity=f"friction {friction:g} N, steps of {1e3 * resolution:g} mm",
        unit="N/m",
        published=round(quiet_law(friction, resolution), 1),
        basis="law",
        predicted=sampled_wall.restless_boundary(friction, resolution),
        within=_WITHIN,
        group="rests under a loose hand, Abbott and Okamura 2005",
    )


def _measure(bench: Bench) -> Findings:
    total, steps = len(_CASES) + 1 + len(DAMPINGS) + len(DEVICES), count(1)
    stable: dict[tuple[float, int], float] = {}
    for case in _CASES:
        stable[case] = sampled_wall.wall_boundary(BARE, *case)
        bench.progress(next(steps), total)
    diverging = _divergence()
    bench.progress(next(steps), total)
    passive: dict[tuple[float, float, int], float] = {}
    for dampings in DAMPINGS:
        for length in PRESSES:
            bounds = [sampled_wall.passive_boundary(*dampings, length, speed) for speed in SPEEDS]
            passive[(*dampings, length)] = min(bounds)
        bench.progress(next(steps), total)
    quiet = []
    for device in DEVICES:
        quiet.append(_quiet(*device))
        bench.progress(next(steps), total)
    rows = (*_stability(stable), *_energy(passive), diverging, *quiet)
    return Findings(rows, (_delay_figure(stable), _press_figure(passive, diverging)), _NOTES)


_NOTES = (
    "Published: what the laws give for frictions, dampings and delays that are assumed; mass, dry "
    "friction and steps are our device's. No number that a source measured is here, and the "
    "equations were not read in the sources again. Exact: eigenvalues of the sampled axis.",
    "Predicted: our haptic master, rigid, with the spring of the chain's soft wall "
    "(walls.wall_force) and a damper B on the difference of two samples. No wall of the chain has "
    "that damper; the damped wall smooths its speed. The force comes in the very next period.",
    "The linear law is one of small stiffness: with B = 5 N·s/m on 45 g it is too high beside the "
    "exact axis from 1 ms on. Those rows miss the law, not the axis.",
    "Energy: work of master/contact over a press within the wall at one speed, by a hand that "
    "nothing stops, less what b takes of the same way, for our device has no viscous friction. The "
    f"worst of presses of {', '.join(map(str, PRESSES))} ms in and as many out; the speed does not "
    "matter. Where the law is 0 the row is judged within 10 N/m.",
    "Rests: a hand of 1 N/m and 0.1 N·s/m leans between two steps of the wall's force, without a "
    "blow. At 80 % of the law a hand that comes with 0.15 m/s comes "
    "to rest too; with 0.2 m/s it swings on, since the held force then gives more than friction "
    "takes (measured once, not by this command).",
)


def _delay_figure(found: Boundaries) -> Figure:
    smooth = np.linspace(0.0, LATE[-1], 101)
    traces: list[Trace] = []
    for wall_damping, color in zip(WALL_DAMPINGS, _COLORS, strict=True):
        law = np.array([linear_law(BARE.damping, wall_damping, 1e-3 * late) for late in smooth])
        exact = np.array([one_axis.sampled_boundary(BARE, late, wall_damping) for late in LATE])
        name = f"B = {wall_damping:g} N·s/m"
        traces += [
            {
                **line(smooth, law, f"{name}, linear law", color, 1.2, "N/m"),
                "line": {"color": color, "width": 1.2, "dash": "dot"},
            },
            line(np.array(LATE, dtype=float), exact, f"{name}, exact", color, 1.5, "N/m"),
        ]
        ys = np.array([found[wall_damping, late] for late in LATE])
        traces.append(points(np.array(LATE, dtype=float), ys, f"{name}, our device", color, "N/m", 1))
    layout = {"xaxis": axis("the force comes later by", "ms"), "yaxis": axis("stiffness", "N/m", type="log")}
    sentence = "Below its line a wall is stable. Our device's marks lie on the exact line."
    return Figure("How stiff a sampled wall may be", sentence, traces, layout, 460)


def _press_figure(found: Bounds, diverging: Comparison) -> Figure:
    damping, wall_damping = DAMPINGS[-1]
    lengths = range(1, max(PRESSES) + 1)
    law = np.array([press_law(damping, wall_damping, n) for n in lengths])
    ours = np.array([found[damping, wall_damping, n] for n in PRESSES])
    shape, note = level(diverging.published or 0.0, "diverges")
    traces = [
        line(np.array(lengths, dtype=float), law, "gives energy, exact", FIRST, 1.5, "N/m"),
        points(np.array(PRESSES, dtype=float), ours, "gives energy, our device", FIXTURE, "N/m"),
    ]
    layout = {
        "xaxis": axis("press, in and as long out", "ms"),
        "yaxis": axis("stiffness", "N/m"),
        "shapes": [shape],
        "annotations": [note],
    }
    sentence = "Passive is what gives energy in no press, the shortest too; a wall diverges far above it."
    return Figure("Passivity and divergence, b = B = 5 N·s/m", sentence, traces, layout, 460)


ZWIDTH = experiment.Experiment(
    "zwidth",
    "how stiff a fixture the device renders: stable, passive, and at rest",
    "laws of Gil 2009, Colgate and Schenkel 1997, Abbott and Okamura 2005",
    _measure,
)
