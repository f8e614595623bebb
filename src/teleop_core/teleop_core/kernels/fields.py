"""Records in plain Python: their fields as attributes, as kernels read them."""

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
        return self[name] if name in fields else super().__getattribute__(name)

    def __setattr__(self, name: str, value: Any) -> None:
        """Set a field; there is nothing else to set."""
        if name not in np.void.__getattribute__(self, "dtype").fields:
            raise AttributeError(f"record has no field {name!r}")
        self[name] = value


def record_dtype(fields: Any) -> np.dtype[Any]:
    """Type of records whose fields are attributes.

    Args:
        fields: What :class:`numpy.dtype` takes: pairs of name and type, or a dtype.
    """
    return np.dtype((Record, np.dtype(fields)))
