"""Stage ``jaw_sim``: drive and grip of a simulated jaw, which follows the jaw's setpoint."""

import numpy as np

from teleop_core.base import fill
from teleop_core.graph import DT, Row, RunningStage, Stage, assign, copy, topics
from teleop_core.kernels import Array, kernel, record
from teleop_core.slave.jaw.drive import drive
from teleop_core.slave.jaw.grip import GripRecord, GripState, move_objects, put_objects, see_objects, tell_board
from teleop_core.slave.jaw.parameters import JawSimParameters

_OTHERS = (topics.FIRST_JAW_BOARD, topics.SECOND_TRUE_CP, topics.SECOND_JAW_GRIP)


def derive(p: GripRecord, parameters: JawSimParameters, places: Array) -> None:
    """Write what follows from the parameters, and from the places of the objects (n, 3) [m]."""
    p.stiffness = parameters.inertia * parameters.bandwidth**2
    p.damping = 2.0 * parameters.inertia * parameters.bandwidth
    origin = np.array(parameters.origin)
    p.objects, p.place[:] = len(places), [*places, origin][0]
    axes = np.reshape(np.array(parameters.pegs.place, dtype=np.float64), (-1, 2)) + origin[:2]
    p.peg_count, p.axes[: axes.size] = len(axes), axes.ravel()


@kernel
def jaw_sim_step(p: GripRecord, s: GripState, row: Row, dt: float) -> None:
    """One tick: take the setpoint, write the measured jaw angle, and advance jaw and object.

    Args:
        p: Parameter record.
        s: State record; written.
        row: Signals.
        dt: Tick [s].
    """
    before = s.setpoint
    if row.slave_jaw_setpoint_js_ns > topics.NO_COMMAND_NS:  # without a setpoint the jaw stays at its start
        s.setpoint = row.slave_jaw_setpoint_js[0]
    row.slave_jaw_measured_js[0], row.slave_jaw_measured_js[1] = s.angle, s.velocity
    drive(p, s, (s.setpoint - before) / dt, dt)
    row.slave_jaw_measured_js[2] = s.effort
    if p.objects:
        if row.first_slave_jaw_board_ns > 0:
            see_objects(p, s, row)
        else:
            move_objects(p, s, row)
        tell_board(p, s, row.slave_jaw_board)
    copy(s.objects[7 * s.numbers[0] : 7 * s.numbers[0] + 7], row.slave_jaw_object_cp)
    grip = row.slave_jaw_grip
    grip[0], grip[1], grip[2] = s.force, s.is_gripped, s.slid
    grip[3], grip[4], grip[5] = s.grips, s.slips, s.drops


class JawSim(RunningStage):
    """Stage of the simulated jaw; it begins open, at rest."""

    def __init__(self, parameters: JawSimParameters, dt: float = DT) -> None:
        super().__init__(JAW_SIM, 0, dt)
        self.parameters, self.state = record(GripRecord), record(GripState)
        self.kernel = jaw_sim_step
        self.arguments = (self.parameters, self.state)
        self._begin = self.signals.copy()
        self.retune(parameters)
        self.reset()

    def reset(self) -> None:
        """Open the jaw, at rest, and put the object at its initial position."""
        s, p, row = self.state, self.parameters, self.signals
        assign(s, 0)
        assign(row, self._begin)
        s["setpoint"] = s["angle"] = row["slave_jaw_measured_js"][0] = p.upper
        put_objects(self.parameters, self.state, self._places)

    def retune(self, parameters: JawSimParameters) -> None:
        """Take new parameters from the next tick on."""
        place = np.array(parameters.object.place, dtype=np.float64)
        self._places = np.reshape(place, (-1, 3)) + np.array(parameters.origin)
        fill(self.parameters, parameters)
        derive(self.parameters, parameters, self._places)


JAW_SIM = Stage(
    "jaw_sim",
    JawSimParameters,
    reads=(topics.SLAVE_JAW_SETPOINT_JS, topics.SLAVE_TRUE_CP, *_OTHERS),
    late=_OTHERS,
    writes=(topics.SLAVE_JAW_MEASURED_JS, topics.SLAVE_JAW_GRIP, topics.SLAVE_JAW_OBJECT_CP, topics.SLAVE_JAW_BOARD),
    optional=(topics.SLAVE_TRUE_CP, *_OTHERS),
    make=JawSim,
)
