"""Tally: accumulates everything that is scored and drawn, window by window."""

from collections import Counter

import numpy as np

from teleop_core.bags.reader import Bag, Series
from teleop_core.evaluation.accumulators import Integers, Moments
from teleop_core.evaluation.fixture_scores import FixtureTally
from teleop_core.evaluation.pairing import NONE, latest, same_tick
from teleop_core.evaluation.pose_errors import PoseErrors, pose_errors
from teleop_core.evaluation.score import OrientationError, Samples
from teleop_core.evaluation.state_history import StateHistory, States
from teleop_core.evaluation.streams import DelayTally, StampTally
from teleop_core.evaluation.traces import Drawing
from teleop_core.evaluation.windows import Window
from teleop_core.geometry import Array
from teleop_core.topics import (
    MASTER_MEASURED_CF,
    SLAVE_MEASURED_CP,
    SLAVE_SERVO_CP,
    SLAVE_SETPOINT_CP,
    STREAMS,
)


class PoseTally:
    """Accumulator of the errors of poses against one reference."""

    def __init__(self) -> None:
        self.position, self.angle = Moments(), Moments()
        self._turns = [Moments() for _ in range(3)]
        self._degenerate = 0

    def add(self, errors: PoseErrors) -> None:
        """Take the errors of N poses."""
        self.position.add(errors.position_mm)
        self.angle.add(errors.angle_deg)
        self._degenerate += int(errors.is_degenerate.sum())
        for moments, column in zip(self._turns, errors.roll_pitch_yaw_deg.T, strict=True):
            moments.add(column)

    def orientation(self) -> OrientationError:
        """Spread of all angles so far."""
        count = self.angle.count
        share = self._degenerate / count if count else None
        roll, pitch, yaw = (moments.spread() for moments in self._turns)
        return OrientationError(roll, pitch, yaw, self.angle.spread(), share)


class Tally:
    """Accumulator of a whole recording.

    Attributes:
        setpoint: Errors against slave/setpoint_cp of the same tick.
        command: Errors against the latest slave/servo_cp.
        fixture: How far outside of the box.
        force: Magnitude of the force on the hand, [N].
        stamps: Per topic name the steps between its stamps.
        delays: Delay of each stage.
        drawing: Traces for a page.
    """

    def __init__(self, bag: Bag, history: StateHistory) -> None:
        self._history = history
        self.setpoint, self.command = PoseTally(), PoseTally()
        self.fixture, self.force = FixtureTally(), Moments()
        self.stamps = {topic.name: StampTally() for topic in STREAMS if topic.name in bag.topics}
        self.delays = DelayTally()
        self._gains: Counter[float] = Counter()
        self._unpaired = self._invalid = 0
        expected = bag.topics[SLAVE_MEASURED_CP.name].count
        self.drawing = Drawing(bag.start_ns, bag.end_ns, expected, history, self.delays.stages)

    def add(self, window: Window) -> None:
        """Take one window."""
        for topic in STREAMS:
            if topic.name in self.stamps:
                self.stamps[topic.name].add(window, topic)
        self.delays.add(window)
        if (measured := window.series.get(SLAVE_MEASURED_CP.name)) is not None:
            self._add_slave(window, measured, window.own(SLAVE_MEASURED_CP))
        if (command := window.series.get(SLAVE_SERVO_CP.name)) is not None:
            own = window.own(SLAVE_SERVO_CP)
            states = self._history.at(command.stamp_ns[own])
            self.fixture.add_command(command.values[own, :3], states)
        if (force := window.series.get(MASTER_MEASURED_CF.name)) is not None:
            self._add_force(force, window.own(MASTER_MEASURED_CF))

    @property
    def samples(self) -> Samples:
        """How many slave poses were scored."""
        return Samples(self.setpoint.angle.count, self._unpaired, self._invalid)

    @property
    def gain(self) -> float | None:
        """Gain that was in force for most slave samples; None without teleop/state."""
        return self._gains.most_common(1)[0][0] if self._gains else None

    def _add_slave(self, window: Window, measured: Series, own: slice) -> None:
        poses, stamps = measured.values[own], measured.stamp_ns[own]
        states = self._history.at(stamps)
        gains, counts = np.unique(states.column("gain"), return_counts=True)
        self._gains.update(
            {g: n for g, n in zip(gains.tolist(), counts.tolist(), strict=True) if g}
        )
        self.fixture.add_slave(poses[:, :3], states)
        partner = _setpoint_of(window, measured)[own]
        setpoints = _rows(window.series.get(SLAVE_SETPOINT_CP.name), partner)
        commands = _command_at(window, stamps)
        against, behind = pose_errors(poses, setpoints), pose_errors(poses, commands)
        self.setpoint.add(against)
        self.command.add(behind)
        is_valid = np.isfinite(against.position_mm) & np.isfinite(against.angle_deg)
        self._unpaired += int((partner == NONE).sum())
        self._invalid += int((~is_valid & (partner != NONE)).sum())
        self._draw(measured.log_ns[own], (commands, setpoints, poses), states)
        self._draw_errors(measured.log_ns[own], against, behind)

    def _draw(self, logs: Integers, poses: tuple[Array, ...], states: States) -> None:
        rows = np.concatenate([pose[:, :3] for pose in poses], axis=1) * 1e3
        self.drawing.position.add(logs, rows)
        is_on = states.column("is_fixture_on")[:, None]
        self.drawing.path.add(np.concatenate((rows[:, 3:], is_on), axis=1))

    def _draw_errors(self, logs: Integers, against: PoseErrors, behind: PoseErrors) -> None:
        turns = (*against.roll_pitch_yaw_deg.T, against.angle_deg)
        errors = np.stack((against.position_mm, behind.position_mm, *turns), axis=1)
        self.drawing.error.add(logs, errors)

    def _add_force(self, series: Series, own: slice) -> None:
        force = series.values[own, :3]
        magnitude = np.sqrt(np.einsum("ij,ij->i", force, force))
        self.force.add(magnitude)
        self.drawing.force.add(series.log_ns[own], np.column_stack((force, magnitude)))


def _setpoint_of(window: Window, measured: Series) -> Integers:
    setpoint = window.series.get(SLAVE_SETPOINT_CP.name)
    logs = np.empty(0, np.int64) if setpoint is None else setpoint.log_ns
    return same_tick(measured.log_ns, logs)


def _command_at(window: Window, stamps: Integers) -> Array:
    """Latest command at or before each stamp, shape (N, 7); NaN before the first."""
    command = window.series.get(SLAVE_SERVO_CP.name)
    known = np.empty(0, np.int64) if command is None else command.stamp_ns
    return _rows(command, latest(stamps, known))


def _rows(series: Series | None, index: Integers) -> Array:
    """Rows of poses by index, shape (N, 7); NaN for those without a partner."""
    if series is None or not len(series):
        return np.full((len(index), 7), np.nan)
    return np.where((index == NONE)[:, None], np.nan, series.values[index])
