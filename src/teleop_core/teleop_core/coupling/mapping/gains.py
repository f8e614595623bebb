"""Gains of motion scaling, its axes, its fixture, and the force of the limits of the slave."""

import math
from dataclasses import dataclass, field
from functools import cached_property
from typing import NamedTuple

import numpy as np

from teleop_core.base import Choice, ParameterError, Within, choice, parameter
from teleop_core.coupling.architectures import ARCHITECTURES
from teleop_core.coupling.fixtures import Fixture
from teleop_core.coupling.mapping import plausibility, walls
from teleop_core.coupling.mapping.side import SIDES
from teleop_core.coupling.passivity import PASSIVITIES
from teleop_core.kernels.axes import AXES, axis_map
from teleop_core.kernels.geometry import Array, quaternion_from_rotation, rotation
from teleop_core.kernels.portable import product
from teleop_core.shapes import SHAPES, files_of

MODES = ("coarse", "fine")


@dataclass(frozen=True, kw_only=True)
class FixtureParameters(walls.WallParameters):
    """The fixture that a press of the fixture button puts around the hand."""

    kind: Choice = choice(SHAPES, "box", doc="shape of the fixture")
    place: tuple[float, ...] = parameter(
        (0.0, 0.0, 0.0),
        Within(-0.5, 0.5, "m"),
        "vector from the hand's position at the start to the middle of the shape, in the master's base",
        length=3,
    )
    keep_out: bool = parameter(False, doc="true: the hand stays outside of the shape; false: inside")
    side: str = parameter(
        "hand",
        choices=SIDES,
        doc="hand: the fixture pushes the hand, and the slave follows the hand; slave: the fixture "
        "bounds the slave's command, and the hand feels nothing; both: it does both",
    )

    @property
    def pushes(self) -> bool:
        """Whether the hand can feel the fixture."""
        return self.side != "slave" and self.max_force > 0.0

    @cached_property
    def made(self) -> Fixture:
        """The fixture; a shape from a file is checked at its first use."""
        shape = SHAPES.find(self.kind.kind)
        return Fixture(shape, self.kind.parameters, self.place, self.keep_out)

    def __post_init__(self) -> None:
        if not files_of(self.kind.parameters):
            self.made.check()


@dataclass(frozen=True, kw_only=True)
class ReachForceParameters:
    """The push on the hand when the slave cannot follow because of a limit."""

    is_on: bool = parameter(True, doc="whether the hand feels the slave's limits as a wall")
    stiffness: float = parameter(
        500.0,
        Within(1.0, 5000.0, "N/m"),
        "stiffness of the wall that shows the slave's limits",
        source="assumed: half of the fixture's stiffness, so that a person can tell both walls apart",
    )
    max_force: float = parameter(
        1.5,
        Within(0.0, 10.0, "N"),
        "largest force of the wall that shows the slave's limits",
        source="assumed: less than half of the fixture's force, so that a person can tell both walls apart",
    )


@dataclass(frozen=True, kw_only=True)
class ReflectionParameters:
    """Force on the hand from the slave and its contacts."""

    architecture: Choice = choice(ARCHITECTURES, "unilateral", doc="law by which the hand feels the slave")
    max_force: float = parameter(
        3.3,
        Within(0.0, 10.0, "N"),
        "largest force on the hand; the device may limit it further",
        source="published: Vongbunyong 2008, section 6.3, the peak force of the device",
    )
    passivity: Choice = choice(
        PASSIVITIES,
        "none",
        doc="tank: in each contact the force gives the hand no more energy than it took from the "
        "hand, at any delay; tdpa: no more than the slave got from its contact, and with a stage "
        "passivity the slave spends no more than the hand supplied; wave: both sides exchange "
        "waves of force and speed, if there is a stage passivity; none: energy is not limited, "
        "and a delayed force may throw the hand",
    )


@dataclass(frozen=True, kw_only=True)
class MotionScalingParameters:
    """Parameters of :class:`MotionScaling`."""

    coarse_gain: float = parameter(
        1.0, Within(1e-3, 10.0, "m/m"), "slave motion divided by master motion, in coarse mode"
    )
    fine_gain: float = parameter(0.1, Within(1e-3, 10.0, "m/m"), "slave motion divided by master motion, in fine mode")
    mode: str = parameter("coarse", choices=MODES, doc="mode, coarse or fine; the mode button changes it too")
    axes: tuple[str, ...] = parameter(
        ("-z", "-x", "+y"),
        choices=AXES,
        length=3,
        doc="axes of the master's base along x, y, z of the slave's base; the default is published",
    )
    tool_axes: tuple[str, ...] = parameter(
        (),
        choices=AXES,
        doc="empty: the tool turns about the axis about which the hand turns, mapped by axes. Three axes align the "
        "stylus with the tool: they lie along x, y, z of the tool before tool_roll is applied, and the tool turns "
        "about its own axes. rcrt1 has the published +x, -y, -z",
    )
    tool_roll: float = parameter(
        math.pi / 2,
        Within(-math.pi, math.pi, "rad"),
        "turn of an aligned tool about its axis; π/2 aligns the tool of rcrt1 with its home pose; no effect if "
        "tool_axes is empty",
    )
    rotation_gain: float = parameter(
        1.0,
        Within(0.0, 1.0, "rad/rad"),
        "turn of the tool divided by the turn of the stylus; below 1 the attitude of the tool "
        "relative to the stylus changes with time",
    )
    longest_pause: float = parameter(
        0.3,
        Within(0.002, 5.0, "s"),
        "after a longer pause of the master, motion scaling takes a new reference, so that the slave does not jump",
    )
    feedback_timeout: float = parameter(
        0.1,
        Within(0.002, 5.0, "s"),
        "slave counts as not following when its setpoint lags behind the last command by more, "
        "and no newer one was heard of for as long; of slow masters twice their period counts",
    )
    fixture: FixtureParameters = field(default_factory=FixtureParameters)
    reach_force: ReachForceParameters = field(default_factory=ReachForceParameters)
    reflection: ReflectionParameters = field(default_factory=ReflectionParameters)
    plausible: plausibility.PlausibilityParameters = field(default_factory=plausibility.PlausibilityParameters)

    def __post_init__(self) -> None:
        if self.fine_gain > self.coarse_gain:
            raise ParameterError("fine_gain", self.fine_gain, f"<= coarse_gain {self.coarse_gain}")
        axis_map("axes", self.axes)
        if len(self.tool_axes) not in (0, 3):
            raise ParameterError("tool_axes", self.tool_axes, "three axes, or empty")
        if self.is_aligned:
            axis_map("tool_axes", self.tool_axes)

    @property
    def is_aligned(self) -> bool:
        """Whether the stylus is aligned with the tool; otherwise the tool turns about the axes of the hand's turn."""
        return bool(self.tool_axes)


class ToolMap(NamedTuple):
    """How orientations of the stylus become those of the tool.

    Attributes:
        slave_master: Quaternion (4,) from the master's base to the slave's axes.
        stylus_tool: Quaternion (4,) from the stylus to an aligned tool.
        is_aligned: Whether the stylus is aligned with the tool.
    """

    slave_master: Array
    stylus_tool: Array
    is_aligned: bool


def tool_map(parameters: MotionScalingParameters) -> ToolMap:
    """Map of orientations that parameters describe.

    Source:
        Vongbunyong 2008, section 6.2, for the aligned tool.
    """
    slave_master, stylus_tool = np.empty(4), np.array([1.0, 0.0, 0.0, 0.0])
    quaternion_from_rotation(np.ascontiguousarray(axis_map("axes", parameters.axes)), slave_master)
    if parameters.is_aligned:
        tool = product(axis_map("tool_axes", parameters.tool_axes).T, rotation("z", parameters.tool_roll))
        quaternion_from_rotation(np.ascontiguousarray(tool), stylus_tool)
    return ToolMap(slave_master, stylus_tool, parameters.is_aligned)
