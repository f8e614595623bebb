"""Appendix E: the printed readings of the RCRT-1's accuracy test with a ruler, and the poses of these readings.

The test has ten targets along each axis, 10 mm apart, with the tool's orientation at home. Along x and z the moves
begin at home. Along y the moves begin 30 mm away from home, because home lies on the edge of the workspace; the ruler
still measures from home to the tip. The source does not print the directions; only -x, +y (or its mirror image -y) and
+z are reachable.

Source:
    Vongbunyong 2008, appendix E.1, tables E.1-E.3.
"""

import numpy as np

from teleop_core.kernels.geometry import Array
from teleop_core.kinematics import IkStatus
from teleop_core.robots.robot import Robot
from teleop_lab.calibration.measured import CalibrationError, Measured

STEP = 0.5e-3
"""Division of the ruler [m]."""
WAY = 0.1
"""Length of the longest move [m]."""
ESCAPE = 0.03
"""Distance from home at which a move begins if it is not possible from home [m]."""
# Distances from home [m]; for table E.2 these are the ruler's readings.
READ = {
    "x": (10.25, 20.0, 30.0, 40.25, 50.25, 60.5, 70.5, 79.5, 90.0, 100.25),
    "y": (31.5, 36.0, 43.0, 50.5, 58.5, 68.0, 77.0, 86.5, 96.0, 105.5),
    "z": (10.0, 20.0, 29.5, 40.5, 50.5, 60.0, 71.0, 81.0, 91.75, 102.0),
}
"""Ruler's readings [mm] for commands of 10, 20 ... 100 mm along each axis."""
OFFSET_OF_D3 = 5.5e-3
"""Offset of joint 3 [m], derived from the tables; it explains most of the readings."""


def published(robot: Robot) -> Measured:
    """Return the thirty readings, with the commanded poses of the arm.

    Raises:
        CalibrationError: The robot is not the RCRT-1.
    """
    if robot.name != "rcrt1":
        raise CalibrationError(f"appendix E measured the rcrt1, not {robot.name}")
    moves = ruler_moves(robot, 30)
    readings = 1e-3 * np.concatenate([READ[axis] for axis in "xyz"])
    return Measured(joints=moves.joints, origins=moves.origins, distances=readings, labels=moves.labels)


def ruler_moves(robot: Robot, count: int) -> Measured:
    """Poses of a test as in appendix E for any arm, with the distances that the nominal arm moves.

    Args:
        robot: An arm that controls x, y and z.
        count: Number of poses, distributed over the axes, x first.

    Raises:
        CalibrationError: Along an axis no straight move is possible, neither from home nor from 30 mm beside home.
    """
    joints, labels = [], []
    escapes: list[Array] = []
    for axis, name in enumerate("xyz"):
        share = (count + 2 - axis) // 3
        direction, path = _move(robot, axis, share, escapes)
        escapes.append(direction)
        joints.append(path)
        labels += [name] * share
    q = np.concatenate(joints)
    origins = np.broadcast_to(robot.home, q.shape)
    way = robot.fk(q)[:, :3, 3] - robot.fk(robot.home)[:3, 3]
    return Measured(joints=q, origins=origins, distances=np.linalg.norm(way, axis=1), labels=tuple(labels))


def _move(robot: Robot, axis: int, count: int, escapes: list[Array]) -> tuple[Array, Array]:
    """Direction (3,) and joints (count, n) of the move along an axis; the positive direction is tried first."""
    targets = WAY * np.arange(1, count + 1) / max(count, 1)
    for start in (np.zeros(3), *(ESCAPE * escape for escape in escapes)):
        for sign in (1.0, -1.0):
            direction = sign * np.eye(3)[axis]
            poses = np.tile(robot.fk(robot.home), (count, 1, 1))
            poses[:, :3, 3] += start + targets[:, None] * direction
            answer = robot.ik_batch(poses)
            if np.isin(answer.status, (IkStatus.FOLLOWED, IkStatus.NEAR_SINGULAR)).all():
                return direction, answer.q
    raise CalibrationError(
        f"{robot.name} cannot move {1e3 * WAY:g} mm straight along {'xyz'[axis]} from home with "
        "its tool held: measure it with a tracker, --noise 0.1e-3"
    )
