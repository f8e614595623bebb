"""Device hand: the thread that reads a gamepad or a 3-D mouse and moves a hand accordingly."""

from collections.abc import Callable
from concurrent.futures import Future
from typing import Any

from teleop_core.base.errors import SessionError, TeleopError
from teleop_core.hand.devices.pilot import Pilot, PilotParameters
from teleop_core.hand.input_device import UNHELD, Device
from teleop_core.hand.operators.remote import RemoteHand
from teleop_core.nodes.loop import Loop

PERIOD = 0.01
"""Time between two readings of the device [s]."""
_RUMBLES = 5  # number of readings from one rumble to the next
_AGAIN = 1.0  # time between two attempts to find a lost device [s]
_OPENING = 20.0  # a device that takes longer to open counts as hung [s]


class DeviceHand:
    """Reader of a device in a separate thread; only this thread uses the device.

    A device that is unplugged is closed, and opened again when it is plugged in again.

    Args:
        node: Node whose log is used.
        hand: Hand that the device moves.
        opens: Opens the device.
        parameters: Parameters of the operator.
        force: Returns the force that the person should feel, as a share of the largest force.

    Raises:
        TeleopError: The device cannot be opened; the error text lists what was found.
    """

    def __init__(
        self,
        node: Any,
        hand: RemoteHand,
        opens: Callable[[Any], Device],
        parameters: PilotParameters,
        force: Callable[[], float],
    ) -> None:
        self._log, self._hand, self._force = node.ros.get_logger(), hand, force
        self._platform = node.platform
        self._opens, self._parameters = opens, parameters
        self._pilot = Pilot(hand, parameters)
        self._device: Device | None = None
        self._lost, self._looks, self._last, self._felt = "", 0, 0.0, 0.0
        self._opened: Future[None] = Future()
        self._loop = Loop(self._platform, "device", self._turn, self._fail, self._open)
        self._loop.start()
        try:
            self._opened.result(_OPENING)
        except TimeoutError as error:
            self._loop.stop()
            raise SessionError(f"the device does not open within {_OPENING:g} s") from error

    def concerns(self) -> list[str]:
        """Texts about a lost device, and about a stylus that nobody holds."""
        if self._lost:
            return [f"{self._lost}; waits for it"]
        return [] if self._hand.is_held else [f"waits for a hand: {UNHELD}"]

    def values(self) -> dict[str, str]:
        """Name of the device, and whether a person holds the stylus."""
        name = self._device.name if self._device is not None else ""
        return {"hand": name, "hand.is_held": str(int(self._hand.is_held))}

    def close(self) -> None:
        """Stop reading and close the device."""
        if self._loop.stop() and self._device is not None:
            self._pilot.let_go()
            self._device.close()
            self._device = None

    # -- in the thread of the device -------------------------------------------------------------

    def _open(self) -> None:
        try:
            self._device = self._opens(self._parameters)
        except Exception as error:  # the constructor raises this error in the node's thread
            self._opened.set_exception(error)
            self._loop.is_running = False
            return
        self._last = 1e-9 * self._platform.monotonic_ns()
        self._opened.set_result(None)

    def _turn(self) -> None:
        self._platform.sleep(PERIOD)
        if self._device is None:
            self._try_again()
        else:
            try:
                self._read(self._device)
            except SessionError as error:
                self._lose(str(error))

    def _read(self, device: Device) -> None:
        now = 1e-9 * self._platform.monotonic_ns()
        elapsed, self._last = now - self._last, now
        self._pilot.step(device.read(), elapsed)
        self._looks += 1
        share = self._force() * getattr(self._parameters, "rumble", 0.0)
        if self._looks % _RUMBLES == 0 and (share or self._felt):
            device.rumble(share)
            self._felt = share

    def _lose(self, text: str) -> None:
        self._pilot.lose()
        self._lost, self._device = text, None
        self._last = 1e-9 * self._platform.monotonic_ns()
        self._log.error(text)

    def _try_again(self) -> None:
        if 1e-9 * self._platform.monotonic_ns() - self._last < _AGAIN:
            return
        self._last = 1e-9 * self._platform.monotonic_ns()
        try:
            self._device = self._opens(self._parameters)
        except TeleopError:
            return
        self._lost = ""
        self._log.info(f"{self._device.name} is back")

    def _fail(self, reason: str, _: bool) -> None:
        """Log an unexpected error. The silence that follows releases the stylus."""
        self._lost = "the reader of the device has crashed; see the log"
        self._log.error(f"{self._lost}:\n{reason}")
