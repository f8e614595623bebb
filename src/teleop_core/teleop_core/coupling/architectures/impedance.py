"""Impedance as a stage: the slave's tip yields to the force on it, as a mass with spring and damper does.

An arm is commanded by positions, so the force on its tip shifts the commanded position. If the architecture sends the
hand's force, this force shifts the commanded position in the opposite direction. The later stages get only the
resulting command: passivity, reach, limits and faults work as without this stage.
"""

import math
from dataclasses import dataclass

from teleop_core.base import Within, parameter
from teleop_core.graph import Row, Stage, copy, topics
from teleop_core.kernels import Fields, Vector3, inner, kernel

_LONGEST = 0.1
"""Longest time of one step [s], after a pause of the commands."""


@dataclass(frozen=True, kw_only=True)
class ImpedanceParameters:
    """Mass, spring and damper between the hand's command and the slave's command."""

    mass: float = parameter(
        1.0,
        Within(0.0, 100.0, "kg"),
        "virtual mass of the tip that yields to force",
        source="assumed: together with stiffness and damping it does not oscillate",
    )
    damping: float = parameter(
        100.0,
        Within(1.0, 10_000.0, "N·s/m"),
        "virtual damping: force divided by the speed at which the tip yields",
        source="assumed: with it, an arm that lags by 50 ms does not oscillate on silicone of 1000 N/m",
    )
    stiffness: float = parameter(
        1000.0,
        Within(10.0, 100_000.0, "N/m"),
        "virtual stiffness: force divided by the distance by which the tip yields",
        source="assumed: five times the stiffness of tissue, and the same as that of silicone",
    )
    force_gain: float = parameter(
        1.0, Within(0.0, 10.0, "N/N"), "force to which the tip yields, divided by slave/measured_cf"
    )
    largest_way: float = parameter(
        0.02, Within(0.0, 0.5, "m"), "largest distance by which the tip yields, at any force", source="assumed"
    )


class ImpedanceState(Fields):
    """State record of the impedance."""

    way: Vector3  # shift of the command [m]
    speed: Vector3  # [m/s]
    last_ns: int  # stamp of the previous command


@inner
def _yield(p: ImpedanceParameters, s: ImpedanceState, row: Row, time: float) -> None:
    """Advance shift and speed by ``time`` [s] under the forces of tip and hand."""
    lead = 1.0 if row.slave_setpoint_cp_ns > topics.NO_COMMAND_NS else 0.0
    inertia, square = p.mass + time * (p.damping + time * p.stiffness), 0.0
    for i in range(3):
        force = lead * (row.slave_servo_cf[i] + p.force_gain * row.slave_measured_cf[i])
        s.speed[i] = (p.mass * s.speed[i] + time * (force - p.stiffness * s.way[i])) / inertia
        s.way[i] += time * s.speed[i]
        square += s.way[i] * s.way[i]
    if square > p.largest_way * p.largest_way:
        share = p.largest_way / math.sqrt(square)
        for i in range(3):
            s.way[i] *= share
            s.speed[i] = 0.0


@kernel
def impedance_step(p: ImpedanceParameters, s: ImpedanceState, row: Row, dt: float) -> None:
    """One command: advance the shift by the time since the last command, and write impedance_servo_cp.

    The step is backward Euler, stable for any mass and time: ``speed = (M speed + t (f - K way)) / (M + t B + t² K)``.
    While the slave does not follow the hand, forces are ignored, so that following begins without a shift; a remaining
    shift decays by itself.

    Args:
        p: Parameters.
        s: State; written.
        row: Signals.
        dt: Tick [s].

    Source:
        Hogan 1985, impedance control, in the form of an admittance for a position-controlled arm.
    """
    time = min(1e-9 * (row.slave_servo_cp_ns - s.last_ns), _LONGEST)
    if time > 0.0:
        s.last_ns = row.slave_servo_cp_ns
        _yield(p, s, row, time)
    copy(row.slave_servo_cp, row.impedance_servo_cp)
    for i in range(3):
        row.impedance_servo_cp[i] += s.way[i]


IMPEDANCE = Stage(
    "impedance",
    ImpedanceParameters,
    reads=(topics.SLAVE_SERVO_CP, topics.SLAVE_SERVO_CF, topics.SLAVE_MEASURED_CF, topics.SLAVE_SETPOINT_CP),
    writes=(topics.IMPEDANCE_SERVO_CP,),
    step=impedance_step,
    state=ImpedanceState,
    late=(topics.SLAVE_MEASURED_CF, topics.SLAVE_SETPOINT_CP),
    trigger=topics.SLAVE_SERVO_CP,
    replaces=topics.SLAVE_SERVO_CP,
    needs=(topics.SLAVE_MEASURED_CF,),
)
