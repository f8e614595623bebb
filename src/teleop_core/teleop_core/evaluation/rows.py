"""Rows: what a table shows of a metric, beside the published figures."""

from dataclasses import dataclass

from teleop_core.evaluation.accumulators import Spread

MISSING = "–"


@dataclass(frozen=True)
class Row:
    """One row: what it is, its unit, the value, the published value, and whether both agree.

    Rows of one group stand together under its name. ``is_met`` says whether the value agrees with
    what was published; None where nothing is compared.
    """

    group: str
    label: str
    unit: str
    value: str
    published: str = ""
    is_met: bool | None = None


def row(
    group: str,
    label: str,
    unit: str,
    value: float | None,
    published: float | None = None,
    agrees: bool | None = None,
) -> Row:
    """Row of a number, beside what was published, and whether both agree if that is asked."""
    return Row(group, label, unit, number(value), number(published, ""), agrees)


def spread_rows(
    group: str,
    label: str,
    unit: str,
    spread: Spread,
    figures: tuple[float, float] | None = None,
    agrees: bool | None = None,
) -> list[Row]:
    """Three rows of a spread; ``figures`` are the published root mean square and maximum.

    Agreement is judged of the root mean square alone: a maximum is one moment of one session.
    """
    rms, largest = figures or (None, None)
    return [
        row(group, f"{label}, RMS", unit, spread.rms, rms, agrees),
        row(group, f"{label}, S.D.", unit, spread.sd),
        row(group, f"{label}, max", unit, spread.max, largest),
    ]


def error_rows(group: str, label: str, unit: str, spread: Spread) -> list[Row]:
    """Root mean square and maximum of a spread of which nothing was published."""
    return [
        row(group, f"{label}, RMS", unit, spread.rms),
        row(group, f"{label}, max", unit, spread.max),
    ]


def number(value: float | None, missing: str = MISSING) -> str:
    """Text with three decimals, two significant digits for small values; ``missing`` for None."""
    if value is None:
        return missing
    return f"{value:.3f}" if value == 0.0 or abs(value) >= 0.0995 else f"{value:#.2g}"
