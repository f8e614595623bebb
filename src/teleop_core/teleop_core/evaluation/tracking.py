"""Tracking: the slave's poses, the poses that it should have had, and the errors between both."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from teleop_core.bags.reader import Series
from teleop_core.evaluation.accumulators import Integers
from teleop_core.evaluation.context import Context
from teleop_core.evaluation.pairing import NONE, latest, same_tick
from teleop_core.evaluation.traces import Envelope
from teleop_core.evaluation.windows import Window
from teleop_core.graph.topics import NO_COMMAND_NS, SLAVE_MEASURED_CP, SLAVE_SERVO_CP, SLAVE_SETPOINT_CP, Topic
from teleop_core.kernels.geometry import Array, roll_pitch_yaw, rotations_from_quaternions

DEGENERATE_DEG = 1.0
"""Roll and yaw are undefined if pitch is nearer to ±90° than this angle, [deg]."""


@dataclass(frozen=True, eq=False)
class PoseErrors:
    """Errors of N poses; NaN if a pose or its reference is not valid.

    Attributes:
        position_mm: Distances, shape (N,), [mm].
        roll_pitch_yaw_deg: Differences of the fixed angles, wrapped to ±180, shape (N, 3), [deg];
            roll and yaw are NaN near pitch ±90°.
        angle_deg: Angle of the single rotation between both orientations, shape (N,), [deg].
        is_degenerate: Whether pitch is too near to ±90° for roll and yaw, shape (N,).
    """

    position_mm: Array
    roll_pitch_yaw_deg: Array
    angle_deg: Array
    is_degenerate: "np.ndarray[tuple[int, ...], np.dtype[np.bool_]]"


def pose_errors(poses: Array, references: Array) -> PoseErrors:
    """Errors of poses relative to their references, both in the same frame.

    Args:
        poses: Rows x, y, z [m] and quaternion w, x, y, z, shape (N, 7).
        references: Reference poses in the same form, shape (N, 7).

    Source:
        Vongbunyong 2008, eqs. 2.7.1-2.7.6 (fixed angles) and section 7.6 (which error is meant).
    """
    a, b = _unit(poses[:, 3:7]), _unit(references[:, 3:7])
    angles, others = (roll_pitch_yaw(rotations_from_quaternions(q)) for q in (a, b))
    difference = np.degrees(_wrapped(angles - others))
    pitch = np.degrees(np.maximum(np.abs(angles[:, 1]), np.abs(others[:, 1])))
    is_degenerate = pitch > 90.0 - DEGENERATE_DEG
    difference[is_degenerate, ::2] = np.nan
    offset = poses[:, :3] - references[:, :3]
    distance = np.sqrt(np.einsum("ij,ij->i", offset, offset))
    return PoseErrors(distance * 1e3, difference, np.degrees(_angle(a, b)), is_degenerate)


def angles_between(quaternions: Array, others: Array) -> Array:
    """Angles (N,) [rad] between quaternions (N, 4) of any length; NaN for quaternions of length zero."""
    return _angle(_unit(quaternions), _unit(others))


def _unit(quaternions: Array) -> Array:
    """Quaternions scaled to unit length; NaN for quaternions of length zero."""
    norm = np.sqrt(np.einsum("ij,ij->i", quaternions, quaternions))
    with np.errstate(invalid="ignore", divide="ignore"):
        unit: Array = quaternions / norm[:, None]
    return unit


def _wrapped(angle: Array) -> Array:
    """The same angle [rad] between -π and π."""
    wrapped: Array = angle - 2.0 * np.pi * np.round(angle / (2.0 * np.pi))
    return wrapped


def _angle(a: Array, b: Array) -> Array:
    """Angle [rad] of the rotation from b to a; exact for small angles, unlike the arc cosine."""
    w = np.abs(np.einsum("ij,ij->i", a, b))
    axis = b[:, :1] * a[:, 1:] - a[:, :1] * b[:, 1:] - np.cross(a[:, 1:], b[:, 1:])
    angle: Array = 2.0 * np.arctan2(np.sqrt(np.einsum("ij,ij->i", axis, axis)), w)
    return angle


TRACKED: tuple[Topic, ...] = (SLAVE_MEASURED_CP, SLAVE_SETPOINT_CP, SLAVE_SERVO_CP)
"""Topics that :func:`tracked` compares."""


@dataclass(frozen=True, eq=False)
class Tracked:
    """Poses of a window, rows x, y, z [m] and quaternion w, x, y, z; NaN without a partner.

    Attributes:
        log_ns: Times of recording, shape (N,), [ns].
        stamp_ns: Times of sampling, shape (N,), [ns].
        poses: slave/measured_cp, shape (N, 7).
        setpoints: slave/setpoint_cp of the tick in which each pose was sampled, shape (N, 7).
        commands: Latest slave/servo_cp at the stamp of the pose, shape (N, 7).
        is_paired: Whether the setpoint of the same tick was recorded, shape (N,).
        against: Errors relative to the setpoints.
        behind: Errors relative to the commands.
    """

    log_ns: Integers
    stamp_ns: Integers
    poses: Array
    setpoints: Array
    commands: Array
    is_paired: NDArray[np.bool_]
    against: PoseErrors
    behind: PoseErrors


def tracked(window: Window) -> Tracked:
    """The slave's poses of a window with their errors, computed once."""
    return window.once(_track)


def _track(window: Window) -> Tracked:
    measured, setpoint = window.samples(SLAVE_MEASURED_CP), window.around(SLAVE_SETPOINT_CP)
    command, all_measured = window.around(SLAVE_SERVO_CP), window.around(SLAVE_MEASURED_CP)
    partner = same_tick(all_measured.log_ns, setpoint.log_ns)[window.own(SLAVE_MEASURED_CP)]
    # Until the first command is in force, for example while it moves to its start, the slave follows no command.
    is_led = partner == NONE
    partner = np.where(is_led, NONE, np.maximum(partner - window.lag, 0))
    is_led[~is_led] = setpoint.stamp_ns[partner[~is_led]] > NO_COMMAND_NS
    measured, partner = measured.only(is_led), partner[is_led]
    poses, setpoints = measured.values, rows_of(setpoint, partner)
    commands = rows_of(command, latest(measured.stamp_ns, command.stamp_ns))
    return Tracked(
        measured.log_ns,
        measured.stamp_ns,
        poses,
        setpoints,
        commands,
        partner != NONE,
        pose_errors(poses, setpoints),
        pose_errors(poses, commands),
    )


def rows_of(series: Series, index: Integers) -> Array:
    """Rows of poses by index, shape (N, 7); NaN for indices without a partner."""
    if not len(series):
        return np.full((len(index), 7), np.nan)
    return np.where((index == NONE)[:, None], np.nan, series.values[index])


class ErrorTrace:
    """Envelope of all errors, for drawing.

    Attributes:
        envelope: 6 columns: position error and command error [mm], then errors of roll, pitch, yaw and total angle
            [deg].
    """

    def __init__(self, context: Context) -> None:
        self.envelope = Envelope(context.bag.start_ns, context.bag.end_ns, columns=6)

    def add(self, window: Window) -> None:
        """Process one window."""
        found = tracked(window)
        turns = (*found.against.roll_pitch_yaw_deg.T, found.against.angle_deg)
        errors = np.stack((found.against.position_mm, found.behind.position_mm, *turns), axis=1)
        self.envelope.add(found.log_ns, errors)
