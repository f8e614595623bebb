"""Inertias of links: mass, centre and moments as a value, and whether a body can have them.

A rigid body of positive density has a positive mass and three positive principal moments about its centre of mass, of
which none exceeds the sum of the other two. These conditions together are equivalent to one: the pseudo-inertia (4, 4)
∫ (x, 1)(x, 1)ᵀ dm is positive definite. A flat plate, whose largest moment equals that sum, is accepted. A point or a
line is refused, because no physics engine can rotate it.

Source:
    Wensing, Kim and Slotine 2018, Linear matrix inequalities for physically consistent inertial
    parameter identification.
"""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from teleop_core.base import ParameterError, ShapeError
from teleop_core.kernels import Array, dot

# Tolerance of the triangle inequality, divided by the largest moment. Numbers of a plate, or numbers that a source
# prints with few digits, violate the inequality by rounding.
_ROUNDING = 1e-9


@dataclass(frozen=True, kw_only=True, eq=False)
class LinkInertia:
    """Inertia of one link in the axes of a frame fixed to it; the arrays are read-only copies.

    Args:
        name: Name of the link in errors.
        mass: Mass [kg].
        center: Centre of mass (3,) in the frame [m].
        inertia: Symmetric tensor (3, 3) about the frame's *origin* [kg·m²], with the products as in mechanics: the
            off-diagonal elements are -∫xy dm. :meth:`about_origin` accepts either sign.

    Raises:
        ShapeError: The centre is not (3,), or the tensor is not (3, 3).
        ParameterError: A value is not finite, or the tensor is not symmetric. Only :func:`check_possible` checks
            whether a body can have these values.
    """

    name: str
    mass: float
    center: Array
    inertia: Array

    def __post_init__(self) -> None:
        for field, shape in (("center", (3,)), ("inertia", (3, 3))):
            array = np.array(getattr(self, field), dtype=np.float64)
            if array.shape != shape:
                raise ShapeError(f"{field} of link {self.name!r}", shape, array.shape)
            if not np.isfinite(array).all():
                raise ParameterError(f"{field} of link {self.name!r}", array.tolist(), "finite")
            array.setflags(write=False)
            object.__setattr__(self, field, array)
        if not np.isfinite(self.mass):
            raise ParameterError(f"mass of link {self.name!r}", self.mass, "a finite number [kg]")
        if not np.allclose(self.inertia, self.inertia.T, rtol=1e-12, atol=0.0):
            what = f"inertia of link {self.name!r}"
            raise ParameterError(what, self.inertia.tolist(), "symmetric")

    @staticmethod
    def about_origin(
        name: str,
        mass: float,
        center: Iterable[float],
        moments: tuple[float, float, float],
        products: tuple[float, float, float],
        sign: float = 1.0,
    ) -> "LinkInertia":
        """Inertia from moments about the frame's origin, as CAD programs print them.

        Args:
            name: Name of the link in errors.
            mass: Mass [kg].
            center: Centre of mass (3,) [m].
            moments: Ixx, Iyy, Izz [kg·m²].
            products: Ixy, Ixz, Iyz [kg·m²].
            sign: +1 if the products are +∫xy dm and so on, -1 if they are -∫xy dm.
        """
        tensor, (xy, xz, yz) = np.diag(moments), (-sign * np.asarray(products))
        tensor[0, 1] = tensor[1, 0] = xy
        tensor[0, 2] = tensor[2, 0] = xz
        tensor[1, 2] = tensor[2, 1] = yz
        return LinkInertia(name=name, mass=mass, center=np.array([*center]), inertia=tensor)

    @property
    def central(self) -> Array:
        """Tensor (3, 3) about the centre of mass [kg·m²], in the axes of the frame (parallel-axis theorem)."""
        c = self.center
        return self.inertia - self.mass * (dot(c, c) * np.eye(3) - np.outer(c, c))

    @property
    def pseudo(self) -> Array:
        """Pseudo-inertia (4, 4) about the origin: second moments [kg·m²] (3, 3), mass times centre (3,), and mass."""
        out = np.empty((4, 4))
        out[:3, :3] = 0.5 * np.trace(self.inertia) * np.eye(3) - self.inertia
        out[:3, 3] = out[3, :3] = self.mass * self.center
        out[3, 3] = self.mass
        return out


def check_possible(links: Iterable[LinkInertia]) -> None:
    """Refuse inertias that no body can have.

    Raises:
        ParameterError: A mass or a principal moment is not positive, or a second moment ∫x² dm is negative, so that one
            principal moment exceeds the sum of the other two. The message names the link and the value.
    """
    for link in links:
        _check_link(link)


def _check_link(link: LinkInertia) -> None:
    of = f"of link {link.name!r}"
    if link.mass <= 0.0:
        raise ParameterError(f"mass {of}", link.mass, "> 0 kg")
    moments: Array = np.linalg.eigvalsh(link.central).astype(np.float64)
    hint = "; check the signs of its centre of mass and of its products of inertia"
    if moments[0] <= 0.0:
        what = f"smallest principal moment about the centre of mass {of}"
        raise ParameterError(what, float(moments[0]), f"> 0 kg·m²{hint}")
    # Second moment along a principal axis: half of (the sum of the two other principal moments minus its own moment).
    least = 0.5 * (moments[0] + moments[1] - moments[2])
    if least < -_ROUNDING * moments[2]:
        what = f"smallest second moment about the centre of mass {of}"
        needed = ">= 0 kg·m², for no principal moment exceeds the sum of the other two"
        raise ParameterError(what, float(least), f"{needed} (they are {_list(moments)}){hint}")


def _list(values: Array) -> str:
    return ", ".join(f"{value:.6g}" for value in values)
