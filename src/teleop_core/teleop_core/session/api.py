"""Python API: run a session, replay a recorded session, open a recording, register parts.

>>> import teleop_core as tc
>>> recording = tc.run("coarse_box", duration=10.0, fixture="sphere", fine_gain=0.2)
>>> recording["slave/measured_cp"]["x"]
>>> recording.score().position_error_mm.rms

The command line is a thin layer on this module.
"""

import warnings
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, TypeAlias, Union

import numpy as np
from numpy.typing import NDArray

from teleop_core.bags.memory import MemoryBag, Message
from teleop_core.bags.series import Series
from teleop_core.base import ParameterError, TeleopError, TeleopWarning
from teleop_core.graph import HAND, SESSION, STAGES, Layer, Stage, config_folder, topics
from teleop_core.graph.graph import DEVICE
from teleop_core.graph.layers import load_file, parse_setting, scenario_file, setting
from teleop_core.hand.operators import OPERATORS, Motion, Operator, following
from teleop_core.kernels.geometry import Array
from teleop_core.robots import ROBOTS, Robot
from teleop_core.robots.arms.dh import DhTable
from teleop_core.session import length, notes, runner, virtual
from teleop_core.session.configuration import Configuration, with_changes
from teleop_core.session.recording import Recording, open_recording
from teleop_core.shapes import SHAPES, Shape
from teleop_core.slave.controllers import CONTROLLERS, Controller
from teleop_core.slave.plants import PLANTS, Plant

if TYPE_CHECKING:
    import pandas

__all__ = ["OperatorLike", "Progress", "configuration", "replay", "run"]

Progress = Callable[[int, int], None]
"""Function that is called after every simulated second with the number of finished ticks and the number of all ticks.
"""
OperatorLike: TypeAlias = Union[
    str, Path, Operator, Motion, NDArray[np.float64], tuple[Array, Array], "pandas.DataFrame"
]
"""An operator, given in one of these forms: a name; the path of a CSV table or recording; a part; a function
``motion(times)``; an array; a pair (times, rows); or a data frame. Columns of an array are the time [s] and the
columns of :data:`~teleop_core.hand.operators.Motion`. A data frame has the column names of a CSV table."""
Setting = float | str | bool | Sequence[float] | Sequence[str]
"""Value of a parameter."""


def configuration(
    scenario: str | None = None,
    *,
    files: Iterable[Path | str] = (),
    settings: Mapping[str, Setting] | None = None,
    texts: Iterable[str] = (),
    operator: OperatorLike | None = None,
    fixture: str | Shape | None = None,
    controller: str | Controller | None = None,
    plant: str | Plant | None = None,
    robot: str | Robot | DhTable | None = None,
    stages: str | Stage | Sequence[str | Stage] = (),
    arms: Sequence[str] = (),
    delays: Mapping[str, float] | None = None,
    **parameters: Setting,
) -> Configuration:
    """Configuration of a session, from a scenario, files, parameters and parts of your own.

    Args:
        scenario: Name of a scenario, as in ``teleop scenarios``; None for the defaults alone.
        files: ROS 2 parameter files. They override the scenario.
        settings: Parameters by name, which override all files: ``{"motion_scaling.fine_gain": 0.2}``. A name without a
            stage sets every stage that has this parameter; ``left/...`` sets the arm ``left`` only.
        texts: Parameters as texts ``key=value``, as on the command line. They override ``settings``.
        operator: Operator that moves the hand; see :data:`OperatorLike`.
        fixture: Shape around the hand: a name, or a part of your own.
        controller: Control law of the slave's joints: a name, or a part of your own.
        plant: Plant that the slave simulator moves: a name, or a part of your own.
        robot: Robot of the slave: a name, the file of a table, or a robot of your own.
        stages: Further stages of every arm, one or several: names, or stages of your own.
        arms: Names of the arms; the first is the default arm.
        delays: Delays on links [s]: ``{"slave/servo_jp": 0.02}``.
        **parameters: Parameters by name, with ``__`` for each dot: ``fixture__box__size=...``.

    Returns:
        The checked configuration.

    Raises:
        TeleopError: An argument is wrong; the error text names it.
    """
    named: dict[str, object] = {}
    if robot is not None:  # first: a scene implies its plant, which plant= overrides
        named["robot"] = robot if isinstance(robot, str) else _known(ROBOTS, robot)
    for name, registry, part in (
        ("fixture", SHAPES, fixture),
        ("controller", CONTROLLERS, controller),
        ("plant", PLANTS, plant),
    ):
        if part is not None:
            named[f"{name}.kind"] = part if isinstance(part, str) else _known(registry, part)
    if operator is not None:
        named |= _operator_settings(operator)
    if stages:
        several = [stages] if isinstance(stages, str | Stage) else stages
        known = [stage if isinstance(stage, str) else _known(STAGES, stage) for stage in several]
        named[f"{SESSION}.stages"] = known
    if arms:
        named[f"{SESSION}.arms"] = [arms] if isinstance(arms, str) else list(arms)
    if delays:
        named[f"{SESSION}.delays"] = [f"{link}={time!r}" for link, time in delays.items()]
    named |= {name.replace("__", "."): value for name, value in parameters.items()}
    layers: list[Layer] = [load_file(config_folder() / "teleop.yaml")]
    if scenario is not None:
        layers.append(load_file(scenario_file(scenario)))
    given = [load_file(Path(file)) for file in files]
    given += [setting(key, _plain(value)) for key, value in (named | dict(settings or {})).items()]
    given += [parse_setting(text) for text in texts]
    made = Configuration.from_layers([*layers, *given], scenario or "")
    return length.as_long_as_followed(made, given)


def run(
    scenario: str | Configuration | None = None,
    *,
    duration: float | None = None,
    seed: int | None = None,
    out: Path | str | None = None,
    progress: Progress = runner.silent,
    files: Iterable[Path | str] = (),
    settings: Mapping[str, Setting] | None = None,
    operator: OperatorLike | None = None,
    fixture: str | Shape | None = None,
    controller: str | Controller | None = None,
    plant: str | Plant | None = None,
    robot: str | Robot | DhTable | None = None,
    stages: str | Stage | Sequence[str | Stage] = (),
    arms: Sequence[str] = (),
    delays: Mapping[str, float] | None = None,
    keep: Collection[str] | None = None,
    **parameters: Setting,
) -> Recording:
    """Run a session in virtual time.

    Args:
        scenario: Name of a scenario, as in ``teleop scenarios``, or a complete configuration. No further settings may
            be given with a configuration.
        duration: Simulated time [s]; replaces the scenario's duration.
        seed: Seed of all random numbers.
        out: Directory of the recording, which is created; None keeps the recording in memory, 2 MB per second.
        progress: Called with the progress of the run.
        files: As in :func:`configuration`, like all arguments from here to ``delays``.
        settings: As in :func:`configuration`.
        operator: As in :func:`configuration`.
        fixture: As in :func:`configuration`.
        controller: As in :func:`configuration`.
        plant: As in :func:`configuration`.
        robot: As in :func:`configuration`.
        stages: As in :func:`configuration`.
        arms: As in :func:`configuration`.
        delays: As in :func:`configuration`.
        keep: Streams of all arms that are kept in memory, such as ``task/state``; None keeps all streams. A run that
            keeps few streams is faster. Reading a stream that was not kept raises an error.
        **parameters: As in :func:`configuration`.

    Returns:
        The recorded session.

    Raises:
        TeleopError: An argument or a part is wrong; the error text names it. If possible, the error is raised before
            the session runs.
    """
    given = dict(settings or {})
    if duration is not None:
        given[f"{SESSION}.duration"] = float(duration)
    if seed is not None:
        given["seed"] = seed
    if isinstance(scenario, Configuration):
        made = scenario
        if given:
            raise ParameterError(
                "settings", sorted(given), "left out if a configuration is given; put them into the configuration"
            )
    else:
        made = configuration(
            scenario, files=files, settings=given, texts=(), operator=operator, fixture=fixture,
            controller=controller, plant=plant, robot=robot, stages=stages, arms=arms,
            delays=delays, **parameters,
        )  # fmt: skip
    for note in notes.notes_of(made):
        warnings.warn(note, TeleopWarning, stacklevel=2)
    session = virtual.VirtualTime(made)
    ticks = runner.session_ticks(made, session)
    return _kept(session, made, runner.run_blocks(session, ticks), ticks, out, progress, keep)


_BEGINS = {"device": DEVICE, "hand": HAND}
"""Names of the points at which a replay may begin; each maps to the stage whose output is taken from the recording."""


def replay(
    recording: Recording | Path | str,
    *,
    out: Path | str | None = None,
    progress: Progress = runner.silent,
    files: Iterable[Path | str] = (),
    settings: Mapping[str, Setting] | None = None,
    texts: Iterable[str] = (),
    begin: Literal["device", "hand"] = "device",
    **parameters: Setting,
) -> Recording:
    """Run the recorded motion of a session's masters through the graph again, in virtual time.

    If nothing is changed, the replay of a recording in virtual time gives exactly the same slave motion, bit for bit,
    for each ``begin``.

    Args:
        recording: Recording to replay. Its own configuration is used, and the arguments below override it.
        out: As in :func:`run`.
        progress: As in :func:`run`.
        files: Parameter files. They override the recorded configuration.
        settings: Parameters, which override the files, as in :func:`configuration`.
        texts: As in :func:`configuration`.
        begin: ``device`` takes the measured motion of the device from the recording. ``hand`` takes the motion that
            the hand wanted; forces of the new session then act on the hand.
        **parameters: As in :func:`configuration`.

    Raises:
        TeleopError: A topic or file is missing, or a value is wrong.
    """
    from teleop_core.session.master_bag import as_master_bag

    bag = as_master_bag(recording.bag if isinstance(recording, Recording) else recording)
    layer, scenario = runner.recorded_configuration(bag)
    named = {name.replace("__", "."): value for name, value in parameters.items()}
    changes = [setting(key, _plain(value)) for key, value in (named | dict(settings or {})).items()]
    changes = [*(load_file(Path(file)) for file in files), *changes, *(parse_setting(text) for text in texts)]
    made = Configuration.from_layers(with_changes(layer, changes), scenario)
    if begin not in _BEGINS:
        raise ParameterError("begin", begin, " or ".join(_BEGINS))
    session = virtual.VirtualTime(made, played=_BEGINS[begin])
    blocks, ticks = runner.replayed_blocks(session, bag)
    return _kept(session, made, blocks, ticks, out, progress)


def _kept(
    session: virtual.VirtualTime,
    made: Configuration,
    blocks: Iterable[NDArray[np.void]],
    ticks: int,
    out: Path | str | None,
    progress: Progress,
    keep: Collection[str] | None = None,
) -> Recording:
    if out is not None:
        runner.record_blocks(session, made, Path(out), blocks, ticks, progress)
        return open_recording(out)
    memory = _Memory(session, keep)
    for block in blocks:
        memory.take(block)
        progress(memory.ticks, ticks)
    return Recording(memory.bag(made))


class _Memory:
    """A recording in memory, which takes blocks of rows and single messages like a writer of bags."""

    def __init__(self, session: virtual.VirtualTime, keep: Collection[str] | None) -> None:
        self._session, self._reports = session, runner.StateReports(session)
        self._is_new = runner.NewSamples()
        streams = session.graph.streams
        self._left_out = [t for t in streams if keep is not None and t.name.removeprefix(f"{t.arm}/") not in keep]
        self._parts: dict[topics.Topic, list[Sequence[NDArray[Any]]]] = {
            topic: [] for topic in streams if topic not in self._left_out
        }
        self._messages: dict[topics.Topic, list[Message]] = {
            topic: [] for topic in session.graph.topics if topic not in streams
        }
        self.ticks = 0

    def take(self, block: NDArray[np.void]) -> None:
        self.ticks += len(block)
        log_ns = block["now_ns"]
        for topic, parts in self._parts.items():
            parts.append([np.array(part) for part in self._is_new.of(topic, block, log_ns)])
        self._reports.write(self, block)

    def write(self, topic: topics.Topic, log_ns: int, data: bytes) -> None:
        """Store one message of a report."""
        self._messages[topic].append((log_ns, data))

    def bag(self, made: Configuration) -> MemoryBag:
        series = {}
        for topic, parts in self._parts.items():
            stamps, values, logs = (np.concatenate(column) for column in zip(*parts, strict=True))
            names = topic.names(self._session.joint_names[topic.arm])
            series[topic] = Series(stamps, logs, values, names, topic.frame_id)
        about = runner.describe(made) | self._session.about
        return MemoryBag(about["scenario"] or "session", series, self._messages, about, self._left_out)


def _known(registry: object, part: object) -> str:
    """Register a part that was given as an object, and return its name."""
    from teleop_core.base.registry import Registry

    assert isinstance(registry, Registry)
    name = getattr(part, "name", None)
    if not isinstance(name, str):
        raise TeleopError(f"{registry.kind} must have a name, is {part!r}")
    registry.add(name, part, replace=True)
    return name


def _operator_settings(operator: OperatorLike) -> dict[str, object]:
    """Settings that choose an operator. An operator given as an object is registered under a new name."""
    if isinstance(operator, Path):
        return _file_settings(operator)
    if isinstance(operator, str):
        is_file = operator not in OPERATORS.names() and Path(operator).exists()
        return _file_settings(Path(operator)) if is_file else {"operator.kind": operator}
    if isinstance(operator, Operator):
        part: Operator | Motion = operator
        name = operator.name
    elif isinstance(operator, np.ndarray):
        name = "array"
        if operator.ndim != 2 or operator.shape[1] not in {4, 7, 10}:
            needed = "(N, 4), (N, 7) or (N, 10): time [s], then the columns of a motion"
            raise ParameterError("operator", f"an array {operator.shape}", needed)
        part = following(name, operator[:, 0], operator[:, 1:])
    elif hasattr(operator, "columns"):
        name = "frame"
        part = following(name, *_of_frame(operator))
    elif isinstance(operator, tuple):
        name = "array"
        part = following(name, *operator)
    else:
        part, name = operator, getattr(operator, "__name__", "function").strip("<>")
    if name in OPERATORS.names() and not OPERATORS.is_added(name):
        name = f"own_{name}"
    OPERATORS.add(name, part, replace=True)
    return {"operator.kind": name}


def _of_frame(frame: "pandas.DataFrame") -> tuple[Array, Array]:
    """Times (N,) [s] and motion (N, 3, 6 or 9) of a data frame that has the column names of an operator's CSV file.

    Raises:
        ParameterError: The frame has no time, no position, or columns with unknown names.
    """
    from teleop_core.session.recorded_hand import COLUMNS

    named = frame if "t" in frame else frame.reset_index(names="t")
    needed = f"columns of {', '.join(COLUMNS)}; t may be the index, and x, y, z are needed"
    names = [str(name) for name in named.columns]
    if not set(COLUMNS[:4]) <= set(names) <= set(COLUMNS):
        raise ParameterError("operator", f"a frame of {', '.join(names)}", needed)
    width = 4 if set(names) <= set(COLUMNS[:4]) else 7 if set(names) <= set(COLUMNS[:7]) else 10
    whole = named.reindex(columns=COLUMNS[:width], fill_value=0.0)
    values = np.asarray(whole.to_numpy(dtype=np.float64))
    return values[:, 0], values[:, 1:]


def _file_settings(path: Path) -> dict[str, object]:
    if path.suffix.lower() == ".csv":
        return {"operator.kind": "file", "operator.file.path": str(path)}
    return {"operator.kind": "bag", "operator.bag": str(path)}


def _plain(value: object) -> object:
    """Value of a setting, with NumPy types converted to Python types."""
    if isinstance(value, np.generic):
        return value.item()
    if isinstance(value, list | tuple | np.ndarray):
        return [_plain(element) for element in value]
    return value
