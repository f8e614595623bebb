"""Configuration: layers of files and settings become one checked parameter group per stage of the graph."""

import warnings
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, TypeVar

from teleop_core.base import ParameterError, PartError, TeleopWarning, UnknownNameError, build, specs, values_of
from teleop_core.base.plain_yaml import written
from teleop_core.coupling.architectures import ARCHITECTURES, impedance
from teleop_core.coupling.passivity import PASSIVITIES
from teleop_core.coupling.passivity.slave_side import PASSIVITY
from teleop_core.graph import HAND, RECORDER_NAME, STAGES, Graph, Member, build_graph
from teleop_core.graph.graph import DEVICE
from teleop_core.graph.layers import (
    EVERY,
    SESSION,
    Layer,
    SessionParameters,
    config_folder,
    declared_groups,
    load_file,
    merge,
    parse_setting,
    scenario_file,
)
from teleop_core.hand.operators import OPERATORS
from teleop_core.robots.parts import is_scene
from teleop_core.robots.selection import PUBLISHED, RobotParameters

_Group = TypeVar("_Group")


@dataclass(frozen=True)
class Configuration:
    """Checked parameters of a session.

    Attributes:
        groups: Parameter groups: ``teleop``, ``recorder`` and one for each member of the graph.
        scenario: Name of the session, stored in the recording.
        graph: Graph that runs.
    """

    groups: dict[str, Any]
    scenario: str
    graph: Graph

    @staticmethod
    def from_layers(layers: Iterable[Layer], scenario: str = "") -> "Configuration":
        """Merge layers: later layers override earlier layers, and all of them override the defaults.

        Parameters of a stage apply to all arms, unless the arm's own group sets them.

        Raises:
            UnknownNameError: A name is not declared.
            ParameterError: A value violates its declaration.
            PartError: The graph cannot run.
        """
        merged = merge({name: _implied(name, given) | given for name, given in layer.items()} for layer in layers)
        every = merged.pop(EVERY, {})
        session = _with_scene(build(SessionParameters, merged.get(SESSION, {}), f"{SESSION}."), merged)
        _check_order(session.stages)
        graph = build_graph(session.arms, session.stages, session.delays)
        _check_names(merged, graph, every)
        groups: dict[str, Any] = {SESSION: session}
        for member in [Member(stage, arm) for arm in graph.namespaces for stage in graph.stages]:
            values = _published(member, merged, graph) | _values_for(member, merged, graph)
            groups[member.name] = build(member.stage.parameters, values, f"{member.name}.")
        recorder = STAGES.find(RECORDER_NAME)
        groups[RECORDER_NAME] = build(recorder.parameters, merged.get(RECORDER_NAME, {}), f"{RECORDER_NAME}.")
        for arm in graph.namespaces:
            _check_robots(graph, groups, arm)
            _check_sides(graph, groups, arm)
            _check_operator(graph, groups, arm)
        return Configuration(groups, scenario, graph)

    @property
    def session(self) -> SessionParameters:
        """Parameters of the session as a whole."""
        return self.of(SessionParameters)

    def of(self, kind: type[_Group], arm: str = "") -> _Group:
        """Parameters of the stage whose parameters are a ``kind``.

        Args:
            kind: Parameter group, such as ``MotionScalingParameters``.
            arm: Namespace of the arm.

        Raises:
            UnknownNameError: No stage of the arm has such parameters.
        """
        own = {name: group for name, group in self.groups.items() if name.rpartition("/")[0] == arm}
        found = next((group for group in own.values() if type(group) is kind), None)
        if found is None:
            raise UnknownNameError("parameter group", kind.__name__, [type(group).__name__ for group in own.values()])
        return found

    def group(self, stage: str, arm: str = "") -> Any:
        """Parameters of a stage, by its name, of the arm with the namespace ``arm``."""
        return self.groups[f"{arm}/{stage}" if arm else stage]

    def value(self, name: str, arm: str = "") -> Any:
        """Value of a parameter from the first stage of an arm that has this parameter; None if no stage has it.

        Args:
            name: A parameter, such as ``robot`` or ``seed``.
            arm: Namespace of the arm.
        """
        groups = (self.group(stage.name, arm) for stage in self.graph.stages)
        return next((getattr(group, name) for group in groups if hasattr(group, name)), None)

    def text(self) -> str:
        """All values as the text of a ROS 2 parameter file, which :func:`parse_layer` reads back."""
        return written(self.content())

    def content(self) -> dict[str, Any]:
        """All values as mappings, lists and plain values, by nodes."""
        return {
            name: {
                "ros__parameters": {k: (list(v) if isinstance(v, tuple) else v) for k, v in values_of(group).items()}
            }
            for name, group in self.groups.items()
        }


_PLANT, _SCENE = "slave_sim", "scene"
_SHARED = ("seed", "device.workspace", "device.start")
"""Parameters that operator and haptic master share: a value set for only one of them applies to both."""

_SAID_TO_ALL = ("seed", "robot", "geometry")
"""Parameters that a file may set for every stage that has them, even for stages that the session leaves out."""


def _implied(name: str, values: Mapping[str, object]) -> dict[str, object]:
    """Values that the robot of a layer implies for a group: a scene moves its arms itself."""
    is_plant, robot = name.rpartition("/")[2] == _PLANT, values.get("robot")
    return {"plant.kind": _SCENE} if is_plant and isinstance(robot, str) and is_scene(robot) else {}


def _with_scene(session: SessionParameters, merged: Layer) -> SessionParameters:
    """Session with the stage of a scene if a scene moves an arm, and without it otherwise."""
    plants = [values.get("plant.kind") for name, values in merged.items() if name.rpartition("/")[2] == _PLANT]
    stages = tuple(name for name in session.stages if name != _SCENE)
    return replace(session, stages=(*stages, _SCENE) if _SCENE in plants else stages)


def _values_for(member: Member, merged: Layer, graph: Graph) -> dict[str, object]:
    """Values of a member: values for the stage, overridden by values for the stage of this arm."""
    named = dict(zip(graph.namespaces, graph.arms, strict=True))[member.arm]

    def said(stage: str) -> dict[str, object]:
        return merged.get(stage, {}) | (merged.get(f"{named}/{stage}", {}) if named else {})

    own = said(member.stage.name)
    if member.stage.name not in {HAND, DEVICE}:
        return own
    other = said(DEVICE if member.stage.name == HAND else HAND)
    return {name: other[name] for name in _SHARED if name in other} | own


def _published(member: Member, merged: Layer, graph: Graph) -> dict[str, object]:
    """Values that the source of the member's robot publishes for its stage."""
    of_robot = next(stage for stage in graph.stages if issubclass(stage.parameters, RobotParameters))
    robot = _values_for(Member(of_robot, member.arm), merged, graph).get("robot", RobotParameters().robot)
    return dict(PUBLISHED.get(str(robot), {}).get(member.stage.name, {}))


def with_changes(recorded: Layer, changes: Iterable[Layer]) -> list[Layer]:
    """Layers of a recorded configuration with changes.

    If the changes give an arm another robot, values that the source of the recorded robot publishes are left out.
    """
    changes, kept = list(changes), {name: dict(values) for name, values in recorded.items()}
    for name, values in kept.items():
        arm, slash, stage = name.rpartition("/")
        robots = [layer.get(f"{arm}{slash}slave", {}).get("robot") for layer in (recorded, *changes)]
        now = [robot for robot in robots if robot is not None]
        if now and now[-1] != now[0]:
            of_scene = _implied(f"{arm}{slash}{stage}", {"robot": now[0]})
            implied: dict[str, Any] = {**PUBLISHED.get(str(now[0]), {}).get(stage, {}), **of_scene}
            for key, value in implied.items():
                if values.get(key) in (value, list(value)):
                    del values[key]
    return [kept, *changes]


def _check_names(merged: Layer, graph: Graph, every: Mapping[str, object]) -> None:
    """Refuse groups of unknown arms and stages, except stages that replace a stage of the session.

    The file of a whole machine also contains the parameters of its bridge, which is a separate node.

    Args:
        merged: Values by group.
        graph: Graph of the session.
        every: Values that a file sets for every stage that has them; a warning tells those that no stage of the session
            has.

    Raises:
        UnknownNameError: A group names an arm or stage that is not in the graph.
    """
    stages = [stage.name for stage in graph.stages]
    written = {topic for stage in graph.stages for topic in stage.writes}
    for name in merged:
        arm, _, stage = name.rpartition("/")
        if arm and arm not in graph.arms:
            raise UnknownNameError(f"arm of {name}", arm, [a for a in graph.arms if a] or ["none"])
        if stage not in {SESSION, RECORDER_NAME, *stages} and stage in STAGES.names():
            own = {k: v for k, v in merged[name].items() if k not in _SAID_TO_ALL and (k, v) not in every.items()}
            if not own or not written.isdisjoint(STAGES.find(stage).writes):
                continue
            keys = ", ".join(f"{name}.{key}" for key in own)
            needed = f"left out: this session has no stage {stage}; add stages=[{stage}]"
            raise ParameterError(keys, next(iter(own.values())) if len(own) == 1 else tuple(own.values()), needed)
        if stage not in {SESSION, RECORDER_NAME, *stages}:
            raise UnknownNameError("stage of teleop.stages", stage, (*stages, RECORDER_NAME))
    groups = (SessionParameters, STAGES.find(RECORDER_NAME).parameters, *(stage.parameters for stage in graph.stages))
    had = {spec.name for group in groups for spec in specs(group)}
    if unused := [name for name in every if name not in had and name not in _SAID_TO_ALL]:
        text = f"{EVERY}: no stage of this session has {', '.join(unused)}"
        warnings.warn(f"{text}; the values have no effect", TeleopWarning, stacklevel=4)


def _check_robots(graph: Graph, groups: Mapping[str, Any], arm: str) -> None:
    """Make sure that all stages of an arm have the same robot.

    Raises:
        ParameterError: Two stages have different robots.
    """
    members = [Member(stage, arm) for stage in graph.stages]
    named = [m.name for m in members if hasattr(groups[m.name], "robot")]
    for name in ("robot", "geometry"):
        values = [getattr(groups[member], name) for member in named]
        if any(value != values[0] for value in values):
            raise ParameterError(name, tuple(values), "the same in " + " and ".join(named))


def _check_sides(graph: Graph, groups: Mapping[str, Any], arm: str) -> None:
    """Make sure that each method with a master side and a slave side has both sides, and that the sides match.

    Raises:
        ParameterError: The slave side is missing, or belongs to another method than the master side.
    """
    names = [stage.name for stage in graph.stages]
    for stage in graph.stages:
        group = groups[Member(stage, arm).name]
        if not hasattr(group, "reflection"):
            continue
        passivity, law = group.reflection.passivity.kind, group.reflection.architecture.kind
        is_whole = PASSIVITIES.find(passivity).needs_slave
        if is_whole and PASSIVITY.name not in names:
            needed = f"used in a session with the stage {PASSIVITY.name}: teleop.stages=[{PASSIVITY.name}]"
            raise ParameterError("reflection.passivity", passivity, needed)
        if is_whole and impedance.IMPEDANCE.name in names:
            kinds = [PASSIVITIES.find(name) for name in PASSIVITIES]
            others = ", ".join(kind.name for kind in kinds if not kind.needs_slave)
            needed = (
                f"one of {others} with the stage {impedance.IMPEDANCE.name}, because that stage moves the tip itself"
            )
            raise ParameterError("reflection.passivity", passivity, needed)
        if ARCHITECTURES.find(law).needs_impedance and impedance.IMPEDANCE.name not in names:
            parts = [ARCHITECTURES.find(name) for name in ARCHITECTURES]
            others = ", ".join(part.name for part in parts if not part.needs_impedance)
            stages = f"teleop.stages=[{impedance.IMPEDANCE.name}]"
            needed = f"used in a session with the stage {impedance.IMPEDANCE.name}, {stages}, or be one of {others}"
            raise ParameterError("reflection.architecture", law, needed)


def _check_operator(graph: Graph, groups: Mapping[str, Any], arm: str) -> None:
    """Make sure that the session has all stages that its operator needs.

    Raises:
        ParameterError: A stage is missing.
    """
    kind = groups[Member(STAGES.find(HAND), arm).name].kind.kind
    names = [stage.name for stage in graph.stages]
    if missing := [name for name in OPERATORS.find(kind).needs if name not in names]:
        needed = f"used in a session with a stage {missing[0]}: teleop.stages=[{', '.join(missing)}]"
        raise ParameterError("operator.kind", kind, needed)


def _check_order(stages: Iterable[str]) -> None:
    """Make sure that the impedance stage is on the slave's side of the network, and that passivity comes after it.

    Raises:
        PartError: The stages are named in another order.
    """
    sides = ["network", impedance.IMPEDANCE.name, PASSIVITY.name]
    order = [name for name in stages if name in sides]
    wanted = sorted(order, key=sides.index)
    if impedance.IMPEDANCE.name in order and order != wanted:
        text = f"named in the order teleop.stages=[{', '.join(wanted)}], not {', '.join(order)}"
        raise PartError("stage", impedance.IMPEDANCE.name, text)


def configure(scenario: str | None = None, files: Iterable[Path] = (), settings: Iterable[str] = ()) -> Configuration:
    """Configuration as the command line gives it: scenario, then files, then settings.

    Raises:
        TeleopError: The scenario, a file or a setting is wrong; the error text names it.
    """
    layers = [load_file(config_folder() / "teleop.yaml")]
    if scenario is not None:
        layers.append(load_file(scenario_file(scenario)))
    layers += [load_file(Path(file)) for file in files]
    layers += [parse_setting(text) for text in settings]
    return Configuration.from_layers(layers, scenario or "")


def parameter_rows(stages: Iterable[str]) -> list[tuple[str, str, str, str]]:
    """Name, default, allowed values and meaning of every parameter of some stages."""
    rows = []
    groups = declared_groups()
    for stage in stages:
        for spec in specs(groups[stage]):
            allowed = ", ".join(spec.choices) if spec.choices else spec.bounds()
            default = spec.default if spec.kind is not tuple else list(spec.default)  # type: ignore[arg-type]
            text = spec.doc + (" (fixed)" if spec.fixed else "")
            text += f" [{spec.source}]" if spec.source else ""
            rows.append((f"{stage}.{spec.name}", str(default), allowed, text))
    return rows
