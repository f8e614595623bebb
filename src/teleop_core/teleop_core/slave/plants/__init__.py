"""Plants: the physics that the slave simulator moves, from the amplifier's input to the true tip.

A plant is a set of numbers for one compiled model: rigid bodies, friction, drives, encoders, and the transmission
behind the encoders. Each file states the origin of its numbers.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from teleop_core.base.errors import ParameterError, PartError, ShapeError
from teleop_core.base.registry import Registry, part_check, places, tried
from teleop_core.kernels.geometry import Array
from teleop_core.robots.robot import Robot

__all__ = ["PLANTS", "Physics", "Plant", "register_plant"]

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


@dataclass(frozen=True)
class Plant:
    """A plant.

    Attributes:
        name: Name of the plant in ``--set plant=``.
        parameters: Parameter group of the plant.
        physics: ``physics(parameters, robot)`` returns the numbers of the plant for a robot with drives.
    """

    name: str
    parameters: type
    physics: Callable[[Any, Robot], Physics]


def _try(part: Plant) -> None:
    """Try a plant once, so that errors are reported before anything runs."""
    from teleop_core.robots import load_robot

    with tried("plant", part.name, "one with physics(parameters, robot) -> Physics"):
        made = part.physics(part.parameters(), load_robot("scara"))
    if not isinstance(made, Physics):
        raise PartError("plant", part.name, f"one that gives Physics, not {type(made).__name__}")


PLANTS: Registry[Plant] = Registry(
    "plant", "plants", places("teleop_core.slave.plants", "ideal hardware"), part_check("plant", Plant, "physics"), _try
)
"""All plants by name."""

register_plant = PLANTS.register
"""Adds your plant under its own name; see :meth:`Registry.register`."""
