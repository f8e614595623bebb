"""Transparency: the impedance that the hand feels, by architecture, passivity and round-trip delay."""

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from teleop_core.evaluation.figure import (
    FIRST,
    FIXTURE,
    MEASURED,
    PUBLISHED,
    SECOND,
    THIRD,
    Figure,
    Trace,
    axis,
    level,
    line,
    points,
)
from teleop_core.kernels.geometry import Array
from teleop_lab.experiments.bench import Bench
from teleop_lab.experiments.comparison import Comparison, Findings, absolute, percent
from teleop_lab.experiments.experiment import Experiment
from teleop_lab.experiments.transmission import AIR, Cell, Way, measure_cells, predicted_hybrid
from teleop_lab.experiments.two_port import LINES, Complex, Lag, bandwidth, felt_impedance, llewellyn

WAYS = (
    ("unilateral", "none"),
    ("position_force", "none"),
    ("position_force", "tank"),
    ("position_force", "tdpa"),
    ("position_force", "wave"),
    ("position_position", "none"),
    ("position_position", "tank"),
    ("position_position", "tdpa"),
    ("impedance", "none"),
    ("three_channel", "none"),
    ("four_channel", "none"),
)
"""Architectures with passivities. With ``wave`` the architecture has no effect. ``impedance`` is position-force with a
slave that yields."""
ROUND_TRIPS = (0.0, 0.02, 0.1, 0.2)
"""Round-trip delays [s], half in each direction."""
LAG = Lag(0.05, 1e-4, 20)
"""Arm of the exactly known two-port. It has the lag of our arm and a delay of 20 ms in each direction; assumed."""
STRAY = 0.3
"""Largest share of a force outside of the spectral lines at which a gain of this force is meaningful; assumed."""
_AT = int(np.abs(LINES - 1.0).argmin())
_WITHIN, _NEAR = percent(5.0), absolute(0.05)
_FORCE, _POSITION = ("position_force", "none"), ("position_position", "none")
_FOUR = ("four_channel", "none")
Cells = Mapping[tuple[Way, float], Cell]
_LATE_COLORS = (FIRST, SECOND, THIRD, FIXTURE)
_COLORS = {_FORCE: FIRST, _POSITION: SECOND, ("position_force", "wave"): MEASURED, _FOUR: THIRD}


@dataclass(frozen=True)
class Number:
    """One number of an architecture with a passivity.

    Attributes:
        quantity: Name of the number.
        unit: Unit of the number.
        measured: Value measured at the ports.
        law: Value computed from a hybrid matrix.
        stray: Share of the underlying signals outside of the excited lines.
    """

    quantity: str
    unit: str
    measured: float
    law: float
    stray: float


def numbers(cell: Cell, hybrid: Complex) -> list[Number]:
    """Numbers of a cell, each as measured and as computed from a hybrid matrix (L, 2, 2)."""
    air, soft, tip = cell.ports[AIR], cell.ports["tissue"], -hybrid[:, 1, 0]
    hz = f"at {LINES[_AT]:g} Hz"
    follows = [bandwidth(air.tip_speed / air.hand_speed), bandwidth(tip)]
    felt = felt_impedance(hybrid, soft.world)
    # Speed of the tip divided by the speed of the hand.
    speed = tip / (1.0 + hybrid[:, 1, 1] * soft.world)
    forces = [bandwidth(soft.hand_force / soft.tip_force), bandwidth(felt / (speed * soft.world))]
    drags = [abs(air.felt[_AT]), abs(hybrid[_AT, 0, 0])]
    found = [
        Number("position, -3 dB", "Hz", follows[0], follows[1], air.stray),
        Number("force on tissue, -3 dB", "Hz", forces[0], forces[1], soft.stray),
        Number(f"felt in the air {hz}", "N·s/m", drags[0], drags[1], air.stray),
    ]
    for world, ports in cell.ports.items():
        if world != AIR:
            own = abs(ports.world[_AT])
            shares = [abs(ports.felt[_AT]), abs(felt_impedance(hybrid, ports.world)[_AT])]
            found.append(Number(f"felt of {world}, share {hz}", "", shares[0] / own, shares[1] / own, ports.stray))
    both = [float(llewellyn(matrix)[_AT]) for matrix in (cell.hybrid, hybrid)]
    found.append(Number(f"Llewellyn's number {hz}", "", both[0], both[1], cell.stray))
    return found


def _rows(found: list[Number], group: str, told: str, *, is_judged: bool) -> list[Comparison]:
    """Rows of all finite numbers; the stray share of their signals is at most :data:`STRAY`."""
    rows = []
    for each in found:
        if each.stray > STRAY or not math.isfinite(each.measured):
            continue
        law = each.law if is_judged and math.isfinite(each.law) else None
        # A relative tolerance does not suit a law that is 0, nor Llewellyn's number.
        within = _NEAR if not each.law or "Llewellyn" in each.quantity else _WITHIN
        rows.append(
            Comparison(
                quantity=each.quantity + told,
                unit=each.unit,
                published=law,
                basis="law",
                predicted=each.measured,
                within=None if law is None else within,
                group=group,
            )
        )
    return rows


def _cell_rows(way: Way, round_trip: float, cell: Cell, arm: Complex) -> list[Comparison]:
    architecture, passivity = way
    is_judged = passivity == "none" and architecture != "unilateral"
    law = predicted_hybrid(arm, architecture, round_trip) if is_judged else cell.hybrid
    told, group = f", {1e3 * round_trip:.0f} ms", f"{architecture}, passivity {passivity}"
    rows = _rows(numbers(cell, law), group, told, is_judged=is_judged)
    for world, ports in cell.ports.items():
        if ports.stray > STRAY:
            rows.append(
                Comparison(
                    quantity=f"off the lines, {world}{told}",
                    unit="%",
                    predicted=100.0 * ports.stray,
                    group=group,
                    note="not linear",
                )
            )
    return rows


def lag_cell() -> Cell:
    """Measure the two-port whose hybrid matrix is known: without an object, and at two springs."""
    return Cell.of({AIR: LAG.ports(0.0), "tissue": LAG.ports(200.0), "silicone": LAG.ports(1000.0)})


def _lag_rows(cell: Cell) -> list[Comparison]:
    exact, group = LAG.hybrid(), "two-port that is known: our hand and mapping, exact lag"
    rows = []
    for i, k in ((0, 1), (1, 0), (1, 1)):
        size = np.abs(exact[:, i, k])
        off = np.abs(cell.hybrid[:, i, k] - exact[:, i, k]) / size
        rows.append(
            Comparison(
                quantity=f"h{i + 1}{k + 1}, farthest from the exact one",
                unit="%",
                published=0.0,
                basis="law",
                predicted=100.0 * float(off.max()),
                within=absolute(5.0),
                group=group,
            )
        )
    return rows + _rows(numbers(cell, exact), group, "", is_judged=True)


def report(cells: Cells, known: Cell) -> Findings:
    """Rows and figures of the measurements.

    Args:
        cells: Results of the chain, which must include position-force without passivity and without delay.
        known: Result of :func:`lag_cell`.
    """
    arm, rows = cells[_FORCE, 0.0].hybrid, _lag_rows(known)
    for (way, late), cell in cells.items():
        rows += _cell_rows(way, late, cell, arm)
    felt = [_felt_figure(cells, world) for world in cells[_FORCE, 0.0].ports]
    figures = (*felt, _stability_figure(cells, arm), _known_figure(known))
    return Findings(tuple(rows), figures, _NOTES)


def _measure(bench: Bench) -> Findings:
    wanted = [(way, late) for way in WAYS for late in ROUND_TRIPS if way[0] != "unilateral"]
    return report(measure_cells(bench, [(WAYS[0], 0.0), *wanted]), lag_cell())


_NOTES = (
    "Published: computed by the equations of the sources, which were not read again; no number "
    "that a source measured is here. Of the known two-port it is the exact hybrid matrix. Of the "
    "chain without passivity it is made of four things: the arm's row, as position_force without "
    "a round trip showed it; the channels with the slave's admittance; the delays of the network; "
    "and 2 ms for two readers. For position_force at 0 ms the tip's numbers are no test.",
    "Excited is the place of a firm hand: 20 lines from 0.1 to 30 Hz of 0.15 mm each, odd "
    "multiples of 0.1 Hz, over one period of 10 s, around a point 3 mm deep in the object of "
    "palpation. Gain of motion and force is 1. Ports: push of the master and place of the device, "
    "which is ideal and is not counted; force on the tip and slave/measured_cp.",
    "Force, -3 dB: of the hand's over the tip's. It has no row where it holds beyond 30 Hz; 0: the "
    "hand feels less than 71 % of the force at the first line.",
    "Llewellyn's number: 1 and more is absolutely stable, whatever passive hand and world. It has "
    "no row where nothing comes back.",
    f"A number has no row where more than {100.0 * STRAY:.0f} % of a force, or of the tip's way, "
    "is off the lines: what is not linear has no impedance there. Tank and TDPA count energy, "
    "which an arm that lags spends as long as it is shaken: they then leave as little as 5 mN of a "
    "force.",
    "With wave the architecture says nothing, so it is measured once.",
)


def _curve(y: Array, name: str, color: str, dash: str, unit: str = "") -> Trace:
    return {**line(LINES, y, name, color, 1.5, unit), "line": {"color": color, "width": 1.5, "dash": dash}}


def _felt_figure(cells: Cells, world: str) -> Figure:
    traces = []
    if world != AIR:
        own = np.abs(cells[_FORCE, 0.0].ports[world].world)
        traces.append(_curve(own, world, PUBLISHED, "dot", "N·s/m"))
    for (way, late), cell in cells.items():
        ports = cell.ports[world]
        is_drawn = way in _COLORS and late in (ROUND_TRIPS[0], ROUND_TRIPS[-1])
        if is_drawn and ports.stray <= STRAY and np.abs(ports.felt).max() > 1e-6:
            name, dash = _told(way, late), "dash" if late else "solid"
            traces.append(_curve(np.abs(ports.felt), name, _COLORS[way], dash, "N·s/m"))
    layout = {"xaxis": axis("frequency", "Hz", type="log"), "yaxis": axis("force over speed", "N·s/m", type="log")}
    sentence = (
        "Impedance that the hand feels; dotted the world's own."
        if world != AIR
        else "Impedance that the hand feels where the tip touches nothing: drag."
    )
    return Figure(f"What the hand feels: {world}", sentence, traces, layout, 460)


def _told(way: Way, late: float) -> str:
    return f"{way[0]}, {way[1]}, {1e3 * late:.0f} ms"


def _stability_figure(cells: Cells, arm: Complex) -> Figure:
    traces = []
    for (way, late), cell in cells.items():
        if way in (_FORCE, _POSITION):
            color, name = _LATE_COLORS[ROUND_TRIPS.index(late)], _told(way, late)
            law = llewellyn(predicted_hybrid(arm, way[0], late))
            traces += [
                _curve(law, f"{name}, by law", color, "dot"),
                _curve(llewellyn(cell.hybrid), name, color, "solid" if way == _FORCE else "dash"),
            ]
    shape, note = level(1.0, "absolutely stable from here on")
    layout = {
        "xaxis": axis("frequency", "Hz", type="log"),
        "yaxis": axis("Llewellyn's number"),
        "shapes": [shape],
        "annotations": [note],
    }
    sentence = "Below 1, some passive hand and world can become unstable; all without passivity."
    return Figure("Absolute stability", sentence, traces, layout, 460)


def _known_figure(known: Cell) -> Figure:
    exact, traces = LAG.hybrid(), []
    for (i, k), color, unit in (((0, 1), FIRST, ""), ((1, 0), SECOND, ""), ((1, 1), THIRD, "m/N·s")):
        name = f"h{i + 1}{k + 1}"
        traces.append(_curve(np.abs(exact[:, i, k]), f"{name}, exact", color, "dot", unit))
        measured = np.abs(known.hybrid[:, i, k])
        traces.append(points(LINES, measured, name, color, unit))
    layout = {"xaxis": axis("frequency", "Hz", type="log"), "yaxis": axis("size", type="log")}
    sentence = "Marks are measured through our hand and mapping; they lie on the exact lines."
    return Figure("A two-port that is known", sentence, traces, layout, 420)


TRANSPARENCY = Experiment(
    "transparency",
    "impedance that the hand feels, and absolute stability, by architecture, passivity and delay",
    "two-ports of Lawrence 1993; criterion of Llewellyn 1952",
    _measure,
)
