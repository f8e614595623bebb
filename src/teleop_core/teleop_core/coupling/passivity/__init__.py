"""Passivity: prevents delayed forces from generating energy, one file per kind.

Hand and slave are connected at two ports. The hand's port has the push on the hand and its motion. The slave's port has
the force on the tip and the tip's motion. The energy into and out of both ports is counted for every kind
(:mod:`teleop_core.coupling.passivity.port`). A kind defines how each side uses this energy. A side knows only its own
port and the values that it received from the other side.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from teleop_core.base import PartError, Registry, part_check
from teleop_core.base.registry import places, tried
from teleop_core.graph import topics
from teleop_core.kernels import Array, fenced, is_whole, kernel, numbers_of, pointer

__all__ = ["MEMORY", "PASSIVITIES", "Passivity", "leave_command", "register_passivity"]

_ROW = "float64[::1]"
HAND = f"void({_ROW}, {_ROW}, {_ROW}, {_ROW}, {_ROW}, {_ROW}, {_ROW}, {_ROW}, {_ROW}, float64, float64)"
SLAVE = f"void({_ROW}, {_ROW}, {_ROW}, {_ROW}, {_ROW}, {_ROW}, {_ROW}, {_ROW}, {_ROW}, float64)"
"""Signatures of both kernels, so that one compiled stage serves every kind."""
MEMORY = 12
"""Number of values that each side of a kind remembers."""


@kernel
def leave_command(
    numbers: Array, memory: Array, flow: Array, force: Array, tip: Array, last: Array,
    heard: Array, port: Array, command: Array, period: float,
) -> None:  # fmt: skip
    """Pass the command to the slave unchanged."""


@dataclass(frozen=True)
class Passivity:
    """A kind of passivity: how it changes the push on the hand and the slave's command.

    The kernels of both sides may write to ``port``, their row of :data:`~teleop_core.graph.topics.ENERGY`. ``heard`` is
    the other side's row as it arrived. Energies are in the slave's scale [J]. ``flow`` (3,) contains three energies
    since the last call: the credit from the other side, the energy into this port, and the energy out of this port.
    ``memory`` (12,) is kept from call to call, and is zero at the start. With every new ``round`` all energies restart
    from zero, and so does ``memory`` at the slave.

    Attributes:
        name: Name of the kind in ``--set reflection.passivity=``.
        parameters: Parameter group of the kind.
        hand: ``hand(numbers, memory, last, moved, led, flow, heard, port, push, scale, period)``, called for every
            sample of the master. ``last`` (3,) is the push since the last sample [N]; ``moved`` (3,) is the motion of
            the hand since then; ``led`` (3,) is the commanded motion of the slave, divided by the motion gain [m]; all
            are in axes of the master's base. ``push`` (3,) is the wanted push, and must be overwritten with the
            allowed push. ``scale`` is the hand's energy divided by that of the slave; ``period`` is the time since the
            last sample [s].
        slave: ``slave(numbers, memory, flow, force, tip, last, heard, port, command, period)``, called for every
            command that arrives, only if there is a stage ``passivity``. ``numbers`` are the numbers of that stage.
            ``force`` (6,) is the wrench on the tip [N, N m], and ``tip`` (7,) is the pose of the tip. ``last`` (7,) is
            the last command given to the slave. ``command`` (7,) is the command that arrived; it must be overwritten
            with the command to give.
        numbers: ``numbers(parameters)`` returns the ``numbers`` of ``hand``, if they differ from the numbers of the
            parameters in their order.
        needs_slave: Whether the kind works only together with a stage ``passivity``.
    """

    name: str
    parameters: type
    hand: Callable[..., None]
    slave: Callable[..., None] = leave_command
    numbers: Callable[[Any], Array] = numbers_of
    needs_slave: bool = False

    hand_pointer = cached_property(lambda self: pointer(self.hand, HAND))
    slave_pointer = cached_property(lambda self: pointer(self.slave, SLAVE))
    """Both sides as arguments for kernels."""


def _try(part: Passivity) -> None:
    """Call both sides for some samples, so that errors are reported before anything runs."""
    needs = (
        "one with hand(numbers, memory, last, moved, led, flow, heard, port, push, scale, period) "
        "and parameters that all have defaults"
    )
    with tried("passivity", part.name, needs):
        (numbers, _), width = fenced(part.numbers(part.parameters())), len(topics.ENERGY)
        memory, fence = fenced(np.zeros(MEMORY))
        push, behind = fenced(np.zeros(3))
        command, after = fenced(np.array([0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0]))
        last = command.copy()
        heard, port, flow = np.zeros(width), np.zeros(width), np.full(3, 1e-6)
        for size in (0.0, 1.0, -1.0):
            push[:], moved = size, np.full(3, 1e-4 * size)
            part.hand(numbers, memory, push.copy(), moved, moved, flow, heard, port, push, 1.0, 1e-3)
            part.slave(np.ones(7), memory, flow, np.full(6, size), last, last, heard, port, command, 1e-3)
            is_sound = np.isfinite(push).all() and np.isfinite(command).all()
            if not (is_sound and is_whole(fence) and is_whole(behind) and is_whole(after)):
                text = f"one whose push and command are finite, not {push!r} and {command!r}"
                raise PartError("passivity", part.name, text)


PASSIVITIES: Registry[Passivity] = Registry(
    "passivity",
    "passivities",
    {**places("teleop_core.coupling.passivity", "none tank tdpa"), "wave": "teleop_core.coupling.passivity.wave:WAVES"},
    part_check("passivity", Passivity, "hand", "slave"),
    _try,
)
"""All kinds by name."""

register_passivity = PASSIVITIES.register
"""Adds your kind under its own name; see :meth:`Registry.register`."""
