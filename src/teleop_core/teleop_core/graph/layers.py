"""Layers: contents of files, scenarios and settings, as values by stage and name, not yet checked."""

import difflib
import math
import warnings
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from teleop_core.base import (
    Spec,
    TeleopError,
    TeleopWarning,
    UnknownNameError,
    Within,
    fixed,
    parameter,
    plain_yaml,
    shown,
    specs,
)
from teleop_core.base.texts import LONGEST_VALUE
from teleop_core.graph.stage import STAGES


@dataclass(frozen=True, kw_only=True)
class RealTimeParameters:
    """Real-time privileges that a live node requests; if one is refused, the node reports the refusal and continues."""

    priority: int = fixed(
        -1,
        Within(-1, 98),
        "SCHED_FIFO priority of the loop; its helper threads get 1. 0: ordinary scheduling; -1: 20 "
        "for sessions by side or in one process if the system permits it, else ordinary scheduling",
    )
    cpus: tuple[int, ...] = fixed((), Within(0), "processors that the loop may use; empty: all")
    patience: float = fixed(
        0.8,
        Within(0.01, 60.0, "s"),
        "if the loop makes no progress for this time, it counts as hung and its process ends; time "
        "without a processor does not count; 0: never",
        off=0.0,
        source="assumed",
    )
    lock_memory: bool = fixed(False, doc="whether all memory of the process is locked, so that it is never swapped out")
    freeze_gc: bool = fixed(True, doc="whether garbage collections skip the objects that exist at the start")


@dataclass(frozen=True, kw_only=True)
class SessionParameters:
    """Parameters of a session as a whole."""

    description: str = parameter("", doc="one sentence that describes the session")
    duration: float = parameter(10.0, Within(0.001, 86400.0, "s"), "duration of the session, in simulated or live time")
    ends_with_task: bool = fixed(
        False, doc="whether the session ends within 1 s after the tasks of all arms are finished"
    )
    arms: tuple[str, ...] = fixed(
        (), doc="names of the arms; the first arm's topics have no namespace; empty: one arm without a name"
    )
    stages: tuple[str, ...] = fixed((), doc="additional stages of every arm, besides the built-in stages")
    delays: tuple[str, ...] = fixed(
        (), doc="delays of topics, as topic=seconds, or topic@reader=seconds for one reader"
    )
    real_time: RealTimeParameters = field(default_factory=RealTimeParameters)


SESSION = "teleop"
"""Name of the group of the session as a whole."""
EVERY = "/**"
"""Name for every node in ROS 2 parameter files. A layer keeps the values of this group, beside those of the stages."""
_OF_ROS = ("use_sim_time", "start_type_description_service", "qos_overrides")
"""Parameters that every node of ROS 2 has. They do not concern the stages, which take their time from the session."""
_LIKE = 0.8  # similarity of a parameter to a known one, from which it is a mistyped name and not of another node
RENAMED = {
    "haptic_master.path.": "operator.",
    "haptic_master.operator.": "operator.",
    "haptic_master.buttons.": "operator.buttons.",
    "haptic_master.patience": "operator.patience",
    "haptic_master.hand.tremor_amplitude": "operator.tremor_amplitude",
    "haptic_master.hand.tremor_frequency": "operator.tremor_frequency",
    "motion_scaling.fixture.size": "motion_scaling.fixture.box.size",
    "slave_sim.pid.": "slave_sim.controller.pid.",
    "network.there.outages.period": "network.there.outages.pause",
    "network.back.outages.period": "network.back.outages.pause",
    **{
        f"slave_sim.{name}": f"slave.{name}"
        for name in (
            "operation.",
            "reference_filter.",
            "command_timeout",
            "interpolation",
            "start",
            "starts_at_home",
            "start_speed",
        )
    },
}
"""Maps former names or prefixes, which recordings and files may still contain, to the present names."""
_READER = ("slave/servo_jp@slave_sim=", "slave/servo_jp@slave=")  # reader of commands: former and present name
_OF_ROBOT = ("robot", "geometry")

Layer = dict[str, dict[str, object]]


def merge(layers: Iterable[Layer]) -> Layer:
    """Values of several layers; later layers override earlier ones."""
    given = list(layers)
    names = dict.fromkeys(name for layer in given for name in layer)
    return {name: {key: value for layer in given for key, value in layer.get(name, {}).items()} for name in names}


def declared_groups() -> dict[str, type]:
    """Maps the name of each group of a parameter file to its type: the session, then all known stages."""
    return {SESSION: SessionParameters, **{name: STAGES.find(name).parameters for name in STAGES}}


def config_folder() -> Path:
    """Folder with the parameter files: in the source tree, or in the installed package."""
    package = Path(__file__).resolve().parents[1]
    prefix = package.parents[3] / "share" / "teleop_core" / "config"
    return prefix if prefix.is_dir() else package.parent / "config"


def _scenarios() -> dict[str, Path]:
    """Maps the names of the scenarios to their files."""
    return {path.stem: path for path in sorted(config_folder().glob("*.yaml")) if path.stem != "teleop"}


def list_scenarios() -> dict[str, str]:
    """Maps the names of the scenarios to their descriptions."""
    files = _scenarios().items()
    return {name: str(load_file(path).get("teleop", {}).get("description", "")) for name, path in files}


def scenario_file(name: str) -> Path:
    """File of a scenario.

    Raises:
        UnknownNameError: There is no such scenario; the error lists the alternatives.
    """
    files = _scenarios()
    if name not in files:
        raise UnknownNameError("scenario", name, files)
    return files[name]


def load_file(path: Path) -> Layer:
    """Values of a ROS 2 parameter file, by stage and dotted name.

    Raises:
        TeleopError: The file is missing, is not YAML, or has the wrong structure.
    """
    return parse_layer(plain_yaml.load(path), str(path))


def parse_text(text: str, where: str) -> Layer:
    """Values of the text of a ROS 2 parameter file; an empty text has no values.

    Raises:
        TeleopError: The text is not YAML, or has the wrong structure.
    """
    try:
        content = plain_yaml.parse(text)
    except plain_yaml.UnreadableError as error:
        raise TeleopError(f"{where}: {error}") from error
    return parse_layer({} if content is None else content, where)


def parse_layer(content: object, where: str) -> Layer:
    """Values of a parsed ROS 2 parameter file.

    A value under ``/**`` applies to every stage that has the parameter, unless the stage's own group sets it. A
    parameter under ``/**`` that no stage has belongs to nodes of others: a warning tells it.

    Raises:
        TeleopError: The structure is not stage / ros__parameters / name / value.
        UnknownNameError: There is no such stage, or a parameter under ``/**`` has a name like that of a known one.
    """
    layer: Layer = {}
    given: dict[str, object] = {}  # keys of the parameters of single stages
    if not isinstance(content, Mapping):
        raise TeleopError(f"{where}: must contain stages, each with ros__parameters")
    for key, inner in sorted(content.items(), key=lambda item: item[0] != EVERY):
        name = str(key).removeprefix("/").removeprefix("**/")
        stage = name.rpartition("/")[2]
        if key != EVERY and stage != SESSION and stage not in STAGES.names():
            raise UnknownNameError(f"{where}: stage", key, (SESSION, *STAGES))
        if not isinstance(inner, Mapping) or not isinstance(inner.get("ros__parameters"), Mapping):
            raise TeleopError(f"{where}: {key} must contain ros__parameters with names and values")
        values = _without_those_of_ros(inner["ros__parameters"], f"{where}: {key}")
        if key == EVERY:
            for own, value in values:
                for stage in _owners(own, where):
                    layer.setdefault(stage, {})[own] = layer.setdefault(EVERY, {})[own] = value
            continue
        layer.setdefault(name, {})
        for own, value in values:
            full = name.removesuffix(stage) + _current(f"{stage}.{own}")
            _check_once(full, key, given, where)
            owner, _, present = full.partition(".")
            layer.setdefault(owner, {})[present] = value
    _share_robot(layer)
    if isinstance(delays := layer.get(SESSION, {}).get("delays"), list | tuple):
        layer[SESSION]["delays"] = [str(one).replace(*_READER) for one in delays]
    return layer


def _without_those_of_ros(values: Mapping[str, Any], where: str) -> list[tuple[str, object]]:
    """Names and values without the parameters of every node of ROS, which have no effect here."""
    every = list(_flat(values))
    if said := [name for name, _ in every if name.partition(".")[0] in _OF_ROS]:
        warnings.warn(f"{where}: without effect on a session: {', '.join(said)}", TeleopWarning, stacklevel=4)
    return [(name, value) for name, value in every if name not in said]


def _check_once(full: str, key: object, given: dict[str, object], where: str) -> None:
    """Refuse a parameter under two keys that mean one node, or in two spellings; ``given`` is written."""
    if full in given:
        raise TeleopError(f"{where}: {full} is given twice, under {given[full]} and {key}; keep one of them")
    given[full] = key


def _owners(name: str, where: str) -> list[str]:
    """Stages that have a parameter of this name; a warning tells if there are none, as other nodes may have it.

    Raises:
        UnknownNameError: No stage has this parameter, and its name is like that of a known one.
    """
    names = {stage: {spec.name for spec in specs(group)} for stage, group in declared_groups().items()}
    if not (owners := [stage for stage, own in names.items() if name in own]):
        known = sorted(set[str]().union(*names.values()))
        if near := difflib.get_close_matches(name[:LONGEST_VALUE], known, cutoff=_LIKE):
            raise UnknownNameError(f"{where}: parameter of {EVERY}", name, near)
        warnings.warn(f"{where}: {EVERY}: no stage has the parameter {shown(name)}", TeleopWarning, stacklevel=5)
    return owners


def _current(full: str) -> str:
    """Present name of a parameter; ``full`` may be a former name."""
    for old, new in RENAMED.items():
        if full == old or (old.endswith(".") and full.startswith(old)):
            return new + full[len(old) :]
    return full


def _share_robot(layer: Layer) -> None:
    """Give ``slave`` the robot of ``slave_sim`` if a file of a former version has no ``slave``."""
    for name in [name for name in layer if name.rpartition("/")[2] == "slave_sim"]:
        slave = layer.setdefault(name.removesuffix("_sim"), {})
        if not slave.keys() & set(_OF_ROBOT):
            slave |= {key: layer[name][key] for key in _OF_ROBOT if key in layer[name]}


def _flat(values: Mapping[str, Any], prefix: str = "") -> Iterable[tuple[str, object]]:
    for name, value in values.items():
        if isinstance(value, Mapping):
            yield from _flat(value, f"{prefix}{name}.")
        else:
            yield f"{prefix}{name}", value


def parse_setting(text: str) -> Layer:
    """Values of one ``--set key=value``.

    The key is ``stage.name``, or a bare name, which sets the parameter in every stage that has it; the prefix ``arm/``
    restricts the setting to that arm. The name of a group with a ``kind`` chooses the kind: ``fixture=sphere``. A list
    is written [1, 2]. Whole numbers are accepted for real numbers.

    Raises:
        TeleopError: There is no "=", or the value is not YAML.
        UnknownNameError: No stage has the key; the nearest keys are listed.
    """
    key, equals, value_text = text.partition("=")
    if not equals:
        raise TeleopError(f"--set {shown(text)} must be key=value")
    try:
        value = plain_yaml.parse(value_text)
    except plain_yaml.UnreadableError as error:
        raise TeleopError(f"--set {shown(text)}: the value {error}") from error
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
    for stage, spec in declared_as(name):
        layer.setdefault(arm + slash + stage, {})[spec.name] = _as_declared(spec, value)
    return layer


def declared_as(key: str) -> list[tuple[str, Spec]]:
    """Stages and parameters to which a key without an arm refers.

    Raises:
        UnknownNameError: There is no such parameter, or there are several with different names.
    """
    declared = {
        f"{stage}.{spec.name}": (stage, spec) for stage, group in declared_groups().items() for spec in specs(group)
    }
    for wanted in (key, f"{key}.kind"):
        if hits := [e for full, e in declared.items() if wanted in {full, e[1].name}]:
            return hits
    known = dict(declared)  # includes former names
    for full, entry in declared.items():
        for old, new in RENAMED.items():
            if full == new or (new.endswith(".") and full.startswith(new)):
                known.setdefault(old + full[len(new) :], entry)
    ends = {full: entry for full, entry in known.items() if f".{full}".endswith("." + key)}
    if len({spec.name for _, spec in ends.values()}) > 1:
        raise UnknownNameError("key", key, ends)  # several parameters have this ending
    if not ends:
        near = difflib.get_close_matches(
            key[:LONGEST_VALUE], dict.fromkeys([*known, *(s.name for _, s in declared.values())])
        )
        raise UnknownNameError("key", key, near or declared)
    return list({stage: (stage, spec) for stage, spec in ends.values()}.values())


def _as_declared(spec: Spec, value: object) -> object:
    """Value in the declared type; if necessary, a whole number becomes a real number, or a number becomes text.

    For a list, a single value becomes a list of one element.
    """
    if isinstance(value, list | tuple):
        return tuple(_as_element(spec, element) for element in value)
    one = _as_element(spec, value)
    return (one,) if spec.kind is tuple and value is not None else one


def _as_element(spec: Spec, value: object) -> object:
    if spec.element is float and isinstance(value, int | str) and not isinstance(value, bool):
        try:
            return float(value)  # YAML 1.1 reads 1e-3 as text
        except OverflowError:
            return math.inf
        except ValueError:
            return value
    return str(value) if spec.element is str and isinstance(value, int | float) else value
