"""Control the slave's joints by your own law: PD with feedforward of the setpoint's speed."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

import teleop_core as tc

Array = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class FollowingParameters:
    """Parameters for ``--set controller.following.bandwidth=...``."""

    bandwidth: float = tc.parameter(80.0, tc.Within(1.0, 200.0, "rad/s"), "double pole")


def gains(parameters: FollowingParameters, robot: tc.Robot, viscous: Array) -> Array:
    """Kp, Kd and viscous friction of each joint, (n, 3)."""
    assert robot.drives is not None
    inertia, pole = robot.drives.inertia, parameters.bandwidth
    return np.stack((pole**2 * inertia, 2.0 * pole * inertia, viscous), axis=1)


@tc.kernel
def control(
    gains: Array, memory: Array, setpoint: Array, measured: Array, feedforward: Array,
    limit: Array, dt: float, effort: Array,
) -> None:  # fmt: skip
    """Write efforts that reduce the errors of position and speed; ``memory`` has the last setpoint and error."""
    for i in range(effort.shape[0]):
        error = setpoint[i] - measured[i]
        speed = (setpoint[i] - memory[i, 0]) / dt
        memory[i, 2] += ((error - memory[i, 1]) / dt - memory[i, 2]) / 4.0
        effort[i] = gains[i, 0] * error + gains[i, 1] * memory[i, 2]
        effort[i] += gains[i, 2] * speed + feedforward[i]
        memory[i, 0], memory[i, 1] = setpoint[i], error


def begin(memory: Array, measured: Array, effort: Array) -> None:
    """Start at rest, with no error."""
    memory[:, 0] = measured


FOLLOWING = tc.Controller("following", FollowingParameters, gains, control, 3, begin)
tc.register_controller(FOLLOWING)


def main() -> None:
    """Print the slave's position error with each law."""
    for law in ("pid", "pd", "following"):
        recording = tc.run("coarse_box", duration=15.0, controller=law, gravity_compensation="all")
        score = recording.score()
        print(f"{law}: {score.value('position_error_mm.rms'):.3f} mm RMS")


if __name__ == "__main__":
    main()
