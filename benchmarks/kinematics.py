"""Inverse kinematics beside its peers: same arm, same targets, one run, one thread.

Run with ``python benchmarks/kinematics.py``. Solved means within 1e-6 m and 1e-6 rad of the
target, legal means inside the joint limits too. The ratio is a peer's median over ours, the step
is the largest joint move between neighbouring poses of a path. A smaller share of the poses is
the middle of each workload, in a path where the singularity is; the spacing stays. PyKDL and
pinocchio take no limits: their answers are brought inside by whole turns where that is enough.

Peers that are not installed are named and skipped. PyKDL comes with the distribution
(``apt install python3-pykdl``) and is found from a virtual environment of the same Python version.
"""

import argparse
import os
import subprocess
import sys
import tempfile
import time
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import Any

for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[variable] = "1"

import numpy as np  # noqa: E402

from ik_peers import PEERS, Adapted, as_it_is  # noqa: E402
from teleop_core.robots import IkStatus, list_robots, load_robot  # noqa: E402
from teleop_core.robots.arms.dh import load_table  # noqa: E402

TABLES = Path(__file__).parent.parent / "config" / "robots"
ARMS = ("puma560", "rcrt1")
COUNT = 1000  # poses of a workload
TOLERANCE = 1e-6


def workloads(robot: Any) -> dict[str, tuple[Any, bool]]:
    """Joint vectors of the targets, and whether they are a path with a warm start."""
    rng, way = np.random.default_rng(1), np.arange(COUNT)[:, None] / COUNT
    start = robot.home.copy()
    start[4] = 0.7
    phases = rng.uniform(0.0, 2.0 * np.pi, robot.n)
    swing = 0.05 * (robot.upper - robot.lower)
    smooth = start - swing + swing * np.sin(2.0 * np.pi * way + phases)
    through = start - 0.2 * swing * way
    through[:, 4] = 0.4 - 0.8 * way[:, 0]  # the very middle has axes 4 and 6 in line
    return {
        "random": (rng.uniform(robot.lower, robot.upper, (COUNT, robot.n)), False),
        "smooth path": (smooth, True),
        "through singularity": (through, True),
        "beside singularity": (beside(robot, through), True),
    }


def beside(robot: Any, through: Any) -> Any:
    """The same path with the tool axis passing axis 4 at 0.01 rad: joint 4 swings half round."""
    joints, miss = through.copy(), 0.01
    swing = np.arctan2(through[:, 4], miss)
    joints[:, 3] = 0.5 * (robot.lower[3] + robot.upper[3]) + swing
    joints[:, 4] = np.hypot(through[:, 4], miss)
    joints[:, 5] = through[:, 5] - swing  # the tool itself does not spin
    return joints


def run(adapted: Adapted, robot: Any, joints: Any, *, is_path: bool) -> tuple[list[float], Any]:
    """Microseconds of each call, and the answers (NaN where a solver raised)."""
    adapt, solve = adapted
    poses = [adapt(pose) for pose in robot.fk(joints)]
    seed = joints[0].copy() if is_path else robot.home.copy()
    times, answers = [], []
    solve(poses[0], seed)
    for pose in poses:
        begin = time.perf_counter()
        try:
            answer = np.asarray(solve(pose, seed), dtype=float)
        except Exception:  # a peer's own failure is a failed pose
            answer = np.full(robot.n, np.nan)
        times.append(1e6 * (time.perf_counter() - begin))
        answers.append(answer)
        if is_path and np.isfinite(answer).all():
            seed = answer
    return times, np.array(answers)


def judge(robot: Any, joints: Any, answers: Any) -> tuple[float, float]:
    """Shares of poses solved, and solved inside the limits [%]."""
    solved = legal = 0
    for q, wanted in zip(answers, robot.fk(joints), strict=True):
        if not np.isfinite(q).all():
            continue
        reached = robot.fk(q)
        turn = reached[:3, :3].T @ wanted[:3, :3]
        angle = np.linalg.norm(turn - np.eye(3)) / np.sqrt(2.0)
        distance = np.linalg.norm(reached[:3, 3] - wanted[:3, 3])
        is_solved = bool(distance <= TOLERANCE and angle <= TOLERANCE)
        solved += is_solved
        legal += is_solved and bool(((q >= robot.lower - 1e-9) & (q <= robot.upper + 1e-9)).all())
    return 100.0 * solved / len(joints), 100.0 * legal / len(joints)


def solvers(name: str, robot: Any) -> Iterator[tuple[str, Adapted]]:
    """Ours, then every peer that is installed and can model the arm."""
    yield "teleop_core", (as_it_is, lambda pose, seed: robot.ik(pose, seed).q)
    table = load_table(TABLES / f"{name}.yaml")
    for peer, make in PEERS.items():
        try:
            yield peer, make(table, robot)
        except ImportError as error:
            print(f"  {peer}: skipped, not installed ({error})")
        except NotImplementedError as error:
            print(f"  {peer}: skipped, {error}")


def compare(name: str, share: float) -> None:
    """Print one arm's table."""
    robot, count = load_robot(name), max(20, round(COUNT * share))
    print(f"\n{name}, single calls from Python, {count} poses each")
    chosen = list(solvers(name, robot))
    print(f"  {'workload':21}{'solver':23}{'solved %':>9}{'legal %':>9}{'median µs':>11}"
          f"{'p99 µs':>9}{'ratio':>8}{'step':>8}")  # fmt: skip
    for workload, (joints, is_path) in workloads(robot).items():
        start, ours = max(0, (COUNT - count) // 2), 0.0
        some = joints[start : start + count]
        for solver, adapted in chosen:
            times, answers = run(adapted, robot, some, is_path=is_path)
            median = float(np.median(times))
            ours = ours or median
            step = np.nanmax(np.abs(np.diff(answers, axis=0))) if is_path else 0.0
            solved, legal = judge(robot, some, answers)
            print(f"  {workload:21}{solver:23}{solved:9.1f}{legal:9.1f}{median:11.1f}"
                  f"{np.percentile(times, 99):9.1f}{median / ours:8.1f}"
                  f"{f'{step:.4f}' if is_path else '-':>8}")  # fmt: skip


def batch(robot: Any, count: int) -> tuple[Any, Any]:
    """Joint vectors that belong together, and seeds near them.

    They are of poses all over the joint ranges, or within a tenth of them around home where most
    others cannot be assembled.
    """
    rng, span = np.random.default_rng(2), robot.upper - robot.lower
    drawn = rng.uniform(robot.lower, robot.upper, (count, robot.n))
    answer = robot.ik(robot.solve_fk(drawn, search=False).T)
    if (answer.status != IkStatus.FOLLOWED).mean() > 0.2:
        near = robot.home + rng.uniform(-0.1, 0.1, (count, robot.n)) * span
        near = np.clip(near, robot.lower, robot.upper)
        answer = robot.ik(robot.solve_fk(near, search=False).T)
    return answer.q, answer.q + 0.01 * span * rng.normal(0.0, 1.0, answer.q.shape)


def batches(name: str, count: int) -> None:
    """Print how many poses and solutions a second one core makes in a batch."""
    robot = load_robot(name)
    q, seeds = batch(robot, count)
    poses = robot.solve_fk(q, search=False).T
    rates = {"fk": 0.0, "ik near": 0.0, "ik far": 0.0}
    for _ in range(5):
        for key, call in (
            ("fk", lambda: robot.solve_fk(q, search=False)),
            ("ik near", lambda: robot.ik(poses, seeds)),
            ("ik far", lambda: robot.ik(poses)),
        ):
            begin = time.perf_counter()
            call()
            rates[key] = max(rates[key], 1e-6 * count / (time.perf_counter() - begin))
    print(f"  {name:18}" + "".join(f"{key:>10} {rate:6.2f} M/s" for key, rate in rates.items()))


_START = """
import time; a = time.perf_counter()
import teleop_core; b = time.perf_counter()
from teleop_core.robots import load_robot
robot = load_robot({name!r}); T = __import__("numpy").eye(4); c = time.perf_counter()
robot.ik(T); d = time.perf_counter()
print(b - a, c - b, d - c)
"""


def start_up(name: str) -> None:
    """Print seconds of import and first solve, on an empty kernel cache and a filled one."""
    with tempfile.TemporaryDirectory() as cache:
        for state in ("cold", "warm"):
            done = subprocess.run(
                [sys.executable, "-c", _START.format(name=name)],
                env={**os.environ, "NUMBA_CACHE_DIR": cache}, capture_output=True, text=True,
                check=True,
            )  # fmt: skip
            imported, loaded, solved = map(float, done.stdout.split())
            print(f"  {name:10}{state:6}import teleop_core {imported:6.3f} s   "
                  f"load_robot {loaded:6.3f} s   first ik {solved:6.3f} s")  # fmt: skip


def main() -> None:
    """Print every table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--share", type=float, default=1.0, help="share of the poses to run")
    share = parser.parse_args().share
    warnings.simplefilter("ignore")  # peers' deprecations
    for name in ARMS:
        compare(name, share)
    print("\nbatches on one core")
    for name in list_robots():
        batches(name, round(20_000 * share))
    print("\nstart-up, each in a new process")
    for name in ARMS:
        start_up(name)


if __name__ == "__main__":
    main()
