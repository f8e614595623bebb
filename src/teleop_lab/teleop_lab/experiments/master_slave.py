"""Master and slave: random motion in an enabled box, coarse and fine (tables 7.8, 7.9 and 8.2)."""

from typing import NamedTuple

import numpy as np

from teleop_core.evaluation import COMMAND, FIRST, MEASURED, SECOND, THIRD, Figure, axis_suffix, time_axis
from teleop_core.evaluation.figure import (
    FIXTURE,
    REFERENCE,
    axis,
    in_planes,
    in_space,
    level,
    line,
    scene,
    stacked_axes,
)
from teleop_core.evaluation.published import ANGLE_FACTOR, BOX_OVERSHOOT_MM, COARSE, FINE, POSITION_SHARE, Published
from teleop_core.kernels.geometry import Array, roll_pitch_yaw, rotations_from_quaternions
from teleop_core.shapes.basis.drawing import edges_of
from teleop_lab.experiments import conditions, experiment
from teleop_lab.experiments.bench import Bench, ScoredSession, mean, pooled
from teleop_lab.experiments.comparison import Comparison, Findings, Tolerance, absolute, factor, percent

MODES = {"coarse_box": COARSE, "fine_box": FINE}
BOX_MM = {"coarse_box": 30.0, "fine_box": 3.0}
_LEAST_MM = {"coarse_box": 0.002, "fine_box": 0.015}
_RATIO = FINE.position_mm[0] / COARSE.position_mm[0]
# The plant must predict RMS values; maxima are single events of one person's hand.
_RMS, _TURN_RMS = percent(100.0 * POSITION_SHARE), factor(ANGLE_FACTOR)
_MAX = factor(ANGLE_FACTOR)
_CALLED = {"roll": "the source's yaw", "yaw": "the source's roll"}
_PATH = 8  # every eighth sample of a path is drawn
_CURVE = 2  # every second sample of a curve is drawn
_QUATERNION = ["qw", "qx", "qy", "qz"]


class Figures(NamedTuple):
    """Errors of one session: RMS and maximum of position [mm] and angles [°]."""

    position_mm: tuple[float, float]
    roll_deg: tuple[float, float]
    pitch_deg: tuple[float, float]
    yaw_deg: tuple[float, float]
    beyond_mm: float
    """Largest distance of the slave beyond the box [mm]."""
    least_mm: float
    """Smallest position error [mm]."""
    offset_mm: float
    """Length of the mean error vector [mm]."""
    about_mm: float
    """RMS of the position error about the mean error [mm]."""


def figures_of(session: ScoredSession) -> Figures:
    """Compute the errors of one session that are compared."""
    score = session.score
    turn = score.orientation_error_deg
    pairs = [(s.rms, s.max) for s in (score.position_error_mm, turn.roll, turn.pitch, turn.yaw)]
    beyond = score.fixture.penetration_max_mm
    position, roll, pitch, yaw = ((rms or 0.0, largest or 0.0) for rms, largest in pairs)
    kept = session.is_followed
    off = (session.places_mm("slave/measured_cp") - session.places_mm("slave/setpoint_cp"))[kept]
    about = off - off.mean(axis=0)
    return Figures(
        position,
        roll,
        pitch,
        yaw,
        beyond or 0.0,
        float(np.linalg.norm(off, axis=1).min()),
        float(np.linalg.norm(off.mean(axis=0))),
        float(np.sqrt((about**2).sum(axis=1).mean())),
    )


def _row(
    quantity: str, unit: str, published: float | None, found: list[float], ours: list[float],
    within: Tolerance | None, group: str, *, is_rms: bool = False, note: str = "",
) -> Comparison:  # fmt: skip
    together = pooled if is_rms else mean
    return Comparison(
        quantity=quantity, unit=unit, published=published, predicted=together(found),
        ours=together(ours), within=within, lowest=min(found),
        highest=max(found), group=group, note=note,
    )  # fmt: skip


def _mode_rows(name: str, found: list[Figures], ours: list[Figures]) -> list[Comparison]:
    printed: Published = MODES[name]
    group = f"{printed.mode}, gain {printed.gain:g}"
    rows = []
    for field, text, unit, within in (
        ("position_mm", "position", "mm", _RMS),
        ("roll_deg", "roll", "°", _TURN_RMS),
        ("pitch_deg", "pitch", "°", _TURN_RMS),
        ("yaw_deg", "yaw", "°", _TURN_RMS),
    ):
        for k, kind in enumerate(("RMS", "max")):
            values, others = ([getattr(f, field)[k] for f in which] for which in (found, ours))
            rows.append(
                _row(f"{text} error, {kind}", unit, getattr(printed, field)[k], values, others,
                     within if k == 0 else _MAX, group, is_rms=k == 0, note=_CALLED.get(text, ""))
            )  # fmt: skip
    for field, text, least, is_rms in (
        ("least_mm", "position error, min", _LEAST_MM[name], False),
        ("offset_mm", "constant part of the position error", None, False),
        ("about_mm", "position error about its mean, RMS", None, True),
    ):
        values, others = ([getattr(f, field) for f in which] for which in (found, ours))
        rows.append(_row(text, "mm", least, values, others, None, group, is_rms=is_rms))
    beyond, others = ([f.beyond_mm for f in which] for which in (found, ours))
    rows.append(
        _row("slave beyond the box, max", "mm", BOX_OVERSHOOT_MM, beyond, others, absolute(0.5),
             group, note="'about 1 mm'")
    )  # fmt: skip
    return rows


def _measure(bench: Bench) -> Findings:
    sessions = {name: bench.sessions(name, conditions.PREDICTED) for name in MODES}
    found = {name: [figures_of(s) for s in several] for name, several in sessions.items()}
    ours = {name: [figures_of(s) for s in bench.sessions(name, conditions.OURS)] for name in MODES}
    rows = [row for name in MODES for row in _mode_rows(name, found[name], ours[name])]
    ratios, others = (_ratios(which) for which in (found, ours))
    rows.append(
        _row("position RMS, fine divided by coarse", "", round(_RATIO, 3), ratios, others, absolute(0.12), "both")
    )
    drawn = [figure for name in MODES for figure in _figures(name, sessions[name][0])]
    drawn.append(_both_boxes({name: several[0] for name, several in sessions.items()}))
    return Findings(tuple(rows), tuple(drawn), _NOTES)


_NOTES = (
    "Each figure is of three sessions by different hands: RMS of all, mean of the maxima; beside "
    "it the smallest and largest. Errors are against the filtered reference, from encoder angles, "
    "presumably as the source has them. The text's 0.266 mm for the largest fine error is below "
    "its own RMS.",
    "The constant part is what gravity and bias hold joints off by, whatever the hand does; the "
    "source prints no split.",
)


def _ratios(found: dict[str, list[Figures]]) -> list[float]:
    coarse, fine = (found[name] for name in MODES)
    return [f.position_mm[0] / c.position_mm[0] for c, f in zip(coarse, fine, strict=True)]


class Drawn(NamedTuple):
    """Samples of a session from the time at which its box was enabled.

    Attributes:
        times: Times since the box was enabled (N,) [s].
        measured: Positions of the tip (N, 3) [mm].
        reference: Positions of the tip's reference (N, 3) [mm].
        turns: Roll, pitch and yaw of the tip minus those of the reference (N, 3) [°].
        center: Centre of the box (3,) [mm].
        size: Side lengths of the box (3,) [mm].
    """

    times: Array
    measured: Array
    reference: Array
    turns: Array
    center: Array
    size: Array


def drawn_of(session: ScoredSession) -> Drawn:
    """Return the samples of a session from the time at which its box was enabled."""
    state = session["teleop/state"]
    on = int(np.argmax(state["is_fixture_on"] > 0.0))
    center, size = (1e3 * state[[f"fixture_{kind}_{letter}" for letter in "xyz"]][on] for kind in ("center", "size"))
    kept = session.time >= state.time[on]
    turned = [
        roll_pitch_yaw(rotations_from_quaternions(session[topic][_QUATERNION][kept]))
        for topic in ("slave/measured_cp", "slave/setpoint_cp")
    ]
    turns = np.degrees((turned[0] - turned[1] + np.pi) % (2.0 * np.pi) - np.pi)
    return Drawn(
        session.time[kept] - session.time[kept][0],
        session.places_mm("slave/measured_cp")[kept],
        session.places_mm("slave/setpoint_cp")[kept],
        turns,
        center,
        size,
    )


def _figures(name: str, session: ScoredSession) -> list[Figure]:
    found, mode = drawn_of(session), MODES[name].mode
    return [
        _path_figure(mode, found),
        _plane_figure(mode, found),
        _place_figure(mode, found),
        _error_figure(name, found),
        _turn_figure(name, found),
    ]


def _path_figure(mode: str, found: Drawn) -> Figure:
    traces = [
        in_space(found.reference[::_PATH], "reference", REFERENCE, 4),
        in_space(found.measured[::_PATH], "measured", MEASURED, 2),
        in_space(found.center + edges_of(found.size), "box", FIXTURE, 3),
    ]
    sentence = f"Path of the slave in the box of {found.size[0]:.3g} mm."
    return Figure(f"Path in space, {mode}", sentence, traces, scene("mm"), 460)


def _plane_figure(mode: str, found: Drawn) -> Figure:
    groups = (
        (found.reference[::_PATH], "reference", REFERENCE, 4.0),
        (found.measured[::_PATH], "measured", MEASURED, 1.2),
        (found.center + edges_of(found.size), "box", FIXTURE, 2.0),
    )
    traces, layout = in_planes("xyz", groups, "mm")
    return Figure(f"Path per plane, {mode}", "The same path, seen along each axis.", traces, layout, 400)


def _place_figure(mode: str, found: Drawn) -> Figure:
    layout, traces, times = stacked_axes("xyz", "mm"), [], found.times[::_CURVE]
    for row in range(3):
        place = {"yaxis": f"y{axis_suffix(row)}", "showlegend": row == 0}
        for path, name, color, width in (
            (found.reference, "reference", REFERENCE, 4.0),
            (found.measured, "measured", MEASURED, 1.2),
        ):
            traces.append({**line(times, path[::_CURVE, row], name, color, width), **place})
    sentence = "Position of the slave against time."
    return Figure(f"x, y and z, {mode}", sentence, traces, layout, 480)


def _error_figure(name: str, found: Drawn) -> Figure:
    off = found.measured - found.reference
    printed = MODES[name]
    traces = [
        line(found.times[::_CURVE], off[::_CURVE, k], "xyz"[k], color, 1.0)
        for k, color in enumerate((FIRST, SECOND, THIRD))
    ]
    whole = np.linalg.norm(off, axis=1)
    traces.append(line(found.times[::_CURVE], whole[::_CURVE], "distance", MEASURED, 1.4))
    shapes, notes = zip(
        level(printed.position_mm[0], "published RMS"), level(printed.position_mm[1], "published max"), strict=True
    )
    layout = {
        "xaxis": time_axis(),
        "yaxis": axis("position error", "mm"),
        "shapes": list(shapes),
        "annotations": list(notes),
    }
    sentence = (
        f"Measured less reference: {np.sqrt(np.mean(whole**2)):.3f} mm RMS, {whole.max():.3f} mm "
        "at most in this session."
    )
    return Figure(f"Position error, {printed.mode}", sentence, traces, layout, 360)


def _turn_figure(name: str, found: Drawn) -> Figure:
    printed, layout, traces = MODES[name], stacked_axes(("roll", "pitch", "yaw"), "°"), []
    shapes = []
    for row, (text, color) in enumerate(zip(("roll", "pitch", "yaw"), (FIRST, SECOND, THIRD), strict=True)):
        place = {"yaxis": f"y{axis_suffix(row)}"}
        curve = line(found.times[::_CURVE], found.turns[::_CURVE, row], text, color, 1.0, "°")
        traces.append({**curve, **place})
        rms = getattr(printed, f"{text}_deg")[0]
        shapes += [level(sign * rms, "", place["yaxis"])[0] for sign in (-1.0, 1.0)]
    layout["shapes"] = shapes
    sentence = (
        "Measured less reference; dotted: the published root mean squares. The source calls roll yaw and yaw roll."
    )
    return Figure(f"Roll, pitch and yaw errors, {printed.mode}", sentence, traces, layout, 440)


def _both_boxes(sessions: dict[str, ScoredSession]) -> Figure:
    """Plot both boxes around one centre, as the source does in its figure."""
    traces = []
    for name, color in (("coarse_box", COMMAND), ("fine_box", MEASURED)):
        found, mode = drawn_of(sessions[name]), MODES[name].mode
        path = found.measured[::_PATH] - found.center
        traces += [in_space(path, mode, color, 2), in_space(edges_of(found.size), f"box, {mode}", FIXTURE, 3)]
    sentence = "Paths of both modes around the centres of their boxes."
    return Figure("Both boxes", sentence, traces, scene("mm"), 480)


MASTER_SLAVE = experiment.Experiment(
    "master_slave",
    "random motion of a hand in a box, coarse and fine: errors of the slave, and the box",
    "Vongbunyong 2008, tables 7.8, 7.9 and 8.2, figures 7.16-7.24",
    _measure,
)
