"""Compute the pose of a platform on legs: one pose, all poses, a path, and leg lengths without a pose."""

import numpy as np

import teleop_core as tc
from teleop_core.robots import FkStatus


def main() -> None:
    """Print the results of forward kinematics of a platform on three legs, with their status."""
    robot = tc.load_robot("rps3")
    for legs in (robot.home, np.array([1.715, 1.165, 1.687]), np.array([0.8, 0.8, 5.0])):
        answer = robot.solve_fk(legs)
        poses = robot.fk_all(legs)
        print(f"legs {legs}: {answer.status.name}, mode {answer.mode:+d},", end=" ")
        print(f"{1e3 * answer.residual:.3g} mm open, {len(poses)} assemblies")

    below = robot.fk_all(robot.home)[:, 2, 3].argmin()
    kept = robot.solve_fk(robot.home, seed=robot.fk_all(robot.home)[below])
    print(f"home's legs below the base: height {kept.T[2, 3]:.3f} m, mode {kept.mode:+d}")

    path = np.linspace(robot.home, (1.715, 1.165, 1.687), 500)
    way = robot.follow_fk(path)
    last = int((way.status == FkStatus.CLOSED).sum()) - 1
    print(f"home's assembly ends {100 * last / 499:.0f} % of the way to the second legs")

    try:
        robot.fk([0.8, 0.8, 5.0])
    except tc.ClosureError as error:
        print(error)


if __name__ == "__main__":
    main()
