"""New samples: which rows of a session are recorded, of topics that are sent where they change."""

import numpy as np
import pytest
from numpy.typing import NDArray

from teleop_core.graph.topics import SELDOM_NS, SLAVE_TRUE_CF
from teleop_core.kernels.geometry import Array
from teleop_core.session.runner import NewSamples

TICK_NS = 1_000_000


def recorded(stamps: NDArray[np.int64], values: Array, pieces: int) -> NDArray[np.int64]:
    """Stamps that are recorded of a topic's rows, which come in pieces."""
    topic = SLAVE_TRUE_CF
    block = np.zeros(len(stamps), [(f"{topic.field}_ns", "i8"), (topic.field, "f8", 6)])
    block[f"{topic.field}_ns"] = stamps
    block[topic.field][:, 0] = values
    finder, found = NewSamples(), []
    for piece in np.array_split(block, pieces):
        found += finder.of(topic, piece, piece[f"{topic.field}_ns"])[0].tolist()
    return np.array(found)


@pytest.mark.parametrize("begin_ns", [TICK_NS, 123_456_789, 7 * SELDOM_NS])
@pytest.mark.parametrize("pieces", [1, 7])
def test_what_does_not_change_is_said_in_each_period_whatever_its_stamps(begin_ns: int, pieces: int) -> None:
    stamps = begin_ns + TICK_NS * np.arange(1000)
    found = recorded(stamps, np.zeros(1000), pieces)
    assert found[0] == stamps[0]
    assert len(found) in {50, 51}
    assert np.diff(found[1:]).tolist() == [SELDOM_NS] * (len(found) - 2)


def test_what_changes_is_said_at_once() -> None:
    stamps = 123_456_789 + TICK_NS * np.arange(100)
    values = np.where(np.arange(100) == 33, 1.0, 0.0)
    found = recorded(stamps, values, 3)
    assert {stamps[33], stamps[34]} <= set(found.tolist())
