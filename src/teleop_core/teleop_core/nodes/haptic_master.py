"""Node ``haptic_master``: the simulated haptic device in the hand of an operator."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from teleop_core.bags.reports import read_reports
from teleop_core.master.haptic_master import HAPTIC_MASTER, HapticMasterParameters
from teleop_core.nodes.streams import Subscription
from teleop_core.nodes.ticking import TickingNode
from teleop_core.parameters import parameter
from teleop_core.session.runner import state_report
from teleop_core.signals import STATE_FIELDS
from teleop_core.stage import Stage
from teleop_core.topics import MASTER_SERVO_CF, TELEOP_STATE, Topic


@dataclass(frozen=True, kw_only=True)
class HapticMasterNodeParameters(HapticMasterParameters):
    """Parameters of the master as a node."""

    patience: float = parameter(
        5.0, unit="s", lower=0.0, upper=3600.0, fixed=True,
        doc="the operator begins when teleop/state says that the slave follows, or after this",
    )  # fmt: skip


class HapticMasterNode(TickingNode):
    """One sample of the device per millisecond, stamped with its nominal time.

    Nodes find each other within seconds. Until the slave follows, the hand rests, as an operator's
    would: no part of its motion is lost.
    """

    def __init__(self, stage: Stage = HAPTIC_MASTER, **options: Any) -> None:
        super().__init__(stage, HapticMasterNodeParameters, **options)

    def setup(self, parameters: HapticMasterNodeParameters) -> None:
        """Make the device and open its topics."""
        super().setup(parameters)
        self.stage.step()  # loads the kernels, which takes longer than many ticks
        self.stage.reset()
        self._force = self.stage.signals[MASTER_SERVO_CF.field]
        self._has_begun, self._first_ns = False, 0
        read_reports(state_report(0, np.zeros(len(STATE_FIELDS))))  # loads the message types
        self._state = Subscription(self, TELEOP_STATE, TELEOP_STATE.name)

    def stop(self) -> None:
        """Forget the force: the next activation starts without one."""
        self._force[:] = 0.0

    def teardown(self) -> None:
        """Stop listening to the state."""
        self._state.close()

    def read_ports(self, trigger: Topic | None = None) -> None:
        """Bring the signals up to date; a source of force that fell silent adds none."""
        for entry in self.ports.inputs[MASTER_SERVO_CF.name]:
            if entry.age() > self.parameters.force_timeout:
                entry.zero()
        super().read_ports(trigger)

    def advance(self, now_ns: int) -> None:
        """Take the sample of one tick; at first the hand rests."""
        if self._has_begun or self._begins(now_ns):
            super().advance(now_ns)

    def _begins(self, stamp_ns: int) -> bool:
        """Whether the operator begins with this sample."""
        self._first_ns = self._first_ns or stamp_ns
        self._has_begun = (stamp_ns - self._first_ns) * 1e-9 >= self.parameters.patience
        while (taken := self._state.take()) is not None:
            for report in read_reports(taken[0]):
                # A report older than our samples is about another master.
                is_about_us = report.stamp_ns >= self._first_ns
                follows = report.values.get("is_following") == "1.0"
                self._has_begun |= is_about_us and follows
        return self._has_begun

    def concerns(self) -> list[str]:
        """An operator who waits for the slave."""
        return [] if self._has_begun else ["waits until teleop/state says that the slave follows"]

    def values(self) -> dict[str, str]:
        """Whether the operator moves yet."""
        return {"has_begun": str(int(self._has_begun))}
