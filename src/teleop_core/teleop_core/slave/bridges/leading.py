"""Leading: when an arm may be commanded, and how far each command may go."""

import numpy as np

from teleop_core.kernels.geometry import Array

_CATCHING_UP = 1.2
"""Largest speed of commands, divided by the rated speed. Setpoints need at most 1; the excess compensates late
setpoints."""
_SLOWLY = 0.1  # speed of an arm that catches up with a setpoint that has moved away, divided by the rated speed
_LONGEST = 2.0  # largest number of missed periods that one command may catch up


class Lead:
    """Turns setpoints (n,) into commands without jumps; there is no command until the arm is at its setpoint.

    Args:
        lower: Lower limits of the joints (n,) [rad or m].
        upper: Upper limits of the joints (n,) [rad or m].
        speed_limit: Rated speeds (n,) [rad/s or m/s].
        tolerance: Largest distance of a joint from its setpoint when commands begin [rad or m].
        period: Time from command to command [s].
        presses: Whether joints may stop before their setpoints, as fingers on an object do. The commands of such joints
            may begin at any position, and continue from the last command if the setpoint has not moved.

    Attributes:
        position: The last command (n,) [rad or m].
        velocity: Velocity of the last command (n,) [rad/s or m/s].
        is_leading: Whether the arm is commanded towards the setpoint.
        waits: Text with the reason why the arm does not follow the setpoint; empty while ``is_leading``.
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
        self.waits = "sends no commands: no message has arrived yet"

    def let_go(self, reason: str) -> bool:
        """Stop commanding; the controller holds the arm at the last command. Returns False for `step`."""
        self.is_leading = self._is_braked = False
        self.waits = f"sends no commands: {reason}"
        return False

    def has_lost(self, measured: Array) -> bool:
        """Whether a commanded arm is not at its last command."""
        off = np.abs(measured - self.position)
        return self.is_leading and not self._presses and not bool((off <= self.tolerance).all())

    def step(self, setpoint: Array, measured: Array, names: tuple[str, ...], elapsed: float) -> bool:
        """Move the command towards a setpoint (n,); return whether there is a command to send.

        Args:
            setpoint: Joint setpoint of the server (n,) [rad or m].
            measured: Measured joint positions (n,) [rad or m].
            names: Joint names, for messages.
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
        """Move slowly to a setpoint that has moved away from the arm; arguments and result as in :meth:`step`.

        The setpoint must be at rest. The arm must have been commanded before, and must still be at its last command:
        an arm that was moved meanwhile gets no command. Normal commands resume when the arm arrives.
        """
        is_still = bool((setpoint == self._setpoint).all())
        self._setpoint[:] = setpoint
        off = np.abs(measured - self.position)
        if not self._has_led or not is_still or not (off <= self.tolerance).all():
            return False
        self.is_leading = bool((np.abs(setpoint - measured) <= self.tolerance).all())
        if self.is_leading:
            return self.step(setpoint, measured, names, elapsed)
        self.waits = "moves slowly to the setpoint, which has moved away from the arm"
        self._approach(np.clip(setpoint, self._lower, self._upper), elapsed, _SLOWLY)
        return True

    def brake(self, measured: Array, elapsed: float) -> bool:
        """Command the arm to its measured position at the moment of braking; return whether there is a command."""
        if not self.is_leading and not self._is_braked:
            return False
        if self.is_leading:
            self._braked[:] = measured
            self.is_leading, self._is_braked = False, True
            self.waits = "sends no commands: brakes hold the arm"
        self._approach(self._braked, elapsed)
        return True

    def _approach(self, goal: Array, elapsed: float, speeds: float = _CATCHING_UP) -> None:
        elapsed = min(max(elapsed, 1e-3), _LONGEST * self._period)
        reach = speeds * elapsed * self._speed_limit
        step = np.clip(goal - self.position, -reach, reach)
        self.position += step
        self.velocity[:] = step / elapsed
