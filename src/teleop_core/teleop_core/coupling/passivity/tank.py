"""Tank: the energies of TDPA, and a slave that stops before something hard.

Without a stage ``passivity`` the push gives the hand no more than it took from it, by its own port.
An empty tank pushes no hand back, so that one before something hard goes on until a drive gives all
it has. With the stage the slave's command stops there by the force on the tip.
"""

from teleop_core.coupling.passivity import Passivity
from teleop_core.coupling.passivity.tdpa import StoreParameters, lead_slave, tdpa_hand
from teleop_core.kernels import Array, kernel


@kernel
def tank_slave(
    numbers: Array, memory: Array, flow: Array, force: Array, tip: Array, last: Array,
    heard: Array, port: Array, command: Array, period: float,
) -> None:  # fmt: skip
    """Let the command (7,) be ahead of the tip the less, the larger the force is, and stop.

    Arguments are those of :func:`teleop_core.coupling.passivity.tdpa.tdpa_slave`; the sixth of
    ``numbers`` is the force that stops it [N].
    """
    lead_slave(numbers, memory, flow, force, tip, last, port, command, numbers[5], period)


TANK = Passivity("tank", StoreParameters, tdpa_hand, tank_slave)
