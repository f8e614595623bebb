"""Node ``haptic_master``: the simulated haptic device in the hand of an operator."""

from typing import Any

import numpy as np

from teleop_core.errors import PartError
from teleop_core.master.haptic_master import HAPTIC_MASTER, HapticMasterParameters
from teleop_core.nodes.crtk_master import CrtkMaster
from teleop_core.nodes.device_hand import DeviceHand
from teleop_core.nodes.hand import HandInput
from teleop_core.nodes.operation import StopInput
from teleop_core.nodes.ticking import TickingNode
from teleop_core.operators import OPERATORS
from teleop_core.stage import Stage
from teleop_core.topics import MASTER_CONTACT, MASTER_SERVO_CF, Topic

_MOST = MASTER_CONTACT.columns.index("largest_force")


class HapticMasterNode(TickingNode):
    """One sample of the device per millisecond, stamped with its nominal time."""

    def __init__(self, stage: Stage = HAPTIC_MASTER, **options: Any) -> None:
        super().__init__(stage, **options)
        self._hand: HandInput | None = None
        self._device: DeviceHand | None = None

    def setup(self, parameters: HapticMasterParameters) -> None:
        """Make the device and open its topics."""
        super().setup(parameters)
        self.stage.step()  # loads the kernels, which takes longer than many ticks
        self.stage.reset()
        self._stop, self._crtk = StopInput(self), CrtkMaster(self)
        self._force = self.stage.signals[MASTER_SERVO_CF.field]
        self._open_hand(parameters)

    def _open_hand(self, parameters: HapticMasterParameters) -> None:
        """Open what moves the hand of a person: a device of this machine, or topics."""
        self._hand, self._device = None, None
        kind, hand = parameters.operator.kind, self.stage.hand
        operator = OPERATORS.find(kind.kind)
        if hand is None:
            if operator.opens is not None:
                text = "one whose make gives a RemoteHand, for it opens a device"
                raise PartError("operator", kind.kind, text)
            return
        if operator.opens is not None:
            self._device = DeviceHand(self, hand, operator.opens, kind.parameters, self._share)
        self._hand = HandInput(self, hand, has_poses=operator.opens is None)

    def _share(self) -> float:
        """Force that the person shall feel, as a share of the device's largest."""
        force, peak = self._force[:3], self.parameters.device.peak_force
        return float(min(np.linalg.norm(force) / peak, 1.0)) if peak > 0.0 else 0.0

    def stop(self) -> None:
        """Forget the force and let go: the next activation starts without either."""
        self._force[:] = 0.0
        if self.stage.hand is not None:
            self.stage.hand.let_go()

    def teardown(self) -> None:
        """Close what :meth:`setup` opened."""
        if self._device is not None:
            self._device.close()
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
        if doubted := self.stage.doubted_force:
            bound = self.parameters.force_range
            found.append(f"no force: {doubted:.3g} N came, at most {bound:g}: a broken sensor")
        most = float(self.stage.signals[MASTER_CONTACT.field][_MOST])
        if 0.0 < most < self.parameters.device.peak_force:
            found.append(f"its motors are warm: {most:.2f} N at most")
        people = (self._hand, self._device)
        return found + [text for one in people if one is not None for text in one.concerns()]

    def values(self) -> dict[str, str]:
        """Whether the operator moves yet, and whose hand it is."""
        begun = {"has_begun": str(int(self.stage.has_begun))}
        people = (self._hand, self._device)
        return begun | {k: v for one in people if one is not None for k, v in one.values().items()}
