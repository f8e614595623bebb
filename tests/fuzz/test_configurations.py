"""Parameter files, settings and what recordings store of them, broken in many ways."""

from typing import Any

import numpy as np
import pytest
from hypothesis import strategies as st

from fuzzing import NASTY, TEXTS, assert_one_line, damaged, fuzz
from teleop_core.bags import memory, reports
from teleop_core.bags.series import Series
from teleop_core.base import specs
from teleop_core.base.plain_yaml import UnreadableError, parse
from teleop_core.evaluation.origin import read_origin
from teleop_core.graph import layers, topics
from teleop_core.session.configuration import Configuration, configure
from teleop_core.session.runner import recorded_configuration

BASE = layers.load_file(layers.config_folder() / "teleop.yaml")
KEYS = [
    key
    for stage, group in layers.declared_groups().items()
    for spec in specs(group)
    for key in (f"{stage}.{spec.name}", spec.name)
]
FILES = [path.read_bytes() for path in map(layers.scenario_file, layers.list_scenarios())]
STORED = b"\n".join(
    line
    for line in configure("coarse_box").text().encode().splitlines()
    if not line.startswith(b"    ") or b"." not in line.partition(b":")[0]
)
"""What recordings store, less the parameters of parts, which are many."""
ANY_KEY = st.one_of(
    st.sampled_from(KEYS),
    st.text(max_size=12),
    st.sampled_from((*NASTY, "robot", "fixture", "operator", "left/slave_sim.robot", "a/b/c", "/")),
)


@pytest.mark.slow
@fuzz("settings", key=ANY_KEY, value=TEXTS, equals=st.sampled_from(("=", "=", "=", "==", "", " = ")))
def test_any_setting_is_taken_or_refused(key: Any, value: Any, equals: Any) -> None:
    layer = layers.parse_setting(key + equals + value)
    Configuration.from_layers([BASE, layer])


ENTRIES = st.dictionaries(ANY_KEY, st.one_of(TEXTS, st.sampled_from(NASTY)), max_size=4)
STAGES = st.one_of(st.sampled_from((*layers.declared_groups(), "/**/slave_sim", "left/slave_sim")), TEXTS)


@st.composite
def parameter_files(draw: st.DrawFn) -> bytes:
    """A scenario with bytes or values that are not meant, or a file made of such values."""
    kind = draw(st.sampled_from(("bytes", "bytes", "values", "text")))
    if kind == "bytes":
        return draw(damaged(draw(st.sampled_from(FILES))))
    if kind == "text":
        return draw(st.one_of(st.binary(max_size=60), TEXTS.map(_encoded)))
    lines = []
    for stage in draw(st.lists(STAGES, max_size=3)):
        lines += [f"{stage}:", "  ros__parameters:"]
        lines += [f"    {key}: {value}" for key, value in draw(ENTRIES).items()]
    return _encoded("\n".join(lines))


def _encoded(text: str) -> bytes:
    return text.encode("utf-8", "surrogatepass")


@fuzz("configurations", content=parameter_files())
def test_any_parameter_file_is_taken_or_refused(tmp_path_factory: pytest.TempPathFactory, content: bytes) -> None:
    path = tmp_path_factory.getbasetemp() / "parameters.yaml"
    path.write_bytes(content)
    Configuration.from_layers([BASE, layers.load_file(path)])


def bag_with(configuration: str) -> memory.MemoryBag:
    stamps = np.arange(1, 3)
    series = Series(stamps, stamps, np.zeros((2, topics.MASTER_BUTTONS.width(0))))
    state = [(1, reports.report(1, "teleop", 0, "", {}))]
    about = {"configuration": configuration}
    return memory.MemoryBag("bag", {topics.MASTER_BUTTONS: series}, {topics.TELEOP_STATE: state}, about)


@fuzz("stored configurations", content=st.one_of(damaged(STORED), TEXTS.map(_encoded)))
def test_any_stored_configuration_can_be_scored_and_is_replayed_or_refused(content: bytes) -> None:
    bag = bag_with(content.decode("utf-8", "replace"))
    read_origin(bag)
    layer, scenario = recorded_configuration(bag)
    Configuration.from_layers([layer], scenario)


REFUSED = ("!!int x", "!!timestamp 2021-13-45", "&a [*a]", "9" * 5000, "[" * 400, NASTY[-1])


@pytest.mark.parametrize("text", REFUSED, ids=lambda text: repr(text[:20]))
def test_what_no_value_can_be_is_refused_and_told_why(text: str) -> None:
    with pytest.raises(UnreadableError) as told:
        parse(text)
    assert_one_line(str(told.value))
