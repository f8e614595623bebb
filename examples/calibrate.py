"""Identify the errors of an arm from measured positions of its tip, and use them to command the arm."""

from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pandas as pd

from teleop_core.robots import Robot, load_robot, robot_from_table
from teleop_lab.calibration import appendix_e, calibrate, read_measured, simulate


def table_of_poses(path: Path, drawn: Robot, built: Robot) -> None:
    """Write 40 poses as an instrument with 0.1 mm of noise measures them: encoder and tip positions."""
    rng = np.random.default_rng(1)
    joints = rng.uniform(drawn.lower, drawn.upper, (40, drawn.n))
    tips = built.fk(joints)[:, :3, 3] + rng.normal(0.0, 0.1e-3, (40, 3))
    table = pd.DataFrame(np.degrees(joints), columns=[f"{n}_deg" for n in drawn.joint_names])
    table[["x", "y", "z"]] = tips
    table.to_csv(path, index=False)


def main() -> None:
    """Calibrate from published readings, from a file, and from simulated instruments."""
    rcrt1 = load_robot("rcrt1")
    published = calibrate(rcrt1, appendix_e.published(rcrt1), ["d3"])
    print(f"published: d3 {1e3 * published.found.errors.d[2]:.2f} mm", end=", ")
    print(f"RMS {1e3 * published.fitted.before['total'].rms:.3f}", end=" -> ")
    print(f"{1e3 * published.fitted.after['total'].rms:.3f} mm")

    drawn, built = load_robot("puma560"), load_robot("puma560", a2=0.4328, d4=0.4311)
    with TemporaryDirectory() as folder:
        file = Path(folder) / "poses.csv"
        table_of_poses(file, drawn, built)
        found = calibrate(drawn, read_measured(file, drawn))
    print(f"\n{found}\n")
    arm = robot_from_table(found.table())
    goal = built.fk(built.start)
    for name, robot in (("as drawn", drawn), ("as found", arm)):
        tip = built.fk(robot.ik(goal, built.start).q)[:3, 3]
        print(f"led {name}: {1e3 * np.linalg.norm(tip - goal[:3, 3]):.3f} mm off")

    for noise in ("ruler", 0.1e-3):
        tried = simulate(rcrt1, poses=30, noise=noise).tried
        if tried is not None:
            print(f"{noise}: {1e3 * tried.after['total'].rms:.3f} mm RMS at fresh poses")


if __name__ == "__main__":
    main()
