"""Operator node with a virtual gamepad, whose left stick goes round and round while it is held.

python padded_operator.py operator --ros-args -p kind:=gamepad
"""

import math
import sys
import threading
import time

from teleop_core.nodes.start import main
from virtual_pad import VirtualPad

_PERIOD = 3.0  # of a round [s]


def drive(pad: VirtualPad) -> None:
    """Hold the gamepad and turn its stick, until the process ends."""
    pad.press("right shoulder")
    while True:
        angle = 2.0 * math.pi * time.monotonic() / _PERIOD
        pad.move("left x", math.cos(angle))
        pad.move("left y", math.sin(angle))
        time.sleep(0.01)


if __name__ == "__main__":
    threading.Thread(target=drive, args=(VirtualPad(),), daemon=True).start()
    sys.exit(main())
