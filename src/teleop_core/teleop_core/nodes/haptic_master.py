"""Node ``haptic_master``: the simulated haptic device, and the hand that holds it."""

from typing import Any

from teleop_core.graph.operation import State
from teleop_core.graph.topics import HAND_SERVO_CP, MASTER_CONTACT, MASTER_SERVO_CF, OPERATION, SLAVE_OPERATION, Topic
from teleop_core.hand.input_device import UNHELD
from teleop_core.hand.master.haptic_master import HapticMasterParameters
from teleop_core.nodes.crtk import Condition, OperatingStateTopics, is_installed
from teleop_core.nodes.operation import StopInput
from teleop_core.nodes.ticking import TickingNode
from teleop_core.slave.operation.states import TABLE, Answer, Event, answer_text, command_event


class CrtkMaster:
    """Operating state of the haptic device.

    The device is enabled from the start and needs no homing, because its encoders are absolute. In all states except
    ENABLED its motors give no force, and the hand moves it freely. An emergency stop of the session sets the state
    FAULT until the stop is released.

    Args:
        node: Node that owns the topics.
    """

    def __init__(self, node: Any) -> None:
        self._node, self._state, self._is_stopped = node, State.ENABLED, False
        self._topics: OperatingStateTopics | None = None
        if is_installed():
            self._topics = OperatingStateTopics(node, "master", self.request, self._condition)

    @property
    def is_enabled(self) -> bool:
        """Whether the device's motors may push."""
        return self._state is State.ENABLED and not self._is_stopped

    def request(self, name: str) -> tuple[Answer, str]:
        """Execute a command by name; the answer includes a text.

        Raises:
            UnknownNameError: There is no such command.
        """
        event, before = command_event(name), self._state
        follower = int(TABLE[before, event])
        if follower < 0:
            return Answer.REFUSED, answer_text(event, Answer.REFUSED, before)
        self._state = State(follower)
        is_new = self._state is not before or event is Event.HOME
        answer = Answer.DONE if is_new else Answer.ALREADY
        self._note()
        return answer, answer_text(event, answer, before)

    def press(self, *, is_pressed: bool) -> None:
        """Process a message of the stop button."""
        if is_pressed is not self._is_stopped:
            self._is_stopped = is_pressed
            self._note()

    def close(self) -> None:
        """Close the topics."""
        if self._topics is not None:
            self._topics.close()

    def _note(self) -> None:
        if self._topics is not None:
            self._topics.note(self._node.platform.time_ns())

    def _condition(self) -> Condition:
        return (State.FAULT if self._is_stopped else self._state).name, True, False


_MOST = MASTER_CONTACT.columns.index("largest_force")
_PRESSED = OPERATION.index("is_pressed")


class HapticMasterNode(TickingNode):
    """Publishes one sample of the device per millisecond, stamped with the nominal time of the tick."""

    def setup(self, parameters: HapticMasterParameters) -> None:
        """Make the device and open its topics."""
        super().setup(parameters)
        self._stop, self._crtk = StopInput(self), CrtkMaster(self)
        self._force = self.stage.signals[MASTER_SERVO_CF.field]
        self._operation = self.stage.signals[SLAVE_OPERATION.field]

    def stop(self) -> None:
        """Set the force to zero, so that the next activation starts without force."""
        self._force[:] = 0.0

    def teardown(self) -> None:
        """Close what :meth:`setup` opened."""
        self._stop.close()
        self._crtk.close()
        super().teardown()

    def read_ports(self, trigger: Topic | None = None) -> None:
        """Update the signals; a silent source of force counts as zero force."""
        for entry in self.ports.inputs[MASTER_SERVO_CF.name]:
            if entry.age() > self.parameters.force_timeout:
                entry.zero()
        for pressed in self._stop.take():
            self._press(is_pressed=pressed)
        was_pressed = self._operation[_PRESSED]
        super().read_ports(trigger)
        if was_pressed and not self._operation[_PRESSED]:  # the stop was released, or overridden at the slave
            self._stop.release()
            self._press(is_pressed=False)
        if not self._crtk.is_enabled:
            self._force[:] = 0.0

    def _press(self, *, is_pressed: bool) -> None:
        self.stage.press(is_pressed=is_pressed)
        self._crtk.press(is_pressed=is_pressed)

    def concerns(self) -> list[str]:
        """Texts about a stylus that nobody holds, and about motors that are too warm."""
        found = []
        if not self.stage.is_held:
            found.append(f"waits for {HAND_SERVO_CP.name}: {UNHELD}")
        if doubted := self.stage.doubted_force:
            bound = self.parameters.force_range
            found.append(f"gives no force: received {doubted:.3g} N, allowed are {bound:g} N: a force sensor is faulty")
        most = float(self.stage.signals[MASTER_CONTACT.field][_MOST])
        if 0.0 < most < self.parameters.device.peak_force:
            found.append(f"the device's motors are warm: the force is limited to {most:.2f} N")
        return found
