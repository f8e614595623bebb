"""Node ``haptic_master``: the simulated haptic device, and the hand that holds it."""

from teleop_core.chain.master.haptic_master import HapticMasterParameters
from teleop_core.graph.topics import HAND_SERVO_CP, MASTER_CONTACT, MASTER_SERVO_CF, Topic
from teleop_core.nodes.crtk_master import CrtkMaster
from teleop_core.nodes.operation import StopInput
from teleop_core.nodes.ticking import TickingNode

_MOST = MASTER_CONTACT.columns.index("largest_force")


class HapticMasterNode(TickingNode):
    """One sample of the device per millisecond, stamped with its nominal time."""

    def setup(self, parameters: HapticMasterParameters) -> None:
        """Make the device and open its topics."""
        super().setup(parameters)
        self.stage.step()  # loads the kernels, which takes longer than many ticks
        self.stage.reset()
        self._stop, self._crtk = StopInput(self), CrtkMaster(self)
        self._force = self.stage.signals[MASTER_SERVO_CF.field]

    def stop(self) -> None:
        """Forget the force: the next activation starts without."""
        self._force[:] = 0.0

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
        if not self._crtk.is_enabled:
            self._force[:] = 0.0

    def concerns(self) -> list[str]:
        """A stylus that nobody holds; motors that are too warm."""
        found = []
        if not self.stage.is_held:
            found.append(f"waits for {HAND_SERVO_CP.name}: nobody holds the stylus")
        if doubted := self.stage.doubted_force:
            bound = self.parameters.force_range
            found.append(f"no force: {doubted:.3g} N came, at most {bound:g}: a broken sensor")
        most = float(self.stage.signals[MASTER_CONTACT.field][_MOST])
        if 0.0 < most < self.parameters.device.peak_force:
            found.append(f"its motors are warm: {most:.2f} N at most")
        return found
