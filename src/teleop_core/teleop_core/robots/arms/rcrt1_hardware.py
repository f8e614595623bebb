"""Hardware of the RCRT-1: how the built arm differs from its model, and the angles of its motors.

Encoders sit on the motors, so the published errors of chapters 7 and 8 do not contain errors of the gears, tendons and
links behind the motors. Only the accuracy test, with a ruler at the tip, measured these errors.

Source:
    Vongbunyong 2008, sections 3.4, 7.3 and appendix E; what is fitted or assumed is marked.
"""

import math

import numpy as np
from numpy.typing import NDArray

from teleop_core.base import ParameterError
from teleop_core.kernels import Array, product
from teleop_core.robots import hardware, link_errors
from teleop_core.robots.arms.rcrt1_dynamics import LINKS, link_row

_FIT = "fitted: to tables 7.1-7.6 with the gains of source_pid, by `teleop fit`"
# After correcting d3, an error of 0.352 mm remains in the accuracy test. Over the 37 mm from wrist to tip this is a
# tendon play of ±9.5 mrad. Half of it is taken, because the ruler causes a part of it.
_PLAY = 0.5 * 0.352e-3 / 0.037
_COUPLING = np.zeros((6, 6))
_COUPLING[5, 4] = 2.5 / 2.5  # r5 / r6: the tendon of joint 6 runs over the idler of axis 5
# One random draw of the tolerances: ±20 µm for machined lengths (links 1-3), ±100 µm for printed lengths (links 4-6),
# and the angles that such errors cause over a bearing 50 mm wide.
_LENGTH = np.array([20e-6, 20e-6, 20e-6, 100e-6, 100e-6, 100e-6])
_DRAWN = np.random.default_rng(2008).uniform(-1.0, 1.0, (4, 6)) * np.stack(
    [_LENGTH, _LENGTH / 0.05, _LENGTH, np.zeros(6)]
)
_DRAWN[2, 2] = 5.5e-3  # error of d3 [m]; it replaces the random value

HARDWARE = hardware.Hardware(
    coulomb=np.array([0.0880, 0.251, 1.0, 6.08e-3, 5.62e-4, 5.10e-4]),
    bias=np.array([0.0445, 0.0, 0.0, 0.0, 0.0, 0.0]),
    wander=np.array([0.27, 0.16, 0.16, 0.30, 0.62, 0.76]),
    play=np.array([0.0, 0.0, 0.0, 0.0, _PLAY, _PLAY]),
    coupling=_COUPLING,
    links=link_errors.LinkErrors.from_vector(_DRAWN.ravel()),
    dynamics=link_row(m2b_L0b=0.0135),
    motors=np.array([LINKS[f"J{i}"] for i in range(1, 7)]),
    sources={
        "coulomb": f"{_FIT}; of d3, which an integrator brings to its target: assumed",
        "bias": _FIT,
        "wander": f"{_FIT}; of d3 as of theta2",
        "play": "assumed: half of what the accuracy test leaves once d3 is mended",
        "coupling": "derived: radii r5 / r6 of the tendons' pulleys",
        "links": "fitted: d3 to tables E.1-E.3; the others assumed, one draw of the tolerances",
        "motors": "published: table A.1, its unit derived; of joints 3 to 6 assumed",
        "dynamics": f"{_FIT}; m2b L0b of the four-bar, which the published controller neglects",
    },
)


def tendon_motor_angles(joints: Array, *, ratio5: float = 1.0, ratio6: float = 1.0, coupling: float = 0.0) -> Array:
    """Motor-side angles of tendon joints 5 and 6: q5* = ratio5 q5, q6* = ratio6 q6 + coupling q5.

    The tendon of joint 6 runs over an idler on axis 5, so a move of joint 5 pulls this tendon. The published numbers
    were computed with the defaults: no coupling. The printed radii give ratio5 = r5/r5* = 0.7143, ratio6 = r6/r6* =
    1.3889 and coupling = r5/r6* = 1.3889.

    Args:
        joints: Joint angles 5 and 6, (..., 2) [rad].
        ratio5: Pulley ratio of joint 5, not 0.
        ratio6: Pulley ratio of joint 6, not 0.
        coupling: Rotation of motor 6 per rotation of joint 5; the sign depends on how the tendon is routed.

    Returns:
        Motor-side angles (..., 2) [rad].

    Raises:
        ParameterError: A ratio is zero.

    Source:
        Vongbunyong 2008, eqs. 3.5-3.7, completed by the balance of tendon travel.
    """
    return product(joints, _tendon_matrix(ratio5, ratio6, coupling).T)


def tendon_joint_angles(motors: Array, *, ratio5: float = 1.0, ratio6: float = 1.0, coupling: float = 0.0) -> Array:
    """Joint angles 5 and 6, (..., 2) [rad]: the inverse of :func:`tendon_motor_angles`."""
    (r5, _), (c, r6) = _tendon_matrix(ratio5, ratio6, coupling)
    return product(motors, np.array([[1.0 / r5, 0.0], [-c / (r5 * r6), 1.0 / r6]]).T)


def _tendon_matrix(ratio5: float, ratio6: float, coupling: float) -> NDArray[np.float64]:
    for name, ratio in (("ratio5", ratio5), ("ratio6", ratio6)):
        if ratio == 0.0 or not math.isfinite(ratio):
            raise ParameterError(name, ratio, "finite and not 0")
    return np.array([[ratio5, 0.0], [coupling, ratio6]])
