"""Inverse kinematics of 75 arms that are sold, in one table: what docs/urdf.md says of them.

Run with ``python benchmarks/sold_arms.py``; ``--poses 200 --paths 10`` takes seconds, names of arms
choose some. Random joint vectors inside the limits make the poses. Solved means the status says so,
that is within 1e-9 m and 1e-9 rad, and inside the limits; *near* seeds lie 0.02 rad (standard
deviation) off the joints that made the pose. A path is a straight line between two legal poses,
whose joints lie up to 0.3 rad apart, in 1 s at 250 Hz; then its end stands for 1 s. *wrist* paths
turn the middle joint of the wrist by 0.6 rad through the place where its neighbours' axes are in
line; every second one leads past it at 1 mrad. There are as many of them as lines.
Unexplained are paths whose end was not reached with no limit and no singular posture beside them.
"""

import argparse
import os
import sys
import tempfile
import warnings
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[variable] = "1"

import numpy as np  # noqa: E402
from scipy.spatial.transform import Rotation  # noqa: E402

from teleop_core.robots import IkStatus, Robot, load_robot  # noqa: E402

sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "support"))
from real_arms import ARMS, urdf_of  # noqa: E402

DT, TICKS, STAND = 0.004, 250, 250
SIDE = 0.3  # [rad] from either end of a wrist path to the middle, and of joints between two poses
REACHED = (int(IkStatus.FOLLOWED), int(IkStatus.NEAR_SINGULAR))
TASK_OF_FIVE = "x y z rx ry"
HEAD = "home % | near % | too fast | late % | at the end % | unexplained | past the wrist %"
WORST: tuple[Callable[..., Any], ...] = (min, min, sum, max, min, sum, min)
"""What counts of each column, over the arms of a class."""


@dataclass(frozen=True, kw_only=True)
class Paths:
    """What became of some paths, counted."""

    count: int
    too_fast: int  # that stepped beyond a speed limit, or left the limits
    late: int  # that lagged somewhere
    arrived: int  # that stood at the end of the path
    unexplained: int  # that did not, with no singular posture and no limit beside their way


def load(name: str, folder: Path) -> Robot:
    """Arm of the data file; one of five axes controls five directions."""
    path = folder / f"{name}.urdf"
    path.write_text(urdf_of(name), encoding="utf-8")
    task = TASK_OF_FIVE if len(ARMS[name]["joints"]) < 6 else ""
    return load_robot(str(path), tip="tip", task=task)


def is_reached(status: Any) -> Any:
    """Which answers reach their pose."""
    return np.isin(status, REACHED)


def solved(robot: Robot, count: int) -> tuple[float, float]:
    """Shares of poses solved from home and from near seeds [%]."""
    rng = np.random.default_rng(1)
    q = rng.uniform(robot.lower, robot.upper, (count, robot.n))
    seeds = np.clip(q + rng.normal(0.0, 0.02, q.shape), robot.lower, robot.upper)
    poses, shares = robot.fk(q), []
    for answer in (robot.ik_batch(poses), robot.ik_batch(poses, seeds)):
        inside = ((answer.q >= robot.lower) & (answer.q <= robot.upper)).all(axis=1)
        shares.append(100.0 * float((is_reached(answer.status) & inside).mean()))
    return shares[0], shares[1]


def line(start: Any, end: Any) -> Any:
    """Poses (N, 4, 4) of a straight line with an even turn, then its end for a while."""
    share = np.append(np.linspace(0.0, 1.0, TICKS), np.ones(STAND))
    poses = np.repeat(start[None], len(share), axis=0)
    poses[:, :3, 3] += share[:, None] * (end - start)[:3, 3]
    turn = Rotation.from_matrix(start[:3, :3].T @ end[:3, :3]).as_rotvec()
    poses[:, :3, :3] = start[:3, :3] @ Rotation.from_rotvec(share[:, None] * turn).as_matrix()
    return poses


def least_singular_value(robot: Robot, joints: Any) -> float:
    """Smallest along a path; lengths over the reach."""
    least = np.inf
    for q in joints[::5]:
        J = robot.jacobian(q)
        J[:3] /= robot.geometry["reach"]
        least = min(least, np.linalg.svd(J, compute_uv=False)[min(robot.n, 6) - 1])
    return float(least)


def followed(robot: Robot, paths: Sequence[tuple[Any, Any]]) -> Paths:
    """Follow paths, each from its joint vector on."""
    too_fast = late = unexplained = arrived = 0
    most = DT * robot.drives.speed_limit + 1e-12  # type: ignore[union-attr]
    for start, poses in paths:
        answer = robot.follow(poses, start, DT)
        moves = abs(np.diff(answer.q, axis=0, prepend=start[None]))
        room = np.minimum(answer.q - robot.lower, robot.upper - answer.q).min()
        too_fast += bool((moves > most).any() or room < 0.0 or not np.isfinite(answer.q).all())
        reached = is_reached(answer.status)
        arrived += bool(reached[-1])
        late += not reached.all()
        if not reached[-1]:
            unexplained += room > 1e-3 and least_singular_value(robot, answer.q) > 0.02
    return Paths(count=len(paths), too_fast=too_fast, late=late, unexplained=unexplained, arrived=arrived)


def lines(robot: Robot, count: int) -> Paths:
    """Follow straight lines between close legal poses."""
    rng, paths = np.random.default_rng(2), []
    far = np.minimum(SIDE, 0.5 * robot.drives.speed_limit)  # type: ignore[union-attr]
    for _ in range(count):
        start = rng.uniform(robot.lower, robot.upper)
        end = np.clip(start + rng.uniform(-far, far), robot.lower, robot.upper)
        paths.append((start, line(robot.fk(start), robot.fk(end))))
    return followed(robot, paths)


def wrist_angle(robot: Robot) -> float | None:
    """Angle of the last joint but one at which its neighbours' axes are in line, if any."""
    middle, best = robot.n - 2, (1e-4, 0.0)
    inner = np.linspace(robot.lower[middle] + SIDE, robot.upper[middle] - SIDE, 20001)
    q = robot.home.copy()

    def sine(angle: float) -> float:
        q[middle] = angle
        J = robot.jacobian(q)
        return float(np.linalg.norm(np.cross(J[3:, middle - 1], J[3:, middle + 1])))

    centre = min(inner[::100], key=sine, default=0.0)
    fine = np.linspace(centre - 0.1, centre + 0.1, 2001)
    for angle in fine[(fine >= inner[0]) & (fine <= inner[-1])]:
        best = min(best, (sine(angle), angle))
    return best[1] if best[0] < 1e-4 else None


def wrists(robot: Robot, count: int) -> Paths | None:
    """Follow paths through the singular posture of the wrist; None if the arm has none."""
    if robot.n < 6 or (angle := wrist_angle(robot)) is None:
        return None
    rng, paths, middle = np.random.default_rng(3), [], robot.n - 2
    room = 0.25 * (robot.upper - robot.lower)
    for k in range(count):
        q = rng.uniform(robot.lower + room, robot.upper - room)
        joints = np.repeat(q[None], TICKS + STAND, axis=0)
        joints[:, middle] = angle + SIDE
        joints[:TICKS, middle] = np.linspace(angle - SIDE, angle + SIDE, TICKS)
        poses = robot.fk(joints)
        if k % 2:
            axis = rng.normal(size=3)
            past = Rotation.from_rotvec(1e-3 * axis / np.linalg.norm(axis)).as_matrix()
            beside = poses.copy()
            beside[:, :3, :3] = poses[:, :3, :3] @ past
            if is_reached(robot.ik(beside[-1], joints[-1]).status):  # not tilted out of reach
                poses = beside
        paths.append((robot.ik(poses[0], joints[0]).q, poses))
    return followed(robot, paths)


def row(name: str, poses: int, paths: int, folder: Path) -> tuple[str, list[float | None]]:
    """What solves an arm, and the numbers of its row."""
    robot = load(name, folder)
    home, near = solved(robot, poses)
    path, wrist = lines(robot, paths), wrists(robot, paths)
    fast, past = path.too_fast, None
    if wrist is not None:
        fast, past = fast + wrist.too_fast, 100.0 * wrist.arrived / wrist.count
    late, arrived = 100.0 * path.late / path.count, 100.0 * path.arrived / path.count
    words = robot.solution.split(",")[0].split(":")[0]
    numbers = [home, near, fast, late, arrived, path.unexplained, past]
    return f"{words}, {robot.n} axes", numbers


def cells(numbers: Iterable[float | None]) -> str:
    """Numbers of a row: two digits, counts without, none where there is nothing."""
    words = ("none" if x is None else f"{x:.2f}" if isinstance(x, float) else f"{x}" for x in numbers)
    return " | ".join(words)


def main() -> None:
    """Print one row an arm, then one a class with its worst arm."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("names", nargs="*", default=list(ARMS), help="arms; all of them if none")
    parser.add_argument("--poses", type=int, default=5000)
    parser.add_argument("--paths", type=int, default=1000)
    given = parser.parse_args()
    warnings.simplefilter("ignore")  # limits that files leave out
    kinds: dict[str, list[list[float | None]]] = {}
    print(f"| arm | solved by | ssik's class | {HEAD} |\n{'|---' * 10}|")
    with tempfile.TemporaryDirectory() as folder:
        for name in given.names:
            kind, numbers = row(name, given.poses, given.paths, Path(folder))
            kinds.setdefault(kind, []).append(numbers)
            theirs = ARMS[name].get("class", "")
            print(f"| {name} | {kind} | {theirs} | {cells(numbers)} |", flush=True)
    print(f"\n| solved by | arms | {HEAD} |\n{'|---' * 9}|")
    for kind, rows in kinds.items():
        columns = [[x for x in column if x is not None] for column in zip(*rows, strict=True)]
        pairs = zip(columns, WORST, strict=True)
        worst = [choose(column) if column else None for column, choose in pairs]
        print(f"| {kind} | {len(rows)} | {cells(worst)} |")


if __name__ == "__main__":
    main()
