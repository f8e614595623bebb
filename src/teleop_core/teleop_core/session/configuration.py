"""Configuration: parameter files, scenarios and settings become checked groups, stage by stage."""

import difflib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import yaml

from teleop_core.errors import ParameterError, TeleopError, UnknownNameError
from teleop_core.graph import RECORDER_NAME, Graph, Member, build_graph
from teleop_core.parameters import Spec, Value, build, parameter, specs, values_of
from teleop_core.stage import STAGES


@dataclass(frozen=True, kw_only=True)
class RealTimeParameters:
    """What a live node asks of the system; a refusal is reported and the node works on."""

    priority: int = parameter(
        0, lower=0, upper=98, fixed=True, doc="SCHED_FIFO priority of the loop; 0: fair shares"
    )
    cpus: tuple[int, ...] = parameter(
        (), lower=0, fixed=True, doc="processors that the loop may use; empty: all"
    )
    lock_memory: bool = parameter(False, fixed=True, doc="keep all memory out of swap")
    freeze_gc: bool = parameter(
        True, fixed=True, doc="keep what exists at the start out of garbage collections"
    )


@dataclass(frozen=True, kw_only=True)
class SessionParameters:
    """Parameters of a session as a whole."""

    description: str = parameter("", doc="what happens in it, in one sentence")
    duration: float = parameter(
        10.0, unit="s", lower=0.001, upper=86400.0, doc="simulated or live time"
    )
    arms: tuple[str, ...] = parameter(
        (), fixed=True,
        doc="names of the arms, the first of which keeps the plain topics; empty: one without name",
    )  # fmt: skip
    stages: tuple[str, ...] = parameter(
        (), fixed=True, doc="further stages of every arm, beside the built-in ones"
    )
    delays: tuple[str, ...] = parameter(
        (), fixed=True, doc="delays on links, topic=seconds or topic@reader=seconds"
    )
    real_time: RealTimeParameters = field(default_factory=RealTimeParameters)


SESSION = "teleop"
"""Name of the group of the session as a whole."""
RENAMED = {
    "haptic_master.path.": "haptic_master.operator.",
    "motion_scaling.fixture.size": "motion_scaling.fixture.box.size",
    "slave_sim.pid.": "slave_sim.controller.pid.",
}
"""Former names, which recordings and files may still have, or their beginnings."""

Layer = dict[str, dict[str, object]]


def declared_groups() -> dict[str, type]:
    """Name of each group of a parameter file to its type: the session, then all known stages."""
    return {SESSION: SessionParameters, **{name: STAGES.find(name).parameters for name in STAGES}}


def config_folder() -> Path:
    """Folder with the parameter files: of the source tree, or where the package is installed."""
    package = Path(__file__).resolve().parents[1]
    prefix = package.parents[3] / "share" / "teleop_core" / "config"
    return prefix if prefix.is_dir() else package.parent / "config"


def list_scenarios() -> dict[str, str]:
    """Names of the scenarios to their descriptions."""
    found = {}
    for path in sorted(config_folder().glob("*.yaml")):
        if path.stem != "teleop":
            found[path.stem] = str(load_file(path).get("teleop", {}).get("description", ""))
    return found


def scenario_file(name: str) -> Path:
    """File of a scenario.

    Raises:
        UnknownNameError: No such scenario; the alternatives are listed.
    """
    scenarios = list_scenarios()
    if name not in scenarios:
        raise UnknownNameError("scenario", name, scenarios)
    return config_folder() / f"{name}.yaml"


def load_file(path: Path) -> Layer:
    """Values of a ROS 2 parameter file: stage to dotted names to values.

    Raises:
        TeleopError: The file is missing, is not YAML, or has another shape.
    """
    try:
        content = yaml.safe_load(path.read_text())
    except OSError as error:
        raise TeleopError(f"{path}: cannot be read: {error.strerror}") from error
    except (yaml.YAMLError, UnicodeDecodeError) as error:
        raise TeleopError(f"{path}: is not YAML: {' '.join(str(error).split())}") from error
    return parse_layer(content, str(path))


def parse_layer(content: object, where: str) -> Layer:
    """Values of a parsed ROS 2 parameter file.

    Raises:
        TeleopError: It has another shape than stage / ros__parameters / name / value.
    """
    layer: Layer = {}
    if not isinstance(content, Mapping):
        raise TeleopError(f"{where}: must hold stages, each with ros__parameters")
    for key, inner in content.items():
        name = str(key).removeprefix("/").removeprefix("**/")
        stage = name.rpartition("/")[2]
        if stage != SESSION and stage not in STAGES.names():
            raise UnknownNameError(f"{where}: stage", key, (SESSION, *STAGES))
        if not isinstance(inner, Mapping) or not isinstance(inner.get("ros__parameters"), Mapping):
            raise TeleopError(f"{where}: {key} must hold ros__parameters with names and values")
        values = dict(_flat(inner["ros__parameters"]))
        layer.setdefault(name, {}).update({_current(stage, n): v for n, v in values.items()})
    return layer


def _current(stage: str, name: str) -> str:
    """Present name of a parameter that may be called by a former one."""
    full = f"{stage}.{name}"
    for old, new in RENAMED.items():
        if full == old or (old.endswith(".") and full.startswith(old)):
            return (new + full[len(old) :]).partition(".")[2]
    return name


def _flat(values: Mapping[str, Any], prefix: str = "") -> Iterable[tuple[str, object]]:
    for name, value in values.items():
        if isinstance(value, Mapping):
            yield from _flat(value, f"{prefix}{name}.")
        else:
            yield f"{prefix}{name}", value


def parse_setting(text: str) -> Layer:
    """Values of one ``--set key=value``.

    The key is ``stage.name``, or a bare name, which sets every stage that has it; ``arm/`` before
    it means that arm alone. The name of a group with a ``kind`` chooses the kind:
    ``fixture=sphere``. A list is written [1, 2]. Whole numbers serve for real ones.

    Raises:
        TeleopError: No "=", or a value that is not YAML.
        UnknownNameError: No stage has the key; the nearest keys are listed.
    """
    key, equals, value_text = text.partition("=")
    if not equals:
        raise TeleopError(f"--set {text!r} must be key=value")
    try:
        value = yaml.safe_load(value_text)
    except yaml.YAMLError as error:
        raise TeleopError(f"--set {text!r}: the value is not YAML") from error
    return setting(key, value)


def setting(key: str, value: object) -> Layer:
    """Values of one key as :func:`parse_setting` describes it.

    Args:
        key: ``stage.name``, a bare name, or the name of a group with a kind.
        value: Number, text, truth value, or a sequence of them.

    Raises:
        UnknownNameError: No stage has the key; the nearest keys are listed.
    """
    arm, slash, name = key.strip().rpartition("/")
    layer: Layer = {}
    for stage, spec in _hits(name):
        layer.setdefault(arm + slash + stage, {})[spec.name] = _as_declared(spec, value)
    return layer


def _hits(key: str) -> list[tuple[str, Spec]]:
    """Stages and parameters that a key means.

    Raises:
        UnknownNameError: None, or several of different names.
    """
    declared = {
        f"{stage}.{spec.name}": (stage, spec)
        for stage, group in declared_groups().items()
        for spec in specs(group)
    }
    for wanted in (key, f"{key}.kind"):
        if hits := [e for full, e in declared.items() if wanted in {full, e[1].name}]:
            return hits
    known = dict(declared)  # by former names too
    for full, entry in declared.items():
        for old, new in RENAMED.items():
            if full == new or (new.endswith(".") and full.startswith(new)):
                known.setdefault(old + full[len(new) :], entry)
    ends = {full: entry for full, entry in known.items() if f".{full}".endswith("." + key)}
    if len({spec.name for _, spec in ends.values()}) > 1:
        raise UnknownNameError("key", key, ends)  # several parameters end so
    if not ends:
        near = difflib.get_close_matches(key, [*known, *(s.name for _, s in declared.values())])
        raise UnknownNameError("key", key, near or declared)
    return list({stage: (stage, spec) for stage, spec in ends.values()}.values())


def _as_declared(spec: Spec, value: object) -> object:
    """Whole numbers as real ones where a real one is declared; text for a name that YAML read."""
    if isinstance(value, list | tuple):
        return tuple(_as_declared(spec, element) for element in value)
    if spec.element is float and isinstance(value, int) and not isinstance(value, bool):
        return float(value)
    if spec.element is float and isinstance(value, str):  # YAML 1.1 reads 1e-3 as text
        try:
            return float(value)
        except ValueError:
            return value
    return str(value) if spec.element is str and isinstance(value, int | float) else value


@dataclass(frozen=True)
class Configuration:
    """Checked parameters of a session.

    Attributes:
        groups: Parameter groups: ``teleop``, ``recorder`` and one for each member of the graph.
        scenario: Name of the session, for the record.
        graph: What runs.
    """

    groups: dict[str, Any]
    scenario: str
    graph: Graph

    @staticmethod
    def from_layers(layers: Iterable[Layer], scenario: str = "") -> "Configuration":
        """Later layers over earlier ones over the defaults.

        What is said of a stage holds for all arms, unless the arm's own group says otherwise.

        Raises:
            UnknownNameError: A name is not declared.
            ParameterError: A value breaks its declaration.
            PartError: The graph cannot run.
        """
        merged: Layer = {}
        for layer in layers:
            for name, values in layer.items():
                merged.setdefault(name, {}).update(values)
        session = build(SessionParameters, merged.get(SESSION, {}), f"{SESSION}.")
        graph = build_graph(session.arms, session.stages, session.delays)
        _check_names(merged, graph)
        groups: dict[str, Any] = {SESSION: session}
        for member in _ordered(graph):
            values = _values_for(member, merged, graph)
            groups[member.name] = build(member.stage.parameters, values, f"{member.name}.")
        recorder = STAGES.find(RECORDER_NAME)
        groups[RECORDER_NAME] = build(
            recorder.parameters, merged.get(RECORDER_NAME, {}), f"{RECORDER_NAME}."
        )
        for arm in graph.namespaces:
            _check_robots(graph, groups, arm)
        return Configuration(groups, scenario, graph)

    def group(self, stage: str, arm: str = "") -> Any:
        """Parameters of a stage of an arm, by the arm's namespace."""
        return self.groups[f"{arm}/{stage}" if arm else stage]

    def value(self, name: str, arm: str = "") -> Any:
        """Parameter of the first stage of an arm that has it; None if none has.

        Args:
            name: A parameter, such as ``robot`` or ``seed``.
            arm: Namespace of the arm.
        """
        groups = (self.group(stage.name, arm) for stage in self.graph.stages)
        return next((getattr(group, name) for group in groups if hasattr(group, name)), None)

    def text(self) -> str:
        """All values as a ROS 2 parameter file, which :func:`parse_layer` reads back."""
        plain = {
            name: {"ros__parameters": {k: _plain(v) for k, v in values_of(group).items()}}
            for name, group in self.groups.items()
        }
        return yaml.safe_dump(plain, sort_keys=False, allow_unicode=True)


def _ordered(graph: Graph) -> list[Member]:
    """Members arm by arm, in the order in which stages are named."""
    return [Member(stage, arm) for arm in graph.namespaces for stage in graph.stages]


def _values_for(member: Member, merged: Layer, graph: Graph) -> dict[str, object]:
    """What is said of the stage, then of the stage of this arm."""
    named = dict(zip(graph.namespaces, graph.arms, strict=True))[member.arm]
    own = merged.get(f"{named}/{member.stage.name}", {}) if named else {}
    return merged.get(member.stage.name, {}) | own


def _check_names(merged: Layer, graph: Graph) -> None:
    """Refuse groups that nobody has.

    Raises:
        UnknownNameError: An arm or stage that is not in the graph.
    """
    stages = [stage.name for stage in graph.stages]
    for name in merged:
        arm, _, stage = name.rpartition("/")
        if arm and arm not in graph.arms:
            raise UnknownNameError(f"arm of {name}", arm, [a for a in graph.arms if a] or ["none"])
        if stage not in {SESSION, RECORDER_NAME, *stages}:
            raise UnknownNameError("stage of teleop.stages", stage, (*stages, RECORDER_NAME))


def _check_robots(graph: Graph, groups: Mapping[str, Any], arm: str) -> None:
    """Make sure that all stages of an arm are for the same robot.

    Raises:
        ParameterError: Two differ.
    """
    members = [Member(stage, arm) for stage in graph.stages]
    named = [m.name for m in members if hasattr(groups[m.name], "robot")]
    for name in ("robot", "geometry"):
        values = [getattr(groups[member], name) for member in named]
        if any(value != values[0] for value in values):
            raise ParameterError(name, tuple(values), "the same in " + " and ".join(named))


def _plain(value: Value) -> object:
    return list(value) if isinstance(value, tuple) else value


def configure(
    scenario: str | None = None, files: Iterable[Path] = (), settings: Iterable[str] = ()
) -> Configuration:
    """Configuration as the command line gives it: scenario, then files, then settings.

    Raises:
        TeleopError: Any of them is wrong; the text names it.
    """
    layers = [load_file(config_folder() / "teleop.yaml")]
    if scenario is not None:
        layers.append(load_file(scenario_file(scenario)))
    layers += [load_file(Path(file)) for file in files]
    layers += [parse_setting(text) for text in settings]
    return Configuration.from_layers(layers, scenario or "")


def parameter_rows(stages: Iterable[str]) -> list[tuple[str, str, str, str]]:
    """Name, default, what is allowed and meaning of every parameter of some stages."""
    rows = []
    groups = declared_groups()
    for stage in stages:
        for spec in specs(groups[stage]):
            allowed = ", ".join(spec.choices) if spec.choices else spec.bounds()
            default = spec.default if spec.kind is not tuple else list(spec.default)  # type: ignore[arg-type]
            text = spec.doc + (" (fixed)" if spec.fixed else "")
            rows.append((f"{stage}.{spec.name}", str(default), allowed, text))
    return rows
