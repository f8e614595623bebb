"""Make a slave of your own from a table of links, and let it follow the hand."""

import numpy as np

import teleop_core as tc

TABLE = {
    "name": "gantry",
    "convention": "modified",
    "angles": "degrees",
    "rows": [
        {"d": "q", "lower": 0.0, "upper": 0.6, "home": 0.3, "name": "up"},
        {"alpha": -90, "d": "q", "theta": -90, "lower": -0.3, "upper": 0.3, "name": "side"},
        {"alpha": -90, "d": "q", "lower": 0.1, "upper": 0.5, "home": 0.3, "name": "out"},
        {"theta": "q", "lower": -170, "upper": 170, "name": "roll"},
        {"alpha": -90, "theta": "q - 90", "lower": -80, "upper": 80, "name": "pitch"},
        {"alpha": -90, "theta": "q", "lower": -80, "upper": 80, "name": "yaw"},
        {"a": 0.05},
    ],
    "drives": {"up": {"inertia": 6.0, "speed_limit": 0.5}, "side": {"inertia": 4.0, "speed_limit": 0.5}},
}


GANTRY = tc.register_robot(tc.robot_from_table(TABLE))


def main() -> None:
    """Print the description of the robot, and its tracking error."""
    robot = tc.load_robot("gantry")
    tip = robot.fk(robot.home)
    answer = robot.ik(tip, seed=robot.home)
    print(robot.name, robot.joint_names, "tip at", np.round(tip[:3, 3], 3))
    print(f"joints that reach its home: {np.round(answer.q, 6)}, {answer.status.name}")
    score = tc.run("coarse_box", duration=15.0, robot="gantry").score()
    print(f"{robot.name}: {score.value('position_error_mm.rms'):.3f} mm RMS behind its reference")


if __name__ == "__main__":
    main()
