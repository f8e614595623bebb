"""Registry: parts by name, each name once, nothing imported before it is asked for."""

import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from teleop_core.base import PartError, Registry, UnknownNameError
from teleop_core.graph import STAGES
from teleop_core.hand.operators import OPERATORS
from teleop_core.shapes import SHAPES
from teleop_core.slave.controllers import CONTROLLERS

BUILT_IN = {"here": "teleop_core.graph.topics:ALL", "json": "json:loads"}


def registry(trial: Callable[[object], None] | None = None, **builtin: Any) -> Registry[Any]:
    return Registry("part", "parts_of_nobody", {**BUILT_IN, **builtin}, check, trial)


def check(name: str, part: object) -> object:
    if part is None:
        raise PartError("part", name, "something")
    return part


def installed(folder: Path, monkeypatch: pytest.MonkeyPatch, *entries: str) -> None:
    """Let a distribution with entry points be found, as if it were installed."""
    made = folder / "own_parts-1.0.dist-info"
    made.mkdir()
    (made / "METADATA").write_text("Metadata-Version: 2.1\nName: own-parts\nVersion: 1.0\n")
    lines = "\n".join(entries)
    (made / "entry_points.txt").write_text(f"[teleop_core.parts_of_nobody]\n{lines}\n")
    (folder / "own_module.py").write_text("CONE = 'cone'\n")
    (folder / "broken_module.py").write_text("raise RuntimeError('no\\nway')\n")
    monkeypatch.syspath_prepend(str(folder))
    monkeypatch.delitem(sys.modules, "own_module", raising=False)


def test_part_is_found_by_the_name_it_was_added_under_and_another_is_refused_with_the_known_ones() -> None:
    parts, part = registry(), object()
    for _ in range(2):  # the same part may be added again
        assert parts.add("mine", part) is part
    assert parts.find("mine") is part
    assert parts.names() == ("here", "json", "mine")
    with pytest.raises(UnknownNameError) as error:
        parts.find("there")
    assert error.value.alternatives == ("here", "json", "mine")


def test_used_name_is_refused_and_an_added_part_may_be_replaced_and_removed_but_no_built_in_one() -> None:
    parts, second = registry(), object()
    parts.add("mine", object())
    for name, replace in (("here", False), ("mine", False), ("here", True)):
        with pytest.raises(PartError) as error:
            parts.add(name, second, replace=replace)
        assert (error.value.kind, error.value.name) == ("part", name)
    assert parts.add("mine", second, replace=True) is second
    assert parts.find("mine") is second
    parts.remove("mine")
    assert "mine" not in parts.names()
    for name in ("mine", "here"):
        with pytest.raises(UnknownNameError):
            parts.remove(name)


def test_part_that_fails_its_trial_is_not_added() -> None:
    def trial(part: object) -> None:
        raise PartError("part", "mine", "better")

    parts = registry(trial)
    with pytest.raises(PartError, match="better"):
        parts.add("mine", object())
    assert "mine" not in parts.names()


def test_nothing_is_imported_before_it_is_asked_for(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    installed(tmp_path, monkeypatch, "cone = own_module:CONE")
    parts = registry()
    assert parts.names() == ("here", "json", "cone")
    assert "own_module" not in sys.modules
    assert parts.find("cone") == "cone"


def test_installed_part_that_cannot_be_loaded_is_refused_in_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    installed(tmp_path, monkeypatch, "broken = broken_module:CONE", "gone = own_module:SPHERE")
    parts = registry()
    for name, reason in (("broken", "RuntimeError"), ("gone", "AttributeError")):
        with pytest.raises(PartError, match=reason) as error:
            parts.find(name)
        assert error.value.name == name
        assert "\n" not in str(error.value)


def test_installed_part_that_takes_a_built_in_name_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    installed(tmp_path, monkeypatch, "here = own_module:CONE")
    with pytest.raises(PartError, match="named once") as error:
        registry().names()
    assert error.value.name == "here"


@pytest.mark.parametrize(
    ("parts", "name"), [(SHAPES, "box"), (CONTROLLERS, "pid"), (OPERATORS, "line"), (STAGES, "slave_sim")]
)
def test_on_every_seam_built_in_parts_are_parts_their_names_are_taken_and_no_object_is_one(
    parts: Registry[Any], name: str
) -> None:
    for found in parts:
        assert parts.find(found) is parts.find(found)
    with pytest.raises(PartError, match="int") as error:
        parts.add("mine", 5)
    assert (error.value.kind, error.value.name) == (parts.kind, "mine")
    other = next(parts.find(found) for found in parts if found != name)
    with pytest.raises(PartError) as error:
        parts.add(name, other)
    assert (error.value.kind, error.value.name) == (parts.kind, name)
