"""Let a policy lead the slave's joints as a LeRobot program does, and hand over to the hand; needs no LeRobot."""

import numpy as np

import teleop_core as tc
from teleop_core_lerobot import MasterSide, SlaveSide

robot = tc.load_robot("rcrt1")
slave, master = SlaveSide(scenario="free_motion"), MasterSide(scenario="free_motion")
slave.begin()
master.begin()


def tip(joints: dict[str, float]) -> np.ndarray:
    """Position of the tip (3,) [m]."""
    return robot.fk(list(joints.values()))[:3, 3]


joints = slave.observe_joints()
for _ in range(60):  # the policy: a slow turn of the first joint
    joints["theta1.pos"] += 0.002
    slave.send(joints)
led = tip(joints)

without = tip(master.next_action())
print(f"without a hand-over the slave would jump by {1e3 * np.linalg.norm(without - led):.1f} mm")

master.hold()
master.feel(joints)  # as feedback of the teleoperator
master.release()
action = master.next_action()
slave.send(action)
print(f"after the hand-over its tip moves by {1e3 * np.linalg.norm(tip(action) - led):.2f} mm")
for _ in range(60):
    slave.send(action := master.next_action())
print(f"two seconds later the hand has led it by {1e3 * np.linalg.norm(tip(action) - led):.1f} mm")
