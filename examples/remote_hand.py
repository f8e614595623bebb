"""Act as the hand: send wanted poses of the stylus at irregular times, release it, and grip it again at another pose.

A live session accepts the same poses on the topic operator/servo_cp, at any rate.
"""

import numpy as np

import teleop_core as tc

RATE = 30.0


class Dragging:
    """A person who drags the stylus to and fro at 30 poses a second, with a break."""

    def __init__(self) -> None:
        self._due = 0.0

    def __call__(self, hand: tc.RemoteHand, time: float) -> None:
        """Send the wanted pose of the stylus, if a pose is due and the stylus is held."""
        if time < self._due or 2.0 < time < 4.0:
            return  # after a fifth of a second of silence the clutch is pressed
        self._due = time + 1.0 / RATE
        way = 0.01 * (1.0 - np.cos(np.pi * time))
        offset = 0.0 if time < 3.0 else 0.05  # the second grip is at another pose, and the stylus does not jump
        hand.want(np.array([offset + way, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0]))


def main() -> None:
    """Print the distances that stylus and slave moved while the stylus was held, released, and held again."""
    settings = {"haptic_master.device.friction": 0.0, "slave.starts_at_home": True}
    recording = tc.run(operator=tc.remote_operator("dragging", Dragging()), duration=6.5, settings=settings)
    state = recording["teleop/state"]
    begin = state.time[state["is_following"] > 0.0][0]
    for text, first, last in (("held", 0.0, 2.0), ("let go", 2.3, 4.0), ("held", 4.0, 6.5)):
        widths = []
        for topic in ("master/measured_cp", "slave/measured_cp"):
            stream = recording[topic]
            part = (stream.time >= begin + first) & (stream.time < begin + last)
            widths.append(1e3 * np.ptp(stream[["x", "y", "z"]][part], axis=0).max())
        print(f"{text}: stylus {widths[0]:.1f} mm, slave {widths[1]:.1f} mm wide")


if __name__ == "__main__":
    main()
