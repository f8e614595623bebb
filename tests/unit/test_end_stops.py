"""Joints at their end stops along a path: the branch stays, and the path is met again."""

import numpy as np
import pytest

from present import present
from teleop_core.robots import IkStatus, load_robot

DT = 0.001
# Joints that stand half a turn away, or on the other side of zero, in another branch.
SIDES = {"rcrt1": (3, 4), "puma560": (3, 4), "scara": (0, 1)}
# Robot, joint vector of the start in degrees (d3 in metres), joint that a path
# drives beyond its stop, by how many degrees beyond, and the sign of the way.
RUNS = {
    "rcrt1 joint 4 up": ("rcrt1", (10.0, 100.0, 0.36, 150.0, 30.0, -20.0), 3, 80.0),
    "rcrt1 joint 4 down": ("rcrt1", (10.0, 100.0, 0.36, -150.0, -40.0, 30.0), 3, -80.0),
    "rcrt1 joint 6 up": ("rcrt1", (10.0, 100.0, 0.36, 20.0, 30.0, 150.0), 5, 120.0),
    "rcrt1 joint 6 down": ("rcrt1", (10.0, 100.0, 0.36, 20.0, -60.0, -150.0), 5, -120.0),
    "puma560 joint 4 up": ("puma560", (10.0, -45.0, -45.0, 150.0, 45.0, 20.0), 3, 80.0),
    "puma560 joint 4 down": ("puma560", (10.0, -45.0, -45.0, -90.0, -60.0, 20.0), 3, -80.0),
    "puma560 joint 1 up": ("puma560", (140.0, -45.0, -45.0, 20.0, 45.0, 0.0), 0, 70.0),
    "puma560 joint 6 down": ("puma560", (10.0, -45.0, -45.0, 20.0, 45.0, -250.0), 5, -90.0),
    "scara joint 4 up": ("scara", (-73.0, -19.0, 0.07, 343.0), 3, 75.0),
    "scara joint 4 down": ("scara", (-73.0, 19.0, 0.07, -343.0), 3, -75.0),
}


@pytest.mark.parametrize("run", RUNS)
def test_path_beyond_an_end_stop_and_back_keeps_the_branch_and_ends_on_the_path(run: str) -> None:
    name, degrees, joint, beyond = RUNS[run]
    robot = load_robot(name)
    start = np.radians(degrees)
    if name in {"rcrt1", "scara"}:
        start[2] = degrees[2]
    path = np.tile(start, (4001, 1))
    path[:, joint] += np.radians(beyond) * np.sin(np.linspace(0.0, np.pi, len(path)))
    stop = (robot.upper if beyond > 0.0 else robot.lower)[joint]
    is_beyond = np.abs(path[:, joint]) > abs(stop)
    assert is_beyond.sum() > 3000

    done = robot.follow(robot.fk(path), start, DT)

    assert np.array_equal(done.q[:, joint] == stop, is_beyond)
    assert np.array_equal(done.status == IkStatus.LIMITED, is_beyond)
    turning, crossing = SIDES[name]
    assert np.abs(done.q[:, turning] - start[turning]).max() < 0.5 * np.pi
    assert (np.sign(done.q[:, crossing]) == np.sign(start[crossing])).all()
    steps = np.abs(np.diff(done.q, axis=0))
    assert (steps <= present(robot.drives).speed_limit * DT + 1e-15).all()
    assert done.residual[-1].max() < 1e-9
    assert np.allclose(done.q[-1], start, rtol=0, atol=1e-9)
