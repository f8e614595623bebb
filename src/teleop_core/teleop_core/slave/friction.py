"""Friction: viscous, and dry friction that either grows smoothly with speed or sticks.

Friction that sticks is the LuGre bristle in the elasto-plastic form of Dupont, Hayward, Armstrong and Altpeter (2002),
with the deflection of break-away equal to that of steady sliding: the bristle bends with the joint until it carries the
dry friction, and then slips. It is the only known model with two properties: a load below the dry friction never
creeps, and there is one set of equations. Plain LuGre creeps under vibration, and Karnopp's model switches between two
sets of equations. LuGre is stiff because of its slip at high speed. Here the bristle is clipped to its bound instead,
which is exact at any step size.
"""

import math
from typing import Any

from teleop_core.kernels import Fields, IntegerPerJoint, PerJoint, inner

# Random numbers: the multiplicative generator of Lewis, Goodman and Miller (1969).
_MULTIPLIER = 48271  # of Park, Miller and Stockmeyer (1993)
_MODULUS = 2147483647
_DAMPING = 1.0  # damping of a stuck joint on its bristle, divided by critical damping


class FrictionRecord(Fields):
    """Fields of a parameter record with the friction of each joint."""

    viscous: PerJoint  # [N·m·s/rad or N·s/m]
    coulomb: PerJoint  # dry friction [N·m or N]
    friction_speed: PerJoint  # [rad/s or m/s]
    bristle: PerJoint  # [N·m/rad or N/m]; 0 for friction that does not stick
    bristle_damping: PerJoint
    wander: PerJoint
    wander_travel: PerJoint


class FrictionState(Fields):
    """Fields of a state record with the friction of each joint."""

    bent: PerJoint  # bend of the bristle at the start of the step [rad or m]
    grip: PerJoint  # present dry friction, divided by its mean
    slipped: PerJoint
    astray: PerJoint
    noise: IntegerPerJoint


@inner
def friction(p: FrictionRecord, s: FrictionState, i: int, moved: float, speed: float) -> float:
    """Friction of joint ``i`` [N·m or N], against its speed.

    Args:
        p: Parameters.
        s: State.
        i: Joint.
        moved: Motion of the joint since the start of the step [rad or m].
        speed: Speed of the joint [rad/s or m/s].
    """
    dry = p.coulomb[i] * s.grip[i]
    if p.bristle[i] > 0.0:
        pull = p.bristle[i] * (s.bent[i] + moved) + p.bristle_damping[i] * speed
        return p.viscous[i] * speed + min(max(pull, -dry), dry)
    scale = p.friction_speed[i]
    return p.viscous[i] * speed + dry * (speed / math.sqrt(speed * speed + scale * scale))


@inner
def bend(p: FrictionRecord, s: FrictionState, i: int, moved: float) -> None:
    """Bend the bristle of joint ``i`` by a whole step, up to the bend at which it carries the dry friction.

    The rest of the motion is slip, and is added to ``s.slipped``.
    """
    slip = moved
    if p.bristle[i] > 0.0:
        most = p.coulomb[i] * s.grip[i] / p.bristle[i]
        bent = s.bent[i] + moved
        s.bent[i] = min(max(bent, -most), most)
        slip = bent - s.bent[i]
    s.slipped[i] += abs(slip)


@inner
def wander(p: FrictionRecord, s: FrictionState) -> None:
    """Vary the dry friction of joints that slipped: first-order noise of mean 1 over the slipped distance.

    As a joint moves, its teeth and balls touch other parts of their tracks, so the friction changes. At rest the
    friction is constant. It never falls below a tenth of its mean. The noise has a uniform distribution in each tick.
    Over the distance on which the friction changes, the sum is therefore approximately normal.
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
    """Damping of bristles that keeps stuck joints from oscillating [N·m·s/rad or N·s/m]."""
    return 2.0 * _DAMPING * (bristle * inertia) ** 0.5
