"""Parts of one's own that cannot work: each is refused in one line, by its kind and name, before anything runs."""

import re
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, NamedTuple

import numpy as np
import pytest

import teleop_core as tc
from teleop_console.controls import CONTROLS, Control
from teleop_core.base import NoParameters, PartError, Within, parameter
from teleop_core.graph import BUILT_IN, STAGES, Graph, Stage, topics
from teleop_core.graph.graph import Delay
from teleop_core.graph.topics import SLAVE_MEASURED_CP, SLAVE_SERVO_CP, TASK_STATE, Kind, Topic, passed_on
from teleop_core.hand.operators import Operator, following, register_operator
from teleop_core.hand.tasks import Task, register_task
from teleop_core.kernels import kernel
from teleop_core.shapes import register_shape, sphere
from teleop_core.slave.controllers import register_controller
from teleop_core.slave.controllers.pid import PID

Make = Callable[[], object]


class Case(NamedTuple):
    """How a part is made and registered, its kind and name in the error, and words of what it must be."""

    make: Make
    kind: str
    name: Any
    words: str


# -- stages and graphs -----------------------------------------------------------------------------

BASE = tuple(STAGES.find(name) for name in BUILT_IN)
ECHO, OTHER = Topic("test/echo", Kind.POSE, passed_on("slave/measured_cp")), Topic("test/x", Kind.POSE)
COMMAND = Topic("test/x", Kind.POSE, passed_on("slave/servo_cp"))
FORTH = Topic("test/forth", Kind.POSE, passed_on("test/back"))
BACK = Topic("test/back", Kind.POSE, passed_on("test/forth"))


def stage(name: str = "echo", group: Any = NoParameters, reads: Any = (SLAVE_MEASURED_CP,), **more: Any) -> Stage:
    return Stage(name, group, reads, **{"writes": (ECHO,), "step": lambda p, s, row, dt: None, **more})


@kernel
def beyond_the_end(p: Any, s: Any, row: Any, dt: Any) -> None:
    for i in range(8):
        row.test_echo[i] = row.slave_measured_cp[i]


LINE = beyond_the_end.py_func.__code__.co_firstlineno + 3
CIRCLE = (stage("forth", reads=(BACK,), writes=(FORTH,)), stage("back", reads=(FORTH,), writes=(BACK,)))
FORCE: dict[str, Any] = {"reads": (topics.MASTER_SERVO_CF,), "writes": (OTHER,), "replaces": topics.MASTER_SERVO_CF}
GRAPHS = [
    Case(partial(Graph, stages), "stage", name, words) for stages, name, words in (
        ((*BASE, stage(reads=(SLAVE_MEASURED_CP, OTHER))), "echo", "test/x, but no stage writes it"),
        ((*BASE, BASE[4]), "slave", "two of them have this name"),
        ((*BASE, stage("a"), stage("b")), "b", "the only one that writes test/echo; a writes it too"),
        ((*BASE, stage(writes=(), notes=(("command_status", "i8"),))), "echo", "slave uses"),
        ((*BASE, *CIRCLE), "forth", "forth, back wait"))
] + [
    Case(partial(Graph, BASE, arms), "arm", name, words) for arms, name, words in (
        (("left", "left"), "left", "two of them have this name"), (("", "left arm"), "left arm", "letters"),
        (("right", ""), "", "letters"), (("right", "2nd"), "2nd", "letters"))
] + [
    Case(partial(Graph, BASE, delays=(Delay("slave/servo_jp", 0.02, "motion_scaling"),)), "delayed stage",
         "motion_scaling", "reads slave/servo_jp"),
]  # fmt: skip
STAGE_CASES = [
    Case(partial(stage, **values), "stage", "echo", words) for values, words in (
        ({"replaces": SLAVE_SERVO_CP}, "reads slave/servo_cp"), (FORCE, "writes a topic of the same type"),
        ({"late": (SLAVE_SERVO_CP,)}, r"slave/servo_cp \(late\)"),
        ({"needs": (SLAVE_SERVO_CP,)}, r"slave/servo_cp \(needs\)"), ({"trigger": SLAVE_SERVO_CP}, "slave/servo_cp"),
        ({"writes": (COMMAND,)}, "slave/servo_cp"), ({"spares": "operator"}, "spares is a tuple of names"),
        *((more, "with a step") for more in ({"step": None}, {"make": lambda p, dt: None})),
        ({"step": lambda p, s, row: None}, "four arguments"),
        ({"reads": (topics.SLAVE_MEASURED_JS,), "writes": ()}, "Robot"), ({"state": (("a", "nothing"),)}, "state"),
        ({"group": dict}, "dataclass"),
        *(({word: value}, rf"{word} is a tuple of Topic, such as \(topics\.") for word in (
            "reads", "writes", "late", "needs") for value in (
            SLAVE_SERVO_CP, "slave/servo_cp", ("slave/servo_cp",), [SLAVE_SERVO_CP], None)))
] + [
    Case(lambda: stage(step=beyond_the_end).run(NoParameters()), "stage", "echo",
         rf"stays inside its arrays; index 7 is .*\.py:{LINE}\)$"),
    *(Case(partial(stage, name), "stage", name, "a name of letters, digits and _")
      for name in ("", "my-limit", "my limit", "2nd", "a.b")),
]  # fmt: skip

# -- operators and tasks ---------------------------------------------------------------------------

MINE = partial(following, "mine")
AT = {name: i for i, name in enumerate(TASK_STATE.columns)}
ATTEMPTS, WIDTH, TIME, ERRORS = (AT[name] for name in ("attempts", "width", "time", "errors"))


def stepped(operator: Any) -> None:
    """Register an operator, and let it move."""
    register_operator("mine", operator)
    tc.VirtualTime(tc.configuration("free_motion", operator="mine")).run(1)


def put_together(**parts: Any) -> None:
    still = lambda parameters, setting: lambda times: np.zeros((len(times), 3))  # noqa: E731
    stepped(Operator("mine", **{"make": still, **parts}))


def endless(numbers: Any, memory: Any, scene: Any, state: Any) -> None:
    state[0], state[WIDTH] = 1.0, 0.01


def always_late(numbers: Any, memory: Any, scene: Any, state: Any) -> None:
    state[0] += 1.0
    state[WIDTH], state[ATTEMPTS], state[ERRORS] = 0.01, state[0], state[0]


@kernel
def beyond(numbers, memory, scene, state):  # type: ignore[no-untyped-def]
    state[0], state[ATTEMPTS], state[WIDTH], state[TIME] = 1.0, 1.0, 0.01, numbers[7]


MOTIONS: list[tuple[Any, str]] = [
    (lambda: np.zeros((1, 3)), "TypeError"), (lambda times: np.zeros((len(times), 4)), r"not \(1000, 4\)"),
    (lambda times: np.zeros(3), r"not \(3,\)"), (lambda times: np.full((len(times), 3), np.nan), "at 0.001 s"),
    (lambda times: "up", "numbers"), (lambda times: AT["up"], "KeyError"),
]  # fmt: skip
WRONG_MOTIONS: list[tuple[Make, str]] = [
    (partial(MINE, np.zeros(0), np.zeros((0, 3))), r"not \(0,\), \(0, 3\)"),
    (partial(MINE, np.arange(3), np.zeros((2, 3))), r"not \(3,\), \(2, 3\)"),
    (partial(MINE, np.arange(3), np.zeros(3)), r"not \(3,\), \(3,\)"),
    (partial(MINE, np.arange(3), np.zeros((3, 4))), "it has 4"),
    (partial(MINE, np.arange(2), np.array([[0, 0, 0], [0, np.nan, 0]])), "row 1"),
    (partial(MINE, np.array([0.0, np.nan]), np.zeros((2, 3))), "row 1"),
    (partial(MINE, np.array([0.0, 1.0, 1.0]), np.zeros((3, 3))), "row 2"),
    *((partial(stepped, motion), words) for motion, words in MOTIONS),
    (partial(put_together, make=5), "callable make"),
    (partial(put_together, make=lambda parameters: None), r"make\(parameters, setting\)"),
    (partial(put_together, ahead=0), ">= 1 tick"), (partial(put_together, parameters=dict), "dataclass"),
]  # fmt: skip
HANDS = [
    *(Case(make, "operator", "mine", words) for make, words in WRONG_MOTIONS),
    *(Case(partial(register_task, Task(name, NoParameters, judge, **more)), "task", name, words)
      for name, judge, more, words in (
        ("endless", endless, {}, "in ten minutes at its goals it counts no attempt"),
        ("always_late", always_late, {}, r"in ten minutes at its goals it counts \d+ attempts without one"),
        # Sound numbers follow those of its own.
        ("beyond", beyond, {"numbers": lambda _: np.zeros(8)[:0]}, "one that writes 22 finite numbers"))),
]  # fmt: skip

# -- groups of parameters, and names ---------------------------------------------------------------


@dataclass(frozen=True, kw_only=True)
class TooFast:
    speed: float = parameter(2.0, Within(0.0, 1.0, "m/s"), "of the tool")


def own(kind: str, group: Any) -> Make:
    """A part with a group of parameters."""
    ways: dict[str, Callable[[], object]] = {
        "shape": lambda: register_shape(replace(sphere.SPHERE, name="own", parameters=group)),
        "controller": lambda: register_controller(replace(PID, name="own", parameters=group)),
        "operator": lambda: register_operator("own", Operator("own", lambda p, s: None, group)),  # type: ignore[arg-type, return-value]
        "stage": lambda: stage("own", group),
    }
    return ways[kind]


LAWS: list[Any] = [
    lambda n, m, f, a, t, out: out.fill(np.nan),
    lambda n, m, f, out: None,
    lambda n, m, f, a, t, out: m.base[12:].fill(0.0),  # behind what it may remember
    lambda n, m, f, a, t, out: out.base[3:].fill(0.0),  # behind what it may write
]
GROUPS = [
    *(Case(own(kind, group), kind, "own", "one whose parameters are a dataclas")
      for kind in ("shape", "controller", "operator", "stage") for group in (NoParameters(), TooFast(), dict)),
    *(Case(lambda name=name: register_shape(replace(sphere.SPHERE, name=name)), "shape", name,  # type: ignore[misc]
           "named with letters, digits, _ and -") for name in ("", "my fixture", "a.b", "a/b", "-a", "a=b", None, 5)),
    *(Case(partial(CONTROLS.add, "x", part), "control", "x", "")
      for part in (len, Control("x", "", None), Control("x", "", len, "", 3))),  # type: ignore[arg-type]
    *(Case(partial(tc.register_architecture, tc.Architecture("wrong", NoParameters, law)), "architecture", "wrong", "")
      for law in LAWS),
]  # fmt: skip


@pytest.mark.usefixtures("own_parts")
@pytest.mark.parametrize("case", GRAPHS + STAGE_CASES + HANDS + GROUPS, ids=lambda case: f"{case.kind} {case.words}")
def test_a_part_that_cannot_work_is_refused_by_kind_and_name_in_one_line(case: Case) -> None:
    with pytest.raises(PartError) as refused:
        case.make()
    assert (refused.value.kind, refused.value.name) == (case.kind, case.name)
    assert re.search(case.words, str(refused.value)), refused.value
    assert "\n" not in str(refused.value)
