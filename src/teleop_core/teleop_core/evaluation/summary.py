"""Summary: the rows that a table shows of a score, beside the published figures."""

from dataclasses import dataclass

from teleop_core.evaluation.accumulators import Spread
from teleop_core.evaluation.published import BOX_OVERSHOOT_MM, Published, published_for
from teleop_core.evaluation.score import Score
from teleop_core.evaluation.streams import STAGES

MISSING = "–"
MET, NOT_MET = "✓", "✗"


@dataclass(frozen=True)
class Row:
    """One row: what it is, its unit, the value, the published value, and whether it is met.

    ``is_met`` is None where nothing was published.
    """

    group: str
    label: str
    unit: str
    value: str
    published: str = ""
    is_met: bool | None = None


def summary(score: Score) -> list[Row]:
    """Rows of a score; the same labels for every score, in the same order."""
    mode = published_for(score.session.gain, score.session.robot)
    return [
        *_errors(score, mode),
        *_command(score),
        *_fixture(score),
        *_latency(score),
        *_counts(score),
    ]


def _errors(score: Score, mode: Published | None) -> list[Row]:
    angles, group = score.orientation_error_deg, "against filtered reference"
    position = mode.position_mm if mode else None
    rows = _spread(group, "position", "mm", score.position_error_mm, position)
    rows += _spread(group, "roll", "deg", angles.roll, mode.roll_deg if mode else None)
    rows += _spread(group, "pitch", "deg", angles.pitch, mode.pitch_deg if mode else None)
    rows += _spread(group, "yaw", "deg", angles.yaw, mode.yaw_deg if mode else None)
    return rows + _spread(group, "rotation", "deg", angles.angle, None)


def _spread(
    group: str, label: str, unit: str, spread: Spread, figures: tuple[float, float] | None
) -> list[Row]:
    rms, largest = figures or (None, None)
    return [
        _row(group, f"{label}, RMS", unit, spread.rms, rms),
        _row(group, f"{label}, S.D.", unit, spread.sd),
        _row(group, f"{label}, max", unit, spread.max, largest),
    ]


def _row(
    group: str, label: str, unit: str, value: float | None, published: float | None = None
) -> Row:
    is_met = None if value is None or published is None else value <= published
    return Row(group, label, unit, number(value), number(published, ""), is_met)


def number(value: float | None, missing: str = MISSING) -> str:
    """Text with three decimals, two significant digits for small values; ``missing`` for None."""
    if value is None:
        return missing
    return f"{value:.3f}" if value == 0.0 or abs(value) >= 0.0995 else f"{value:#.2g}"


def _command(score: Score) -> list[Row]:
    group, angle = "against unfiltered command", score.command_orientation_error_deg.angle
    return [
        _row(group, "position, RMS", "mm", score.command_error_mm.rms),
        _row(group, "position, max", "mm", score.command_error_mm.max),
        _row(group, "rotation, RMS", "deg", angle.rms),
        _row(group, "rotation, max", "deg", angle.max),
    ]


def _fixture(score: Score) -> list[Row]:
    box, group = score.fixture, "virtual fixture"
    share = None if box.outside_share is None else 100.0 * box.outside_share
    return [
        Row(group, "box on for", "s", f"{box.on_s:.1f}"),
        _row(group, "slave outside, max", "mm", box.penetration_max_mm, BOX_OVERSHOOT_MM),
        _row(group, "slave outside, RMS", "mm", box.penetration_rms_mm),
        Row(group, "slave outside, time", "%", MISSING if share is None else f"{share:.1f}"),
        _row(group, "hand outside, max", "mm", box.hand_penetration_max_mm),
        _row(group, "force on hand, max", "N", score.force_n.max),
    ]


def _latency(score: Score) -> list[Row]:
    rows = []
    for stage in STAGES:
        delay = score.latency_ms[stage]
        known = (delay.median, delay.p99, delay.max)
        text = MISSING if delay.max is None else "/".join(map(_short, known))
        rows.append(Row("latency: median/p99/max", stage.replace("_", " "), "ms", text))
    return rows


def _short(value: float | None) -> str:
    """Text of a few milliseconds."""
    if not value:
        return "0"
    return f"{value:.2f}" if abs(value) < 10.0 else f"{value:.1f}"


def _counts(score: Score) -> list[Row]:
    ticks, group = score.ticks, "counts"
    late = MISSING if ticks.late is None else str(ticks.late)
    gaps = sum(topic.gaps or 0 for topic in score.topics.values())
    return [
        Row(
            group,
            "ticks done/late/missed",
            "",
            f"{ticks.executed}/{late}/{ticks.missed}",
        ),
        Row(group, "messages", "", str(sum(topic.count for topic in score.topics.values()))),
        Row(group, "messages missing", "", str(gaps)),
    ]
