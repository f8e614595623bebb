"""Port: where hand or slave touch what is between them, and the energy that goes through it.

The power of a port is the sum of each force times its own speed: forces with speeds, torques with
turns. What goes in is counted apart from what goes out, so that both only grow: a message of them
that is lost, late or doubled takes nothing away from the next one.

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
    """Work [J] of a force (3,) [N] on a way (3,) [m], or of a torque [N m] on a turn [rad]."""
    work = 0.0
    for i in range(3):
        work += force[i] * way[i]
    return work


@kernel
def begin_round(port: Array, law: float, number: float) -> None:
    """Begin to count anew: no energy is in or out, told or heard."""
    for i in range(port.shape[0]):
        port[i] = 0.0
    port[LAW], port[ROUND] = law, number


@inner
def count(port: Array, at: int, work: float) -> None:
    """Add what came in, or with the other sign went out, to the columns ``at`` and after it."""
    if work > 0.0:
        port[at] += work
    else:
        port[at + 1] -= work


@kernel
def hear_energy(port: Array, heard: Array) -> float:
    """Take what the other side tells of this round; returns what is new of it [J].

    What is older than what was heard already tells less and changes nothing.
    """
    if heard[LAW] != port[LAW] or heard[ROUND] != port[ROUND] or heard[TOLD] <= port[HEARD]:
        return 0.0
    gained = heard[TOLD] - port[HEARD]
    port[HEARD] = heard[TOLD]
    return float(gained)
