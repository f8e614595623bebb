"""Room: small temporary arrays that a kernel needs only until it returns, without the cost of an allocation.

Making and freeing an array of ``np.empty`` takes 0.015 µs, and a kernel that makes arrays counts the references to all
its other arrays too (:mod:`teleop_core.kernels.compiler.borrowing`). :func:`room` uses memory of the kernel's own stack
frame.
"""

import numpy as np
from numpy.typing import NDArray


def room(*shape: int) -> NDArray[np.float64]:
    """Uninitialised array of floats, valid until the kernel returns. The kernel must not return this array.

    In a loop, each pass uses the same memory.

    Args:
        *shape: One or two sizes, written as literal numbers.
    """
    return np.empty(shape)
