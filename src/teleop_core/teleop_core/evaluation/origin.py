"""Origin: the session in which a recording was made, as the recording stores it: graph, map of axes and parts."""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from itertools import pairwise
from typing import Any

from teleop_core.bags import arms, reader
from teleop_core.base import TeleopError, build, plain_yaml, shown, specs
from teleop_core.coupling.mapping.gains import MotionScalingParameters, ToolMap, tool_map
from teleop_core.coupling.mapping.motion_scaling import MOTION_SCALING
from teleop_core.graph import HAND, SESSION, STAGES, Graph, Layer, SessionParameters, build_graph, topics
from teleop_core.graph.former_shapes import present_layer
from teleop_core.graph.graph import DEVICE
from teleop_core.graph.layers import parse_layer
from teleop_core.hand.master.operator import OPERATOR
from teleop_core.kernels.axes import axis_map
from teleop_core.kernels.geometry import Array
from teleop_core.slave import slave, slave_sim

_BEGINS = (HAND, DEVICE)
_GRAPH = ("arms", "stages", "delays")
_WORLD = "world."
_TOOL = ("axes", "tool_axes", "tool_roll", "rotation_gain")


@dataclass(frozen=True, eq=False)
class Origin:
    """Session in which a recording was made, from the view of one arm, whose topics have plain names.

    Attributes:
        graph: Graph of the session; the graph of the built-in stages if the graph is unknown or a stage is not
            installed.
        axes: Rotation (3, 3) from the master's base to the slave's axes.
        operator: Stored parameters of the stage ``operator``, by names.
        interpolation: Interpolation of the slave between commands; None if not stored.
        plant: Plant of the simulated slave; "ideal" for versions that had no other plant, None if no simulator is
            stored.
        controller: Control law of the slave; None if not stored.
        geometry: Settings with which the robot was made.
        lag: Number of setpoints between a measured pose and the setpoint with which it was sampled: 1 if an arm's
            server sent the pose, otherwise 0.
        world: Stored parameters of the object that the slave touches, by names without ``world.``.
        missing: Parts that the recording names but that are unknown here, each as a text.
        begin: Last stage whose topics were taken from a file; empty if there is no such stage.
        tool: Map of the tool's orientation; None if the tool does not rotate as much as the stylus.
    """

    graph: Graph
    axes: Array
    operator: Mapping[str, object] = field(default_factory=dict)
    interpolation: str | None = None
    tool: ToolMap | None = None
    plant: str | None = None
    controller: str | None = None
    geometry: tuple[str, ...] = ()
    lag: int = 0
    world: Mapping[str, object] = field(default_factory=dict)
    missing: tuple[str, ...] = ()
    begin: str = ""

    @cached_property
    def chain(self) -> tuple[tuple[str, topics.Topic], ...]:
        """Chain from a master's sample to the slave: stages, each with its output topic."""
        return self.graph.chain()

    @property
    def streams(self) -> tuple[topics.Topic, ...]:
        """Topics of this arm that have one message per step."""
        return tuple(topic for topic in self.graph.streams if not topic.arm)

    @property
    def chain_delay(self) -> float:
        """Sum of the configured delays [s] along the chain."""
        steps = {(topic, stage) for (_, topic), (stage, _) in pairwise(self.chain)}
        links = (link for link in self.graph.links if not link.reader.arm)
        return sum(link.delay for link in links if (link.topic, link.reader.stage.name) in steps)

    @property
    def sources(self) -> dict[str, topics.Topic]:
        """For the name of each topic that copies its stamps: the topic from which it copies them."""
        return {
            written.name: link.topic
            for link in self.graph.links
            for written in link.reader.stage.writes
            if not link.reader.arm and written.stamp.of == link.port.name
        }

    @property
    def played(self) -> frozenset[str]:
        """Names of the topics that a replay took from a file."""
        stages = (member.stage for member in self.graph.played(self.begin) if not member.arm)
        return frozenset(topic.name for stage in stages for topic in stage.writes)

    def writer(self, topic: topics.Topic) -> str:
        """Name of the stage that writes a topic; empty if no stage writes it."""
        names = (stage.name for stage in self.graph.stages if topic in stage.writes)
        return next(names, "")


def read_origin(bag: reader.Bag, arm: str = "") -> Origin:
    """Origin of a recording.

    Stages that are missing, or cannot be built any more, are replaced by the built-in stages with published values.
    Scores of recorded streams do not depend on this.

    Args:
        bag: The recording, or the view of one arm.
        arm: Name of the arm.
    """
    content = _content(bag)
    layer, has_server = _layer(bag, content), any(_stage(name) == slave.SLAVE.name for name in content)
    return Origin(
        _graph(layer), _axes(layer, arm), _said(layer, OPERATOR.name, arm), _interpolation(layer, arm),
        _tool(layer, arm), *_slave(layer, arm), _geometry(layer, arm),
        int(has_server), _world(layer, arm), tuple(dict.fromkeys(_missing(layer, arm))),
        begin if (begin := bag.metadata.get(arms.PLAYED_KEY, "")) in _BEGINS else "",
    )  # fmt: skip


def _content(bag: reader.Bag) -> Mapping[Any, Any]:
    """Stored parameters of all stages, installed or not."""
    try:
        content = plain_yaml.parse(bag.metadata.get("configuration", ""))
    except plain_yaml.UnreadableError:
        return {}
    return content if isinstance(content, Mapping) else {}


def _stage(name: object) -> str:
    return str(name).rpartition("/")[2]


def _layer(bag: reader.Bag, content: Mapping[Any, Any]) -> Layer:
    """Stored parameters of the stages that are installed."""
    known = {SESSION, *STAGES}
    kept = {name: said for name, said in content.items() if _stage(name) in known}
    try:
        return present_layer(parse_layer(kept, f"{bag.path}: configuration"))
    except TeleopError:
        return {}


def _missing(layer: Layer, arm: str) -> Iterator[str]:
    """Names of parts that are not installed: stages of the session, and parts that these stages chose by name."""
    stages = layer.get(SESSION, {}).get("stages", ())
    for name in stages if isinstance(stages, list | tuple) else ():
        if name not in STAGES.names():
            yield f"stage {shown(name)}"
    for name in dict.fromkeys(map(_stage, layer)):
        if name not in STAGES.names():
            continue
        said = _said(layer, name, arm)
        for spec in specs(STAGES.find(name).parameters):
            chosen = said.get(spec.name, spec.default)
            if spec.is_part and chosen not in spec.choices:
                yield f"{spec.name.removesuffix('.kind')} {shown(chosen)}"


def _graph(layer: Layer) -> Graph:
    given = layer.get(SESSION, {})
    try:
        values = {name: given[name] for name in _GRAPH if name in given}
        session = build(SessionParameters, values, f"{SESSION}.")
        return build_graph(session.arms, session.stages, session.delays)
    except TeleopError:
        return build_graph()


def _said(layer: Layer, stage: str, arm: str) -> dict[str, object]:
    """Values stored for a stage; values for one arm override values for all arms."""
    return layer.get(stage, {}) | layer.get(f"{arm}/{stage}", {})


def _interpolation(layer: Layer, arm: str) -> str | None:
    """Interpolation of the slave between commands, if it is stored."""
    said = _said(layer, slave.SLAVE.name, arm).get("interpolation")
    return said if isinstance(said, str) else None


def _slave(layer: Layer, arm: str) -> tuple[str | None, str | None]:
    """Plant and control law of the slave."""
    said = _said(layer, slave_sim.SLAVE_SIM.name, arm)
    if not said:
        return None, None
    law = said.get("controller.kind", "pid")
    return str(said.get("plant.kind", "ideal")), str(law)


def _geometry(layer: Layer, arm: str) -> tuple[str, ...]:
    said = _said(layer, slave_sim.SLAVE_SIM.name, arm).get("geometry")
    return tuple(map(str, said)) if isinstance(said, list | tuple) else ()


def _world(layer: Layer, arm: str) -> dict[str, object]:
    """Parameters of the object that the slave touches, by names without prefix."""
    said = _said(layer, slave_sim.SLAVE_SIM.name, arm).items()
    return {name[len(_WORLD) :]: value for name, value in said if name.startswith(_WORLD)}


def _mapping(layer: Layer, arm: str, names: Iterable[str]) -> MotionScalingParameters:
    """Some stored parameters of the mapping; the published parameters if the stored values are invalid."""
    name = MOTION_SCALING.name
    said = _said(layer, name, arm)
    try:
        values = {key: said[key] for key in names if key in said}
        return build(MotionScalingParameters, values, f"{name}.")
    except TeleopError:
        return MotionScalingParameters()


def _tool(layer: Layer, arm: str) -> ToolMap | None:
    """Map of the tool's orientation; None unless the tool rotates as far as the master."""
    parameters = _mapping(layer, arm, _TOOL)
    return tool_map(parameters) if parameters.rotation_gain == 1.0 else None


def _axes(layer: Layer, arm: str) -> Array:
    return axis_map("axes", _mapping(layer, arm, ("axes",)).axes)
