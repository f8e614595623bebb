"""Hardware plant: friction that sticks, drives in steps, and a tip that encoders do not see.

What is known of a robot stands in :attr:`Robot.hardware <teleop_core.robots.robot.Robot.hardware>`;
a robot without it sticks by the dry friction of its drive table and is made as drawn.
"""

from dataclasses import dataclass

import numpy as np

from teleop_core.geometry import Array
from teleop_core.parameters import parameter
from teleop_core.plants import Physics, Plant
from teleop_core.robots.hardware import Hardware
from teleop_core.robots.link_errors import true_chain
from teleop_core.robots.robot import Robot


@dataclass(frozen=True, kw_only=True)
class HardwareParameters:
    """Which faults there are, each to be switched off alone, and what no robot states."""

    sticking: bool = parameter(True, doc="dry friction that holds a joint at rest")
    wandering: bool = parameter(True, doc="dry friction that changes as time goes by")
    bias: bool = parameter(True, doc="amplifiers that give effort when none is asked for")
    drive_steps: bool = parameter(True, doc="efforts in steps of the converter")
    play: bool = parameter(True, doc="backlash and stretch of tendons behind the encoders")
    links: bool = parameter(True, doc="links, and zeros of joints, that are not as drawn")
    masses: bool = parameter(True, doc="weights that the control law does not know")
    coulomb: tuple[float, ...] = parameter(
        (), unit="N·m or N", lower=0.0, doc="dry friction of each joint; empty: the robot's",
    )  # fmt: skip
    bristle_frequency: float = parameter(
        250.0, unit="rad/s", lower=10.0, upper=2000.0,
        doc="at which a joint swings on its friction before it slips",
        source="assumed: a joint gives by a few encoder counts before it slips",
    )  # fmt: skip
    wander_time: float = parameter(
        1.0, unit="s", lower=0.01, upper=1000.0, doc="over which dry friction changes",
        source="assumed: runs of the precision test, seconds apart, differ as if drawn anew",
    )  # fmt: skip
    drive_bits: int = parameter(
        14, lower=4, upper=32, doc="of the converter that commands the amplifier, peak to peak",
        source="assumed: usual for cards of analog outputs; the source names no number",
    )  # fmt: skip


def faults_of(robot: Robot) -> Hardware:
    """What is known of the real arm; without anything, the dry friction of its drive table."""
    if robot.hardware is not None:
        return robot.hardware
    assert robot.drives is not None
    zero = np.zeros(robot.n)
    return Hardware(
        coulomb=robot.drives.coulomb, bias=zero, wander=zero, play=zero,
        coupling=np.zeros((robot.n, robot.n)),
        sources={"coulomb": "assumed: as in the drive table"},
    )  # fmt: skip


def hardware_physics(parameters: HardwareParameters, robot: Robot) -> Physics:
    """Numbers of a robot's drive table and of its faults, as far as they are switched on.

    Raises:
        ParameterError: ``coulomb`` is not of the robot's number of joints.
    """
    from teleop_core.controllers import per_joint

    drives, faults = robot.drives, faults_of(robot)
    assert drives is not None

    def where(is_on: bool, numbers: Array) -> Array:
        return numbers if is_on else np.zeros_like(numbers)

    bristle = drives.inertia * parameters.bristle_frequency**2
    steps = 2.0 * drives.effort_limit / 2.0**parameters.drive_bits
    return Physics(
        viscous=drives.viscous,
        coulomb=per_joint(robot, "plant.hardware.coulomb", parameters.coulomb, faults.coulomb),
        friction_speed=drives.friction_speed,
        bristle=where(parameters.sticking, bristle),
        wander=where(parameters.wandering, faults.wander),
        wander_time=parameters.wander_time,
        bias=where(parameters.bias, faults.bias),
        effort_step=where(parameters.drive_steps, steps),
        encoder_step=drives.encoder_step,
        play=where(parameters.play, faults.play),
        coupling=where(parameters.play, faults.coupling),
        tip_geometry=_tip_geometry(robot, faults) if parameters.links else np.zeros(0),
        dynamics=faults.dynamics if parameters.masses else np.zeros(0),
    )


def _tip_geometry(robot: Robot, faults: Hardware) -> Array:
    """Geometry row of the arm as built; empty where nothing differs, or the robot is no chain."""
    built = None if faults.links is None else true_chain(robot, faults.links)
    return np.zeros(0) if built is None else built


HARDWARE = Plant("hardware", HardwareParameters, hardware_physics)
