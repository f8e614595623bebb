"""Held master: a haptic master in the hand of an operator, tick by tick, without the slave."""

from collections.abc import Callable

from teleop_core.graph.topics import HAND_BUTTONS, HAND_SERVO_CP, HAND_TREMOR
from teleop_core.hand.master.haptic_master import HapticMaster, HapticMasterParameters
from teleop_core.hand.master.operator import RunningOperator
from teleop_core.hand.operators.behaviour import OperatorParameters

_HAND = [topic.field for topic in (HAND_SERVO_CP, HAND_BUTTONS, HAND_TREMOR)]


class HeldMaster:
    """Operator and device; ``signals`` and ``state`` are those of the device."""

    def __init__(self, operator: OperatorParameters, master: HapticMasterParameters | None = None) -> None:
        self.operator, self.device = (RunningOperator(operator), HapticMaster(master or HapticMasterParameters()))
        self.signals, self.state = self.device.signals, self.device.state

    def prepare(self, ticks: int) -> None:
        """Draw what both need in the next ticks."""
        for stage in (self.operator, self.device):
            stage.prepare(ticks)

    def step(self) -> None:
        """One tick of both; what the operator sees is what the device showed last."""
        self.operator.step()
        self._hand_over()
        self.device.step()

    def load(self) -> Callable[[], None]:
        """Tick of what is prepared, without looking for more: faster."""
        move, feel = self.operator.load(), self.device.load()

        def step() -> None:
            move()
            self._hand_over()
            feel()

        return step

    def _hand_over(self) -> None:
        for name in _HAND:
            self.signals[name] = self.operator.signals[name]
        self.signals["hand_servo_cp_ns"] += 1

    def reset(self) -> None:
        """Back to before the first tick."""
        self.operator.reset()
        self.device.reset()
