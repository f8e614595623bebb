"""Friction: viscous, and dry friction that either grows smoothly with speed or sticks.

Friction that sticks is the LuGre bristle in the elasto-plastic form of Dupont, Hayward, Armstrong
and Altpeter (2002), with the deflection of break-away equal to that of steady sliding: the bristle
bends with the joint until it carries the dry friction, and then slips. Of the known models it is
the one that holds a load below dry friction for ever (plain LuGre creeps under vibration) and
needs no switch between two sets of equations (Karnopp's does). What makes LuGre stiff, the slip
at high speed, is the return of the bristle to its bound here, which is exact at any step.
"""

import math
from typing import Any

from teleop_core.kernels import inner

# Noise: the multiplicative generator of Lewis, Goodman and Miller (1969), multiplier of Park,
# Miller and Stockmeyer (1993).
_MULTIPLIER, _MODULUS = 48271, 2147483647
_DAMPING = 1.0  # of a stuck joint on its bristle, share of critical


@inner
def friction(p: Any, s: Any, i: int, moved: float, speed: float) -> float:
    """Friction of joint ``i`` [N·m or N], against its speed.

    Args:
        p: Record with ``viscous``, ``coulomb``, ``friction_speed``, ``bristle``,
            ``bristle_damping``, (n,) each.
        s: Record with ``bent``, the bristle's bend at the start of the step, and ``grip``, the
            share of dry friction in force, (n,) each.
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
def bend(p: Any, s: Any, i: int, moved: float) -> None:
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
def wander(p: Any, s: Any) -> None:
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
