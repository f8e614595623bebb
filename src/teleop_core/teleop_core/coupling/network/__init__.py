"""Network: how packets travel between the master's side and the slave's, one file per kind.

For every packet a kind determines the delay beyond the least delay, or the loss of the packet. Order, rate and contents
of packets are the same for all kinds (:mod:`teleop_core.coupling.network.link`).
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from teleop_core.base import PartError, Registry, part_check
from teleop_core.base.registry import places, tried
from teleop_core.kernels import Array, fenced, is_whole, numbers_of, pointer

__all__ = ["CHANCES", "LOST", "MEMORY", "NETWORKS", "Network", "register_network"]

_ROW = "float64[::1]"
DRAW = f"float64({_ROW}, {_ROW}, {_ROW}, float64)"
"""Signature of a draw kernel, so that one compiled stage serves every kind."""
LOST = -1.0
"""Result of a draw for a lost packet."""
CHANCES = 3
"""Number of random numbers for each packet."""
MEMORY = 4
"""Number of values that a direction remembers."""


@dataclass(frozen=True)
class Network:
    """A kind of network, for one direction.

    Attributes:
        name: Name of the kind in ``--set network.there.kind=``.
        parameters: Parameter group of the kind.
        draw: ``draw(numbers, memory, chances, now)``, a kernel or a plain function, called once for every packet.
            ``numbers`` are the numbers of the parameters. ``memory`` (4,) is kept from packet to packet, and is zero at
            the start. ``chances`` (3,) are random numbers, uniform from 0 to 1. ``now`` is the time since the start
            [s]. The function returns the delay beyond the least delay [s], or :data:`LOST`.
        numbers: ``numbers(parameters)`` returns the ``numbers`` of ``draw``, if they differ from the numbers of the
            parameters in their order.
    """

    name: str
    parameters: type
    draw: Callable[[Array, Array, Array, float], float]
    numbers: Callable[[Any], Array] = numbers_of

    draw_pointer = cached_property(lambda self: pointer(self.draw, DRAW))
    """The draw as an argument for kernels."""


def _try(part: Network) -> None:
    """Call the kernel for some packets, so that errors are reported before anything runs."""
    needs = "one with draw(numbers, memory, chances, now) -> float and parameters that all have defaults"
    with tried("network", part.name, needs):
        numbers, _ = fenced(part.numbers(part.parameters()))  # an index one too large reads NaN
        memory, fence = fenced(np.zeros(MEMORY))
        for i, chance in enumerate(np.linspace(0.0, 0.999, 32)):
            drawn = float(part.draw(numbers, memory, np.full(CHANCES, chance), 1e-3 * i))
            if not (math.isfinite(drawn) and is_whole(fence)):
                text = f"one whose draw is finite and remembers {MEMORY} numbers; it is {drawn!r}"
                raise PartError("network", part.name, text)


NETWORKS: Registry[Network] = Registry(
    "network",
    "networks",
    places("teleop_core.coupling.network", "constant jitter gilbert_elliott outages trace"),
    part_check("network", Network, "draw"),
    _try,
)
"""All kinds by name."""

register_network = NETWORKS.register
"""Adds your network under its own name; see :meth:`Registry.register`."""
