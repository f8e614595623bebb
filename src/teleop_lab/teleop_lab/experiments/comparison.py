"""Comparison: a number of an experiment, the published number, and the tolerance between these two."""

import math
from dataclasses import dataclass
from typing import NamedTuple

from teleop_core.base.errors import ParameterError
from teleop_core.evaluation.figure import Figure

Plain = str | int | float | bool | None | list["Plain"] | dict[str, "Plain"]
_KINDS = ("exact", "share", "absolute", "factor")
_ROUNDING = 1e-9
BASES = ("printed", "law", "goal")
"""Origins of the reference values with which predictions are compared."""


@dataclass(frozen=True)
class Tolerance:
    """Largest difference at which a prediction agrees with a published number.

    Attributes:
        kind: "exact" allows only rounding errors. "share" is relative to the published number, and "absolute" is in the
            unit of the row. "factor" limits the ratio of prediction and published number in both directions.
        amount: Share (0.15), amount in the unit (0.5), or factor above 1 (1.6); 0 for "exact".

    Raises:
        ParameterError: An unknown kind, or an amount that no prediction can meet.
    """

    kind: str
    amount: float = 0.0

    def __post_init__(self) -> None:
        if self.kind not in _KINDS:
            raise ParameterError("kind", self.kind, f"one of {', '.join(_KINDS)}")
        if self.kind == "exact":
            if self.amount != 0.0:
                raise ParameterError("amount", self.amount, "0 for a quantity that must be exact")
            return
        least = 1.0 if self.kind == "factor" else 0.0
        if not (math.isfinite(self.amount) and self.amount > least):
            raise ParameterError("amount", self.amount, f"finite and above {least:g}")

    def allows(self, published: float, predicted: float) -> bool:
        """Whether the predicted value agrees with the published value."""
        if self.kind == "factor":
            if published * predicted <= 0.0:
                return False
            return abs(math.log(predicted / published)) <= math.log(self.amount)
        room = self.amount * (abs(published) if self.kind == "share" else 1.0)
        # If the difference is equal to the tolerance, except for rounding, the values agree.
        room += _ROUNDING * (room or max(1.0, abs(published)))
        return abs(predicted - published) <= room

    def text(self, unit: str) -> str:
        """Text for a table: "15 %", "0.5 mm", "factor 1.6" or "exact"."""
        if self.kind == "exact":
            return self.kind
        if self.kind == "share":
            return f"{100.0 * self.amount:.3g} %"
        if self.kind == "factor":
            return f"factor {self.amount:g}"
        return f"{self.amount:.3g}{unit if unit == '°' else f' {unit}'.rstrip()}"


EXACT = Tolerance("exact")


def percent(amount: float) -> Tolerance:
    """Tolerance of ``amount`` percent of the published number."""
    return Tolerance("share", amount / 100.0)


def absolute(amount: float) -> Tolerance:
    """Tolerance of ``amount`` in the unit of the row."""
    return Tolerance("absolute", amount)


def factor(amount: float) -> Tolerance:
    """Tolerance of a factor ``amount`` in both directions."""
    return Tolerance("factor", amount)


@dataclass(frozen=True, kw_only=True)
class Comparison:
    """One quantity of an experiment; missing values are None.

    Attributes:
        quantity: Name of the quantity.
        unit: Unit of the quantity; empty for pure numbers.
        published: Value that the source printed, or a value of another ``basis``.
        predicted: Value of our model of the source's machine.
        ours: Value with another controller on the same model.
        within: Tolerance for agreement of ``predicted`` with ``published``; None if the row is not judged.
        basis: Origin of ``published``: "printed", a "law" of the source evaluated by us, or a "goal" of our own. Only
            printed values count as published numbers.
        lowest: Smallest value over several seeds; ``predicted`` is the mean over these seeds.
        highest: Largest value over several seeds.
        group: Heading above the row.
        note: Remark on the row, such as a misprint in the source.

    Raises:
        ParameterError: A number is not finite, or the basis is unknown.
    """

    quantity: str
    unit: str = ""
    published: float | None = None
    predicted: float | None = None
    ours: float | None = None
    within: Tolerance | None = None
    basis: str = "printed"
    lowest: float | None = None
    highest: float | None = None
    group: str = ""
    note: str = ""

    def __post_init__(self) -> None:
        if self.basis not in BASES:
            raise ParameterError("basis", self.basis, f"one of {', '.join(BASES)}")
        for name in ("published", "predicted", "ours", "lowest", "highest"):
            value = getattr(self, name)
            if value is None:
                continue
            if not math.isfinite(value):
                raise ParameterError(f"{name} of {self.quantity}", value, "finite, or None")
            object.__setattr__(self, name, float(value))  # converts NumPy's types

    @property
    def difference(self) -> float | None:
        """Predicted minus published value; None if one of them is missing."""
        if self.published is None or self.predicted is None:
            return None
        return self.predicted - self.published

    @property
    def agrees(self) -> bool | None:
        """Whether the prediction agrees with the published value; None if the row is not judged."""
        if self.within is None or self.published is None or self.predicted is None:
            return None
        return self.within.allows(self.published, self.predicted)

    def to_json(self) -> dict[str, Plain]:
        """The row as plain values; numbers are exact."""
        within: Plain = None
        if self.within is not None:
            within = {"kind": self.within.kind, "amount": self.within.amount}
        return {
            "group": self.group, "quantity": self.quantity, "unit": self.unit,
            "published": self.published, "predicted": self.predicted, "ours": self.ours,
            "difference": self.difference, "within": within, "agrees": self.agrees,
            "basis": self.basis,
            "lowest": self.lowest, "highest": self.highest, "note": self.note,
        }  # fmt: skip


class Findings(NamedTuple):
    """Return value of an experiment's function.

    Attributes:
        rows: Published and predicted numbers.
        figures: Plots for the page; they include published points if the source printed any.
        notes: Explanations without which the numbers would mislead a reader.
    """

    rows: tuple[Comparison, ...]
    figures: tuple[Figure, ...] = ()
    notes: tuple[str, ...] = ()
