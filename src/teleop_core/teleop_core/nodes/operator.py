"""Node ``operator``: who holds the stylus, a simulated person or one at a device or elsewhere."""

import numpy as np

from teleop_core.base.errors import PartError
from teleop_core.chain.operators import OPERATORS
from teleop_core.chain.operators.follower import MOST
from teleop_core.chain.operators.parameters import OperatorParameters
from teleop_core.graph.topics import (
    MASTER_MEASURED_CF,
    MASTER_MEASURED_CP,
    SLAVE_MEASURED_CP,
    Topic,
)
from teleop_core.nodes.device_hand import DeviceHand
from teleop_core.nodes.person_hand import HandInput
from teleop_core.nodes.ticking import TickingNode

_FULL = 3.3
"""Force that is told a person in full [N]; a rumble has no more."""
_LOOK = 10
"""Ticks from one look at the state to the next, of operators who answer to nothing."""


class OperatorNode(TickingNode):
    """Where the hand is wanted, once per millisecond."""

    _hand: HandInput | None = None
    _device: DeviceHand | None = None
    _ticks = 0

    def setup(self, parameters: OperatorParameters) -> None:
        """Make the operator and open its topics, and its device."""
        super().setup(parameters)
        self.stage.step()  # loads the kernels, which takes longer than many ticks
        self.stage.reset()
        self._force = self.stage.signals[MASTER_MEASURED_CF.field]
        self._hand, self._device = None, None
        self._sees = self.stage.ahead <= MOST
        if not self._sees:  # whoever plans so far ahead answers to nothing
            for port in (SLAVE_MEASURED_CP, MASTER_MEASURED_CP, MASTER_MEASURED_CF):
                self.input(port).close()
        kind, hand = parameters.kind, self.stage.hand
        operator = OPERATORS.find(kind.kind)
        if not operator.is_here:
            self.leave_topics()
        if hand is None:
            if operator.opens is not None:
                text = "one whose make gives a RemoteHand, for it opens a device"
                raise PartError("operator", kind.kind, text)
            return
        if operator.opens is not None:
            self._device = DeviceHand(self, hand, operator.opens, kind.parameters, self._share)
        self._hand = HandInput(self, hand, has_poses=operator.opens is None)

    def _share(self) -> float:
        """Force that the person shall feel, as a share of the largest."""
        return min(float(np.linalg.norm(self._force[:3])) / _FULL, 1.0)

    def stop(self) -> None:
        """Let go: the next activation starts without a hand."""
        if self.stage.hand is not None:
            self.stage.hand.let_go()

    def teardown(self) -> None:
        """Close what :meth:`setup` opened."""
        if self._device is not None:
            self._device.close()
        super().teardown()

    def read_ports(self, trigger: Topic | None = None) -> None:
        """Bring the signals up to date, and hear who says where the stylus shall be."""
        self._ticks += 1
        if self._sees or not self.has_own_loop or self._ticks % _LOOK == 0:
            super().read_ports(trigger)
        if self._hand is not None:
            self._hand.read()

    def concerns(self) -> list[str]:
        """An operator who waits for the slave, or for a person."""
        found = []
        if not self.stage.has_begun:
            found.append("waits until teleop/state says that the slave follows")
        people = (self._hand, self._device)
        return found + [text for one in people if one is not None for text in one.concerns()]

    def values(self) -> dict[str, str]:
        """Whether the operator moves yet, and whose hand it is."""
        begun = {"has_begun": str(int(self.stage.has_begun))}
        people = (self._hand, self._device)
        return begun | {k: v for one in people if one is not None for k, v in one.values().items()}
