"""A process that listens to stop buttons alone, and ends with so many presses.

    python stop_reader.py PRESSES

It says that it is ready, and where it finds a button that it has found one. It answers 0 once it
has heard the presses, and 1 where they did not come in three seconds after the first message.
"""

import os
import sys
import time

from teleop_core.middleware.ros import ROS
from teleop_core.nodes.guest import Guest
from teleop_core.nodes.operation import STOP_TOPIC, StopInput

ROS.init([])
guest = Guest("stop_reader")
stop, end, is_found, missing = StopInput(guest), float("inf"), False, int(sys.argv[1])
stop.take()
print("ready", flush=True)
while time.monotonic() < end:
    heard = stop.take()
    missing -= sum(heard)
    if missing <= 0:
        os._exit(0)
    if heard:
        end = min(end, time.monotonic() + 3.0)
    if not is_found and guest.ros.count_publishers(STOP_TOPIC):
        is_found = True
        print("found", flush=True)
    time.sleep(0.001)
os._exit(1)
