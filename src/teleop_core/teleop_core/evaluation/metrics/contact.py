"""Contact: the energy that the device's force absorbed from the hand and returned to it."""

from dataclasses import dataclass

import numpy as np

from teleop_core.evaluation import Context, Metric, TableRow, Window, keys_of, number, row
from teleop_core.evaluation.metric import figure
from teleop_core.evaluation.metrics.fixture import GROUP
from teleop_core.graph.topics import MASTER_CONTACT
from teleop_core.kernels.geometry import Array

TOUCH_J = 14e-6
"""A contact that absorbs less energy than this counts as a touch [J]. The limit is the energy that the device's dry
friction, 0.26 N, dissipates over one encoder step, 0.055 mm. In a touch, a force that begins and ends one period late
may return tenths of a microjoule more than it absorbed, whatever the law of the wall."""
_NUMBER, _TAKEN, _RETURNED, _FRICTION, _MOST = range(len(MASTER_CONTACT.columns))


@dataclass(frozen=True)
class ContactScore:
    """Energies of the hand's contacts with walls; values are None without contacts or if none were recorded."""

    count: int | None = figure(
        "1",
        "number of contacts: stretches in which the device pushed the hand and took 14 µJ or "
        "more; null if not recorded",
    )
    touches: int | None = figure(
        "1", "number of touches: stretches in which the device pushed the hand and took less than 14 µJ"
    )
    returned_max: float | None = figure(
        "1", "largest ratio of returned to absorbed energy in a contact; above 1, the contact gave the hand energy"
    )
    feeding: int | None = figure("1", "number of contacts in which the wall returned more energy than it absorbed")
    feeding_device: int | None = figure(
        # Only in such a contact the hand receives more energy than it spent.
        "1",
        "number of contacts that returned more energy than the wall and the device's dry friction absorbed",
    )
    gain_max_uj: float | None = figure(
        "uJ",
        "largest difference of returned and absorbed energy in a contact or touch; negative: every one absorbed more",
    )
    taken_max_mj: float | None = figure("mJ", "largest energy that a contact absorbed")
    worst_s: float | None = figure("s", "start of the contact with returned_max, since the start of the recording")
    largest_force_min_n: float | None = figure(
        "N", "smallest force limit that the temperature of the device's motors imposed"
    )


class ContactMetric(Metric):
    """Energy that each contact absorbed and returned, as the simulated device reports it."""

    name = "contact"
    keys = keys_of("contact", ContactScore)
    topics = (MASTER_CONTACT,)

    def __init__(self, context: Context) -> None:
        self._start_ns = context.bag.start_ns
        # Finished contacts (N, 6): the columns of the topic, then the time at which the contact began [s].
        self._over: list[Array] = []
        # The current contact, with the same columns.
        self._present = np.empty((0, len(MASTER_CONTACT.columns) + 1))
        self._most = np.inf

    def add(self, window: Window) -> None:
        """Process one window. The last sample of each contact contains its energies."""
        samples = window.samples(MASTER_CONTACT)
        if not len(samples.values):
            return
        self._most = min(self._most, float(samples.values[:, _MOST].min()))
        times = (samples.log_ns - self._start_ns) * 1e-9
        rows = np.vstack((self._present, np.column_stack((samples.values, times))))
        is_last = np.append(np.diff(rows[:, _NUMBER]) != 0.0, True)
        found = rows[is_last]
        found[1:, -1] = rows[1:][is_last[:-1], -1]
        found[0, -1] = rows[0, -1]
        self._over.append(found[:-1])
        self._present = found[-1:]

    def values(self) -> ContactScore:
        """Score of everything so far."""
        found = np.vstack((*self._over, self._present))
        if not len(found):
            return ContactScore(*[None] * 9)
        found = found[found[:, _NUMBER] > 0.0]
        taken, returned = found[:, _TAKEN], found[:, _RETURNED]
        gain = returned - taken
        is_contact = np.maximum(taken, returned) >= TOUCH_J
        with np.errstate(divide="ignore", invalid="ignore"):
            shares = np.where(is_contact, returned / taken, -np.inf)
        worst = int(shares.argmax()) if is_contact.any() else None
        return ContactScore(
            count=int(is_contact.sum()),
            touches=int((~is_contact).sum()),
            returned_max=None if worst is None else float(shares[worst]),
            feeding=int((gain[is_contact] > 0.0).sum()),
            feeding_device=int((gain > found[:, _FRICTION])[is_contact].sum()),
            gain_max_uj=1e6 * float(gain.max()) if len(found) else None,
            taken_max_mj=1e3 * float(taken.max()) if len(found) else None,
            worst_s=None if worst is None else float(found[worst, -1]),
            largest_force_min_n=self._most,
        )

    def rows(self) -> list[TableRow]:
        """Rows about the number of contacts and the worst contact; "none recorded" without contacts."""
        score = self.values()
        if score.count is None:
            return [TableRow(GROUP, "energy of contacts", "", "none recorded")]
        worst = f" at {score.worst_s:.1f} s" if score.worst_s is not None else ""
        share = None if score.returned_max is None else 100.0 * score.returned_max
        return [
            TableRow(GROUP, "contacts, touches", "", f"{score.count}, {score.touches}"),
            TableRow(GROUP, "energy given back of taken, max", "%", f"{number(share)}{worst}"),
            TableRow(GROUP, "contacts that gave more, wall/device", "", f"{score.feeding}/{score.feeding_device}"),
            row(GROUP, "least force that warmth allowed", "N", score.largest_force_min_n),
        ]
