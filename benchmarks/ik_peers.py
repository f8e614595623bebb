"""Other solvers of inverse kinematics, brought to one form: a pose and a seed in, joints out."""

import importlib
import os
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

from teleop_core.robots.arms.dh import CONVENTIONS, DhTable, elementary

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
            jacobian = end.inverse().action @ pin.getJointJacobian(model, data, parent, pin.ReferenceFrame.LOCAL)
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
        return chain.inverse_kinematics_frame(pose, initial_position=start, orientation_mode="all")[1:-1]

    return as_it_is, solve


PEERS: dict[str, Callable[[DhTable, Any], Adapted]] = {
    "EAIK + nearest": eaik,
    "roboticstoolbox ik_LM": roboticstoolbox,
    "PyKDL LMA": pykdl,
    "pinocchio CLIK": pinocchio,
    "ikpy": ikpy,
}
