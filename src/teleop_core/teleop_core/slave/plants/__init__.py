"""Plants: the physics that the slave simulator moves, from the amplifier's input to the true tip.

A plant is a set of numbers for one compiled model: rigid bodies, friction, drives, encoders, and the transmission
behind the encoders. Each file states the origin of its numbers.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from teleop_core.base.errors import ParameterError, PartError, ShapeError
from teleop_core.base.registry import Registry, part_check, places, tried
from teleop_core.kernels.addresses import Addressed
from teleop_core.kernels.geometry import Array
from teleop_core.robots.robot import Robot
from teleop_core.slave.arm import ArmParts

__all__ = ["PLANTS", "Mover", "Physics", "Plant", "register_plant"]

PER_JOINT = (
    "viscous", "coulomb", "friction_speed", "bristle", "wander", "wander_travel", "bias",
    "effort_step", "encoder_step", "play", "drive_gain", "gear_stiffness", "motor_inertia",
)  # fmt: skip


@dataclass(frozen=True, kw_only=True, eq=False)
class Physics:
    """Numbers of a plant; each has shape (n,) unless another shape is given.

    Args:
        viscous: Viscous friction [N·m·s/rad or N·s/m].
        coulomb: Dry friction [N·m or N].
        friction_speed: Speed at which dry friction that does not stick has 71 % of its value [rad/s or m/s].
        bristle: Stiffness of dry friction that sticks [N·m/rad or N/m]; 0 for friction that does not stick.
        wander: Standard deviation of dry friction, divided by its mean.
        wander_travel: Distance of slip over which dry friction changes [rad or m], > 0.
        bias: Effort that the amplifier adds [N·m or N].
        effort_step: Resolution of the drive's effort [N·m or N]; 0: continuous.
        encoder_step: Resolution of the encoder [rad or m].
        play: Half width of the play between encoder and joint [rad or m].
        coupling: Motion of a joint per lag of an earlier joint, (n, n), below the diagonal.
        tip_geometry: Row of :func:`teleop_core.kinematics.dh_kernels.fk` for the true links;
            empty for the robot's own forward kinematics.
        dynamics: Parameter row of the true dynamics; empty for the dynamics that the control law knows.
        effort_delay: Delay from commanded effort to motor effort, beyond the tick [s]; whole ticks.
        drive_gain: Effort that the drives give, divided by the commanded effort; None: 1.
        gear_stiffness: Stiffness of gears that bend [N·m/rad or N/m]; 0 for rigid gears; None if all gears are rigid.
        motor_inertia: Inertia of the motors, seen through their gears [kg·m² or kg]. The dynamics contain it already;
            it is used only for gears that bend.
    """

    viscous: Array
    coulomb: Array
    friction_speed: Array
    bristle: Array
    wander: Array
    wander_travel: Array
    bias: Array
    effort_step: Array
    encoder_step: Array
    play: Array
    coupling: Array
    tip_geometry: Array
    dynamics: Array
    effort_delay: float = 0.0
    drive_gain: Array | None = None
    gear_stiffness: Array | None = None
    motor_inertia: Array | None = None

    def __post_init__(self) -> None:
        n = len(np.atleast_1d(self.viscous))
        for name, usual in (("drive_gain", 1.0), ("gear_stiffness", 0.0), ("motor_inertia", 1.0)):
            if getattr(self, name) is None:
                object.__setattr__(self, name, np.full(n, usual))
        for name in PER_JOINT:
            array = np.array(getattr(self, name), dtype=np.float64)
            if array.shape != (n,):
                raise ShapeError(f"plant.{name}", (n,), array.shape)
            if not np.isfinite(array).all():
                raise ParameterError(f"plant.{name}", array.tolist(), "finite")
            object.__setattr__(self, name, array)


class Mover(Protocol):
    """Simulator of others that moves an arm in place of our own equations of motion.

    In each tick of the arm, ``see`` is called first and ``move`` last. The kernels of both exchange values with the
    arrays of the :class:`~teleop_core.slave.arm.ArmParts` and the signals for which the mover was made.

    Attributes:
        see: Writes joint positions and speeds of the present moment, ``slave_true_cf``, and with servos the efforts.
        move: Takes the efforts of the drives, or with servos the setpoint, for the coming tick.
        has_servos: Whether drives of the mover follow the setpoint, so that no control law of ours is used.
    """

    see: Addressed
    move: Addressed
    has_servos: bool

    def reset(self) -> None:
        """Return to the state before the first tick, with the arm at its present position, at rest."""

    def close(self) -> None:
        """End a trial, which no other stage of the session joins."""

    def concerns(self) -> list[str]:
        """Sentences for users about present problems."""


@dataclass(frozen=True)
class Plant:
    """A plant.

    Attributes:
        name: Name of the plant in ``--set plant=``.
        parameters: Parameter group of the plant.
        physics: ``physics(parameters, robot)`` returns the numbers of the plant for a robot with drives.
        mover: ``mover(parameters, robot, arm, signals, dt)`` returns a simulator that moves the arm; None for our own
            equations of motion. Then the numbers of ``physics`` only serve the checks of the control loop.
    """

    name: str
    parameters: type
    physics: Callable[[Any, Robot], Physics]
    mover: Callable[[Any, Robot, ArmParts, Any, float], Mover] | None = None


def _try(part: Plant) -> None:
    """Try a plant once, so that errors are reported before anything runs."""
    from teleop_core.robots import load_robot

    with tried("plant", part.name, "one with physics(parameters, robot) -> Physics"):
        made = part.physics(part.parameters(), load_robot("scara"))
    if not isinstance(made, Physics):
        raise PartError("plant", part.name, f"one that gives Physics, not {type(made).__name__}")


PLANTS: Registry[Plant] = Registry(
    "plant",
    "plants",
    places("teleop_core.slave.plants", "ideal hardware"),
    part_check("plant", Plant, "physics"),
    _try,
    elsewhere={"scene": "teleop_scene"},
)
"""All plants by name."""

register_plant = PLANTS.register
"""Adds your plant under its own name; see :meth:`Registry.register`."""
