"""Friction: viscous, and dry friction that either grows smoothly with speed or sticks.

Friction that sticks is the LuGre bristle in the elasto-plastic form of Dupont, Hayward, Armstrong and Altpeter (2002),
with the deflection of break-away equal to that of steady sliding: the bristle bends with the joint until it carries the
dry friction, and then slips. Of the known models it is the one that holds a load below dry friction always (plain LuGre
creeps under vibration) and needs no switch between two sets of equations (Karnopp's does). What makes LuGre stiff, the
slip at high speed, is the return of the bristle to its bound here, which is exact at any step.
"""

import math
from typing import Any

from teleop_core.kernels import Fields, IntegerPerJoint, PerJoint, inner

# Noise: the multiplicative generator of Lewis, Goodman and Miller (1969), multiplier of Park,
# Miller and Stockmeyer (1993).
_MULTIPLIER, _MODULUS = 48271, 2147483647
_DAMPING = 1.0  # of a stuck joint on its bristle, share of critical


class FrictionNumbers(Fields):
    """Fields of a parameter record with the friction of each joint."""

    viscous: PerJoint  # [N·m·s/rad or N·s/m]
    coulomb: PerJoint  # dry friction [N·m or N]
    friction_speed: PerJoint  # [rad/s or m/s]
    bristle: PerJoint  # [N·m/rad or N/m]; 0 where it does not stick
    bristle_damping: PerJoint
    wander: PerJoint
    wander_travel: PerJoint


class FrictionState(Fields):
    """Fields of a state record with the friction of each joint."""

    bent: PerJoint  # bend of the bristle at the start of the step [rad or m]
    grip: PerJoint  # share of dry friction in force
    slipped: PerJoint
    astray: PerJoint
    noise: IntegerPerJoint


@inner
def friction(p: FrictionNumbers, s: FrictionState, i: int, moved: float, speed: float) -> float:
    """Friction of joint ``i`` [N·m or N], against its speed.

    Args:
        p: Parameters.
        s: State.
        i: Joint.
        moved: How far it has come since the start of the step [rad or m].
        speed: Its speed [rad/s or m/s].
    """
    dry = p.coulomb[i] * s.grip[i]
    if p.bristle[i] > 0.0:
        pull = p.bristle[i] * (s.bent[i] + moved) + p.bristle_damping[i] * speed
        return p.viscous[i] * speed + min(max(pull, -dry), dry)
    scale = p.friction_speed[i]
    return p.viscous[i] * speed + dry * (speed / math.sqrt(speed * speed + scale * scale))


@inner
def bend(p: FrictionNumbers, s: FrictionState, i: int, moved: float) -> None:
    """Bend the bristle of joint ``i`` by a whole step, as far as dry friction carries it.

    The rest of the way slips, and is added to ``s.slipped``.
    """
    slip = moved
    if p.bristle[i] > 0.0:
        most = p.coulomb[i] * s.grip[i] / p.bristle[i]
        bent = s.bent[i] + moved
        s.bent[i] = min(max(bent, -most), most)
        slip = bent - s.bent[i]
    s.slipped[i] += abs(slip)


@inner
def wander(p: FrictionNumbers, s: FrictionState) -> None:
    """Let the dry friction of joints that slipped change: first-order noise of mean 1 over the way.

    Teeth and balls meet other places of their paths as a joint moves on; at rest they stay, and so
    does what they hold. The share never falls below a tenth, and its noise is uniform within a
    tick, hence normal over the way on which it changes.
    """
    for i in range(s.grip.shape[0]):
        if p.wander[i] > 0.0 and s.slipped[i] > 0.0:
            kept = 1.0 - min(s.slipped[i] / p.wander_travel[i], 1.0)
            s.noise[i] = s.noise[i] * _MULTIPLIER % _MODULUS
            drawn = math.sqrt(12.0) * (s.noise[i] / _MODULUS - 0.5)
            s.astray[i] = kept * s.astray[i] + math.sqrt(1.0 - kept * kept) * drawn
            s.grip[i] = max(1.0 + p.wander[i] * s.astray[i], 0.1)
        s.slipped[i] = 0.0


def bristle_damping(bristle: Any, inertia: Any) -> Any:
    """Damping of bristles that keeps stuck joints from swinging [N·m·s/rad or N·s/m]."""
    return 2.0 * _DAMPING * (bristle * inertia) ** 0.5
