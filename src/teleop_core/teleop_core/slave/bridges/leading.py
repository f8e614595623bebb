"""Leading: when an arm may be commanded, and how far each command may go."""

import numpy as np

from teleop_core.kernels.geometry import Array

_CATCHING_UP = 1.2
"""Largest speed of commands in rated speeds: setpoints keep 1, the rest makes up for late ones."""
_SLOWLY = 0.1  # rated speeds, of an arm that catches up with a setpoint that went on without it
_LONGEST = 2.0  # periods for which one command may make up


class Lead:
    """Commands (n,) from setpoints: none before the arm stands at them, and none that jumps.

    Args:
        lower: Limits of the joints (n,) [rad or m].
        upper: The same at the other end.
        speed_limit: Rated speeds (n,) [rad/s or m/s].
        tolerance: How far a joint may be from its setpoint when the lead begins [rad or m].
        period: Time from command to command [s].
        presses: Whether joints may stand short of their setpoints, as fingers on what they hold:
            they begin anywhere, and go on from the last command if the setpoint is still there.

    Attributes:
        position: The last command (n,) [rad or m].
        velocity: How fast it went there (n,) [rad/s or m/s].
        is_leading: Whether the arm is led to the setpoint.
        waits: What is commanded in place of that, and why; empty if it is led.
    """

    def __init__(
        self, lower: Array, upper: Array, speed_limit: Array, tolerance: float, period: float, *, presses: bool = False
    ) -> None:
        n = len(lower)
        self._presses, self._has_led = presses, False
        self._lower, self._upper, self._speed_limit = lower, upper, speed_limit
        self.tolerance, self._period = tolerance, period
        self.position, self.velocity, self._braked = np.zeros(n), np.zeros(n), np.zeros(n)
        self._setpoint = np.full(n, np.nan)
        self._is_braked = self.is_leading = False
        self.waits = "commands nothing: nothing has come yet"

    def let_go(self, reason: str) -> bool:
        """Command nothing; the controller holds the arm at the last command. False, as `step`."""
        self.is_leading = self._is_braked = False
        self.waits = f"commands nothing: {reason}"
        return False

    def has_lost(self, measured: Array) -> bool:
        """Whether an arm that is led is not where it was commanded."""
        off = np.abs(measured - self.position)
        return self.is_leading and not self._presses and not bool((off <= self.tolerance).all())

    def step(self, setpoint: Array, measured: Array, names: tuple[str, ...], elapsed: float) -> bool:
        """Go on towards a setpoint (n,); whether there is a command to send.

        Args:
            setpoint: Where the server wants the joints (n,) [rad or m].
            measured: Where they are (n,) [rad or m].
            names: Of the joints, for messages.
            elapsed: Time since the last command [s].
        """
        self._is_braked = False
        if not self.is_leading:
            off = np.abs(setpoint - measured)
            if not self._presses and not (off <= self.tolerance).all():
                i = int(np.argmax(off))
                return self.let_go(f"{names[i]} is {off[i]:.4g} from its setpoint, at most {self.tolerance:g} to begin")
            stays = self._has_led and (np.abs(setpoint - self.position) <= self.tolerance).all()
            if not (self._presses and stays):
                self.position[:] = measured
            self.is_leading, self._has_led, self.waits = True, True, ""
        self._approach(np.clip(setpoint, self._lower, self._upper), elapsed)
        return True

    def rejoin(self, setpoint: Array, measured: Array, names: tuple[str, ...], elapsed: float) -> bool:
        """Go on slowly to a setpoint that went on without the arm; otherwise as :meth:`step`.

        Only to one that stands still, and only an arm that was led and stands at the last command:
        one that somebody moved meanwhile is commanded nothing. It is led again when it arrives.
        """
        is_still = bool((setpoint == self._setpoint).all())
        self._setpoint[:] = setpoint
        off = np.abs(measured - self.position)
        if not self._has_led or not is_still or not (off <= self.tolerance).all():
            return False
        self.is_leading = bool((np.abs(setpoint - measured) <= self.tolerance).all())
        if self.is_leading:
            return self.step(setpoint, measured, names, elapsed)
        self.waits = "goes slowly to the setpoint, which went on without the arm"
        self._approach(np.clip(setpoint, self._lower, self._upper), elapsed, _SLOWLY)
        return True

    def brake(self, measured: Array, elapsed: float) -> bool:
        """Bring the arm to where it is when its brakes close; whether there is a command."""
        if not self.is_leading and not self._is_braked:
            return False
        if self.is_leading:
            self._braked[:] = measured
            self.is_leading, self._is_braked = False, True
            self.waits = "commands nothing: its brakes hold it"
        self._approach(self._braked, elapsed)
        return True

    def _approach(self, goal: Array, elapsed: float, speeds: float = _CATCHING_UP) -> None:
        elapsed = min(max(elapsed, 1e-3), _LONGEST * self._period)
        reach = speeds * elapsed * self._speed_limit
        step = np.clip(goal - self.position, -reach, reach)
        self.position += step
        self.velocity[:] = step / elapsed
