"""Node ``haptic_master``: the simulated haptic device in the hand of an operator."""

from typing import Any

from teleop_core.master.haptic_master import HAPTIC_MASTER, HapticMasterParameters
from teleop_core.nodes.crtk_master import CrtkMaster
from teleop_core.nodes.hand import HandInput
from teleop_core.nodes.operation import StopInput
from teleop_core.nodes.ticking import TickingNode
from teleop_core.stage import Stage
from teleop_core.topics import MASTER_CONTACT, MASTER_SERVO_CF, Topic

_MOST = MASTER_CONTACT.columns.index("largest_force")


class HapticMasterNode(TickingNode):
    """One sample of the device per millisecond, stamped with its nominal time."""

    def __init__(self, stage: Stage = HAPTIC_MASTER, **options: Any) -> None:
        super().__init__(stage, **options)

    def setup(self, parameters: HapticMasterParameters) -> None:
        """Make the device and open its topics."""
        super().setup(parameters)
        self.stage.step()  # loads the kernels, which takes longer than many ticks
        self.stage.reset()
        self._stop, self._crtk = StopInput(self), CrtkMaster(self)
        self._force = self.stage.signals[MASTER_SERVO_CF.field]
        hand = self.stage.hand
        self._hand = HandInput(self, hand, has_poses=True) if hand is not None else None

    def stop(self) -> None:
        """Forget the force and let go: the next activation starts without either."""
        self._force[:] = 0.0
        if self.stage.hand is not None:
            self.stage.hand.let_go()

    def teardown(self) -> None:
        """Close what :meth:`setup` opened."""
        self._stop.close()
        self._crtk.close()
        super().teardown()

    def read_ports(self, trigger: Topic | None = None) -> None:
        """Bring the signals up to date; a source of force that fell silent adds none."""
        for entry in self.ports.inputs[MASTER_SERVO_CF.name]:
            if entry.age() > self.parameters.force_timeout:
                entry.zero()
        for pressed in self._stop.take():
            self.stage.press(is_pressed=pressed)
            self._crtk.press(is_pressed=pressed)
        super().read_ports(trigger)
        if self._hand is not None:
            self._hand.read()
        if not self._crtk.is_enabled:
            self._force[:] = 0.0

    def concerns(self) -> list[str]:
        """An operator who waits for the slave, a hand for its person; motors that are too warm."""
        found = []
        if not self.stage.has_begun:
            found.append("waits until teleop/state says that the slave follows")
        most = float(self.stage.signals[MASTER_CONTACT.field][_MOST])
        if 0.0 < most < self.parameters.device.peak_force:
            found.append(f"its motors are warm: {most:.2f} N at most")
        return found + (self._hand.concerns() if self._hand is not None else [])

    def values(self) -> dict[str, str]:
        """Whether the operator moves yet, and whose hand it is."""
        begun = {"has_begun": str(int(self.stage.has_begun))}
        return begun | (self._hand.values() if self._hand is not None else {})
