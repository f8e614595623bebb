"""Settings of the page: what a control shows is what the parameter is, there and back."""

from collections.abc import Iterator
from typing import Any

import pytest

from desk import Desk
from page_client import TOKEN
from teleop_console.inputs import KINDS, LATER, Input, kind_of, parsed, shown, text
from teleop_console.link import ParameterInfo
from teleop_console.server import ConsoleServer
from teleop_console.settings import SettingsPanel
from teleop_core.base.parameters import specs, values_of
from teleop_core.base.plain_yaml import parse
from teleop_core.graph.layers import declared_groups

MODE, GAIN = ("motion_scaling", "mode"), ("motion_scaling", "fine_gain")
EVERY: list[tuple[str, str, Any]] = [
    (name, spec.name, values_of(group())[spec.name])
    for name, group in declared_groups().items()
    for spec in specs(group)
    if spec.name in values_of(group())
]


@pytest.fixture(scope="module")
def _server() -> Iterator[Any]:
    with ConsoleServer(0, token=TOKEN) as opened:
        yield opened.viser


@pytest.fixture
def viser(_server: Any) -> Any:
    """Server of a page on which nothing stands."""
    _server.gui.reset()
    return _server


def panel(viser: Any, known: dict[tuple[str, str], ParameterInfo], *, may: bool = True) -> tuple[SettingsPanel, Any]:
    """Settings of a session with these parameters, and its desk; whoever looks may change them or not."""
    desk: Any = Desk()
    desk.known = known
    settings = SettingsPanel(viser, desk, lambda _: may)
    settings.refresh()
    return settings, desk


def inputs(viser: Any) -> dict[str, Any]:
    """Inputs on the page by their labels."""
    return {handle.label: handle for handle in viser.gui._gui_input_handle_from_uuid.values()}


@pytest.mark.parametrize(
    ("said", "present", "wanted"),
    [
        ("[0.1, 2]", (1.0,), (0.1, 2.0)), ("0.1, 2", (1.0,), (0.1, 2.0)), ("3", (1.0,), (3.0,)),
        ("[a, b]", (), ("a", "b")), ("['a=0.1']", ("b",), ("a=0.1",)), ("[]", (1.0,), ()),
        ("[a]", (1.0,), None), (3, 2, 3), (3, 2.0, 3.0), (True, False, True),
    ],
)  # fmt: skip
def test_lists_are_read_as_people_write_them(
    said: str | int | bool, present: Any, wanted: float | bool | tuple[str | float, ...] | None
) -> None:
    assert parsed(said, ParameterInfo("node", "name", present)) == wanted


@pytest.mark.parametrize("value", [(0.1, 2.0), ("a=0.1", "b"), ("ball at=[0, 1]", "box"), (), True, 3, 0.25, "hold"])
def test_a_setting_text_is_read_by_the_session_as_the_value(value: Any) -> None:
    found = parse(text(value)) if not isinstance(value, bool) else {"True": True}[text(value)]
    assert (tuple(found) if isinstance(found, list) else found) == value


@pytest.mark.parametrize(
    ("doc", "unit"),
    [
        ("delay of a link [s]", " [s]"),
        ("one of [a, b] things", ""),
        ("no unit", ""),
        ("", ""),
        ("weight [kg m] or length [m]", " [m]"),
    ],
)
def test_a_label_has_the_unit_that_ends_the_meaning(viser: Any, doc: str, unit: str) -> None:
    control = Input(viser.gui, "x", ParameterInfo("slave", "x", 1.0, doc))
    assert control.parts[0].label == f"x{unit}"


def test_every_parameter_has_an_input_of_its_kind_which_shows_its_value_and_reads_it_as_itself(viser: Any) -> None:
    bounds = {(n, s.name): s for n, group in declared_groups().items() for s in specs(group)}
    used = set()
    for node, name, value in EVERY:
        spec = bounds[node, name]
        info = ParameterInfo(node, name, value, spec.doc, spec.lowest, spec.upper, spec.choices, spec.fixed)
        read = parsed(shown(value), info)
        assert read == value or read == pytest.approx(value), name
        control = Input(viser.gui, name, info)
        assert control.value == value or control.value == pytest.approx(value), name
        assert control.show(value)
        assert control.kind == "vector" or (LATER in control.parts[0].label) == spec.fixed
        used.add(control.kind)
        control.remove()
    assert used == set(KINDS)


@pytest.mark.parametrize(
    ("value", "more", "kind", "element"),
    [
        (True, {}, "switch", "GuiCheckboxHandle"),
        ("coarse", {"choices": ("coarse", "fine")}, "choice", "GuiDropdownHandle"),
        (3, {"lower": 1.0, "upper": 9.0}, "whole number", "GuiNumberHandle"),
        (0.5, {"lower": 0.0, "upper": 2.0}, "slider", "GuiSliderHandle"),
        (0.5, {"lower": 0.0}, "number", "GuiNumberHandle"),
        (0.5, {"lower": 0.0, "upper": 1e6}, "number", "GuiNumberHandle"),  # no hand finds 0.5 there
        ((0.1, 0.2, 0.3), {}, "vector", "GuiNumberHandle"),
        (tuple([0.1] * 8), {}, "text", "GuiTextHandle"),
        (("a", "b"), {}, "text", "GuiTextHandle"),
        ("bags/run_1", {}, "text", "GuiTextHandle"),
    ],
)
def test_seven_kinds_of_values_have_seven_kinds_of_inputs(
    viser: Any, value: Any, more: Any, kind: str, element: str
) -> None:
    info = ParameterInfo("elsewhere", "x", value, **more)
    control = Input(viser.gui, "x", info)
    assert kind_of(info) == control.kind == kind
    assert {type(part).__name__ for part in control.parts} == {element}
    assert control.value == value


def test_numbers_of_a_vector_have_the_names_of_axes_or_joints_and_are_set_one_by_one(viser: Any) -> None:
    joints = Desk().arms[0].robot.joint_names
    place, gains = ("slave_sim", "world.place"), ("slave_sim", "own.gains")
    settings, desk = panel(
        viser,
        {
            place: ParameterInfo(*place, (0.1, 0.2, 0.3), "place [m]"),
            gains: ParameterInfo(*gains, (1.0,) * len(joints)),
        },
    )
    search: Any = settings._search
    search.value = "slave_sim"
    settings._show()
    assert [part.label for part in settings._by_key[place].parts] == ["x", "y", "z"]
    assert [part.label for part in settings._by_key[gains].parts] == list(joints)
    y: Any = settings._by_key[place].parts[1]
    y.value = 0.5
    settings._changed(0, settings._by_key[place], settings._failed, desk.known[place])
    assert settings.known[place].value == (0.1, 0.5, 0.3)
    settings.follow({place: (1.0, 2.0, 3.0)})
    assert [part.value for part in settings._by_key[place].parts] == [1.0, 2.0, 3.0]
    settings.follow({place: ()})  # which has no fields
    assert settings._by_key[place].kind == "text"


def test_value_that_a_button_of_the_stylus_changed_is_shown_as_it_is_and_can_be_set_back(viser: Any) -> None:
    settings, _ = panel(
        viser, {MODE: ParameterInfo(*MODE, "coarse", choices=("coarse", "fine")), GAIN: ParameterInfo(*GAIN, 0.1)}
    )
    heard: list[Any] = []
    settings.on_change(heard.append)
    settings.follow({MODE: "fine", ("elsewhere", "mode"): "coarse"})
    assert inputs(viser)["mode"].value == settings.known[MODE].value == "fine"
    assert inputs(viser)["fine_gain"].value == 0.1
    assert heard == [settings.known]


def test_search_finds_words_of_stage_name_and_meaning_and_changed_only_what_is_no_default(viser: Any) -> None:
    filtered = ("slave", "reference_filter.is_on")
    known = {
        MODE: ParameterInfo(*MODE, "coarse", "which gain holds", choices=("coarse", "fine")),
        GAIN: ParameterInfo(*GAIN, 0.25, "ratio of the fine mode [m/m]"),
        filtered: ParameterInfo(*filtered, True, "whether setpoints are smoothed"),
    }
    settings, desk = panel(viser, known)
    search, changed = (inputs(viser)[name] for name in ("search", "changed only"))
    for said, found in (
        ("", [MODE, GAIN, filtered]),
        ("SCALING gain", [MODE, GAIN]),
        ("m/m", [GAIN]),
        ("smoothed", [filtered]),
        ("nothing like it", []),
    ):
        search.value = said
        assert settings.keys() == found, said
    search.value = ""
    changed.value = True
    assert settings.keys() == [GAIN]  # 0.1 by default
    settings._reset(0)
    assert desk.asked == ["fine_gain"]
    assert settings.known[GAIN].value == 0.1
    assert settings.keys() == []


def test_who_watches_resets_nothing(viser: Any) -> None:
    settings, desk = panel(viser, {GAIN: ParameterInfo(*GAIN, 0.25)}, may=False)
    settings._reset(1)
    assert desk.asked == []
    assert settings.known[GAIN].value == 0.25
