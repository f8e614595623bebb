"""Portable arithmetic: products, lengths and functions with the same bits on every processor.

NumPy computes ``@``, ``np.dot`` and ``np.linalg`` with OpenBLAS, whose order of additions depends on the processor.
Most of NumPy's functions, such as ``exp`` and ``x**3``, use vector code that rounds differently with AVX-512 than
without. Therefore all values that determine the bits of a session are computed with these functions, in compiled
kernels, or with NumPy's sums, ``sin``, ``cos``, ``sqrt`` and ``hypot``, which do not differ. Only the C library
remains: its sines differ between versions, and on processors without fused multiply-add (before 2013).
"""

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from teleop_core.kernels import kernel

Array = NDArray[np.float64]


def dot(a: ArrayLike, b: ArrayLike) -> Array:
    """Sum of a times b along the last axis, (..., n) and (..., n) to (...), added in the order of the indices."""
    products = np.asarray(a) * b
    terms = products.T if products.ndim < 3 else np.moveaxis(products, -1, 0)
    total = np.zeros(terms.shape[1:])
    for term in terms:
        total = total + term
    return total


def length(vectors: ArrayLike) -> Array:
    """Euclidean length of vectors (..., n) along the last axis, (...)."""
    return np.sqrt(dot(vectors, vectors))


def product(a: ArrayLike, b: ArrayLike) -> Array:
    """Product of matrices (..., n, m) and (..., m, k), as ``a @ b``; vectors (n,) are treated as in ``a @ b``."""
    a, b = np.asarray(a), np.asarray(b)
    if b.ndim == 1:
        return dot(a, b)
    if a.ndim == 1:
        return dot(np.swapaxes(b, -1, -2), a)
    return dot(a[..., :, None, :], np.swapaxes(b, -1, -2)[..., None, :, :])


def inverse_motion(transform: Array) -> Array:
    """Inverse of a rigid transform (4, 4): for rotation R and position p, it is Rᵀ and -Rᵀ p."""
    out = np.eye(4)
    out[:3, :3] = transform[:3, :3].T
    out[:3, 3] = -product(out[:3, :3], transform[:3, 3])
    return out


def exponential(values: ArrayLike) -> Array:
    """Exponential of each value of an array of any shape."""
    wanted = np.asarray(values, dtype=np.float64)
    return np.reshape([math.exp(value) for value in wanted.ravel().tolist()], wanted.shape)


def arctangent(y: ArrayLike, x: ArrayLike) -> Array:
    """Angle [rad] of each point x, y, within ±π; arrays of any shapes that broadcast."""
    ys, xs = (np.array(each, dtype=np.float64) for each in np.broadcast_arrays(y, x))
    out = np.empty(ys.shape)
    _arctangents(ys.reshape(-1), xs.reshape(-1), out.reshape(-1))
    return out


def matrix_exponential(matrix: Array) -> Array:
    """Exponential of a square matrix (n, n): Taylor's series of the matrix after halvings, then squared as often.

    Source:
        Moler and Van Loan 2003, method 3, scaling and squaring.
    """
    halvings = max(math.frexp(float(np.abs(matrix).sum(axis=1).max()))[1] + 1, 0)
    scaled, term = matrix / 2.0**halvings, np.eye(len(matrix))
    out = term.copy()
    for k in range(1, 19):  # 0.5^19 / 19! is far below the rounding of 1
        term = product(term, scaled) / k
        out = out + term
    for _ in range(halvings):
        out = product(out, out)
    return out


@kernel
def _arctangents(y: Array, x: Array, out: Array) -> None:
    for i in range(len(out)):
        out[i] = math.atan2(y[i], x[i])
