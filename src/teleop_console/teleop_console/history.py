"""History: what the page has seen in the last seconds, for plots, and what it sums up as scores."""

from dataclasses import dataclass

import numpy as np

from teleop_console.link import Arm, ArmView
from teleop_core.graph import topics
from teleop_core.kernels.geometry import Array

SPAN = 30.0
"""How far plots reach back [s]."""
_ROWS = 1200  # 30 s at 40 Hz
_LEFT = topics.ENERGY.index("margin")


class History:
    """Last seconds of one arm: a row for each look.

    Columns: joints wanted (n) and measured (n) [rad or m]; place wanted and measured (3 each) [m];
    force (3) [N]; distance from the wanted place [m]; delay [s]; energy that the ports of hand and
    slave may still give (2) [J]; NaN where nothing was known.

    Args:
        arm: The arm.
    """

    def __init__(self, arm: Arm) -> None:
        self.arm, n = arm, arm.robot.n
        ends = np.cumsum([n, n, 3, 3, 3, 1, 1, 2]).tolist()
        starts = [0, *ends]
        names = ("wanted", "joints", "reference", "place", "force", "error", "delay", "left")
        self._columns = {name: slice(a, b) for name, a, b in zip(names, starts, ends, strict=False)}
        self._rows = np.full((_ROWS, ends[-1]), np.nan)
        self._times = np.full(_ROWS, np.nan)
        self._next = self._count = 0

    def add(self, time: float, view: ArmView, delay: float) -> None:
        """Note what is known at a time [s]; an earlier one begins anew, the same adds nothing."""
        if self._count:
            last = self._times[self._next - 1]
            if time == last:
                return
            if time < last:
                self.clear()
        row, n = self._rows[self._next], self.arm.robot.n
        row[:] = np.nan
        for name, topic, width in (
            ("wanted", topics.SLAVE_SETPOINT_JS, n),
            ("joints", topics.SLAVE_MEASURED_JS, n),
            ("reference", topics.SLAVE_SERVO_CP, 3),
            ("place", topics.SLAVE_MEASURED_CP, 3),
            ("force", topics.MASTER_MEASURED_CF, 3),
        ):
            values = view.get(topic)
            if values is not None:
                row[self._columns[name]] = values[:width]
        away = row[self._columns["reference"]] - row[self._columns["place"]]
        row[self._columns["error"]] = np.sqrt(away @ away)
        row[self._columns["delay"]] = delay
        for i, topic in enumerate((topics.MASTER_ENERGY, topics.SLAVE_ENERGY)):
            if (energies := view.get(topic)) is not None:
                row[self._columns["left"].start + i] = energies[_LEFT]
        self._times[self._next] = time
        self._next, self._count = (self._next + 1) % _ROWS, min(self._count + 1, _ROWS)

    def clear(self) -> None:
        """Forget everything."""
        self._next = self._count = 0
        self._times[:] = np.nan

    def read(self, name: str) -> tuple[Array, Array]:
        """Times (N,) [s], 0 being now, and columns (N, k) of the last :data:`SPAN` seconds."""
        order = (np.arange(self._next - self._count, self._next)) % _ROWS
        times = self._times[order]
        if len(times):
            times = times - times[-1]
        recent = times >= -SPAN
        return times[recent], self._rows[order[recent]][:, self._columns[name]]


@dataclass
class LiveScores:
    """Figures of one arm since they were last begun, from the samples that the page has seen.

    The scores of a recording come from every sample; these are a look at them on the way.

    Attributes:
        time: How long it has followed the hand [s]; what the clutch holds does not count.
        way: Length of the tip's path [m].
        rms: Root mean square of the distance between wanted and measured place [m].
        largest: Largest such distance [m].
        force: Largest force at the stylus [N].
    """

    time: float = 0.0
    way: float = 0.0
    rms: float = 0.0
    largest: float = 0.0
    force: float = 0.0
    _square: float = 0.0
    _last: tuple[float, Array] | None = None

    def add(self, time: float, view: ArmView) -> None:
        """Take account of what is known at a time [s]; only what follows the hand counts."""
        reference, place = view.get(topics.SLAVE_SERVO_CP), view.get(topics.SLAVE_MEASURED_CP)
        force = view.get(topics.MASTER_MEASURED_CF)
        is_led = view.state.get("is_following") and not view.state.get("is_clutched")
        if reference is None or place is None or not is_led:
            self._last = None
            return
        if self._last is not None and 0.0 < (step := time - self._last[0]) < 1.0:
            error = float(np.linalg.norm(reference[:3] - place[:3]))
            self.time += step
            self.way += float(np.linalg.norm(place[:3] - self._last[1]))
            self._square += step * error * error
            self.rms = float(np.sqrt(self._square / self.time))
            self.largest = max(self.largest, error)
        if force is not None:
            self.force = max(self.force, float(np.linalg.norm(force[:3])))
        self._last = (time, place[:3].copy())

    def text(self) -> str:
        """The figures as a table in Markdown."""
        rows = (
            ("followed", f"{self.time:.1f} s"),
            ("path of the tip", f"{1e3 * self.way:.1f} mm"),
            ("tracking error, RMS", f"{1e3 * self.rms:.3f} mm"),
            ("tracking error, largest", f"{1e3 * self.largest:.3f} mm"),
            ("force, largest", f"{self.force:.2f} N"),
        )
        return "\n".join(["| so far | |", "|---|---:|", *(f"| {a} | {b} |" for a, b in rows)])
