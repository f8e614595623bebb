"""Motion scaling: from the master's pose to the slave's, with modes, clutch and fixture."""

import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from teleop_core.errors import ParameterError
from teleop_core.geometry import (
    Array,
    multiply_quaternions,
    quaternion_from_rotation,
    rotation,
)
from teleop_core.kernels import bound, inner, kernel
from teleop_core.mapping.fixtures import box_penetration, wall_force
from teleop_core.parameters import parameter
from teleop_core.signals import STATE, make_signals

MODES = ("coarse", "fine")

# Axes of the master's base in the slave's: x_S = -z_P, y_S = -x_P, z_S = y_P (Vongbunyong 2008,
# eq. 6.2.3), and of the slave's tool in the stylus.
R_SLAVE_MASTER = np.array([[0.0, 0.0, -1.0], [-1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
R_STYLUS_TOOL = np.diag([1.0, -1.0, -1.0])


@dataclass(frozen=True, kw_only=True)
class FixtureParameters:
    """The box that the fixture button puts around the hand."""

    size: tuple[float, ...] = parameter(
        (0.03, 0.03, 0.03), unit="m", lower=1e-4, upper=0.5, length=3,
        doc="wall to wall on the master's x, y, z; the slave's box is this times the gain",
    )  # fmt: skip
    wall: str = parameter(
        "soft", choices=("soft", "hard"), doc="spring up to max_force, or max_force at once"
    )
    stiffness: float = parameter(
        1000.0, unit="N/m", lower=1.0, upper=5000.0, doc="spring of the soft wall"
    )
    max_force: float = parameter(
        3.3, unit="N", lower=0.0, upper=10.0, doc="largest push; the device limits it further"
    )


@dataclass(frozen=True, kw_only=True)
class MotionScalingParameters:
    """Parameters of :class:`MotionScaling`."""

    coarse_gain: float = parameter(
        1.0, unit="m/m", lower=1e-3, upper=10.0, doc="slave motion per master motion, coarse mode"
    )
    fine_gain: float = parameter(
        0.1, unit="m/m", lower=1e-3, upper=10.0, doc="slave motion per master motion, fine mode"
    )
    mode: str = parameter("coarse", choices=MODES, doc="mode; the mode button changes it too")
    tool_roll: float = parameter(
        math.pi / 2, unit="rad", lower=-math.pi, upper=math.pi,
        doc="turn of the slave's tool about its axis; π/2 aligns it with the home pose",
    )  # fmt: skip
    feedback_timeout: float = parameter(
        0.1, unit="s", lower=0.002, upper=5.0,
        doc="slave counts as not following when its setpoint is older than this",
    )  # fmt: skip
    fixture: FixtureParameters = field(default_factory=FixtureParameters)

    def __post_init__(self) -> None:
        if self.fine_gain > self.coarse_gain:
            raise ParameterError("fine_gain", self.fine_gain, f"<= coarse_gain {self.coarse_gain}")


_PARAMETERS = np.dtype(
    [("gain", "f8", (2,)), ("stylus_tool", "f8", (4,)), ("slave_master", "f8", (4,)),
     ("size", "f8", (3,)), ("stiffness", "f8"), ("max_force", "f8"), ("timeout_ns", "i8")]
)  # fmt: skip
_STATE = np.dtype(
    [("buttons", "f8", (3,)), ("is_fine", "i8"), ("is_engaged", "i8"), ("must_latch", "i8"),
     ("is_fixture_on", "i8"),
     ("center", "f8", (3,)), ("master", "f8", (3,)), ("command", "f8", (7,)),
     ("alignment", "f8", (4,))]
)  # fmt: skip
_FOLLOWING, _CLUTCHED = STATE["is_following"], STATE["is_clutched"]
_FINE, _GAIN, _FIXTURE = STATE["is_fine"], STATE["gain"], STATE["is_fixture_on"]
_CENTER, _SIZE = STATE["fixture_center_x"], STATE["fixture_size_x"]


@kernel
def to_slave_axes(master: Array, slave: Array) -> None:
    """Write a vector (3,) of the master's base in the slave's axes: (-z, -x, y)."""
    x, y, z = master[0], master[1], master[2]
    slave[0], slave[1], slave[2] = -z, -x, y


@kernel
def mapped_orientation(p: Any, stylus: Array, tool: Array) -> None:
    """Write the slave tool's quaternion that matches a stylus quaternion, before alignment."""
    multiply_quaternions(p.slave_master, stylus, tool)
    multiply_quaternions(tool, p.stylus_tool, tool)


@inner
def _toggle_mode(s: Any, buttons: Array) -> None:
    """Change the mode at the rising edge of its button."""
    if buttons[2] > s.buttons[2]:
        s.is_fine = 1 - s.is_fine


@inner
def _toggle_fixture(s: Any, buttons: Array, position: Array) -> None:
    """Put the box around the present position, or take it away, at the rising edge."""
    if buttons[1] > s.buttons[1]:
        s.is_fixture_on = 1 - s.is_fixture_on
        for i in range(3):
            s.center[i] = position[i]


@inner
def _latch(s: Any, position: Array, tool: Array) -> None:
    """Hold the command and measure further motion from here: no step, whatever happened before.

    The box goes with the hand, so that it stays where it is around the slave.
    """
    if s.is_engaged:
        for i in range(3):
            s.center[i] += position[i] - s.master[i]
    inverse = np.empty(4)
    inverse[0] = tool[0]
    for i in range(1, 4):
        inverse[i] = -tool[i]
    multiply_quaternions(s.command[3:7], inverse, s.alignment)


@inner
def _move(s: Any, gain: float, position: Array, tool: Array) -> None:
    """Add the scaled step of the hand to the command; turn the tool as the stylus."""
    step = np.empty(3)
    for i in range(3):
        step[i] = position[i] - s.master[i]
    to_slave_axes(step, step)
    for i in range(3):
        s.command[i] += gain * step[i]
    multiply_quaternions(s.alignment, tool, s.command[3:7])
    # One Newton step keeps the product of many unit quaternions a unit quaternion.
    square = 0.0
    for i in range(3, 7):
        square += s.command[i] * s.command[i]
    for i in range(3, 7):
        s.command[i] *= 1.5 - 0.5 * square


@inner
def _report(p: Any, s: Any, gain: float, is_following: bool, row: Any) -> None:
    """Write teleop_state; the box in the slave's base, where it is what the slave is held in."""
    state = row.teleop_state
    state[_FOLLOWING] = 1.0 if is_following else 0.0
    state[_CLUTCHED], state[_FINE] = s.buttons[0], s.is_fine
    state[_GAIN], state[_FIXTURE] = gain, s.is_fixture_on
    for i in range(6):
        state[_CENTER + i] = 0.0
    if s.is_fixture_on:
        offset = np.empty(3)
        for i in range(3):
            offset[i] = s.center[i] - s.master[i]
        to_slave_axes(offset, offset)
        for i in range(3):
            # Rounded to a nanometre: a box that stands still reports no change.
            state[_CENTER + i] = round((s.command[i] + gain * offset[i]) * 1e9) / 1e9
        state[_SIZE], state[_SIZE + 1] = gain * p.size[2], gain * p.size[0]
        state[_SIZE + 2] = gain * p.size[1]


@kernel
def motion_scaling_step(p: Any, s: Any, row: Any) -> None:
    """One master sample: write slave_servo_cp, master_servo_cf and teleop_state.

    Position is incremental (X_S += gain X_P), so a change of gain alone moves nothing;
    orientation follows the stylus absolutely, up to an alignment that is latched whenever the
    slave is engaged anew. While clutched the command is held; while the slave does not follow it
    is the slave's own setpoint.

    Source:
        Vongbunyong 2008, sections 6.2-6.3.
    """
    pose, buttons = row.master_measured_cp, row.master_buttons
    _toggle_mode(s, buttons)
    gain = p.gain[s.is_fine]
    is_following = row.stamp_ns - row.setpoint_stamp_ns <= p.timeout_ns
    tool = np.empty(4)
    mapped_orientation(p, pose[3:7], tool)
    if not (is_following and s.is_engaged):
        s.must_latch = 1
        for i in range(7):
            s.command[i] = row.slave_setpoint_cp[i]
    if s.must_latch or buttons[0] > 0.0 or s.buttons[0] > 0.0:
        _latch(s, pose, tool)
    else:
        _move(s, gain, pose, tool)
    _toggle_fixture(s, buttons, pose)
    s.is_engaged, s.must_latch = 1, 0
    for i in range(3):
        s.master[i], s.buttons[i] = pose[i], buttons[i]
    depth = np.zeros(3)
    length = box_penetration(pose, s.center, p.size, depth) if s.is_fixture_on else 0.0
    wall_force(depth, length, p.stiffness, p.max_force, row.master_servo_cf)
    for i in range(7):
        row.slave_servo_cp[i] = s.command[i]
    _report(p, s, gain, is_following, row)


class MotionScaling:
    """Stage that turns master poses into slave poses and fixture forces.

    ``signals`` is the record it reads (``stamp_ns``, ``master_measured_cp``, ``master_buttons``,
    ``slave_setpoint_cp``, ``setpoint_stamp_ns``) and writes (``slave_servo_cp``,
    ``master_servo_cf``, ``teleop_state``).
    """

    def __init__(self, parameters: MotionScalingParameters, signals: Any = None) -> None:
        self.signals = make_signals(1)[0] if signals is None else signals
        self.parameters = np.zeros(1, _PARAMETERS)[0]
        self.state = np.zeros(1, _STATE)[0]
        self._values = parameters
        self.reset()
        self.retune(parameters)
        self._step = bound(motion_scaling_step, self.parameters, self.state, self.signals)

    def reset(self) -> None:
        """Forget the latched poses: the next sample starts from the slave's setpoint."""
        self.state["is_engaged"] = 0
        self.state["is_fixture_on"] = 0
        self.state["is_fine"] = MODES.index(self._values.mode)
        self.state["buttons"] = 0.0
        self.state["command"] = self.state["alignment"] = 0.0
        self.state["command"][3] = self.state["alignment"][0] = 1.0

    def retune(self, parameters: MotionScalingParameters) -> None:
        """Take new parameters from the next sample on; nothing moves. A new mode is switched to."""
        p, fixture = self.parameters, parameters.fixture
        p["gain"] = parameters.coarse_gain, parameters.fine_gain
        tool = R_STYLUS_TOOL @ rotation("z", parameters.tool_roll)
        quaternion = np.empty(4)
        for name, matrix in (("stylus_tool", tool), ("slave_master", R_SLAVE_MASTER)):
            quaternion_from_rotation(np.ascontiguousarray(matrix), quaternion)
            p[name] = quaternion
        p["size"] = fixture.size
        p["stiffness"] = math.inf if fixture.wall == "hard" else fixture.stiffness
        p["max_force"] = fixture.max_force
        p["timeout_ns"] = round(parameters.feedback_timeout * 1e9)
        if parameters.mode != self._values.mode:
            self.state["is_fine"] = MODES.index(parameters.mode)
        if parameters.tool_roll != self._values.tool_roll:
            self.state["must_latch"] = 1  # align anew: the tool does not turn
        self._values = parameters

    def step(self) -> None:
        """Process one master sample."""
        self._step()
