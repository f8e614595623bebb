"""Stop an arm in full motion, measure its stopping distance, and let it continue; in virtual time."""

import numpy as np

import teleop_core as tc
from teleop_core.graph.operation import State


def main() -> None:
    """Print the states of a stopped session, and the distance that the setpoint moved in each."""
    events = ("stop@3.0", "reset@4.0", "enable@4.1", "pause@6.0", "resume@6.5")
    recording = tc.run("free_motion", duration=8.0, settings={"operation.events": events, "slave.starts_at_home": True})
    setpoint = recording["slave/setpoint_cp"]
    times = 1e-9 * setpoint.log_ns
    for begin, end in ((2.5, 3.0), (3.002, 4.0), (4.2, 6.0), (6.2, 6.5), (7.0, 8.0)):
        part = setpoint.values[(times > begin) & (times < end), :3]
        way = np.linalg.norm(np.diff(part, axis=0), axis=1).sum()
        print(f"{begin:5.3f} to {end:5.3f} s: the setpoint moved {1e3 * way:6.2f} mm")
    operation = recording["slave/operation"]
    for time, state in zip(1e-9 * operation.stamp_ns, operation["state"], strict=True):
        print(f"{time:6.3f} s  {State(int(state)).name}")


if __name__ == "__main__":
    main()
