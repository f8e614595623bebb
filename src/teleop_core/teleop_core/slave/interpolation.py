"""Interpolation: the path from command to command if the period of commands is longer than a tick."""

from teleop_core.kernels import Array, Fields, PerJoint, inner

INTERPOLATIONS = ("none", "linear", "minimum_jerk")
"""Ways from command to command."""
_LINEAR, _MINIMUM_JERK = 1, 2


class WayRecord(Fields):
    """Fields of a parameter record that define the interpolation between commands."""

    lower: PerJoint
    upper: PerJoint
    interpolation: str  # one of :data:`INTERPOLATIONS`, stored as its index


class WayState(Fields):
    """Fields of a state record with the path to the newest command; derivatives are by the share of the path."""

    command: PerJoint  # present position on the path [rad or m]
    target: PerJoint  # the newest command
    begin: PerJoint
    slope: PerJoint  # first derivative at the start
    bend: PerJoint  # second derivative at the start
    end_slope: PerJoint
    ticks: int  # number of finished ticks
    span: int  # total number of ticks


@inner
def begin_way(p: WayRecord, s: WayState, command: Array, period_ns: int, dt: float) -> None:
    """Begin a path to a new command; it lasts one period of commands if that is longer than a tick.

    Args:
        p: Parameters.
        s: State; written.
        command: New joints (n,) [rad or m]; they are clipped to the joint limits.
        period_ns: Time since the last command [ns]; 0 for the first.
        dt: Tick [s].
    """
    span = 1
    if int(p.interpolation) >= _LINEAR:
        span = max(1, round(period_ns * 1e-9 / dt))
    for i in range(command.shape[0]):
        goal = min(max(command[i], p.lower[i]), p.upper[i])
        if int(p.interpolation) == _MINIMUM_JERK and s.span > 0:
            slope, bend = _slopes(s, i)
            longer = span / s.span
            s.slope[i], s.bend[i] = slope * longer, bend * longer * longer
            s.end_slope[i] = goal - s.target[i]
        else:  # a straight path or a jump, stored so that a minimum-jerk path may continue from it
            s.bend[i] = 0.0
            s.slope[i] = s.end_slope[i] = goal - s.command[i] if int(p.interpolation) == _LINEAR else 0.0
        s.begin[i], s.target[i] = s.command[i], goal
    s.ticks, s.span = 0, span


@inner
def _coefficients(s: WayState, i: int) -> tuple[float, float, float, float, float]:
    """Coefficients of a polynomial in the share of the path, from the first to the fifth power."""
    rise, a, b, e = s.target[i] - s.begin[i], s.slope[i], s.bend[i], s.end_slope[i]
    return (
        a,
        0.5 * b,
        10.0 * rise - 6.0 * a - 4.0 * e - 1.5 * b,
        -15.0 * rise + 8.0 * a + 7.0 * e + 1.5 * b,
        6.0 * rise - 3.0 * a - 3.0 * e - 0.5 * b,
    )


@inner
def _slopes(s: WayState, i: int) -> tuple[float, float]:
    """First and second derivative of joint i at the present point of the path; 0 at the end of the path."""
    if s.ticks > s.span:
        return 0.0, 0.0
    x = s.ticks / s.span
    c1, c2, c3, c4, c5 = _coefficients(s, i)
    first = c1 + x * (2.0 * c2 + x * (3.0 * c3 + x * (4.0 * c4 + x * 5.0 * c5)))
    return first, 2.0 * c2 + x * (6.0 * c3 + x * (12.0 * c4 + x * 20.0 * c5))


@inner
def advance_on_way(p: WayRecord, s: WayState) -> None:
    """Advance the command by one tick; at the end of the path it equals the newest command exactly.

    The minimum-jerk path is the polynomial of fifth degree with given positions, speeds and accelerations at both ends.

    Source:
        Flash and Hogan 1985, eq. 3.
    """
    s.ticks += 1
    x = s.ticks / s.span if s.ticks < s.span else 1.0
    for i in range(s.command.shape[0]):
        if x >= 1.0:
            s.command[i] = s.target[i]
        elif int(p.interpolation) == _MINIMUM_JERK:
            c1, c2, c3, c4, c5 = _coefficients(s, i)
            way = x * (c1 + x * (c2 + x * (c3 + x * (c4 + x * c5))))
            s.command[i] = min(max(s.begin[i] + way, p.lower[i]), p.upper[i])
        else:
            s.command[i] = s.begin[i] + x * (s.target[i] - s.begin[i])
