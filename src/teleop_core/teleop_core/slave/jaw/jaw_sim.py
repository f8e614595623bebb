"""Stage ``jaw_sim``: drive and grip of a simulated jaw, which follows the jaw's setpoint."""

import math
from dataclasses import dataclass, field

import numpy as np

from teleop_core.base import ParameterError, Within, fixed, parameter
from teleop_core.graph import DT, Row, RunningStage, Stage, assign, copy, topics
from teleop_core.kernels import kernel, record
from teleop_core.slave.jaw.drive import drive
from teleop_core.slave.jaw.grip import PEGS, GripNumbers, GripState, move_objects, put_objects, see_objects, tell_board

_OTHERS = (topics.FIRST_JAW_BOARD, topics.SECOND_TRUE_CP, topics.SECOND_JAW_GRIP)


@dataclass(frozen=True, kw_only=True)
class GripObjectParameters:
    """Objects that the jaw can grip, with equal thickness in all directions; they stand on a flat table."""

    place: tuple[float, ...] = fixed(
        (),
        Within(-10.0, 10.0, "m"),
        "start position of the middle of the object, half its size above the table; several objects: "
        "one position after the other, with the same z; empty: no object",
    )
    size: float = parameter(0.02, Within(1e-3, 0.2, "m"), "edge length of the object")
    mass: float = parameter(0.05, Within(1e-4, 10.0, "kg"), "mass of the object")
    stiffness: float = parameter(
        4000.0, Within(10.0, 1e6, "N/m"), "stiffness of the object and both pads together", source="assumed"
    )
    damping: float = parameter(
        20.0, Within(0.0, 1e4, "N·s/m"), "damping of the object and both pads together", source="assumed"
    )
    friction: float = parameter(
        0.5, Within(0.0, 5.0), "coefficient of dry friction between each pad and the object", source="assumed"
    )

    def __post_init__(self) -> None:
        n, rest = divmod(len(self.place), 3)
        if rest or n > topics.JAW_OBJECTS or len(set(self.place[2::3])) > 1:
            needed = f"x, y, z of up to {topics.JAW_OBJECTS} objects, with one z, or empty"
            raise ParameterError("jaw_sim.object.place", self.place, needed)


@dataclass(frozen=True, kw_only=True)
class PegParameters:
    """Upright pegs of the table, onto which objects can be put."""

    place: tuple[float, ...] = fixed(
        (), Within(-10.0, 10.0, "m"), "x, y of the axis of each peg, one peg after the other; empty: no pegs"
    )
    height: float = parameter(
        0.015, Within(1e-3, 0.5, "m"), "height by which an object must be lifted to come off a peg", source="assumed"
    )
    clearance: float = parameter(
        0.0015,
        Within(0.0, 0.1, "m"),
        "distance by which an object can move from the peg's axis before the peg touches it",
        source="assumed",
    )

    def __post_init__(self) -> None:
        x, y = self.place[::2], self.place[1::2]
        if len(x) != len(y) or len(x) > PEGS:
            raise ParameterError("jaw_sim.pegs.place", self.place, f"x, y of up to {PEGS} pegs")
        ways = [math.hypot(x[i] - x[k], y[i] - y[k]) for i in range(len(x)) for k in range(i)]
        if min(ways, default=math.inf) <= 2.0 * self.clearance:
            needed = f"pegs more than 2 clearances ({2.0 * self.clearance:g} m) apart"
            raise ParameterError("jaw_sim.pegs.place", self.place, needed)


@dataclass(frozen=True, kw_only=True)
class JawSimParameters:
    """Parameters of :class:`JawSim`."""

    upper: float = fixed(
        0.8,
        Within(0.05, 3.0, "rad"),
        "angle between the fingers at the drive's open stop, which is also the start",
        source="assumed",
    )
    effort_limit: float = parameter(
        0.15, Within(0.0, 100.0, "N·m"), "effort limit of the jaw's drive", source="assumed"
    )
    inertia: float = parameter(1e-4, Within(1e-7, 1.0, "kg·m²"), "inertia of drive and fingers", source="assumed")
    viscous: float = parameter(1e-3, Within(0.0, 10.0, "N·m·s/rad"), "viscous friction of the drive", source="assumed")
    bandwidth: float = parameter(
        100.0,
        Within(1.0, 200.0, "rad/s"),
        "bandwidth of the jaw's control law, which is critically damped",
        source="assumed",
    )
    finger_length: float = parameter(
        0.04, Within(1e-3, 0.5, "m"), "distance from the pivot of a finger to its pad", source="assumed"
    )
    origin: tuple[float, ...] = fixed(
        (0.0, 0.0, 0.0),
        Within(-10.0, 10.0, "m"),
        "origin of the board in the base of the first arm; positions of objects and pegs are relative to it",
        length=3,
    )
    second_base: tuple[float, ...] = fixed(
        (0.0, 0.0, 0.0),
        Within(-10.0, 10.0, "m"),
        "position of the second arm's base in the base of the first arm; their axes are parallel",
        length=3,
    )
    object: GripObjectParameters = field(default_factory=GripObjectParameters)
    pegs: PegParameters = field(default_factory=PegParameters)


@kernel
def jaw_sim_step(p: GripNumbers, s: GripState, row: Row, dt: float) -> None:
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
        self.parameters, self.state = record(GripNumbers), record(GripState)
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
        s["setpoint"] = s["angle"] = row["slave_jaw_measured_js"][0] = p["upper"]
        put_objects(self.parameters, self.state, self._places)

    def retune(self, parameters: JawSimParameters) -> None:
        """Take new parameters from the next tick on."""
        p, thing = self.parameters, parameters.object
        p["upper"], p["effort"] = parameters.upper, parameters.effort_limit
        p["inertia"], p["friction"] = parameters.inertia, parameters.viscous
        p["length"] = parameters.finger_length
        p["stiffness"] = parameters.inertia * parameters.bandwidth**2
        p["damping"] = 2.0 * parameters.inertia * parameters.bandwidth
        origin = np.array(parameters.origin)
        self._places = np.reshape(np.array(thing.place, dtype=np.float64), (-1, 3)) + origin
        p["objects"], p["place"] = len(self._places), [*self._places, origin][0]
        p["second_base"] = parameters.second_base
        pegs = parameters.pegs
        axes = np.reshape(np.array(pegs.place, dtype=np.float64), (-1, 2)) + origin[:2]
        p["pegs"], p["axes"][: axes.size] = len(axes), axes.ravel()
        p["peg_height"], p["clearance"] = pegs.height, pegs.clearance
        p["size"], p["mass"], p["pad_friction"] = thing.size, thing.mass, thing.friction
        p["pad_stiffness"], p["pad_damping"] = thing.stiffness, thing.damping


JAW_SIM = Stage(
    "jaw_sim",
    JawSimParameters,
    reads=(topics.SLAVE_JAW_SETPOINT_JS, topics.SLAVE_TRUE_CP, *_OTHERS),
    late=_OTHERS,
    writes=(topics.SLAVE_JAW_MEASURED_JS, topics.SLAVE_JAW_GRIP, topics.SLAVE_JAW_OBJECT_CP, topics.SLAVE_JAW_BOARD),
    optional=(topics.SLAVE_TRUE_CP, *_OTHERS),
    make=JawSim,
)
