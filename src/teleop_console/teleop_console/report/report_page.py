"""Report page: scores and plots of recordings as one self-contained HTML file."""

from collections.abc import Iterator, Sequence

from teleop_console.report.pages import Card, Cell, Section, Sessions, Table, page
from teleop_core.evaluation.published import ANGLE_FACTOR, POSITION_SHARE, SOURCE, published_for
from teleop_core.evaluation.rows import is_compared, number, side_by_side
from teleop_core.evaluation.score import Score
from teleop_core.evaluation.scoring import ReportedScore
from teleop_core.evaluation.traces import spacing_s
from teleop_core.evaluation.verdict import SHARE, percent

SHOWN = 5
"""Number of scores on the card of a session."""
_FIGURES = (
    (SHARE, "%", "time followed"),
    ("asked_error_mm.max", "mm", "largest lag behind the hand"),
    ("position_error_mm.rms", "mm", "tracking error RMS"),
    ("true_error_mm.rms", "mm", "error of the true tip RMS"),
    ("orientation_error_deg.angle.rms", "°", "orientation error RMS"),
    ("fixture.penetration_max_mm", "mm", "largest fixture penetration"),
    ("latency_ms.total.p99", "ms", "delay p99, hand to setpoint"),
    ("force_n.max", "N", "peak force on the hand"),
    ("motion.hand.speed_median_mm_s", "mm/s", "median speed of the hand"),
)
_OFTEN_NOTHING = {"latency_ms.total.p99", "force_n.max", "fixture.penetration_max_mm"}
_MARKS = {True: "value met", False: "value missed", None: "value plain"}


def report_page(studies: Sequence[ReportedScore]) -> str:
    """HTML page with the summary of all recordings and the plots of each.

    The page works offline, because it contains plotly.js. All plots of a recording against time show the same interval,
    down to single samples. Texts from recordings are escaped.
    """
    scores = [study.score for study in studies]
    cards = [
        Card(score.session.place, f"#recording-{i}", score.verdict, list(_known(score))[:SHOWN])
        for i, score in enumerate(scores)
    ]
    title = "Teleoperation: " + ", ".join(score.session.title for score in scores)
    sections = [_section(i, study) for i, study in enumerate(studies)]
    return page(title, [Sessions(cards), scores_table(scores)], sections, heading="Teleoperation report")


def _known(score: Score) -> Iterator[tuple[str, str, str]]:
    """Value, unit and meaning of the available scores that are not trivial."""
    values = score.to_dict()
    for key, unit, text in _FIGURES:
        value = values.get(key)
        if key == SHARE and isinstance(value, float):
            yield percent(value), unit, text
        elif isinstance(value, int | float) and not (value == 0.0 and key in _OFTEN_NOTHING):
            yield number(value), unit, text


def _section(i: int, study: ReportedScore) -> Section:
    session = study.score.session
    samples = max((topic.count for topic in study.score.topics.values()), default=0)
    kept_s = spacing_s(samples, session.duration_s)
    told = [f"plots hold the smallest and largest value of each {kept_s * 1e3:.3g} ms"] * (kept_s > 0.0)
    return Section(
        session.place,
        " · ".join((*session.facts, *told)),
        study.figures(),
        f"recording-{i}",
        study.bands,
        session.duration_s,
        kept_s,
    )


def scores_table(scores: Sequence[Score]) -> Table:
    """Scores side by side, with a second column for published numbers if there are any."""
    found = side_by_side([score.rows for score in scores])
    columns = list(zip(*(line.rows for line in found), strict=True))
    are_compared = [any(row.published for row in rows) for rows in columns]
    heads, kinds = [Cell(), Cell()], [Cell(), Cell()]
    for score, is_beside in zip(scores, are_compared, strict=False):
        mode = published_for(score.session.gain, score.session.robot, score.session.plant)
        heads.append(Cell(score.session.place, span=1 + is_beside))
        kinds += [Cell(note="measured"), *[Cell(note=f"published{f', {mode.mode}' if mode else ''}")] * is_beside]
    rows = []
    for line in found:
        cells = [Cell(line.label), Cell(line.unit, "unit")]
        for row, is_beside in zip(line.rows, are_compared, strict=True):
            cells += [Cell(row.value, _MARKS[row.is_met]), *[Cell(row.published, "published")] * is_beside]
        rows.append((line.group, cells))
    note = (
        f"Beside the published figures of the RCRT-1 ({SOURCE}), presumably taken against the filtered reference too. "
        f"✓ agrees, ✗ does not: position RMS within {100.0 * POSITION_SHARE:.0f} %, angles within a factor of "
        f"{ANGLE_FACTOR:g}."
    )
    return Table([heads, kinds], rows, "All figures", note if is_compared(found) else "")
