"""Overview: the first part of a report page, with the sessions side by side."""

from collections.abc import Iterator, Sequence
from html import escape

from teleop_core.evaluation.rows import number
from teleop_core.evaluation.score import Score
from teleop_core.evaluation.verdict import SHARE, Verdict, percent

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


def overview(scores: Sequence[Score]) -> str:
    """HTML of a card for each session, with the verdict and five scores."""
    cards = [
        f'<article class="card session"><h2><a href="#recording-{i}">{escape(score.session.place)}'
        f"</a></h2>{_verdict(score.verdict)}{_figures(score)}</article>"
        for i, score in enumerate(scores)
    ]
    return f'<div class="sessions">{"".join(cards)}</div>'


def _verdict(found: Verdict) -> str:
    kind = "good" if found.is_good else "bad"
    advice = f'<p class="advice">{escape(found.advice)}</p>' if found.advice else ""
    return f'<p class="verdict {kind}">{escape(found.text)}</p>{advice}'


def _figures(score: Score) -> str:
    found = list(_known(score))[:SHOWN]
    items = (
        f"<div><dd>{value}<small> {escape(unit)}</small></dd><dt>{escape(text)}</dt></div>"
        for value, unit, text in found
    )
    return f'<dl class="figures">{"".join(items)}</dl>'


def _known(score: Score) -> Iterator[tuple[str, str, str]]:
    """Value, unit and meaning of the available scores that are not trivial."""
    values = score.to_dict()
    for key, unit, text in _FIGURES:
        value = values.get(key)
        if key == SHARE and isinstance(value, float):
            yield percent(value), unit, text
        elif isinstance(value, int | float) and not (value == 0.0 and key in _OFTEN_NOTHING):
            yield number(value), unit, text
