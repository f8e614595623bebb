"""Drives of Denavit-Hartenberg tables: every chain can be a slave, and says what is assumed."""

import numpy as np
import pytest

from present import present
from teleop_core.robots import robot_from_table
from teleop_core.robots.drives import ENTRIES

TABLE = {
    "name": "my_arm",
    "convention": "modified",
    "angles": "degrees",
    "rows": [
        {"theta": "q", "lower": -150, "upper": 150},
        {"a": 0.4, "theta": "q", "lower": -120, "upper": 120, "home": 60},
        {"a": 0.3, "d": "q", "lower": -0.1, "upper": 0.1, "name": "slide"},
    ],
    "task": ["x", "y", "z"],
}


def test_a_chain_that_states_no_drives_has_assumed_ones() -> None:
    robot = robot_from_table(TABLE)
    assert present(robot.drives).assumed == ENTRIES
    assert np.array_equal(present(robot.dynamics).parameters, present(robot.drives).inertia)


def test_stated_drives_are_read_in_the_table_unit_and_the_rest_is_assumed() -> None:
    stated = {
        "q1": {"speed_limit": 90, "encoder_step": 0.01, "inertia": 0.5, "viscous": 0},
        "slide": {"speed_limit": 0.2, "inertia": 3.0},
    }
    drives = present(robot_from_table({**TABLE, "drives": stated}).drives)
    assert drives.speed_limit == pytest.approx([np.pi / 2.0, 2.0, 0.2])
    assert drives.encoder_step[0] == pytest.approx(np.radians(0.01))
    assert drives.inertia == pytest.approx([0.5, 0.1, 3.0])
    assert drives.viscous[0] == 0.0
    # In proportion to the inertia.
    assert drives.effort_limit == pytest.approx([50.0, 10.0, 120.0])
    assert "inertia" in drives.assumed  # of q2


def test_a_chain_that_states_every_entry_assumes_nothing() -> None:
    every = {name: 60.0 if name == "bandwidth" else 1.0 for name in ENTRIES}
    names = ("q1", "q2", "slide")
    robot = robot_from_table({**TABLE, "drives": dict.fromkeys(names, every)})
    assert not robot.drives_are_assumed
