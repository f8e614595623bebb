"""Answers: parameters, scores and their differences in words, and in the units in which a reader thinks."""

from collections.abc import Sequence
from math import floor, log10
from typing import TYPE_CHECKING, Any, NamedTuple

from teleop_core.evaluation.metric import Key
from teleop_core.evaluation.score import keys
from teleop_core.graph.layers import declared_as
from teleop_lab.studies.study import is_number
from teleop_lab.studies.summary import Mean

if TYPE_CHECKING:
    from teleop_lab.studies.study import Study

UNTOLD = "cannot be told apart"
NO_SCORE = "no session has this score"
_SMALLER = {"s": "ms", "m": "mm"}
_WORDS = {"ms": ("longer", "shorter"), "s": ("longer", "shorter")}


class Quantity(NamedTuple):
    """A parameter or a score as a reader sees it.

    Attributes:
        name: Name, as on the command line.
        title: Name in words.
        meaning: What it is.
        factor: Number by which a value is multiplied to be in the unit.
        unit: Unit; empty for a number.
    """

    name: str
    title: str
    meaning: str
    factor: float = 1.0
    unit: str = ""

    @property
    def head(self) -> str:
        """Name in words with the unit, for tables."""
        return f"{self.title} [{self.unit}]" if self.unit else self.title

    def range(self, values: Sequence[Any]) -> str:
        """First and last value with the unit, or the first of values that are no numbers."""
        first, last = self.text(values[0]), self.text(values[-1])
        return f"from {first} to {last} {self.unit}".strip() if all(map(is_number, values)) else f"against {first}"

    def told(self, value: object) -> str:
        """Title, value and unit."""
        return f"{self.title} {self.text(value)} {self.unit}".strip()

    def text(self, value: object) -> str:
        """A value without its unit; a dash for NaN."""
        if is_number(value):
            return f"{value * self.factor:.6g}"  # type: ignore[operator]
        return "–" if isinstance(value, float) else str(value)

    def ends(self, mean: Mean) -> list[float]:
        """A mean and the ends of its interval in the unit; a share ends at 100 %."""
        value, low, high = (self.factor * x for x in mean[:3])
        return [value, low, min(high, max(100.0, value)) if self.unit == "%" else high]

    def shown(self, mean: Mean) -> str:
        """A mean with its interval, without the unit; as many digits as the interval tells."""
        if not mean.samples:
            return "–"
        value, low, high = _rounded(self.ends(mean))
        return value if mean.samples == 1 else f"{value} ({low} to {high})"


def parameter_of(name: str, values: Sequence[Any]) -> Quantity:
    """A swept parameter with its values; seconds below 1 s become milliseconds, and metres millimetres.

    Raises:
        UnknownNameError: There is no such parameter.
    """
    spec = declared_as(name.rpartition("/")[2])[0][1]
    return _scaled(Quantity(name, name, spec.doc, 1.0, spec.unit), [abs(v) for v in values if is_number(v)])


def parameters_of(study: "Study") -> dict[str, Quantity]:
    """The swept parameters of a study by name; the title is the last part of the name, unless two have the same."""
    found = {name: parameter_of(name, values) for name, values in study.swept.items()}
    short = {name: name.removesuffix(".kind").rpartition(".")[2].replace("_", " ") for name in found}
    count = list(short.values()).count
    return {name: one._replace(title=short[name]) if count(short[name]) == 1 else one for name, one in found.items()}


def score_of(name: str, values: Sequence[float]) -> Quantity:
    """A score with some of its values or differences; shares become per cent."""
    key = next((key for key in keys() if key.covers(tuple(name.split(".")))), Key(name, "1", ""))
    unit = "_" + key.unit.replace("/", "_").replace("^", "")
    title = " ".join(part.removesuffix(unit).replace("_", " ") for part in name.split("."))
    if key.unit == "1" and "share" in name:
        return Quantity(name, title, key.meaning, 100.0, "%")
    return _scaled(Quantity(name, title, key.meaning, 1.0, key.unit), [abs(value) for value in values])


def _scaled(quantity: Quantity, sizes: Sequence[float]) -> Quantity:
    largest = max((size for size in sizes if size == size), default=0.0)  # noqa: PLR0124 NaN differs from itself
    if 0.0 < largest < 1.0 and quantity.unit in _SMALLER:
        return quantity._replace(factor=1e3, unit=_SMALLER[quantity.unit])
    return quantity._replace(unit="" if quantity.unit in {"1", "m/m"} else quantity.unit)


def effect_told(score: str, effect: Mean, before: float) -> str:
    """Say in words how much a score differs.

    The words follow from the numbers: a difference whose interval includes zero cannot be told apart from none. A known
    difference has its sign, unit and interval, and its share of the value before, if that is not a share itself.

    Args:
        score: Key of the score.
        effect: Difference with its interval.
        before: Mean of the score where the difference is counted from; 0 or NaN if unknown.
    """
    if not effect.samples:
        return NO_SCORE
    unit = score_of(score, effect[:3])
    value, low, high = _rounded([unit.factor * x for x in effect[:3]])
    name = {"%": " percentage points", "": ""}.get(unit.unit, f" {unit.unit}")
    signed = value if effect.value < 0.0 else f"+{value}"
    if effect.samples == 1:
        return f"{signed}{name} in one pair of sessions; no interval, so {UNTOLD}"
    if effect.low == effect.high == 0.0:
        return "the same in all sessions"
    if not effect.is_told:
        return f"{UNTOLD}: {low} to {high}{name}"
    share = abs(effect.value / before) if before else float("nan")
    more, less = _WORDS.get(unit.unit, ("more", "less"))
    word = less if effect.value < 0.0 else more
    told = f", {100.0 * share:.0f} % {word}" if 0.005 <= share < 2.0 and unit.unit != "%" else ""
    return f"{signed}{name} ({low} to {high}){told}"


def _rounded(numbers: Sequence[float]) -> list[str]:
    """A number and the ends of its interval, with as many digits as the interval tells; no end is rounded to zero."""
    width = max(numbers) - min(numbers)
    if not width > 0.0:
        return [_minus(f"{x:.4g}") for x in numbers]
    digits = max(0, 1 - floor(log10(width)))
    digits += next((n for n in range(4) if all(not x or float(f"{x:.{digits + n}f}") for x in numbers[1:])), 0)
    return [_minus(f"{x:.{digits}f}") for x in numbers]


def _minus(text: str) -> str:
    """A number with a minus sign, and without a sign if it is zero."""
    return text.lstrip("-") if not float(text) else text.replace("-", "−")
