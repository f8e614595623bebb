"""Puncture: a surface that gives way to the tip, and the channel of the needle behind it.

Once the push along the normal reaches the puncture force, the surface opens under the tip, and the spring of the
surface is gone there. The tip then moves in a channel, straight along the normal of that place. In the channel the tip
meets the cutting force where it goes deeper than before, and the dry friction of the shaft, which grows with depth.
Both are springs that yield at a bound: they hold at rest, and give back no more than was stored in them.

Source:
    Okamura, Simone and O'Leary 2004: stiffness before the puncture, then friction along the shaft
    and cutting. The yielding springs are those of :mod:`teleop_core.slave.friction`.
"""

from teleop_core.kernels import Array, Fields, Vector3, inner


class PunctureNumbers(Fields):
    """Fields of a parameter record with what a needle meets."""

    puncture_force: float  # [N]; 0 where the surface never opens
    cutting_force: float  # [N]
    shaft_friction: float  # largest dry friction over depth [N/m]
    hole_radius: float  # [m]


class PunctureState(Fields):
    """Fields of a state record with the last hole, and what the needle does in it."""

    gap: float  # of the tip, along the normal in force [m]
    normal: Vector3
    stuck: Vector3  # bend of the bristle across the normal [m]
    is_open: int  # the tip is in the channel, or above its hole
    punctures: int  # so far
    hole: Vector3  # from the middle of the object [m]
    channel: Vector3  # unit vector out of the object
    cut: float  # depth from which tissue ahead of the tip resists [m]
    drawn: float  # how far the shaft has drawn the tissue along, positive inwards [m]


@inner
def puncture(p: PunctureNumbers, s: PunctureState, stiffness: float, push: float, offset: Array) -> None:
    """Open the surface under the tip, if the push on it reaches the puncture force.

    What is left of the force at once is the cutting force, as far as the surface has stored it.

    Args:
        p: Parameters.
        s: State; written.
        stiffness: Of the object [N/m].
        push: Along the normal [N].
        offset: Tip from the middle of the object (3,) [m].
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
def _is_open(p: PunctureNumbers, s: PunctureState, before: float, along: float, beside: float) -> bool:
    """Whether a tip goes on in the channel, or is where it can enter it.

    Args:
        p: Parameters.
        s: State, open as a tick ago, with the gap to the surface now [m].
        before: Gap a tick ago [m].
        along: Tip from the hole, along the channel [m]; negative inside.
        beside: The same, across it [m].
    """
    # A tip that was above the hole went into it, wherever it is now: no spring was bent under it.
    if s.is_open and (s.gap < 0.0 or (along < 0.0 and before < 0.0)):
        return True
    if p.puncture_force <= 0.0 or beside > p.hole_radius:
        return False
    # Not from behind: a tip there is outside, though it lies deep along the channel.
    return along >= 0.0 if s.gap >= 0.0 else abs(along - s.gap) <= p.hole_radius


@inner
def follow_channel(
    p: PunctureNumbers, s: PunctureState, stiffness: float, before: float, offset: Array, normal: Array
) -> None:
    """Measure a tip at the last hole along its channel, and let what yields take up its way.

    Elsewhere nothing changes: there the surface is whole.

    Args:
        p: Parameters.
        s: State; the gap to the surface becomes that along the channel.
        stiffness: Of the object [N/m].
        before: Gap a tick ago [m].
        offset: Tip from the middle of the object (3,) [m].
        normal: Out of the object (3,); written.
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
        if not was_inside:  # the channel begins to hold sideways where the tip enters
            s.stuck[k] = 0.0


@inner
def push_in_channel(p: PunctureNumbers, s: PunctureState, stiffness: float, out: float) -> float:
    """Push along the channel [N], out of the object, on a tip that moved ``out`` [m] in this tick.

    A function of the place alone, so that no motion within a tick gains energy.
    """
    depth = max(-(s.gap + out), 0.0)
    most = p.shaft_friction * depth
    pull = stiffness * (s.drawn + depth - max(-s.gap, 0.0))
    cutting = stiffness * (depth - s.cut)
    return min(max(pull, -most), most) + min(max(cutting, 0.0), p.cutting_force)
