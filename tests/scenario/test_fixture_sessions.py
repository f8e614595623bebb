"""Sessions with every built-in fixture: its wall holds the hand, and the score tells how well."""

from typing import Any

import numpy as np
import pytest

import teleop_core as tc
from any_shape import depth_of
from present import present
from teleop_core.coupling.fixtures import Fixture
from teleop_core.shapes import SHAPES

SECONDS = 10.0
# The simulated person of the scenario goes up from there: a ceiling holds that hand, no floor.
SETTINGS: dict[str, dict[str, Any]] = {
    "half_space": {"fixture__half_space__normal": (0.0, -1.0, 0.0)},
    "plane": {"fixture__plane__normal": (0.0, 1.0, 0.0)},
    "hole": {"fixture__keep_out": True, "fixture__place": (0.0, 0.0, 0.015)},
}
# The least of what a hand without a wall goes beyond that the wall takes away.
HELD = 0.2
# A step of the reading to the left and one to the right, and the last bit of the limits [mm].
READING = 0.11

pytestmark = pytest.mark.slow


def session(kind: Any, **settings: object) -> Any:
    """Ten seconds of a person who aims beyond the fixture."""
    more: dict[str, Any] = {**SETTINGS.get(kind, {}), **settings}
    return tc.run("coarse_box", duration=SECONDS, fixture=kind, **more)


def ways(recording: tc.Recording, kind: Any) -> Any:
    """Depths (N,) and ways (N, 3) [m] of the hand from its fixture while it is on, and pushes."""
    on = recording["teleop/state"]["is_fixture_on"] > 0
    begin = recording["teleop/state"].time[np.argmax(on)]
    hand, force = recording["master/measured_cp"], recording["master/servo_cf"]
    after = hand.time >= begin
    offsets = hand[["x", "y", "z"]][after]
    offsets = np.ascontiguousarray(offsets - offsets[0])
    shape, given = SHAPES.find(kind), dict(SETTINGS.get(kind, {}))
    own = ("place", "keep_out")
    used = {name: given.pop(f"fixture__{name}") for name in own if f"fixture__{name}" in given}
    numbers = {name.rpartition("__")[2]: value for name, value in given.items()}
    fixture = Fixture(shape, shape.parameters(**numbers), **used)
    depths, out = zip(*(depth_of(fixture, offset) for offset in offsets), strict=True)
    return np.array(depths), np.array(out), force[["fx", "fy", "fz"]][after]


@pytest.mark.parametrize("kind", sorted(set(SHAPES) - {"mesh", "height_field"}))
def test_every_fixture_holds_the_hand_and_is_scored(kind: Any) -> None:
    recording = session(kind)
    score = recording.score()
    assert score.fixture.kind == kind
    assert score.fixture.unscored is None
    assert score.fixture.on_s == pytest.approx(SECONDS - 4.1, abs=0.05)
    depths, out, push = ways(recording, kind)
    hand = score.value("fixture.hand_penetration_max_mm")
    assert hand == pytest.approx(1e3 * depths.max(), abs=READING)
    free = session(kind, fixture__max_force=0.0).score()
    assert 0.1 < present(hand) < (1.0 - HELD) * free.value("fixture.hand_penetration_max_mm")
    # The push is against the way out wherever the hand is well outside, and within its limit.
    against = (push * out).sum(axis=1)[depths > 1e-4]
    assert len(against) > 20
    assert (against < 0.0).all()
    assert np.linalg.norm(push, axis=1).max() <= 3.3 + 1e-9
