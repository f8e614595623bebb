"""Inverse kinematics of arms from a URDF beside their peers: six axes and seven, one run.

Run with ``python benchmarks/urdf_arms.py``. Seeds lie 0.05 rad (standard deviation) off the joints
that made the pose. Solved means within 1e-6 m and 1e-6 rad, legal means inside the joint limits
too; the ratio is ours over the peer's median. A move is the largest of any joint from the seed: a
large one is another branch. Pink and mink step with damped least squares, steps
of full length, until the tolerance or 100 rounds; EAIK has two choices: the nearest branch, and the
nearest of all whole turns inside the limits. Peers that are not installed are named and skipped.
"""

import argparse
import os
import tempfile
import time
import warnings
from collections.abc import Callable, Iterator
from importlib import import_module
from pathlib import Path
from typing import Any

for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[variable] = "1"

import numpy as np  # noqa: E402

from teleop_core.robots import load_robot  # noqa: E402

SIX = Path(__file__).parent.parent / "examples" / "any_arm.urdf"
# KUKA LBR iiwa 14 R820: signs of alpha in quarter turns, and d [m]; limits [degrees].
QUARTERS, LENGTHS = (-1, 1, 1, -1, -1, 1, 0), (0.36, 0.0, 0.42, 0.0, 0.4, 0.0, 0.126)
LIMITS = (170, 120, 170, 120, 170, 120, 175)
TOLERANCE, ROUNDS = 1e-6, 100
Solver = Callable[[Any, Any], Any]


def iiwa(folder: Path) -> Path:
    """Write the seven-axis arm with links of 1 kg, which mujoco needs."""
    body = '<inertial><mass value="1"/><inertia ixx="1e-2" iyy="1e-2" izz="1e-2" ixy="0" ixz="0" '
    body += 'iyz="0"/></inertial>'
    text, d, turn = '<robot name="iiwa14"><link name="l0"/>', 0.0, 0.0
    for i, (quarter, length, limit) in enumerate(zip(QUARTERS, LENGTHS, LIMITS, strict=True)):
        text += (
            f'<link name="l{i + 1}">{body}</link><joint name="j{i + 1}" type="revolute"><parent '
            f'link="l{i}"/><child link="l{i + 1}"/><origin xyz="0 0 {d!r}" rpy="{turn!r} 0 0"/>'
            f'<axis xyz="0 0 1"/><limit effort="200" velocity="2" lower="{-np.radians(limit)}" '
            f'upper="{np.radians(limit)}"/></joint>'
        )
        d, turn = length, quarter * 0.5 * np.pi
    path = folder / "iiwa14.urdf"
    path.write_text(text + "</robot>")
    return path


def eaik_of(robot: Any) -> Any:
    """EAIK's branches of a pose: it counts points and axes at zero, rotations from there."""
    from eaik.IK_HP import HPRobot

    axes, points, here = [], [np.zeros(3)], np.zeros(robot.n)
    J = robot.jacobian(here)
    tip = robot.fk(here)
    for i in range(robot.n):
        w = J[3:, i]
        axes.append(w)
        points.append(tip[:3, 3] + np.cross(w, J[:3, i]))  # a point of the axis
    solver = HPRobot(np.array(axes), np.diff(np.array([*points, tip[:3, 3]]), axis=0))

    def branches(pose: Any) -> Any:
        target = pose.copy()
        target[:3, :3] = pose[:3, :3] @ tip[:3, :3].T
        return np.asarray(solver.IK(target).Q)

    return branches


def eaik_nearest(path: Path, robot: Any) -> Solver:
    """The branch nearest to the seed by the largest joint move, limits aside."""
    branches = eaik_of(robot)

    def solve(pose: Any, seed: Any) -> Any:
        q = branches(pose)
        q = q - 2.0 * np.pi * np.round((q - seed) / (2.0 * np.pi))
        return q[np.argmin(np.abs(q - seed).max(axis=1))]

    return solve


def eaik_limits(path: Path, robot: Any) -> Solver:
    """The nearest of all branches and whole turns that lie inside the limits."""
    branches, turns = eaik_of(robot), 2.0 * np.pi * np.array([-1.0, 0.0, 1.0])[:, None]

    def solve(pose: Any, seed: Any) -> Any:
        q = branches(pose)[:, None] + turns
        move = np.where((q >= robot.lower) & (q <= robot.upper), np.abs(q - seed), np.inf)
        round_ = move.argmin(axis=1)  # of each joint
        best = np.take_along_axis(move, round_[:, None], 1)[:, 0].max(axis=1).argmin()
        return np.take_along_axis(q[best], round_[best][None], 0)[0]

    return solve


def pink_loop(path: Path, robot: Any) -> Solver:
    """Pink: a frame task, steps with the solver daqp."""
    import pink
    import pinocchio as pin

    model = pin.buildModelFromUrdf(str(path))
    task = pink.FrameTask("l7", position_cost=1.0, orientation_cost=1.0)

    def solve(pose: Any, seed: Any) -> Any:
        task.set_target(pin.SE3(pose))
        place = pink.Configuration(model, model.createData(), seed)
        for _ in range(ROUNDS):
            if np.abs(task.compute_error(place)).max() < 0.5 * TOLERANCE:
                break
            place.integrate_inplace(pink.solve_ik(place, [task], 1.0, solver="daqp"), 1.0)
        return place.q

    return solve


def mink_loop(path: Path, robot: Any) -> Solver:
    """Mink: a frame task with the joint limits, steps with the solver daqp."""
    import mink
    import mujoco

    model = mujoco.MjModel.from_xml_path(str(path))
    limits = [mink.ConfigurationLimit(model)]
    task = mink.FrameTask("l7", "body", position_cost=1.0, orientation_cost=1.0)
    place = mink.Configuration(model)

    def solve(pose: Any, seed: Any) -> Any:
        task.set_target(mink.SE3.from_matrix(pose))
        place.update(seed)
        for _ in range(ROUNDS):
            if np.abs(task.compute_error(place)).max() < 0.5 * TOLERANCE:
                break
            place.integrate_inplace(mink.solve_ik(place, [task], 1.0, "daqp", limits=limits), 1.0)
        return place.q.copy()

    return solve


def rtb_lm(path: Path, robot: Any) -> Solver:
    """Roboticstoolbox's compiled Levenberg-Marquardt, with its restarts."""
    rtb: Any = import_module("roboticstoolbox")
    chain = rtb.ETS()
    last = (0, 0.0)  # the tip is the frame of joint 7
    links = [*zip(QUARTERS[:6], LENGTHS[:6], strict=True), last]
    for (quarter, length), limit in zip(links, LIMITS, strict=True):
        chain = chain * rtb.ET.Rz(qlim=np.radians([-limit, limit]))
        chain = chain * rtb.ET.tz(length) if length else chain
        chain = chain * rtb.ET.Rx(0.5 * np.pi * quarter) if quarter else chain
    return lambda pose, seed: chain.ik_LM(pose, q0=seed, tol=1e-14)[0]


PEERS: dict[str, dict[str, Callable[[Path, Any], Solver]]] = {
    "six axes": {"EAIK + nearest": eaik_nearest, "EAIK + limits": eaik_limits},
    "seven axes": {"pink": pink_loop, "mink": mink_loop, "roboticstoolbox ik_LM": rtb_lm},
}


def solvers(path: Path, robot: Any, kind: str) -> Iterator[tuple[str, Solver]]:
    """Ours, then every peer that is installed."""
    yield "teleop_core", lambda pose, seed: robot.ik(pose, seed).q
    for name, make in PEERS[kind].items():
        try:
            yield name, make(path, robot)
        except ImportError as error:
            print(f"  {name}: skipped, not installed ({error})")


def judged(robot: Any, poses: Any, answers: Any) -> tuple[float, float]:
    """Shares solved, and solved inside the limits [%]."""
    finite = np.isfinite(answers).all(axis=1)
    reached = robot.fk(np.where(finite[:, None], answers, 0.0))
    is_solved = finite & (np.abs(reached - poses).max(axis=(1, 2)) < TOLERANCE)
    inside = ((answers >= robot.lower - 1e-9) & (answers <= robot.upper + 1e-9)).all(axis=1)
    return 100.0 * is_solved.mean(), 100.0 * (is_solved & inside).mean()


def compare(path: Path, robot: Any, kind: str, count: int) -> None:
    """Print one arm's table."""
    print(f"\n{robot.name}, {kind}, {robot.solution}; {count} poses, single calls from Python")
    rng = np.random.default_rng(3)
    joints = rng.uniform(robot.lower, robot.upper, (count, robot.n))
    seeds = np.clip(joints + rng.normal(0.0, 0.05, joints.shape), robot.lower, robot.upper)
    poses, ours = robot.fk(joints), 0.0
    for name, solve in solvers(path, robot, kind):
        solve(poses[0], seeds[0])
        times, answers = [], []
        for pose, seed in zip(poses, seeds, strict=True):
            begin = time.perf_counter()
            try:
                answer = np.asarray(solve(pose, seed), dtype=float)
            except Exception:  # a peer's own failure is a failed pose
                answer = np.full(robot.n, np.nan)
            times.append(1e6 * (time.perf_counter() - begin))
            answers.append(answer)
        median = float(np.median(times))
        ours = ours or median
        solved, legal = judged(robot, poses, np.array(answers))
        moves = np.abs(np.array(answers) - seeds).max(axis=1)
        far = f"moves by {np.nanmax(moves):.2f} rad at most, {(moves > 0.5).sum()} by more than 0.5"
        print(f"  {name:23} solved {solved:5.1f} %  legal {legal:5.1f} %  median {median:9.1f} µs  "
              f"p99 {np.percentile(times, 99):9.1f} µs  ratio {ours / median:6.3f}")  # fmt: skip
        print(f"  {'':23} {far}")
    many, beside, rates = np.tile(poses, (10, 1, 1)), np.tile(seeds, (10, 1)), []
    for _ in range(5):
        begin = time.perf_counter()
        robot.ik_batch(many, beside)
        rates.append(1e-6 * len(many) / (time.perf_counter() - begin))
    print(f"  teleop_core in a batch on one core: {max(rates):.3f} M/s")


def main() -> None:
    """Print both tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--share", type=float, default=1.0, help="share of the poses to run")
    count = max(20, round(1000 * parser.parse_args().share))
    warnings.simplefilter("ignore")  # peers' deprecations
    compare(SIX, load_robot(str(SIX), tip="tool0"), "six axes", count)
    with tempfile.TemporaryDirectory() as folder:
        path = iiwa(Path(folder))
        compare(path, load_robot(str(path)), "seven axes", count)


if __name__ == "__main__":
    main()
