"""Records in plain Python: their fields as attributes, as kernels read them."""

from collections.abc import Iterable
from difflib import get_close_matches
from typing import Any

import numpy as np

_NUMPY_RECORD: Any = np.record  # numpy's types call its parents final


class Record(_NUMPY_RECORD):
    """One record, whose attributes are its fields first of all.

    With :class:`numpy.record` a field named ``size``, ``min`` or ``data`` gives what every NumPy
    number has under that name; compiled kernels know fields only.
    """

    def __getattribute__(self, name: str) -> Any:
        """Value of a field, else what NumPy has of that name."""
        fields = np.void.__getattribute__(self, "dtype").fields
        if name in fields:
            return self[name]
        try:
            return super().__getattribute__(name)
        except AttributeError:
            raise AttributeError(_missing(name, fields)) from None

    def __setattr__(self, name: str, value: Any) -> None:
        """Set a field; there is nothing else to set."""
        fields = np.void.__getattribute__(self, "dtype").fields
        if name not in fields:
            raise AttributeError(_missing(name, fields))
        self[name] = value


def _missing(name: str, fields: Iterable[str]) -> str:
    """What is wrong with a name, as the compiler's messages have it."""
    known = list(fields)
    near = get_close_matches(name, known, n=1)
    hint = f"; did you mean {near[0]!r}?" if near else ""
    return f"record has no field {name!r}{hint} (fields: {', '.join(known)})"


def record_dtype(fields: Any) -> np.dtype[Any]:
    """Type of records whose fields are attributes.

    Args:
        fields: What :class:`numpy.dtype` takes: pairs of name and type, or a dtype.
    """
    return np.dtype((Record, np.dtype(fields)))
