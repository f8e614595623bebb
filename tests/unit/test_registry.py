"""Registry: what a program adds by name can be found, replaced and taken away again."""

import pytest

from teleop_core.errors import PartError, UnknownNameError
from teleop_core.registry import Registry


@pytest.fixture
def shapes():
    """A registry of texts with one built-in part."""
    return Registry("shape", "shapes", {"tau": "math:tau"}, lambda name, part: part)


def test_part_that_was_removed_is_unknown_and_its_name_free(shapes):
    shapes.add("cone", "a cone")
    shapes.remove("cone")
    assert shapes.names() == ("tau",)
    with pytest.raises(UnknownNameError, match="shape is 'cone', must be one of: tau"):
        shapes.find("cone")
    assert shapes.add("cone", "another cone") == shapes.find("cone") == "another cone"


def test_part_that_replaced_another_is_removed_whole(shapes):
    shapes.add("cone", "a cone")
    shapes.add("cone", "another cone", replace=True)
    shapes.remove("cone")
    assert not shapes.is_added("cone")


@pytest.mark.parametrize("name", ["tau", "cube"])
def test_only_what_the_program_added_can_be_removed(shapes, name):
    shapes.find("tau")
    with pytest.raises(UnknownNameError, match=f"added shape is '{name}', must be one of: none"):
        shapes.remove(name)
    shapes.add("cone", "a cone")
    with pytest.raises(UnknownNameError, match="one of: cone"):
        shapes.remove(name)
    assert shapes.find("tau") > 6.0


def test_taken_name_is_refused_and_the_same_object_is_not(shapes):
    cone = shapes.add("cone", "a cone")
    assert shapes.add("cone", cone) is cone
    for name in ("cone", "tau"):
        with pytest.raises(PartError, match="a name that is free"):
            shapes.add(name, "another cone")
