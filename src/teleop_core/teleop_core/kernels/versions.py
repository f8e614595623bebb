"""Versions of numba that the kernels are written for: they use what it keeps to itself."""

import numba

SUPPORTED = ((0, 68), (0, 69))
"""The first that will do, and the first beyond it that may differ; the same as in setup.py."""


def check_version(found: str = numba.__version__) -> None:
    """Refuse other versions of numba.

    Raises:
        ImportError: That version is installed; the text says which will do.
    """
    first, beyond = SUPPORTED
    if not first <= tuple(int(part) for part in found.split(".")[:2]) < beyond:
        lower, upper = (".".join(map(str, version)) for version in SUPPORTED)
        raise ImportError(f"numba is {found}, must be >= {lower} and < {upper}")
