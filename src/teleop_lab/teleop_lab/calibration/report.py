"""Report of a calibration: tables for the terminal, numbers for JSON, and a file for sessions."""

from collections.abc import Iterator
from typing import TYPE_CHECKING

from teleop_core.base.plain_yaml import written
from teleop_lab.calibration.accuracy import misread
from teleop_lab.calibration.identify import LEVEL
from teleop_lab.calibration.model import FRAME

if TYPE_CHECKING:
    from teleop_lab.calibration import Calibration
    from teleop_lab.calibration.accuracy import Accuracy


def text(calibration: "Calibration") -> str:
    """Text for the terminal: the found entries, the other entries, and the accuracy."""
    found, measured = calibration.found, calibration.measured
    kind = "points" if measured.points is not None else "distances"
    head = (
        f"{calibration.robot.name}: {len(measured)} poses, {measured.readings} readings of {kind}; "
        f"{len(found.names)} unknowns, condition {found.condition:.3g}"
    )
    lines = [head, "", *_errors(calibration)]
    if found.left:
        lines += ["", "left at zero"]
        lines += [f"  {left.name:10} {left.reason}" for left in found.left]
    for accuracy in (calibration.fitted, calibration.tried):
        if accuracy is not None:
            lines += ["", *_table(accuracy)]
    return "\n".join([*lines, "", *_verdict(calibration)])


def _errors(calibration: "Calibration") -> Iterator[str]:
    found, known = calibration.found, calibration.equivalent
    if not found.names:
        yield "no error is told from zero: the arm is as drawn, as far as these readings tell"
        return
    yield f"{'found':12}{'error':>12}{f'± {100 * LEVEL:.0f} %':>10}" + (f"{'true':>10}" if known else "")
    for name, value, half in zip(found.names, found.values, found.half_widths, strict=True):
        unit = "m" + found.model.unit(name)
        cells = f"  {name:10}{1e3 * value:12.4f}{1e3 * half:10.4f}"
        if known:
            cells += f"{1e3 * known[name]:10.4f}" if name in known else f"{'':10}"
        yield f"{cells}  {unit}"


def _table(accuracy: "Accuracy") -> Iterator[str]:
    yield f"tip error [mm] {accuracy.where}"
    yield f"{'':8}{'before: RMS':>14}{'S.D.':>9}{'max':>9}{'after: RMS':>14}{'S.D.':>9}{'max':>9}"
    for name, before in accuracy.before.items():
        after = accuracy.after[name]
        cells = [f"{1e3 * v:{w}.4f}" for v, w in zip((*before, *after), (14, 9, 9) * 2, strict=True)]
        yield f"  {name:6}" + "".join(cells)


def _verdict(calibration: "Calibration") -> Iterator[str]:
    """Verdict on the result: its accuracy and its weaknesses."""
    odd = misread(calibration.found, calibration.measured) if calibration.truth is None else None
    if odd is not None:
        yield (
            f"pose {odd.pose} is off by {1e3 * odd.off:.3g} mm still, {odd.times:.0f} times as "
            "much as is usual here; take it out if it was misread"
        )
    tried = calibration.tried or calibration.fitted
    before, after = tried.before["total"].rms, tried.after["total"].rms
    if after < before:
        yield f"total RMS {1e3 * before:.4g} -> {1e3 * after:.4g} mm {tried.where}"
    elif calibration.found.names:
        yield (
            f"no gain: total RMS {1e3 * before:.4g} -> {1e3 * after:.4g} mm {tried.where}; measure "
            "more poses, with less noise, or fit fewer errors (--fit offsets)"
        )


def content(calibration: "Calibration") -> dict[str, object]:
    """All numbers of a calibration [m, rad], as plain values."""
    found, truth = calibration.found, calibration.truth
    return {
        "robot": calibration.robot.name,
        "poses": len(calibration.measured),
        "readings": calibration.measured.readings,
        "found": {
            name: {"value": float(value), "half_width": float(half), "unit": found.model.unit(name)}
            for name, value, half in zip(found.names, found.values, found.half_widths, strict=True)
        },
        "confidence": LEVEL,
        "left": {left.name: left.reason for left in found.left},
        "condition": found.condition,
        "residual": found.residual,
        "freedom": found.freedom,
        "true": None if truth is None else truth.named(),
        "true_sums": dict(calibration.equivalent) or None,
        "accuracy": [
            {"where": one.where, "before": _dicts_of(one.before), "after": _dicts_of(one.after)}
            for one in (calibration.fitted, calibration.tried)
            if one is not None
        ],
    }


def _dicts_of(spreads: object) -> dict[str, dict[str, float]]:
    return {name: one._asdict() for name, one in spreads.items()}  # type: ignore[attr-defined]


def correction_file(calibration: "Calibration") -> str:
    """The calibrated arm as a YAML table for ``--set robot=FILE``; the first lines contain the errors as comments."""
    found = calibration.found
    head = [f"# {calibration.robot.name} as calibrated from {len(calibration.measured)} poses."]
    for name, value, half in zip(found.names, found.values, found.half_widths, strict=True):
        if name not in FRAME:
            head.append(f"# {name}: {value:.6g} ± {half:.2g} {found.model.unit(name)}")
    body = written(calibration.table(), width=200)
    return "\n".join([*head, "# Take it with --set robot=FILE.", body])
