"""Identifiability: which entries of a model the measurements can distinguish, and why not the others.

The method uses the singular values of the identification Jacobian with columns of unit length. While the ratio of the
largest to the smallest singular value is above a bound, one entry of the least determined combination is fixed at zero.
Link lengths and twists are fixed before joint offsets.

Source:
    Bound of 100: Schröer 1993, as quoted in the chapter on model identification by Hollerbach, Khalil and Gautier of
    the Springer handbook of robotics, 2016, which also describes the elimination by singular values.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from teleop_core.kernels.geometry import Array
from teleop_lab.calibration.model import FRAME, ChainModel

WORST_CONDITION = 100.0
# An entry has no effect if the tip moves by less than this [m] per metre (an angle is multiplied by the arm's length).
_NOTHING = 1e-9
# A column depends on the other columns if its independent part is below this share of its length.
_SAME = 1e-6
# Weights that decide which entry is left out first: lengths and twists, then joint offsets, then the frame.
_LINK, _OFFSET, _FRAME = 1.0, 0.2, 0.01


@dataclass(frozen=True)
class Left:
    """Entry that was fixed at zero, and the reason."""

    name: str
    reason: str


def select(
    model: ChainModel, J: Array, names: Sequence[str], worst_condition: float
) -> tuple[tuple[str, ...], tuple[Left, ...]]:
    """Return the entries that readings with the Jacobian J (m, 4n + 6) can distinguish, and the others with reasons."""
    column = {name: J[:, model.names.index(name)] for name in names}
    lever = {name: model.size if model.unit(name) == "rad" else 1.0 for name in names}
    effect = {name: float(np.linalg.norm(column[name])) / lever[name] for name in names}
    kept = [name for name in names if effect[name] > _NOTHING * np.sqrt(len(J))]
    moving = list(kept)
    while kept and condition(np.column_stack([column[name] for name in kept])) > worst_condition:
        kept.remove(_weakest(model, column, kept))
    left = []
    for name in names:
        if name not in moving:
            left.append(Left(name, "does not change what is measured"))
        elif name not in kept:
            left.append(Left(name, _reason(column, name, kept)))
    return tuple(kept), tuple(left)


def _unit_columns(columns: Array) -> Array:
    return columns / np.linalg.norm(columns, axis=0)


def condition(columns: Array) -> float:
    """Ratio of the largest to the smallest singular value of columns of unit length."""
    values = np.linalg.svd(_unit_columns(columns), compute_uv=False)
    if len(values) < columns.shape[1] or values[-1] == 0.0:
        return float("inf")
    return float(values[0] / values[-1])


def _weakest(model: ChainModel, column: dict[str, Array], kept: list[str]) -> str:
    """Entry with the largest part in the combination that the readings determine least."""
    _, _, Vt = np.linalg.svd(_unit_columns(np.column_stack([column[k] for k in kept])))
    ease = [_FRAME if name in FRAME else _OFFSET if name in model.offsets else _LINK for name in kept]
    return kept[int(np.argmax(np.abs(Vt[-1]) * ease))]


def _reason(column: dict[str, Array], name: str, kept: Sequence[str]) -> str:
    """Text that names the entries from which an entry cannot be distinguished."""
    A = np.column_stack([column[k] for k in kept])
    share = np.linalg.lstsq(_unit_columns(A), column[name], rcond=None)[0]
    rest = column[name] - _unit_columns(A) @ share
    length = np.linalg.norm(column[name])
    order = np.argsort(-np.abs(share))
    many = [kept[i] for i in order if abs(share[i]) > 0.05 * length][:4]
    how = "acts as" if np.linalg.norm(rest) < _SAME * length else "is hardly told from"
    together = " together" if len(many) > 1 else ""
    return f"{how} {' and '.join(filter(None, (', '.join(many[:-1]), many[-1])))}{together}"
