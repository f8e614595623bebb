"""Joy messages of any number of buttons: which of them are clutch, fixture and mode."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from teleop_core.bags.messages import Refusal, read_values
from teleop_core.graph import topics


def joy(*pressed: int) -> Any:
    header = SimpleNamespace(stamp=SimpleNamespace(sec=1, nanosec=2), frame_id="")
    return SimpleNamespace(header=header, buttons=list(pressed))


@pytest.mark.parametrize(
    ("pressed", "places", "expected"),
    [
        ((1, 0, 1), (0, 1, 2), [1, 0, 1]),
        ((1, 0, 1, 0, 0, 1), (0, 1, 2), [1, 0, 1]),
        ((0, 0, 0, 0, 1, 0), (4, 5, 0), [1, 0, 0]),
        ((1, 0), (0, -1, 1), [1, 0, 0]),
        ((0, 1), (0, -1, 1), [0, 0, 1]),
        ((1,), (0, -1, -1), [1, 0, 0]),
        ((1, 1), (-1, -1, -1), [0, 0, 0]),
    ],
)
def test_a_map_says_which_button_is_what(pressed: Any, places: Any, expected: list[int]) -> None:
    taken = read_values(topics.Kind.BUTTONS, joy(*pressed), buttons=places)
    assert not isinstance(taken, Refusal)
    stamp_ns, values = taken
    assert stamp_ns == 1_000_000_002
    assert np.array_equal(values, expected)


@pytest.mark.parametrize("places", [(0, 1, 2), (2, -1, -1)])
def test_a_message_with_fewer_buttons_is_refused_with_what_to_set(places: tuple[int, int, int]) -> None:
    refusal = read_values(topics.Kind.BUTTONS, joy(1, 0), buttons=places)
    assert refusal is Refusal.FEW_BUTTONS
    assert "set joy_buttons=[0, -1, 1]" in refusal.value
