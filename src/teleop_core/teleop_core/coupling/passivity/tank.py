"""Tank: the energies of TDPA, and a slave that stops at a hard obstacle.

Without a stage ``passivity`` the push returns no more energy to the hand than it took, counted at the hand's port. With
an empty tank nothing pushes the hand back. So a slave at a hard obstacle continues until a drive is at its effort
limit. With the stage, the force on the tip stops the slave's command at the obstacle.
"""

from teleop_core.coupling.passivity import Passivity
from teleop_core.coupling.passivity.tdpa import StoreParameters, lead_slave, tdpa_hand
from teleop_core.kernels import Array, kernel


@kernel
def tank_slave(
    numbers: Array, memory: Array, flow: Array, force: Array, tip: Array, last: Array,
    heard: Array, port: Array, command: Array, period: float,
) -> None:  # fmt: skip
    """Let the command (7,) be ahead of the tip; the larger the force, the smaller the lead, down to zero.

    Arguments are those of :func:`teleop_core.coupling.passivity.tdpa.tdpa_slave`; the sixth of ``numbers`` is the force
    that stops the command [N].
    """
    lead_slave(numbers, memory, flow, force, tip, last, port, command, numbers[5], period)


TANK = Passivity("tank", StoreParameters, tdpa_hand, tank_slave)
