"""Puncture: a surface that opens under the tip, and the channel of the needle behind it.

Once the push along the normal reaches the puncture force, the surface opens under the tip, and the spring of the
surface vanishes there. The tip then moves in a straight channel along the normal at that point. Two forces act in the
channel: the cutting force when the tip goes deeper than before, and the dry friction of the shaft, which grows with
depth. Each force is modelled by a spring that yields at a bound. Such a spring holds a load at rest, and never releases
more energy than was stored in it.

Source:
    Okamura, Simone and O'Leary 2004: stiffness before the puncture, then friction along the shaft
    and cutting. The yielding springs are those of :mod:`teleop_core.slave.friction`.
"""

from teleop_core.kernels import Array, Fields, Vector3, inner


class PunctureRecord(Fields):
    """Fields of a parameter record with the forces on a needle."""

    puncture_force: float  # [N]; 0 if the surface never opens
    cutting_force: float  # [N]
    shaft_friction: float  # largest dry friction per depth [N/m]
    hole_radius: float  # [m]


class PunctureState(Fields):
    """Fields of a state record with the last hole, and the state of the needle in it."""

    gap: float  # gap of the tip along the present normal [m]
    normal: Vector3
    stuck: Vector3  # bend of the bristle across the normal [m]
    is_open: int  # whether the tip is in the channel, or above its hole
    punctures: int  # number of punctures so far
    hole: Vector3  # position of the hole, from the middle of the object [m]
    channel: Vector3  # direction of the channel, a unit vector out of the object
    cut: float  # depth below which the tissue ahead of the tip is uncut and resists [m]
    drawn: float  # distance that the shaft has dragged the tissue, positive inwards [m]


@inner
def puncture(p: PunctureRecord, s: PunctureState, stiffness: float, push: float, offset: Array) -> None:
    """Open the surface under the tip, if the push on it reaches the puncture force.

    Immediately after the puncture the force equals the cutting force, if the surface was bent far enough for it.

    Args:
        p: Parameters.
        s: State; written.
        stiffness: Stiffness of the object [N/m].
        push: Push along the normal [N].
        offset: Position of the tip relative to the middle of the object (3,) [m].
    """
    if not 0.0 < p.puncture_force <= push:
        return
    depth = max(-s.gap, 0.0)
    kept = min(p.cutting_force, p.puncture_force) / stiffness
    s.punctures += 1
    s.is_open, s.drawn, s.cut = 1, 0.0, max(depth - kept, 0.0)
    for k in range(3):
        s.channel[k] = s.normal[k]
        s.hole[k] = offset[k] - s.gap * s.normal[k]


@inner
def _is_open(p: PunctureRecord, s: PunctureState, before: float, along: float, beside: float) -> bool:
    """Whether a tip stays in the channel, or is at a position from which it can enter the channel.

    Args:
        p: Parameters.
        s: State with ``is_open`` of the previous tick, and with the present gap to the surface [m].
        before: Gap one tick ago [m].
        along: Position of the tip relative to the hole, along the channel [m]; negative inside.
        beside: Distance of the tip from the channel's axis [m].
    """
    # A tip that was above the hole has entered it at any position, because no spring was bent under the tip.
    if s.is_open and (s.gap < 0.0 or (along < 0.0 and before < 0.0)):
        return True
    if p.puncture_force <= 0.0 or beside > p.hole_radius:
        return False
    # A tip behind the object cannot enter: it is outside, although its depth along the channel is large.
    return along >= 0.0 if s.gap >= 0.0 else abs(along - s.gap) <= p.hole_radius


@inner
def follow_channel(
    p: PunctureRecord, s: PunctureState, stiffness: float, before: float, offset: Array, normal: Array
) -> None:
    """Measure the gap of a tip at the last hole along the channel, and update the yielding springs by the tip's motion.

    Away from the hole the surface is intact, so nothing changes.

    Args:
        p: Parameters.
        s: State; written: the gap becomes the one along the channel.
        stiffness: Stiffness of the object [N/m].
        before: Gap a tick ago [m].
        offset: Tip from the middle of the object (3,) [m].
        normal: Normal out of the object (3,); written.
    """
    was_open = s.is_open != 0
    was_inside = was_open and before < 0.0
    along = square = 0.0
    for k in range(3):
        way = offset[k] - s.hole[k]
        along += s.channel[k] * way
        square += way * way
    beside = max(square - along * along, 0.0) ** 0.5
    s.is_open = int(_is_open(p, s, before, along, beside))
    if not s.is_open:
        return
    s.gap = along
    depth = max(-along, 0.0)
    drawn = s.drawn + depth - max(-before, 0.0) if was_open else 0.0
    most = p.shaft_friction * depth / stiffness
    s.drawn = min(max(drawn, -most), most)
    s.cut = max(s.cut, depth - p.cutting_force / stiffness)
    for k in range(3):
        normal[k] = s.channel[k]
        if not was_inside:  # the sideways force of the channel is zero where the tip enters
            s.stuck[k] = 0.0


@inner
def push_in_channel(p: PunctureRecord, s: PunctureState, stiffness: float, out: float) -> float:
    """Push along the channel [N], out of the object, on a tip that moved ``out`` [m] in this tick.

    The push is a function of the position alone, so that no motion within a tick gains energy.
    """
    depth = max(-(s.gap + out), 0.0)
    most = p.shaft_friction * depth
    pull = stiffness * (s.drawn + depth - max(-s.gap, 0.0))
    cutting = stiffness * (depth - s.cut)
    return min(max(pull, -most), most) + min(max(cutting, 0.0), p.cutting_force)
