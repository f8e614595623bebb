"""Mistakes in parts of one's own: one line each, which names the part and what was expected."""

import os
import subprocess
import sys
import warnings
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import pytest

from teleop_core.base import NoParameters, ParameterError, PartError, Within, build, parameter, specs
from teleop_core.graph import Stage, register_stage
from teleop_core.graph.topics import SLAVE_MEASURED_CP, Kind, Topic, passed_on
from teleop_core.kernels import IS_COMPILED, kernel, records
from teleop_core.session.configuration import configure
from teleop_core.shapes import register_shape, sphere

ECHO = Topic("test/echo", Kind.POSE, passed_on("slave/measured_cp"))


def rest(parameters: Any, state: Any, signals: Any, dt: Any) -> None:
    """Step of a stage that does nothing."""


def stage(
    name: str = "echo",
    parameters: Any = NoParameters,
    step: Callable[..., Any] = rest,
    reads: tuple[Topic] = (SLAVE_MEASURED_CP,),
    **more: Any,
) -> Stage:
    return Stage(name, parameters, reads, (ECHO,), step=step, **more)


# Parameter groups.


@dataclass(frozen=True, kw_only=True)
class TooFast:
    speed: float = parameter(2.0, Within(0.0, 1.0, "m/s"), "of the tool")


@dataclass(frozen=True, kw_only=True)
class Whole:
    speed: float = parameter(1, Within(unit="m/s"), "of the tool")


@dataclass(frozen=True, kw_only=True)
class OutOfChoice:
    side: str = parameter("middle", choices=("left", "right"), doc="where")


@dataclass(frozen=True, kw_only=True)
class Unmade:
    speed: float = 1.0


WRONG_GROUPS = {
    TooFast: (ParameterError, "^speed is 2.0, must be between 0 and 1 m/s$"),
    Whole: (ParameterError, r"^speed is 1, must be of type float \(write 1.0, not 1\)$"),
    OutOfChoice: (ParameterError, "^side is 'middle', must be one of: left, right$"),
    Unmade: (PartError, r"'Unmade' must be .* made by parameter\(\.\.\.\); speed is not$"),
}


@pytest.mark.parametrize("group", WRONG_GROUPS)
def test_wrong_declaration_of_a_parameter_is_refused_before_it_is_used(group: type[object]) -> None:
    kind, told = WRONG_GROUPS[group]
    for way in (lambda: list(specs(group)), lambda: build(group, {}), lambda: stage("own", group)):
        with pytest.raises(kind, match=told):
            way()


# Names.


@pytest.mark.parametrize("name", ["my_2nd", "my-cone", "Kegel", "größe"])
def test_name_of_letters_digits_underscores_and_hyphens_is_taken(own_parts: None, name: str) -> None:
    assert register_shape(replace(sphere.SPHERE, name=name)).name == name


# Topics of a stage.


# Fields of a record.


def test_misspelt_field_of_a_plain_record_suggests_the_near_one() -> None:
    row = records([("gain", "f8"), ("place", "f8", (3,))])[0]
    told = r"^record has no field 'gian'; did you mean 'gain'\? \(fields: gain, place\)$"
    with pytest.raises(AttributeError, match=told):
        row.gian  # noqa: B018
    with pytest.raises(AttributeError, match=told):
        row.gian = 1.0
    with pytest.raises(AttributeError, match=r"^record has no field 'xyz' \(fields: gain, place\)$"):
        row.xyz  # noqa: B018


# Indices.


@kernel
def counts(p: Any, s: Any, row: Any, dt: Any) -> None:
    s.count += 1
    row.test_echo[0] = 1.0 / row.test_echo[1] + s.count


def test_trial_of_a_step_leaves_no_trace() -> None:
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        runner = stage(step=counts, state=(("count", "i8"),)).run(NoParameters())
    assert told == []
    assert runner.arguments[1]["count"] == 0
    assert runner.signals["test_echo"].tolist() == [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0]


LATER = """
from teleop_core.kernels import kernel
from teleop_core.base.parameters import NoParameters
from teleop_core.graph.stage import Stage
from teleop_core.graph.topics import SLAVE_MEASURED_CP


@kernel
def step(p, s, row, dt):
    s.count += 1
    s.held = row.slave_measured_cp[5 + s.count]


runner = Stage(
    "later", NoParameters, (SLAVE_MEASURED_CP,), (), step=step,
    state=(("count", "i8"), ("held", "f8")),
).run(NoParameters())
for _ in range(3):
    runner.step()
"""


@pytest.mark.skipif(not IS_COMPILED, reason="plain Python always checks")
def test_index_that_goes_wrong_later_is_found_with_checks_compiled_in(tmp_path: Path) -> None:
    (tmp_path / "later.py").write_text(LATER)
    errors = []
    for checks in ("0", "1", "0"):  # each finds its own kernels on the disk
        done = subprocess.run(
            [sys.executable, "later.py"], cwd=tmp_path, capture_output=True, text=True, check=False,
            env=os.environ | {"NUMBA_BOUNDSCHECK": checks},
        )  # fmt: skip
        errors.append(done.stderr.strip().splitlines()[-1:])
    assert errors[0] == errors[2] == []
    assert "IndexError" in errors[1][0]


# Sessions and metrics.


def test_parameter_of_a_stage_that_the_session_has_not_is_refused_with_the_way_out(own_parts: None) -> None:
    @dataclass(frozen=True, kw_only=True)
    class Limit:
        speed: float = parameter(0.1, Within(unit="m/s"), "of the tool")

    register_stage(stage("limit", Limit))
    told = r"limit\.speed is .*0\.5.*, must be left out: this session has no stage limit; add stag"
    with pytest.raises(ParameterError, match=told):
        configure(settings=["limit.speed=0.5"])
    assert configure(settings=["teleop.stages=[limit]", "limit.speed=0.5"]).value("speed") == 0.5


# Tasks.
