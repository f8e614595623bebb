"""Hardware plant: sticking friction, quantised drive efforts, and tip errors that encoders do not measure.

The known faults of a robot are in :attr:`Robot.hardware <teleop_core.robots.robot.Robot.hardware>`. A robot without
this entry has sticking dry friction from its drive table, and links exactly as drawn.
"""

from dataclasses import dataclass

import numpy as np

from teleop_core.base import ParameterError, UnknownNameError, Within, fixed, parameter
from teleop_core.graph import DT
from teleop_core.kernels import Array, pointer
from teleop_core.robots.arms.as_chain import true_chain
from teleop_core.robots.drives import ACCELERATION, Drives
from teleop_core.robots.dynamics.rigid_body import write_model
from teleop_core.robots.hardware import Hardware
from teleop_core.robots.robot import Robot
from teleop_core.slave.controllers import per_joint
from teleop_core.slave.plants import Physics, Plant

FASTEST_GEAR = 1500.0
"""Largest natural frequency [rad/s] of a gear on its spring that steps of half a tick can integrate."""
FAULTS = {
    "friction": "dry friction",
    "sticking": "that dry friction sticks, and is not smooth",
    "wandering": "dry friction that changes as a joint moves on",
    "bias": "amplifiers that give effort when none is asked for",
    "weights": "weights that the control law does not know",
    "drive_steps": "efforts in steps of the converter",
    "play": "backlash and stretch of tendons behind the encoders",
    "links": "links, and zeros of joints, that are not as drawn",
}
"""Faults that can be left out, by name."""


@dataclass(frozen=True, kw_only=True)
class HardwareParameters:
    """Simulated effects, values that replace those of the robot, and values that no robot file contains."""

    without: tuple[str, ...] = fixed(
        (), choices=tuple(FAULTS), doc="effects that the plant leaves out, to see what each contributes"
    )
    coulomb: tuple[float, ...] = parameter(
        (), Within(0.0, None, "N·m or N"), "dry friction of each joint; empty: the robot's"
    )
    wander: tuple[float, ...] = parameter(
        (), Within(0.0, 2.0), "standard deviation of each joint's dry friction, divided by its mean; empty: the robot's"
    )
    bias: tuple[float, ...] = parameter(
        (), Within(unit="N·m or N"), "effort of each amplifier at a command of zero; empty: the robot's"
    )
    play: tuple[float, ...] = parameter(
        (), Within(0.0, None, "rad or m"), "half of the backlash behind each encoder; empty: the robot's"
    )
    weights: tuple[str, ...] = fixed(
        (), doc="symbol=value for each dynamic parameter that the source does not state; empty: the robot's"
    )
    bristle_frequency: float = parameter(
        250.0,
        Within(10.0, 2000.0, "rad/s"),
        "frequency at which a joint oscillates on the elasticity of its friction before it slips",
        source="assumed: a joint moves elastically by a few encoder counts before it slips",
    )
    wander_travel: float = parameter(
        2000.0,
        Within(1.0, 1e7, "encoder counts"),
        "distance over which the random dry friction of a slipping joint changes; at rest it does not change",
        source="assumed: about one turn of the motor, after which gears and bearings repeat",
    )
    drive_bits: int = parameter(
        14,
        Within(4, 32),
        "resolution of the converter that commands the amplifier, in bits for the range from peak to peak",
        source="assumed: usual for analog output cards; the source states no number",
    )
    # Faults that no source of the RCRT-1 mentions; `teleop experiment robustness` turns them on.
    effort_delay: float = parameter(
        0.0,
        Within(0.0, 0.03, "s"),
        "delay from the control law to the motor in addition to one tick, rounded to whole ticks",
        source="assumed: no delay; field buses of drives take 1 to 5 ms",
    )
    drive_gain: float = parameter(
        1.0,
        Within(0.1, 20.0),
        "effort of the drives, divided by the commanded effort",
        source="assumed: 1; torque constants are known to some 10 %",
    )
    gear_stiffness: tuple[float, ...] = fixed(
        (),
        Within(0.0, None, "N·m/rad or N/m"),
        "stiffness of each gear between its motor (with the encoder) and its link; 0 or empty: rigid",
    )
    motor_inertia: tuple[float, ...] = fixed(
        (),
        Within(1e-12, None, "kg·m² or kg"),
        "inertia of each motor at the output of its gear, a part of the axis's inertia; used for "
        "elastic gears only; empty: the robot's",
    )


def faults_of(robot: Robot) -> Hardware:
    """Known faults of the real arm; if none are known, the dry friction of its drive table."""
    if robot.hardware is not None:
        return robot.hardware
    assert robot.drives is not None
    zero = np.zeros(robot.n)
    return Hardware(
        coulomb=robot.drives.coulomb,
        bias=zero,
        wander=zero,
        play=zero,
        coupling=np.zeros((robot.n, robot.n)),
        sources={"coulomb": "assumed: as in the drive table"},
    )


def _steps(drives: Drives, bits: int) -> Array:
    """Resolution of the converters over their range [N·m or N].

    The range ends at the drive's effort limit, or at the effort that brings the axis to full speed within a tick. The
    second bound is needed because some robot files contain drives of 100 N·m for links of a few grams. One step of such
    a drive would accelerate the link too much.
    """
    quick = drives.inertia * drives.speed_limit / DT
    return 2.0 * np.minimum(drives.effort_limit, quick) / 2.0**bits


def hardware_physics(parameters: HardwareParameters, robot: Robot) -> Physics:
    """Physics from a robot's drive table and its faults, except the faults that the parameters leave out.

    Raises:
        ParameterError: The length of a list is not the robot's number of joints, or a weight has no value.
        UnknownNameError: A weight is not among the unknown parameters of the robot's dynamics.
    """
    drives, faults, out = robot.drives, faults_of(robot), set(parameters.without)
    assert drives is not None

    def number(name: str, fault: str) -> Array:
        given = getattr(parameters, name)
        values = per_joint(robot, f"plant.hardware.{name}", given, getattr(faults, name))
        return np.zeros(robot.n) if fault in out else values

    ones = np.ones(robot.n)
    zero, bristle = np.zeros(robot.n), drives.inertia * parameters.bristle_frequency**2
    return Physics(
        viscous=drives.viscous,
        coulomb=number("coulomb", "friction"),
        friction_speed=drives.friction_speed,
        bristle=zero if "sticking" in out else bristle,
        wander=number("wander", "wandering"),
        wander_travel=parameters.wander_travel * drives.encoder_step,
        bias=number("bias", "bias"),
        effort_step=zero if "drive_steps" in out else _steps(drives, parameters.drive_bits),
        encoder_step=drives.encoder_step,
        play=number("play", "play"),
        coupling=np.zeros((robot.n, robot.n)) if "play" in out else faults.coupling,
        tip_geometry=np.zeros(0) if "links" in out else _tip_geometry(robot, faults),
        dynamics=np.zeros(0) if "weights" in out else _dynamics(robot, faults, parameters.weights),
        effort_delay=parameters.effort_delay,
        drive_gain=parameters.drive_gain * ones,
        gear_stiffness=_gears(robot, parameters),
        motor_inertia=_motors(robot, parameters),
    )


def _motors(robot: Robot, parameters: HardwareParameters) -> Array:
    """Inertias of the motors (n,), seen through their gears: the robot's values, or half of each axis's inertia."""
    faults, drives = faults_of(robot), robot.drives
    assert drives is not None
    known = faults.motors if len(faults.motors) else 0.5 * drives.inertia
    return per_joint(robot, "plant.hardware.motor_inertia", parameters.motor_inertia, known)


def _gears(robot: Robot, parameters: HardwareParameters) -> Array:
    """Stiffness of the gears (n,).

    Raises:
        ParameterError: A gear that bends has no link inertia behind it, or oscillates too fast for the ticks.
    """
    given, n, model = parameters.gear_stiffness, robot.n, robot.dynamics
    stiffness = per_joint(robot, "plant.hardware.gear_stiffness", given, np.zeros(n))
    if not stiffness.any():
        return stiffness
    assert model is not None
    out, motors = np.empty(n + n * n), _motors(robot, parameters)
    row, home = model.parameters.copy(), robot.home.copy()
    write_model(pointer(model.acceleration, ACCELERATION), row, home, np.zeros(n), out)
    links = np.diag(out[n:].reshape(n, n)) - motors
    for i in np.flatnonzero(stiffness):
        of = f"plant.hardware.gear_stiffness of {robot.joint_names[i]}"
        if links[i] <= 1e-9 * motors[i]:
            raise ParameterError(of, stiffness[i], "0: in this model its motor is all that it moves")
        most = FASTEST_GEAR**2 * motors[i] * links[i] / (motors[i] + links[i])
        if stiffness[i] > most:
            raise ParameterError(of, stiffness[i], f"<= {most:.3g}, which swings at {FASTEST_GEAR} rad/s")
    return stiffness


def _dynamics(robot: Robot, faults: Hardware, weights: tuple[str, ...]) -> Array:
    """Parameter row of the true dynamics; empty if it equals the row that the control law uses."""
    model = robot.dynamics
    assert model is not None
    row = (faults.dynamics if len(faults.dynamics) else model.parameters).copy()
    for text in weights:
        symbol, _, value = text.partition("=")
        if symbol not in model.unknown:
            raise UnknownNameError("plant.hardware.weights", symbol, model.unknown)
        try:
            row[model.unknown[symbol]] = float(value)
        except ValueError:
            raise ParameterError("plant.hardware.weights", text, f"{symbol}=number") from None
    return row


def _tip_geometry(robot: Robot, faults: Hardware) -> Array:
    """Geometry row of the arm as built; empty if it equals the drawing, or if the robot is not a chain."""
    built = None if faults.links is None else true_chain(robot, faults.links)
    return np.zeros(0) if built is None else built


HARDWARE = Plant("hardware", HardwareParameters, hardware_physics)
