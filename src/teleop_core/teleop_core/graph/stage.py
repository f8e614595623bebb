"""Stage: the description of one step of the chain, and its object in a running session.

A stage names its parameters, the topics at its ports and the kernel that makes one step. From a
tuple of stages everything else follows: the order of a tick, the nodes, the links, the recording.
"""

import traceback
from collections.abc import Callable
from dataclasses import dataclass, is_dataclass
from inspect import signature
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from teleop_core.base import PartError, Registry, fill, specs
from teleop_core.graph.signals import DT, assign, make_signals
from teleop_core.graph.topics import Topic
from teleop_core.kernels import Fields, fields_of, held, raise_pending, records
from teleop_core.kernels.groups import Field, group_fields

__all__ = ["STAGES", "Beside", "Runner", "RunningStage", "Stage", "joints_of", "register_stage"]


class Runner(Protocol):
    """A running stage: the interface for virtual time and nodes.

    ``kernel(*arguments, signals, dt)`` makes one step: it reads inputs from ``signals`` and writes outputs into it. A
    compiled kernel becomes part of the compiled tick; any other callable is called from Python.
    """

    signals: Any
    kernel: Callable[..., None]
    arguments: tuple[Any, ...]
    ahead: int
    """Largest number of ticks for which the stage can be prepared at once, 1000 at most."""
    changes_itself: bool
    """Whether the stage changes parameters by itself, as with a mode button; see :meth:`present`."""

    @property
    def lead(self) -> int:
        """Number of ticks before the stage can follow commands, for example while it moves to its start."""

    def prepare(self, ticks: int) -> None:
        """Prepare the next ``ticks`` steps, at most ``ahead``."""

    def reset(self) -> None:
        """Reset the stage to its state before the first step."""

    def retune(self, parameters: Any) -> None:
        """Use new parameters from the next step on, without a jump of the outputs."""

    def step(self) -> None:
        """Make one step."""

    def load(self) -> object:
        """Compile or load the kernel, so that the first step takes no longer than others."""

    def examine(self, parameters: Any) -> None:
        """Try parameters before :meth:`retune`, outside the running steps, if the trial takes long."""

    def present(self) -> Any:
        """Present parameters; called only if the stage changes its parameters by itself."""

    def fall_silent(self) -> None:
        """Make outputs safe when the topic that the stage answers has fallen silent."""

    def concerns(self) -> list[str]:
        """Sentences for users about current problems of the stage; this method is called once per second."""

    def described(self) -> dict[str, str]:
        """Names and texts that the report of the stage contains in addition to its numbers."""


@dataclass(frozen=True)
class Beside:
    """Process beside a live session; the session goes on without it if it ends.

    Attributes:
        words: Words of its command after ``teleop``; ``--config`` with the session's parameters follows them.
        records: Topics of the process that the recorder records, as ``recorder.also`` takes them.
    """

    words: tuple[str, ...]
    records: tuple[str, ...]


@dataclass(frozen=True, repr=False)
class Stage:
    """One stage of the graph.

    Attributes:
        name: Name of the stage's node, and of the stage's group in parameter files.
        parameters: Parameter group, a dataclass of :func:`~teleop_core.base.parameters.parameter`.
        reads: Topics that the stage reads; the stage's record has a field for each topic.
        writes: Topics that the stage writes: streams, and at most one report.
        step: ``step(parameters, state, signals, dt)``, a kernel or a plain function: ``parameters`` and ``state`` are
            records with a field for each parameter and each entry of ``state``.
        state: Memory of the stage from step to step, which is zero at the start: a class of
            :class:`~teleop_core.kernels.fields.Fields`, or fields as :class:`numpy.dtype` takes them.
        make: Function that makes the :class:`Runner` from the parameters and the length of a tick [s]; it replaces
            ``step`` and ``state``.
        late: Topics of ``reads`` whose values from the end of the last tick are read. A cycle of stages needs one.
        optional: Topics of ``reads`` that no stage has to write; their values are zero if no stage writes them.
        trigger: Topic whose messages the stage answers with one step each; None for a stage with its own clock, which
            makes one step per tick.
        replaces: Topic that ``writes[0]`` replaces for all other readers, as for a limit or a filter between two
            stages. Several topics are replaced by ``writes`` in their order.
        spares: Names of stages that still read the original topic, such as an operator who holds the stylus itself. An
            entry like ``slave/measured_cf@passivity`` applies to one topic only.
        serves: Names of the only stages that read the replacement, such as an operator who sees the slave on a
            display. They read it even if other stages replace the same topic. Empty for all stages.
        on_demand: Topics of ``writes`` that exist only if another stage must read them, or if the topic that they
            replace is written.
        notes: Further fields of the stage's record, which no stage reads.
        node: ``module:class`` of the stage's node, if a generic node is not enough.
        needs: Topics without which the node answers no message.
        beside: Function of the parameters: the process that a live session starts beside its nodes, or None.

    Raises:
        PartError: The stage contradicts itself; the message states the contradiction.
    """

    name: str
    parameters: type
    reads: tuple[Topic, ...]
    writes: tuple[Topic, ...]
    step: Callable[..., None] | None = None
    state: type[Fields] | tuple[Field, ...] = ()
    make: Callable[[Any, float], Runner] | None = None
    late: tuple[Topic, ...] = ()
    optional: tuple[Topic, ...] = ()
    trigger: Topic | None = None
    replaces: Topic | tuple[Topic, ...] | None = None
    spares: tuple[str, ...] = ()
    serves: tuple[str, ...] = ()
    on_demand: tuple[Topic, ...] = ()
    notes: tuple[Field, ...] = ()
    node: str = ""
    needs: tuple[Topic, ...] = ()
    beside: Callable[[Any], "Beside | None"] | None = None

    def __post_init__(self) -> None:
        """Refuse a stage that could never run."""
        self._insist(self.name.isidentifier(), "a name of letters, digits and _")
        for word in ("reads", "writes", "late", "optional", "needs"):
            found = getattr(self, word)
            is_right = isinstance(found, tuple) and all(isinstance(t, Topic) for t in found)
            text = f"one whose {word} is a tuple of Topic, such as (topics.SLAVE_SERVO_CP,), not {found!r}"
            self._insist(is_right, text)
        for word in ("spares", "serves"):
            found = getattr(self, word)
            is_right = isinstance(found, tuple) and all(isinstance(name, str) for name in found)
            self._insist(is_right, f"one whose {word} is a tuple of names, not {found!r}")
        known = {topic.name for topic in self.reads}
        for word in ("late", "optional", "needs"):
            for topic in getattr(self, word):
                self._insist(topic.name in known, f"one with {topic.name} ({word}) among its reads")
        if self.trigger is not None:
            text = f"one with its trigger {self.trigger.name} among its reads"
            self._insist(self.trigger.name in known, text)
        for topic in self.writes:
            is_known = topic.stamp.is_in_force or topic.stamp.of in {"", *known}
            text = f"one with {topic.stamp.of}, whose stamp {topic.name} passes on, among its reads"
            self._insist(is_known, text)
        for i, topic in enumerate(self.replaced):
            is_like = i < len(self.writes) and self.writes[i].kind is topic.kind
            place = "first" if i == 0 else f"at position {i + 1}"
            text = f"one that reads {topic.name} and writes a topic of the same type {place}"
            self._insist(topic.name in known and is_like, text)
        if self.reads or self.writes:
            text = "one with a step(parameters, state, signals, dt) or a make"
            self._insist(callable(self.step) is not callable(self.make), text)
        self._check_parts()
        names = {spec.name for spec in specs(self.parameters)}
        has_joints = any(topic.kind.has_joints for topic in (*self.reads, *self.writes))
        text = "one whose parameters inherit RobotParameters, because it has topics with joints"
        self._insist("robot" in names or not has_joints, text)

    def _check_parts(self) -> None:
        """Refuse parts that do not have the required form."""
        is_group = isinstance(self.parameters, type) and is_dataclass(self.parameters)
        self._insist(is_group, "one whose parameters are a dataclass, not an instance of one")
        if self.step is not None:
            takes = "one whose step takes four arguments, step(parameters, state, signals, dt)"
            try:
                signature(getattr(self.step, "py_func", self.step)).bind(*range(4))
            except TypeError as error:
                raise PartError("stage", self.name, f"{takes} ({error})") from error
        for word, fields in (("state", self.remembered(1)), ("notes", self.notes)):
            try:
                np.dtype(list(fields))
            except (TypeError, ValueError) as error:
                text = f"one whose {word} is a list of fields as numpy.dtype takes it ({error})"
                raise PartError("stage", self.name, text) from error

    def remembered(self, joints: int) -> list[Field]:
        """Fields of the stage's state, for a robot with this many joints."""
        if isinstance(self.state, type):
            return fields_of(self.state, joints)
        return list(self.state)

    def _insist(self, is_so: bool, expected: str) -> None:
        if not is_so:
            raise PartError("stage", self.name, expected)

    def __repr__(self) -> str:
        return f"Stage({self.name!r})"

    @property
    def replaced(self) -> tuple[Topic, ...]:
        """Topics that ``writes`` replaces for all other readers, in the order of ``writes``."""
        if self.replaces is None:
            return ()
        return self.replaces if isinstance(self.replaces, tuple) else (self.replaces,)

    @property
    def ports(self) -> tuple[Topic, ...]:
        """All topics of the stage's record."""
        return tuple(dict.fromkeys((*self.reads, *self.writes)))

    def run(self, parameters: Any, dt: float = DT) -> Runner:
        """Make the object that runs this stage in a session.

        Args:
            parameters: An instance of the stage's parameter group.
            dt: Length of a tick [s].
        """
        if self.make is not None:
            return self.make(parameters, dt)
        return _Plain(self, parameters, dt)


def joints_of(parameters: Any) -> tuple[str, ...]:
    """Joint names of the robot that a stage's parameters name; empty without a robot."""
    return tuple(getattr(parameters, "joint_names", ()))


class RunningStage:
    """Base of :class:`Runner` classes: a record of signals and a kernel bound to its arguments.

    Args:
        stage: The stage that it runs.
        joints: Number of joints of the arm; 0 without joints.
        dt: Length of a tick [s].
    """

    def __init__(self, stage: Stage, joints: int, dt: float) -> None:
        self.stage, self.dt = stage, dt
        self.signals: Any = make_signals(stage.ports, joints, (*stage.notes, ("answered_ns", "i8")))[0]
        self.kernel: Callable[..., None] = _nothing
        self.arguments: tuple[Any, ...] = ()
        self.ahead, self.changes_itself = 1000, False
        self._bound: Callable[[], object] | None = None

    @property
    def lead(self) -> int:
        """Number of ticks before the stage can follow commands; 0 by default."""
        return 0

    def prepare(self, ticks: int) -> None:
        """Prepare the next ``ticks`` steps; does nothing by default."""

    def reset(self) -> None:
        """Reset the stage to its state before the first step."""

    def retune(self, parameters: Any) -> None:
        """Use new parameters from the next step on."""

    def examine(self, parameters: Any) -> None:
        """Try parameters before :meth:`retune`; does nothing by default."""

    def present(self) -> Any:
        """Present parameters of a stage that changes them by itself."""
        raise NotImplementedError

    def fall_silent(self) -> None:
        """Make outputs safe when the topic that the stage answers has fallen silent; does nothing by default."""

    def concerns(self) -> list[str]:
        """Sentences for users about current problems of the stage; none by default."""
        return []

    def described(self) -> dict[str, str]:
        """Names and texts that the report contains in addition to its numbers; none by default."""
        return {}

    def step(self) -> None:
        """Make one step."""
        self.prepare(1)
        (self._bound or self.load())()
        raise_pending()

    def load(self) -> Callable[[], object]:
        """Compile the kernel or load it from disk, which takes longer than many ticks."""
        if self._bound is None:
            self._bound = held(self.kernel, *self.arguments, self.signals, self.dt)
        return self._bound


def _nothing() -> None:
    """Do nothing: placeholder for the kernel of a stage that is being made."""


class _Plain(RunningStage):
    """Runner of a stage with a ``step``: parameters become fields of a record, and the state starts at zero."""

    def __init__(self, stage: Stage, parameters: Any, dt: float) -> None:
        joints = len(joints_of(parameters))
        super().__init__(stage, joints, dt)
        assert stage.step is not None
        self.kernel = stage.step
        declared = group_fields(type(parameters), parameters)
        self._parameters = records(declared or [("none", "i8")])[0]
        self._state = records(stage.remembered(joints) or [("none", "i8")])[0]
        self.arguments = (self._parameters, self._state)
        self._begin = self.signals.copy()
        self.retune(parameters)
        self._try()

    def _try(self) -> None:
        """Make one step of a compiled kernel in plain Python, on copies, because plain Python checks indices.

        Raises:
            PartError: The kernel reaches beyond the end of an array.
        """
        plain = getattr(self.kernel, "py_func", None)
        if plain is None:
            return
        copies = [records(record.dtype) for record in (*self.arguments, self.signals)]
        for copy, record in zip(copies, (*self.arguments, self.signals), strict=True):
            copy[0] = record
        try:
            with np.errstate(all="ignore"):  # because compiled code continues with infinity
                plain(*(copy[0] for copy in copies), self.dt)
        except IndexError as error:
            place = traceback.extract_tb(error.__traceback__)[-1]
            where = f"{Path(place.filename).name}:{place.lineno}"
            text = f"one that stays inside its arrays; {error} ({where})"
            raise PartError("stage", self.stage.name, text) from error
        except Exception:  # kernels that call inner kernels run only compiled
            return

    def reset(self) -> None:
        """Reset state and signals to their values before the first step."""
        assign(self._state, 0)
        assign(self.signals, self._begin)

    def retune(self, parameters: Any) -> None:
        """Use new parameters."""
        fill(self._parameters, parameters)


def _checked(name: str, part: object) -> Stage:
    if not isinstance(part, Stage):
        raise PartError("stage", name, f"a Stage, not a {type(part).__name__}")
    if part.name != name:
        raise PartError("stage", name, f"registered under its own name, {part.name!r}")
    return part


STAGES: Registry[Stage] = Registry(
    "stage",
    "stages",
    {
        "operator": "teleop_core.hand.master.operator:OPERATOR",
        "haptic_master": "teleop_core.hand.master.haptic_master:HAPTIC_MASTER",
        "master_bridge": "teleop_core.hand.master.master_bridge:MASTER_BRIDGE",
        "tremor_filter": "teleop_core.coupling.filters.tremor_filter:TREMOR_FILTER",
        "motion_scaling": "teleop_core.coupling.mapping.motion_scaling:MOTION_SCALING",
        "network": "teleop_core.coupling.network.network:NETWORK",
        "passivity": "teleop_core.coupling.passivity.slave_side:PASSIVITY",
        "impedance": "teleop_core.coupling.architectures.impedance:IMPEDANCE",
        "remote_centre": "teleop_core.coupling.fixtures.remote_centre:REMOTE_CENTRE_STAGE",
        "inverse_kinematics": "teleop_core.coupling.mapping.inverse_kinematics:INVERSE_KINEMATICS",
        "slave": "teleop_core.slave.slave:SLAVE",
        "slave_sim": "teleop_core.slave.slave_sim:SLAVE_SIM",
        "display": "teleop_core.hand.master.display:DISPLAY",
        "task": "teleop_core.hand.tasks.task:TASK",
        "arm_bridge": "teleop_core.slave.bridges.arm_bridge:ARM_BRIDGE",
        "jaw_command": "teleop_core.coupling.mapping.jaw_command:JAW_COMMAND",
        "jaw": "teleop_core.slave.jaw.jaw:JAW_STAGE",
        "jaw_sim": "teleop_core.slave.jaw.jaw_sim:JAW_SIM",
        "jaw_bridge": "teleop_core.slave.bridges.jaw_bridge:JAW_BRIDGE",
        "recorder": "teleop_core.bags.recording:RECORDER",
        "frames": "teleop_core.bags.recording:FRAMES",
    },
    _checked,
)
"""All stages by name, in the order in which data pass through the built-in stages."""

register_stage = STAGES.register
"""Adds your stage under its own name; see :meth:`Registry.register`."""
