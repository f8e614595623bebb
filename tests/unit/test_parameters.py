"""Parameters: types, bounds, tuples, nested groups, relations, and what a refusal says."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

import pytest
from hypothesis import given
from hypothesis import strategies as st

from teleop_core.base import ParameterError, UnknownNameError, Within, build, parameter, specs, values_of


@dataclass(frozen=True, kw_only=True)
class Spring:
    stiffness: float = parameter(300.0, Within(1.0, 5000.0, "N/m"), "spring")
    rest: tuple[float, ...] = parameter((0.0, 0.0), Within(-1.0, None, "m"), "place", length=2)


@dataclass(frozen=True, kw_only=True)
class Arm:
    name: str = parameter("left", choices=("left", "right"), doc="side")
    count: int = parameter(3, Within(1), "joints", fixed=True)
    is_on: bool = parameter(False, doc="switch")
    slow: float = parameter(0.1, Within(None, 1.0), "slow gain")
    fast: float = parameter(0.5, doc="fast gain")
    tags: tuple[str, ...] = parameter((), choices=("a", "b"), doc="marks")
    spring: Spring = field(default_factory=Spring)

    def __post_init__(self) -> None:
        if self.slow > self.fast:
            raise ParameterError("slow", self.slow, f"<= fast {self.fast}")


def refusal(
    values: Mapping[str, str | float | bool | tuple[str | float, ...] | None], prefix: str = ""
) -> ParameterError:
    with pytest.raises(ParameterError) as error:
        build(Arm, values, prefix)
    return error.value


def test_nested_groups_are_reached_by_dotted_names_and_defaults_stand_where_nothing_is_said() -> None:
    assert build(Arm, {}) == Arm()
    assert build(Arm, {"spring.rest": [0.3, 0.4]}).spring.rest == (0.3, 0.4)  # lists serve as tuples
    arm = build(Arm, {"spring.stiffness": 10.0, "spring.rest": (0.1, 0.2), "count": 4})
    assert arm == Arm(count=4, spring=Spring(stiffness=10.0, rest=(0.1, 0.2)))


def test_declarations_come_in_order_with_what_the_table_and_ros_need() -> None:
    declared = {spec.name: spec for spec in specs(Arm)}
    assert list(declared) == ["name", "count", "is_on", "slow", "fast", "tags", "spring.stiffness", "spring.rest"]
    stiffness, tags = declared["spring.stiffness"], declared["tags"]
    assert (stiffness.unit, stiffness.default, stiffness.kind) == ("N/m", 300.0, float)
    assert (tags.kind, tags.element, tags.default) == (tuple, str, ())
    assert declared["count"].fixed
    assert not stiffness.fixed


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("count", 3.0),
        ("count", True),
        ("is_on", 1),
        ("slow", "0.1"),
        ("slow", None),
        ("name", 3),
        ("spring.rest", 0.5),
        ("spring.rest", (0.1, 1)),
        ("tags", "a"),
    ],
)
def test_another_type_is_refused_by_name(name: str, value: str | float | bool | tuple[float, int] | None) -> None:
    error = refusal({name: value})
    assert error.name == name
    assert "type" in error.requirement or "list" in error.requirement


@pytest.mark.parametrize("name", ["slow", "fast", "spring.stiffness"])
@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
def test_nan_and_infinity_are_refused_with_and_without_bounds(name: str, value: float) -> None:
    error = refusal({name: value})
    assert error.name == name
    assert "finite" in error.requirement


@pytest.mark.parametrize(
    ("name", "value", "needed"),
    [
        ("slow", 1, "1.0"),  # the way out
        ("spring.rest", (0.0, math.nan), "finite"),
        ("spring.rest", (), "2 values"),
        ("spring.rest", (0.1,), "2 values"),
        ("spring.rest", (0.1, 0.2, 0.3), "2 values"),
        ("spring.rest", (0.0, -1.5), "at least -1 m"),
        ("slow", 0.6, "<= fast 0.5"),
    ],
)
def test_value_that_breaks_its_declaration_is_refused_with_what_it_needs(
    name: str, value: float | tuple[float, ...], needed: str
) -> None:
    assert needed in refusal({name: value}).requirement


@given(st.one_of(st.floats(max_value=math.nextafter(1.0, 0.0)), st.floats(min_value=5000.1)))
def test_every_number_outside_the_bounds_is_refused_with_range_and_unit(value: float) -> None:
    for allowed in (1.0, 5000.0):
        assert build(Arm, {"spring.stiffness": allowed}).spring.stiffness == allowed
    error = refusal({"spring.stiffness": value})
    assert error.value == value
    assert "between 1 and 5000 N/m" in error.requirement


def test_name_that_is_no_choice_is_refused_with_the_choices() -> None:
    error = refusal({"name": "middle"})
    assert isinstance(error, UnknownNameError)
    assert error.alternatives == ("left", "right")
    assert refusal({"tags": ("a", "c")}).value == "c"  # of each element of a tuple


@pytest.mark.parametrize("name", ["nam", "spring", "spring.", "spring.stiff", "stiffness", ""])
def test_unknown_name_is_refused_with_all_names(name: str) -> None:
    error = refusal({name: 1.0})
    assert isinstance(error, UnknownNameError)
    assert "spring.stiffness" in error.alternatives


@dataclass(frozen=True)
class Loose:
    length: float = parameter(0.0, Within(unit="m"), "")
    angle: float = parameter(0.0, Within(0.0, None, "rad or m"), "")
    silence: float = parameter(0.0, Within(0.01, 9.0, "s"), "", off=0.0)


@pytest.mark.parametrize(
    ("name", "value", "needed"),
    [
        ("length", 1e9, "between -1e+07 and 1e+07 m"),
        ("length", -1e300, "between -1e+07 and 1e+07 m"),
        ("angle", 2e9, "between -1e+07 and 1e+07 rad or m"),
        ("silence", 1e-9, "0, or between 0.01 and 9 s"),
    ],
)
def test_without_bounds_of_its_own_a_number_has_those_of_its_unit(name: str, value: float, needed: str) -> None:
    with pytest.raises(ParameterError) as told:
        build(Loose, {name: value})
    assert told.value.requirement == needed


def test_what_turns_a_parameter_off_is_allowed_whatever_its_bounds() -> None:
    assert build(Loose, {"silence": 0.0}).silence == 0.0
    (spec,) = (one for one in specs(Loose) if one.name == "silence")
    assert spec.lowest == 0.0


def test_relation_is_checked_against_the_values_given_together_and_a_refusal_names_the_stage_too() -> None:
    assert build(Arm, {"slow": 0.6, "fast": 0.7}).slow == 0.6
    assert refusal({"spring.stiffness": 0.0}, "master.").name == "master.spring.stiffness"


@given(
    st.builds(
        lambda slow, more, name, rest, count: {
            "slow": slow, "fast": slow + more, "name": name, "spring.rest": rest, "count": count,
        },
        st.floats(-10.0, 1.0), st.floats(0.0, 10.0), st.sampled_from(["left", "right"]),
        st.tuples(st.floats(-1.0, 10.0), st.floats(-1.0, 10.0)), st.integers(1, 1000),
    )
)  # fmt: skip
def test_values_of_a_group_build_it_again(values: Mapping[str, str | float | tuple[float, float]]) -> None:
    arm = build(Arm, values)
    assert build(Arm, values_of(arm)) == arm


def test_field_of_a_type_that_no_parameter_can_have_is_a_programming_error() -> None:
    @dataclass(frozen=True)
    class Wrong:
        maybe: float | None = parameter(None, doc="")

    with pytest.raises(TypeError, match="maybe"):
        list(specs(Wrong))
