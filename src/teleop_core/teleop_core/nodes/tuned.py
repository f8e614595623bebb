"""Tuned node: a lifecycle node with the parameters of its stage, which can be set before and during work."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from teleop_core.bags.messages import BUTTONS
from teleop_core.base.errors import ParameterError, SessionError, TeleopError
from teleop_core.base.parameters import Value, Within, build, fixed, specs, values_of
from teleop_core.graph.layers import RealTimeParameters
from teleop_core.graph.stage import Runner, Stage
from teleop_core.middleware.platform import Hooks, LifecycleNode, Platform
from teleop_core.middleware.ros import ROS
from teleop_core.middleware.ros_type_support import spare_generator
from teleop_core.nodes.quality import PREFIX, QualityOverrides
from teleop_core.nodes.sender import Sender

_LOCK_PATIENCE = 1.0
spare_generator()  # must be called before the first node is made


@dataclass(frozen=True, kw_only=True)
class NodeParameters:
    """Parameters that every node has in addition to the parameters of its stage."""

    autostart: bool = fixed(True, doc="true: the node configures and activates itself; false: a supervisor does it")
    max_catch_up: int = fixed(
        1000,
        Within(0, 10_000, "ticks"),
        "largest number of missed ticks that the loop makes up after a late wake-up; it skips the others",
    )
    links: tuple[str, ...] = fixed(
        (),
        doc="other topics that feed a port, as port=topic or port=topic@delay, with the delay in "
        "seconds; the values of several topics of one port are added",
    )
    joy_buttons: tuple[int, ...] = fixed(
        BUTTONS,
        Within(-1, 255),
        "indices of the clutch, fixture and mode buttons in an incoming Joy, from 0; -1: no such button",
        length=3,
    )
    second_publisher: str = fixed(
        "refuse",
        choices=("refuse", "fault"),
        doc="reaction to a second publisher on a topic that the node reads: refuse: its messages are "
        "refused and counted; fault: it is also a fault",
    )
    owner_silence: float = fixed(
        0.5,
        Within(0.0, 60.0, "s"),
        "time without messages from a topic's publisher after which another publisher is accepted",
        source="assumed",
    )
    flood_rate: int = fixed(
        5000,
        Within(1, 1_000_000, "1/s"),
        "largest number of messages per second on one topic; messages beyond it are refused",
        source="assumed",
    )
    real_time: RealTimeParameters = field(default_factory=RealTimeParameters)

    def sender(self, into: Any = None) -> Sender:
        """New object that checks the sender of an input topic; ``into`` is its record."""
        return Sender(self.flood_rate, self.owner_silence, into)

    def feeds(self, port: str) -> list[tuple[str, float]]:
        """Topics that feed a port, each with its delay [s].

        Raises:
            ParameterError: A link has an invalid form.
        """
        found = []
        for text in self.links:
            own, equals, feed = text.partition("=")
            topic, at, delay = feed.partition("@")
            try:
                seconds = float(delay) if at else 0.0
            except ValueError:
                seconds = -1.0
            if not (equals and topic) or seconds < 0.0:
                raise ParameterError("links", text, "port=topic or port=topic@seconds")
            if own == port:
                found.append((topic, seconds))
        return found or [(port, 0.0)]


class TunedNode(Hooks):
    """Lifecycle node that declares and accepts parameters: its own, and those of a stage.

    Args:
        stage: Stage of the node in the graph.
        group: Parameter group that replaces the group of the stage; None for the group of the stage.
        platform: Platform of the node.
        options: Options of :meth:`~teleop_core.middleware.platform.Platform.lifecycle_node`.

    Attributes:
        ros: Node of the middleware.

    Raises:
        TeleopError: A given parameter is unknown or not allowed.
    """

    def __init__(self, stage: Stage, group: type | None = None, platform: Platform = ROS, **options: Any) -> None:
        self.platform = platform
        self.ros: LifecycleNode = platform.lifecycle_node(stage.name, self, **options)
        self.runner: Runner | None = None
        """The running stage; None before it is made, and for a node without a stage."""
        self.lock = platform.lock()  # locked while the stage works or accepts parameters
        self._groups = (NodeParameters, group or stage.parameters)
        self._specs = {spec.name: spec for entry in self._groups for spec in specs(entry)}
        self.overrides = QualityOverrides(self.ros.given)
        self.options, self.parameters = self._built(self._overrides())
        values = values_of(self.options) | values_of(self.parameters)
        self.ros.declare(self._specs.values(), values, self._accept)
        self._present = self.ros.create_guard_condition(self._show_present)

    @property
    def arm(self) -> str:
        """Namespace of the node, without the slash before it."""
        return self.ros.get_namespace().strip("/")

    @property
    def member_name(self) -> str:
        """Name of the node with its namespace, without the slash before it."""
        return f"{self.arm}/{self.ros.get_name()}".strip("/")

    def show_present(self) -> None:
        """Let the executor publish parameters that the stage changed by itself; publishing is too slow for the loop."""
        if self._changes_itself():
            self._present.trigger()

    def _overrides(self) -> dict[str, Any]:
        """Values of the node's parameters from the command line and from parameter files."""
        return {
            name: () if value is None and name in self._specs else value
            for name, value in self.ros.given.items()
            if not name.startswith(PREFIX)
        }

    def _built(self, values: dict[str, Any]) -> tuple[NodeParameters, Any]:
        options, group = self._groups
        own = {spec.name for spec in specs(options)}
        prefix = f"{self.member_name}."
        return (
            build(options, {k: v for k, v in values.items() if k in own}, prefix),
            build(group, {k: v for k, v in values.items() if k not in own}, prefix),
        )

    def _accept(self, changes: Mapping[str, Value]) -> str:
        """Accept all changes or none: a new group is built, and the stage must accept it."""
        self._take_present()
        values = values_of(self.options) | values_of(self.parameters) | dict(changes)
        try:
            _, parameters = self._built(values)
            self._retune(parameters)
        except TeleopError as error:
            return str(error)
        self.parameters = parameters
        return ""

    def _take_present(self) -> None:
        """Copy parameters that the stage has changed by itself, for example by the mode button."""
        if self._changes_itself() and self.lock.acquire(True, _LOCK_PATIENCE):
            assert self.runner is not None
            self.parameters = self.runner.present()
            self.lock.release()

    def _changes_itself(self) -> bool:
        return self.runner is not None and self.runner.changes_itself

    def _show_present(self) -> None:
        """Show parameters that the stage has changed by itself, without setting them again."""
        if not self._changes_itself():
            return
        before = values_of(self.parameters)
        self._take_present()
        changed = {k: v for k, v in values_of(self.parameters).items() if v != before[k]}
        if changed:
            self.ros.show(changed)

    def _retune(self, parameters: Any) -> None:
        if self.runner is None:
            return
        self.runner.examine(parameters)  # takes long; runs outside of the loop, which continues meanwhile
        if not self.lock.acquire(True, _LOCK_PATIENCE):
            raise SessionError(f"{self.member_name} is in a step that takes too long; try again")
        try:
            self.runner.retune(parameters)
        except TeleopError:
            self.runner.retune(self.parameters)
            raise
        finally:
            self.lock.release()
