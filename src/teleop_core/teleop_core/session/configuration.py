"""Configuration: parameter files, scenarios and settings become checked groups, stage by stage."""

import difflib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import yaml

from teleop_core.errors import ParameterError, TeleopError, UnknownNameError
from teleop_core.parameters import Spec, Value, build, parameter, specs, values_of
from teleop_core.session.graph import STAGES


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
    real_time: RealTimeParameters = field(default_factory=RealTimeParameters)


GROUPS: dict[str, type] = {
    "teleop": SessionParameters,
    **{stage.name: stage.parameters for stage in STAGES},
}
"""Name of each group of a parameter file to its type."""

Layer = dict[str, dict[str, object]]


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
    for stage, inner in content.items():
        if stage not in GROUPS:
            raise UnknownNameError(f"{where}: stage", stage, GROUPS)
        if not isinstance(inner, Mapping) or not isinstance(inner.get("ros__parameters"), Mapping):
            raise TeleopError(f"{where}: {stage} must hold ros__parameters with names and values")
        layer[stage] = dict(_flat(inner["ros__parameters"]))
    return layer


def _flat(values: Mapping[str, Any], prefix: str = "") -> Iterable[tuple[str, object]]:
    for name, value in values.items():
        if isinstance(value, Mapping):
            yield from _flat(value, f"{prefix}{name}.")
        else:
            yield f"{prefix}{name}", value


def parse_setting(text: str) -> Layer:
    """Values of one ``--set key=value``.

    The key is ``stage.name``, or a bare name, which sets every stage that has it. A list is
    written [1, 2]. Whole numbers serve for real ones.

    Raises:
        TeleopError: No "=", or a value that is not YAML.
        UnknownNameError: No stage has the key; the nearest keys are listed.
    """
    key, equals, value_text = text.partition("=")
    if not equals:
        raise TeleopError(f"--set {text!r} must be key=value")
    declared = {
        f"{stage}.{spec.name}": (stage, spec)
        for stage, group in GROUPS.items()
        for spec in specs(group)
    }
    key = key.strip()
    hits = [entry for full, entry in declared.items() if key in {full, entry[1].name}]
    if not hits:
        ends = {full: entry for full, entry in declared.items() if full.endswith("." + key)}
        if len({spec.name for _, spec in ends.values()}) > 1:
            raise UnknownNameError("key", key, ends)  # several parameters end so
        hits = list(ends.values())
    if not hits:
        near = difflib.get_close_matches(key, [*declared, *(s.name for _, s in declared.values())])
        raise UnknownNameError("key", key, near or declared)
    try:
        value = yaml.safe_load(value_text)
    except yaml.YAMLError as error:
        raise TeleopError(f"--set {text!r}: the value is not YAML") from error
    layer: Layer = {}
    for stage, spec in hits:
        layer.setdefault(stage, {})[spec.name] = _as_declared(spec, value)
    return layer


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
    """Checked parameters of all stages: ``groups`` by stage name, ``scenario`` for the record."""

    groups: dict[str, Any]
    scenario: str

    @staticmethod
    def from_layers(layers: Iterable[Layer], scenario: str = "") -> "Configuration":
        """Later layers over earlier ones over the defaults.

        Raises:
            UnknownNameError: A name is not declared.
            ParameterError: A value breaks its declaration.
        """
        merged: Layer = {name: {} for name in GROUPS}
        for layer in layers:
            for stage, values in layer.items():
                merged[stage] |= values
        groups: dict[str, Any] = {
            name: build(group, merged[name], f"{name}.") for name, group in GROUPS.items()
        }
        stages = ("inverse_kinematics", "slave_sim")
        for name in ("robot", "geometry"):
            first, second = (getattr(groups[stage], name) for stage in stages)
            if first != second:
                raise ParameterError(name, (first, second), "the same in " + " and ".join(stages))
        return Configuration(groups, scenario)

    def text(self) -> str:
        """All values as a ROS 2 parameter file, which :func:`parse_layer` reads back."""
        plain = {
            name: {"ros__parameters": {k: _plain(v) for k, v in values_of(group).items()}}
            for name, group in self.groups.items()
        }
        return yaml.safe_dump(plain, sort_keys=False, allow_unicode=True)


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
    for stage in stages:
        for spec in specs(GROUPS[stage]):
            allowed = ", ".join(spec.choices) if spec.choices else spec.bounds()
            default = spec.default if spec.kind is not tuple else list(spec.default)  # type: ignore[arg-type]
            text = spec.doc + (" (fixed)" if spec.fixed else "")
            rows.append((f"{stage}.{spec.name}", str(default), allowed, text))
    return rows
