"""Hardware: how a real arm differs from its ideal model, as measured or fitted."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType

import numpy as np

from teleop_core.base.errors import ParameterError, ShapeError, UnknownNameError
from teleop_core.base.parameters import MARKS
from teleop_core.kernels.geometry import Array
from teleop_core.robots import drives, link_errors

NUMBERS = ("coulomb", "bias", "wander", "play")
ENTRIES = (*NUMBERS, "coupling", "links", "dynamics", "motors")
NOT_NEGATIVE = ("coulomb", "wander", "play")


@dataclass(frozen=True, kw_only=True, eq=False)
class Hardware:
    """Faults of a real arm, one number per joint, (n,) each; the arrays are read-only copies.

    Args:
        coulomb: Dry friction that holds a joint at rest [N·m or N], >= 0.
        bias: Effort of the motor while the command is zero, an offset of the amplifier [N·m or N].
        wander: Standard deviation of the dry friction, divided by the mean friction, >= 0.
        play: Half width of the play between encoder and joint [rad or m], >= 0: backlash, and friction behind an
            elastic tendon, which has the same effect.
        coupling: Matrix (n, n), zero on and above the diagonal. Element (i, j) is the motion of joint i per unit of lag
            of joint j behind the encoder of joint j.
        links: How the links, and the zeros of the joints, differ from the drawing; None for no difference.
        dynamics: Parameter row of the true dynamics; empty if they equal those of the control law.
        motors: Inertias of the motors through their gears (n,) [kg·m² or kg]; empty: not known.
        sources: Maps each name above to the source of its numbers, as in
            :func:`teleop_core.base.parameters.parameter`.

    Raises:
        ShapeError: The shape of an array does not fit that of ``coulomb``.
        ParameterError: A number is impossible, or a source does not begin with a valid mark.
        UnknownNameError: A name in ``sources`` is not one of the numbers.
    """

    coulomb: Array
    bias: Array
    wander: Array
    play: Array
    coupling: Array
    links: link_errors.LinkErrors | None = None
    dynamics: Array = field(default_factory=lambda: np.zeros(0))
    motors: Array = field(default_factory=lambda: np.zeros(0))
    sources: Mapping[str, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for name in NUMBERS:
            array = drives.read_only(name, getattr(self, name), np.shape(self.coulomb))
            if name in NOT_NEGATIVE and not (array >= 0.0).all():
                raise ParameterError(f"hardware.{name}", array.tolist(), ">= 0 for every joint")
            object.__setattr__(self, name, array)
        n = len(self.coulomb)
        coupling = np.array(self.coupling, dtype=np.float64)
        if coupling.shape != (n, n):
            raise ShapeError("hardware.coupling", (n, n), coupling.shape)
        if np.triu(coupling).any():
            raise ParameterError("hardware.coupling", coupling.tolist(), "zero except in the columns of earlier joints")
        coupling.setflags(write=False)
        object.__setattr__(self, "coupling", coupling)
        if self.links is not None and self.links.n != n:
            raise ShapeError("hardware.links", n, self.links.n)
        object.__setattr__(self, "dynamics", drives.read_only("dynamics", self.dynamics))
        object.__setattr__(self, "motors", drives.read_only("motors", self.motors))
        self._check_sources()

    def _check_sources(self) -> None:
        for name, text in self.sources.items():
            if name not in ENTRIES:
                raise UnknownNameError("hardware source", name, ENTRIES)
            if text.partition(":")[0] not in MARKS:
                raise ParameterError(f"source of {name}", text, f"one that begins with {MARKS}")
        object.__setattr__(self, "sources", MappingProxyType(dict(self.sources)))
