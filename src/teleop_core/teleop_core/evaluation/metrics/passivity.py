"""Passivity: the energy into and out of the ports of hand and slave, and the cost of keeping the session passive."""

from dataclasses import dataclass, fields

import numpy as np

from teleop_core.coupling.passivity.port import DRIFT, HEARD, IN, LAW, MARGIN, OUT, ROUND, WITHHELD
from teleop_core.evaluation import Context, Envelope, Integers, Metric, TableRow, Window, keys_of, number, row
from teleop_core.evaluation.figure import FIRST, FIXTURE, SECOND, THIRD, Figure, line, time_axis
from teleop_core.evaluation.metric import figure
from teleop_core.evaluation.traces import Rows
from teleop_core.graph.topics import MASTER_ENERGY, MASTER_SERVO_CF, SLAVE_ENERGY
from teleop_core.kernels.geometry import Array

GROUP = "passivity"
_MJ = 1e3
_COLUMNS = [IN, OUT, HEARD, WITHHELD]


@dataclass(frozen=True)
class PortScore:
    """Energies of one port in the slave's scale; None if they were not recorded."""

    in_mj: float | None = figure("mJ", "energy that flowed into the port")
    out_mj: float | None = figure("mJ", "energy that flowed out of the port")
    withheld_mj: float | None = figure("mJ", "energy that the passivity law did not let out of the port")
    least_margin_mj: float | None = figure(
        "mJ", "smallest remaining energy; negative: more energy flowed out of the port than was available"
    )


@dataclass(frozen=True)
class PassivityScore:
    """Energies of both ports, and the cost of passivity."""

    hand: PortScore
    slave: PortScore
    chatter_ns: float | None = figure("N/s", "total variation of the force at the hand, divided by the recorded time")
    drift_max_mm: float | None = figure("mm", "largest distance by which the passivity law held back the command")
    drift_end_mm: float | None = figure("mm", "distance by which the command is held back at the end of the recording")


class _Port:
    """Energies of one port, summed over rounds, and their curve against time."""

    def __init__(self, context: Context) -> None:
        self._trace = Envelope(context.bag.start_ns, context.bag.end_ns, columns=len(_COLUMNS))
        self._last: Array | None = None
        self._sums, self._least = np.zeros(len(_COLUMNS)), 0.0
        self.drifts: tuple[float, float] = (0.0, 0.0)

    def add(self, times: Integers, values: Array) -> None:
        """Add samples (N, columns) of a port's energies."""
        if not len(values):
            return
        rows = values if self._last is None else np.vstack((self._last, values))
        grown = np.diff(rows[:, _COLUMNS], axis=0, prepend=rows[:1, _COLUMNS])
        is_new = np.diff(rows[:, ROUND], prepend=rows[0, ROUND]) != 0.0
        grown[is_new] = rows[is_new][:, _COLUMNS]
        sums = self._sums + np.cumsum(grown, axis=0)
        if self._last is not None:
            sums = sums[1:]
        self._sums, self._last = sums[-1], values[-1]
        self._least = min(self._least, float(values[:, MARGIN].min()))
        self._trace.add(times, _MJ * sums)
        drift = np.linalg.norm(values[:, DRIFT : DRIFT + 3], axis=1)
        self.drifts = max(self.drifts[0], float(drift.max())), float(drift[-1])

    @property
    def is_there(self) -> bool:
        """Whether anything was recorded."""
        return self._last is not None

    @property
    def law(self) -> int:
        """Kind of passivity in the last sample, as its index among all kinds."""
        return int(self._last[LAW]) if self._last is not None else 0

    def score(self) -> PortScore:
        """Energies so far."""
        if not self.is_there:
            return PortScore(None, None, None, None)
        into, out, _, withheld = (_MJ * self._sums).tolist()
        return PortScore(into, out, withheld, _MJ * self._least)

    def line(self) -> tuple[Array, Rows]:
        """Times [s]; and energies [mJ]: in, out, received from the other side, and withheld."""
        return self._trace.line()


class PassivityMetric(Metric):
    """Energies at both ports, of a session with a stage ``passivity``."""

    name = "passivity"
    keys = (
        *keys_of("passivity.hand", PortScore, "hand: "),
        *keys_of("passivity.slave", PortScore, "slave: "),
        *keys_of("passivity", fields(PassivityScore)[2:]),
    )
    topics = (MASTER_ENERGY, SLAVE_ENERGY, MASTER_SERVO_CF)

    def __init__(self, context: Context) -> None:
        self._ports = _Port(context), _Port(context)
        self._seconds = 1e-9 * (context.bag.end_ns - context.bag.start_ns)
        self._force: Array | None = None
        self._variation = 0.0

    def add(self, window: Window) -> None:
        """Process one window."""
        for port, topic in zip(self._ports, (MASTER_ENERGY, SLAVE_ENERGY), strict=True):
            samples = window.samples(topic)
            port.add(samples.log_ns, samples.values)
        force = window.samples(MASTER_SERVO_CF).values[:, :3]
        if len(force):
            before = force[:1] if self._force is None else self._force
            steps = np.diff(force, axis=0, prepend=before)
            self._variation += float(np.linalg.norm(steps, axis=1).sum())
            self._force = force[-1:]

    def values(self) -> PassivityScore:
        """Score of everything so far."""
        hand, slave = self._ports
        if not slave.is_there:
            return PassivityScore(hand.score(), slave.score(), None, None, None)
        chatter = self._variation / self._seconds if self._seconds else None
        return PassivityScore(hand.score(), slave.score(), chatter, *(1e3 * drift for drift in slave.drifts))

    def rows(self) -> list[TableRow]:
        """Energies of both ports and the costs; empty without a stage ``passivity``."""
        score, found = self.values(), []
        if score.chatter_ns is None:
            return []
        for name, port in (("hand", score.hand), ("slave", score.slave)):
            found += [
                row(GROUP, f"energy in at the {name}", "mJ", port.in_mj),
                row(GROUP, f"energy out at the {name}", "mJ", port.out_mj),
                row(GROUP, f"kept from going out at the {name}", "mJ", port.withheld_mj),
            ]
        return [
            *found,
            row(GROUP, "change of the force at the hand", "N/s", score.chatter_ns),
            row(GROUP, "command held back, max", "mm", score.drift_max_mm),
        ]

    def figures(self) -> list[Figure]:
        """Plot of the energies of both ports against time; no plot without a stage ``passivity``."""
        score, traces = self.values(), []
        if score.chatter_ns is None:
            return []
        colors = ((FIRST, SECOND), (THIRD, FIXTURE))
        for name, port, (into, out) in zip(("hand", "slave"), self._ports, colors, strict=True):
            times, values = port.line()
            traces += [
                line(times, values[:, 0], f"in at the {name}", into, 1.4, "mJ"),
                line(times, values[:, 1], f"out at the {name}", out, 1.4, "mJ"),
            ]
        layout = {"xaxis": time_axis(), "yaxis": {"title": {"text": "energy [mJ]"}}, "hovermode": "x unified"}
        whole = sum(part or 0.0 for part in (score.hand.in_mj, score.slave.in_mj))
        given = sum(part or 0.0 for part in (score.hand.out_mj, score.slave.out_mj))
        text = f"{number(whole)} mJ went in at both ports together, {number(given)} mJ came out, in the slave's scale."
        return [Figure("Energy between hand and slave", text, traces, layout, 320)]
