"""Time figures: positions, errors, force and delays of a recording."""

from typing import Any

from teleop_core.evaluation.accumulators import Distribution
from teleop_core.evaluation.figure import (
    BOX,
    COMMAND,
    DARK,
    DRAWN_BOXES,
    FIRST,
    MEASURED,
    REFERENCE,
    SECOND,
    THIRD,
    Figure,
    line,
    span,
    time_axis,
)
from teleop_core.evaluation.metrics import Study
from teleop_core.evaluation.streams import STAGES
from teleop_core.evaluation.summary import number
from teleop_core.evaluation.traces import Box, Drawing

_BINS = 150
_STAGE_COLORS = (FIRST, "#e69f00", SECOND, THIRD, DARK)


def position(study: Study, boxes: list[Box]) -> Figure:
    """x, y and z of command, reference and tip against time."""
    times, values = study.drawing.position.line()
    begin, end = _interesting(study.drawing, boxes)
    is_shown = (times >= begin) & (times <= end)
    layout, shapes, traces = _rows("xyz", "mm"), [], []
    for row in range(3):
        suffix = _suffix(row)
        layout[f"yaxis{suffix}"]["range"] = span(values[is_shown][:, [row + 3, row + 6]])
        traces += [
            {**trace, "yaxis": f"y{suffix}", "showlegend": row == 0}
            for trace in (
                line(times, values[:, row], "command", COMMAND, 1),
                line(times, values[:, row + 3], "reference", REFERENCE, 5),
                line(times, values[:, row + 6], "measured", MEASURED, 1.6),
            )
        ]
        shapes += [wall for box in boxes[:DRAWN_BOXES] for wall in _walls(box, row, suffix)]
    layout |= {"shapes": shapes, "hovermode": "x unified"}
    layout["xaxis"]["range"] = [begin, end]
    return Figure("Position against time", _position_sentence(study, boxes), traces, layout, 640)


def _position_sentence(study: Study, boxes: list[Box]) -> str:
    sentence = (
        "The reference is the command after the low-pass and lags behind it; the tip stays within "
        f"{number(study.score.position_error_mm.max)} mm of the reference."
    )
    if boxes:
        sentence += " Dashed: walls of the box. Double-click to see the whole recording."
    return sentence


def _suffix(row: int) -> str:
    """What plotly.js appends to the names of the axes of a row."""
    return "" if row == 0 else str(row + 1)


def _rows(names: str | tuple[str, ...], unit: str) -> dict[str, Any]:
    """Layout of plots on top of each other with one time axis, at the lowest of them."""
    count = len(names)
    layout: dict[str, Any] = {"xaxis": {**time_axis(), "anchor": f"y{_suffix(count - 1)}"}}
    for row, name in enumerate(names):
        top = 1.0 - row / count
        layout[f"yaxis{_suffix(row)}"] = {
            "title": {"text": f"{name} [{unit}]"},
            "domain": [max(0.0, top - 1.0 / count + 0.03), top],
        }
    return layout


def _interesting(drawing: Drawing, boxes: list[Box]) -> tuple[float, float]:
    """Time that is shown first: with the box on, or all if it never was."""
    if not boxes:
        return 0.0, drawing.duration_s
    return boxes[0].begin_s, boxes[-1].end_s


def _walls(box: Box, axis: int, suffix: str) -> list[dict[str, Any]]:
    return [
        {
            "type": "line", "xref": "x", "yref": f"y{suffix}", "x0": box.begin_s, "x1": box.end_s,
            "y0": wall, "y1": wall, "line": {"color": BOX, "width": 1.5, "dash": "dash"},
        }
        for wall in box.walls(axis)
    ]  # fmt: skip


def position_error(study: Study) -> Figure:
    """Distance of the tip from reference and command against time."""
    times, values = study.drawing.error.line()
    spread, behind = study.score.position_error_mm, study.score.command_error_mm
    traces = [
        line(times, values[:, 0], "against filtered reference", MEASURED, 1.2),
        {**line(times, values[:, 1], "against command", COMMAND, 1.2), "visible": "legendonly"},
    ]
    sentence = (
        f"Distance between tip and reference: {number(spread.rms)} mm RMS, "
        f"{number(spread.max)} mm at most. Against the unfiltered command (click the legend) it is "
        f"{number(behind.rms)} mm RMS, with the lag of the low-pass in it."
    )
    layout = {
        "xaxis": time_axis(),
        "yaxis": {"title": {"text": "position error [mm]"}, "rangemode": "tozero"},
    }
    return Figure("Position error", sentence, traces, layout, 340)


def orientation_error(study: Study) -> Figure:
    """Roll, pitch and yaw of the tip against the reference, against time."""
    times, values = study.drawing.error.line()
    error = study.score.orientation_error_deg
    names = ("roll", "pitch", "yaw")
    traces = [
        {
            **line(times, values[:, 2 + row], name, color, 1.2, "deg"),
            "yaxis": f"y{_suffix(row)}", "showlegend": False,
        }
        for row, (name, color) in enumerate(zip(names, (FIRST, SECOND, THIRD), strict=True))
    ]  # fmt: skip
    layout = _rows(names, "deg") | {"hovermode": "x unified"}
    largest = [known.max for known in (error.roll, error.pitch, error.yaw) if known.max is not None]
    sentence = (
        f"No angle is off by more than {number(max(largest, default=None))} deg; the rotation as "
        f"a whole by {number(error.angle.rms)} deg RMS, {number(error.angle.max)} deg at most."
    )
    if error.degenerate_share:
        share = 100.0 * error.degenerate_share
        sentence += f" For {share:.1f} % of the time pitch is near ±90°: no roll, no yaw there."
    return Figure("Orientation error", sentence, traces, layout, 480)


def force(study: Study, boxes: list[Box]) -> Figure | None:
    """Force on the hand against time; None if it was not recorded."""
    times, values = study.drawing.force.line()
    if not len(times):
        return None
    traces = [
        line(times, values[:, i], f"{axis} (master)", color, 1.2, "N")
        for i, (axis, color) in enumerate(zip("xyz", (FIRST, SECOND, THIRD), strict=True))
    ]
    traces.append(line(times, values[:, 3], "magnitude", DARK, 1.4, "N"))
    sentence = f"The device pushes the hand with {number(study.score.force_n.max)} N at most"
    sentence += "; the box pushes back only where the hand is beyond a wall." if boxes else "."
    layout = {
        "xaxis": time_axis(),
        "yaxis": {"title": {"text": "force [N]"}},
        "hovermode": "x unified",
    }
    return Figure("Force on the hand", sentence, traces, layout, 340)


def latency(study: Study) -> Figure | None:
    """Distribution of each stage's delay; None in virtual time, where there is none."""
    delays = study.drawing.delays
    known = [stage for stage in STAGES if delays[stage].count]
    if not any(delays[stage].values_us.any() for stage in known):
        return None
    width_us = _bin_width([delays[stage] for stage in known])
    traces = []
    for stage, color in zip(STAGES, _STAGE_COLORS, strict=True):
        if stage in known:
            middles, shares = delays[stage].histogram(width_us)
            trace = line(middles, shares, stage.replace("_", " "), color, 1.8, "%")
            traces.append({**trace, "line": {**trace["line"], "shape": "hvh"}})
    total = study.score.latency_ms["total"]
    sentence = (
        f"From the sample of the hand to the slave's setpoint: {number(total.median)} ms median, "
        f"{number(total.p99)} ms for 99 of 100. Other lines: what each stage adds. "
        "The last step of a line holds all that took longer."
    )
    layout = {
        "xaxis": {"title": {"text": "delay [ms]"}},
        "yaxis": {"title": {"text": f"share per {width_us * 1e-3:g} ms [%]"}},
    }
    return Figure("Latency per stage", sentence, traces, layout, 340)


def _bin_width(delays: list[Distribution]) -> int:
    """Width of bins [µs] that is the same for all, so that their heights compare."""
    spans = [(delay.quantile_us(0.99) or 0) - int(delay.values_us[0]) for delay in delays]
    return max(1, -(-max(spans) // _BINS))
