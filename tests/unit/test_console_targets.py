"""Targets on the page are where the hand of the task comes to rest."""

import numpy as np

import teleop_core as tc
from teleop_console.recorded_arms import parameters_of
from teleop_console.scene import targets_of
from teleop_core.graph.topics import MASTER_MEASURED_CP


def test_the_hand_of_a_task_passes_every_target_and_no_other_operator_has_any() -> None:
    configuration = tc.configuration("points24", duration=40.0)
    targets = targets_of(parameters_of(configuration), "")
    assert targets.shape == (24, 3)
    path = tc.run(configuration)[MASTER_MEASURED_CP.name][["x", "y", "z"]]
    away = [np.linalg.norm(path - target, axis=1).min() for target in targets]
    assert max(away) < 1.5e-3  # tremor, and what friction of the device holds back
    assert len(targets_of(parameters_of(tc.configuration("free_motion")), "")) == 0
    assert len(targets_of(parameters_of(configuration), "left")) == 0
