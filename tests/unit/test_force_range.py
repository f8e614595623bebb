"""Force range: a broken sensor's force is not given to the hand."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest

from teleop_core.hand.master.haptic_master import HapticMaster, HapticMasterParameters
from teleop_core.kernels.geometry import Array

MS = 1_000_000


def forces(asked: Sequence[Sequence[float]] | Array, **parameters: Any) -> tuple[Array, HapticMaster]:
    """Forces (N, 3) that the device gives, for those asked in each tick (N, 3) [N]."""
    stage = HapticMaster(HapticMasterParameters(**parameters))
    given = []
    for tick, force in enumerate(asked, start=1):
        stage.signals["now_ns"] = tick * MS
        stage.signals["master_servo_cf"][:3] = force
        stage.prepare(1)
        stage.step()
        given.append(stage.signals["master_measured_cf"][:3].copy())
    return np.array(given), stage


@pytest.mark.parametrize("broken", [1e6, -31.0, np.nan, np.inf])
def test_a_force_out_of_range_is_not_given_until_it_was_within_for_a_second(broken: float) -> None:
    asked = np.zeros((1300, 3))
    asked[:, 2] = 1.0
    asked[100:105, 0] = broken
    given, stage = forces(asked)
    assert (given[50:100, 2] > 0.5).all()
    assert not given[100:1100].any()
    assert (given[1150:, 2] > 0.5).all()
    assert stage.doubted_force == 0.0


def test_what_was_out_of_range_is_told_meanwhile() -> None:
    _, stage = forces([[40.0, 0.0, 0.0], [0.0, 0.0, 0.0]])
    assert stage.doubted_force == pytest.approx(40.0)


def test_a_force_at_the_end_of_its_range_is_given() -> None:
    given, stage = forces(np.tile([5.0, 0.0, 0.0], (200, 1)), force_range=5.0)
    assert given[-1, 0] > 0.5
    assert stage.doubted_force == 0.0
