"""Port: the connection of hand or slave to the system between them, and the energy that flows through it.

The power of a port is force times velocity plus torque times angular velocity. Energy in and energy out are counted
separately, so that both only increase. So a lost, late or doubled message with these energies does not make the next
message wrong.

Source:
    Hannaford and Ryu 2002 for the observer; Ryu, Artigas and Preusche 2010 for monotone energies
    over a link whose delay varies.
"""

from teleop_core.graph import topics
from teleop_core.kernels import Array, inner, kernel

LAW, ROUND, IN, OUT, TOLD, HEARD, MARGIN, WITHHELD, TURN_IN, TURN_OUT, DRIFT, IMPEDANCE, WAVE = (
    topics.ENERGY.index(name) for name in (
        "law", "round", "energy_in", "energy_out", "told", "heard", "margin", "withheld",
        "turn_in", "turn_out", "drift_x", "impedance", "wave_x",
    )
)  # fmt: skip
"""Columns of a port's energies."""


@kernel
def port_work(force: Array, way: Array) -> float:
    """Work [J] of a force (3,) [N] along a displacement (3,) [m], or of a torque [N m] along a rotation [rad]."""
    work = 0.0
    for i in range(3):
        work += force[i] * way[i]
    return work


@kernel
def begin_round(port: Array, law: float, number: float) -> None:
    """Restart the count: all energies, in, out, told and heard, are zero."""
    for i in range(port.shape[0]):
        port[i] = 0.0
    port[LAW], port[ROUND] = law, number


@inner
def count(port: Array, at: int, work: float) -> None:
    """Add positive work to the column ``at`` (in), and the size of negative work to the next column (out)."""
    if work > 0.0:
        port[at] += work
    else:
        port[at + 1] -= work


@kernel
def hear_energy(port: Array, heard: Array) -> float:
    """Take the energy that the other side has credited in this round; return its increase [J].

    An older message contains a smaller energy, and changes nothing.
    """
    if heard[LAW] != port[LAW] or heard[ROUND] != port[ROUND] or heard[TOLD] <= port[HEARD]:
        return 0.0
    gained = heard[TOLD] - port[HEARD]
    port[HEARD] = heard[TOLD]
    return float(gained)
