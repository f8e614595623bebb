"""Objects: the object that a recording's slave could touch, and the base class of metrics of one kind of object."""

from abc import abstractmethod
from contextlib import suppress
from typing import Any, ClassVar

from teleop_core.base import TeleopError, build
from teleop_core.evaluation.context import Context
from teleop_core.evaluation.metric import Metric
from teleop_core.evaluation.windows import Window
from teleop_core.graph.topics import SLAVE_TRUE_CF, SLAVE_TRUE_CP
from teleop_core.kernels.geometry import Array
from teleop_core.slave.world.contents import WorldParameters


def object_of(context: Context, kind: type) -> tuple[WorldParameters, Array] | None:
    """The world of a recording, and the middle (3,) [m] of the object in it.

    Args:
        context: Context of the recording.
        kind: Parameter group of the object.

    Returns:
        World and middle; None if the object is of another kind, or if the robot or a part of the object is no longer
        available.
    """
    with suppress(TeleopError):
        world = build(WorldParameters, dict(context.origin.world))
        if isinstance(world.kind.parameters, kind) and (robot := context.load_robot()) is not None:
            return world, world.center(robot.fk(robot.start))
    return None


class ObjectMetric(Metric):
    """Metric of the true tip at one kind of object. The values are None if the object is of another kind.

    Attributes:
        kind: Parameter group of the object.
    """

    kind: ClassVar[type]
    topics = (SLAVE_TRUE_CF,)

    def __init__(self, context: Context) -> None:
        super().__init__(context)
        self._object = object_of(context, self.kind)
        if self._object is not None:
            context.read((SLAVE_TRUE_CP,))

    @abstractmethod
    def meet(self, shape: Any, ways: Array, wrench: Array) -> None:
        """Process samples of the tip's position and of the wrench on the tip.

        Args:
            shape: Parameters of the object, of type ``kind``.
            ways: Vectors from the object's middle to the tip (N, 3) [m].
            wrench: Wrenches on the tip (M, 6) [N, N·m].
        """

    def add(self, window: Window) -> None:
        """Process one window."""
        if self._object is not None:
            world, center = self._object
            places = window.samples(SLAVE_TRUE_CP).values[:, :3]
            self.meet(world.kind.parameters, places - center, window.samples(SLAVE_TRUE_CF).values[:, :6])
