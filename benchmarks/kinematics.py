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
import importlib
import os
import shutil
import subprocess
import sys
import tempfile
import time
import warnings
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[variable] = "1"

import numpy as np  # noqa: E402

from teleop_core.robots import load_robot  # noqa: E402
from teleop_core.robots.dh import CONVENTIONS, DhTable, elementary, load_table  # noqa: E402

TABLES = Path(__file__).parent.parent / "config" / "robots"
ARMS = ("puma560", "rcrt1")
COUNT = 1000  # poses of a workload
TOLERANCE = 1e-6
TURN = 2.0 * np.pi
Solver = Callable[[Any, Any], Any]
# Brings a pose into the form a peer takes, outside the measured time; and its solver.
Adapted = tuple[Callable[[Any], Any], Solver]


def motions(table: DhTable) -> Iterator[tuple[str, str, float, float]]:
    """Elementary motions of a chain: kind, axis, constant, sign of the joint (0: no joint)."""
    for row in table.rows:
        for kind, axis, symbol in CONVENTIONS[table.convention]:
            is_joint = row.joint is not None and row.joint.symbol == symbol
            sign = row.joint.sign if row.joint and is_joint else 0.0
            yield kind, axis, row.constants.get(symbol, 0.0), sign


def joint_frames(table: DhTable) -> tuple[list[tuple[Any, str]], Any]:
    """Fixed transform before each joint with the joint's kind, and the one after the last."""
    frames, fixed = [], np.eye(4)
    for kind, axis, amount, sign in motions(table):
        fixed = fixed @ elementary(kind, axis, amount)
        if sign:
            frames.append((fixed, kind))
            fixed = np.eye(4)
    return frames, fixed


def as_it_is(pose: Any) -> Any:
    """Return the pose: the peer takes a (4, 4) matrix."""
    return pose


def whole_turns(q: Any, robot: Any, turning: Any) -> Any:
    """Bring turning joints that are outside their limits inside by whole turns, if one can be."""
    outside = turning & ((q < robot.lower) | (q > robot.upper))
    if not outside.any():
        return q
    turns = np.round((q - 0.5 * (robot.lower + robot.upper)) / TURN)
    return np.where(outside, q - TURN * turns, q)


def system_module(name: str) -> Any:
    """Import a module, also one that only the distribution's own Python has beside it.

    Its folders are searched last and for this import alone, so nothing else comes from there.
    """
    try:
        return importlib.import_module(name)
    except ImportError:
        python = shutil.which("python3", path=os.defpath) or sys.executable
    question = "import site; print(*site.getsitepackages(), sep='\\n')"
    asked = [python, "-I", "-c", question]
    folders = subprocess.run(asked, capture_output=True, text=True, check=False).stdout
    before = sys.path.copy()
    try:
        sys.path.extend(folders.splitlines())
        return importlib.import_module(name)
    finally:
        sys.path[:] = before


def eaik(table: DhTable, robot: Any) -> Adapted:
    """EAIK with the branch nearest to the seed, by the largest joint move, inside the limits."""
    module = importlib.import_module("eaik.IK_HP")
    frames, tool = joint_frames(table)
    if any(kind == "slide" for _, kind in frames):
        raise NotImplementedError("it has no sliding joints")
    here, axes, points = np.eye(4), [], [np.zeros(3)]
    for fixed, _ in frames:
        here = here @ fixed
        axes.append(here[:3, 2])
        points.append(here[:3, 3])
    points.append((here @ tool)[:3, 3])
    zero = (here @ tool)[:3, :3]
    solver = module.HPRobot(np.array(axes), np.diff(np.array(points), axis=0))

    def adapt(pose: Any) -> Any:  # its rotations count from the zero pose
        target = pose.copy()
        target[:3, :3] = pose[:3, :3] @ zero.T
        return target

    def solve(target: Any, seed: Any) -> Any:
        branches = np.asarray(solver.IK(target).Q)
        branches = branches - TURN * np.round((branches - seed) / TURN)
        outside = ((branches < robot.lower) | (branches > robot.upper)).any(axis=1)
        return branches[np.argmin(np.abs(branches - seed).max(axis=1) + 100.0 * outside)]

    return adapt, solve


def roboticstoolbox(table: DhTable, robot: Any) -> Adapted:
    """Roboticstoolbox's compiled Levenberg-Marquardt, with its restarts."""
    rtb = importlib.import_module("roboticstoolbox")
    chain = rtb.ETS()
    for kind, axis, amount, sign in motions(table):
        make = getattr(rtb.ET, f"R{axis}" if kind == "turn" else f"t{axis}")
        chain = chain * make(amount) if amount else chain
        chain = chain * make(flip=sign < 0.0) if sign else chain
    chain.qlim = np.stack((robot.lower, robot.upper))
    return as_it_is, lambda pose, seed: chain.ik_LM(pose, q0=seed, tol=1e-14)[0]


def pykdl(table: DhTable, robot: Any) -> Adapted:
    """PyKDL's Levenberg-Marquardt; its default of 1e-5 would solve nothing to the tolerance."""
    kdl = system_module("PyKDL")
    chain, (frames, tool) = kdl.Chain(), joint_frames(table)
    turning = np.array([kind == "turn" for _, kind in frames])

    def adapt(pose: Any) -> Any:
        return kdl.Frame(kdl.Rotation(*pose[:3, :3].flat), kdl.Vector(*pose[:3, 3]))

    before = kdl.Joint(kdl.Joint.Fixed)  # a segment is a joint and the transform after it
    for fixed, kind in [*frames, (tool, "none")]:
        chain.addSegment(kdl.Segment(before, adapt(fixed)))
        before = kdl.Joint(kdl.Joint.RotZ if kind == "turn" else kdl.Joint.TransZ)
    solver = kdl.ChainIkSolverPos_LMA(chain, 1e-9)
    start, found = kdl.JntArray(robot.n), kdl.JntArray(robot.n)

    def solve(wanted: Any, seed: Any) -> Any:
        for i, value in enumerate(seed):
            start[i] = value
        solver.CartToJnt(start, wanted, found)
        q = np.array([found[i] for i in range(chain.getNrOfJoints())])  # the solver needs chain
        return whole_turns(q, robot, turning)

    return adapt, solve


def pinocchio(table: DhTable, robot: Any) -> Adapted:
    """Closed-loop inverse kinematics in a Python loop on pinocchio, as in its examples."""
    pin = importlib.import_module("pinocchio")
    model, parent = pin.Model(), 0
    frames, tool = joint_frames(table)
    for number, (fixed, kind) in enumerate(frames):
        joint = pin.JointModelRZ() if kind == "turn" else pin.JointModelPZ()
        parent = model.addJoint(parent, joint, pin.SE3(fixed), f"joint{number}")
    data, end = model.createData(), pin.SE3(tool)
    turning = np.array([kind == "turn" for _, kind in frames])

    def solve(wanted: Any, seed: Any) -> Any:
        q = np.array(seed)
        for _ in range(200):
            pin.computeJointJacobians(model, data, q)
            error = pin.log6((data.oMi[parent] * end).actInv(wanted))
            if np.linalg.norm(error.vector) < 1e-9:
                break
            jacobian = end.inverse().action @ pin.getJointJacobian(
                model, data, parent, pin.ReferenceFrame.LOCAL
            )
            square = jacobian @ jacobian.T + 1e-12 * np.eye(6)
            q = q + jacobian.T @ np.linalg.solve(square, error.vector)
        return whole_turns(q, robot, turning)

    return pin.SE3, solve


def ikpy(table: DhTable, robot: Any) -> Adapted:
    """Ikpy's least squares, position and whole orientation."""
    chain_module = importlib.import_module("ikpy.chain")
    link_module = importlib.import_module("ikpy.link")
    frames, tool = joint_frames(table)
    links = [link_module.OriginLink()]
    bounds = [*zip(robot.lower, robot.upper, strict=True), (None, None)]
    for i, (fixed, kind) in enumerate([*frames, (tool, "none")]):
        matrix, pitch = fixed, -np.arcsin(np.clip(fixed[2, 0], -1.0, 1.0))
        roll = np.arctan2(matrix[2, 1], matrix[2, 2])
        yaw = np.arctan2(matrix[1, 0], matrix[0, 0])
        links.append(
            link_module.URDFLink(
                f"joint{i}", matrix[:3, 3], [roll, pitch, yaw], bounds=bounds[i],
                rotation=[0, 0, 1] if kind == "turn" else None,
                translation=[0, 0, 1] if kind == "slide" else None,
                joint_type={"turn": "revolute", "slide": "prismatic", "none": "fixed"}[kind],
            )
        )  # fmt: skip
    chain = chain_module.Chain(links, active_links_mask=[False, *[True] * len(frames), False])

    def solve(pose: Any, seed: Any) -> Any:
        start = np.array([0.0, *np.clip(seed, robot.lower, robot.upper), 0.0])
        return chain.inverse_kinematics_frame(pose, initial_position=start, orientation_mode="all")[
            1:-1
        ]

    return as_it_is, solve


PEERS: dict[str, Callable[[DhTable, Any], Adapted]] = {
    "EAIK + nearest": eaik,
    "roboticstoolbox ik_LM": roboticstoolbox,
    "PyKDL LMA": pykdl,
    "pinocchio CLIK": pinocchio,
    "ikpy": ikpy,
}


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
        is_solved = distance <= TOLERANCE and angle <= TOLERANCE
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
            step = np.nanmax(np.abs(np.diff(answers, axis=0))) if is_path else np.nan
            solved, legal = judge(robot, some, answers)
            print(f"  {workload:21}{solver:23}{solved:9.1f}{legal:9.1f}{median:11.1f}"
                  f"{np.percentile(times, 99):9.1f}{median / ours:8.1f}{step:8.4f}")  # fmt: skip


def batches(name: str, count: int) -> None:
    """Print how many poses and solutions a second one core makes in a batch."""
    robot, rng = load_robot(name), np.random.default_rng(2)
    q = rng.uniform(robot.lower, robot.upper, (count, robot.n))
    poses, seeds = robot.fk(q), q + rng.normal(0.0, 0.05, q.shape)
    robot.ik(poses[:2], seeds[:2])
    rates = {"fk": 0.0, "ik near": 0.0, "ik far": 0.0}
    for _ in range(5):
        for key, call in (
            ("fk", lambda: robot.fk(q)),
            ("ik near", lambda: robot.ik(poses, seeds)),
            ("ik far", lambda: robot.ik(poses)),
        ):
            begin = time.perf_counter()
            call()
            rates[key] = max(rates[key], 1e-6 * count / (time.perf_counter() - begin))
    print(f"  {name:10}" + "".join(f"{key:>10} {rate:6.2f} M/s" for key, rate in rates.items()))


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
    for name in ARMS:
        batches(name, round(100_000 * share))
    print("\nstart-up, each in a new process")
    for name in ARMS:
        start_up(name)


if __name__ == "__main__":
    main()
