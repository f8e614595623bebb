"""Node ``haptic_master``: the simulated haptic device in the hand of an operator."""

import sys
import time
from typing import Any

from teleop_core.bags import topics
from teleop_core.master.haptic_master import HapticMaster, HapticMasterParameters
from teleop_core.nodes.base import CoreNode
from teleop_core.nodes.process import run
from teleop_core.session.configuration import Configuration
from teleop_core.session.graph import STAGE
from teleop_core.session.runner import recorded_path


class HapticMasterNode(CoreNode):
    """One sample of the device per millisecond, stamped with its nominal time."""

    def __init__(self, **options: Any) -> None:
        super().__init__(STAGE["haptic_master"], **options)

    def setup(self, parameters: HapticMasterParameters) -> None:
        """Make the device and open its topics."""
        recorded = recorded_path(Configuration({"haptic_master": parameters}, ""))
        self.stage = HapticMaster(parameters, recorded=recorded)
        self.stage.step()  # loads the kernels, which takes longer than many ticks
        self.stage.reset()
        self.open_streams()
        self._servo_cf = self.input(topics.MASTER_SERVO_CF)
        self._samples = [self.output(topic) for topic in STAGE["haptic_master"].writes]
        self._force = self.stage.signals[topics.MASTER_SERVO_CF.field]

    def start(self) -> None:
        """Relate the monotonic time of the loop to the stamps."""
        self._epoch_ns = time.time_ns() - time.monotonic_ns()

    def stop(self) -> None:
        """Forget the force: the next activation starts without one."""
        self._force[:] = 0.0

    def turn(self) -> None:
        """Take all samples that are due."""
        for tick_ns in self.schedule.due():
            self.work(tick_ns)

    def work(self, tick_ns: int) -> None:
        """Take the sample of one tick [ns, monotonic]."""
        self._servo_cf.newest()
        if self._servo_cf.age() > self.parameters.force_timeout:
            self._force[:] = 0.0
        with self.lock:
            self.stage.step()
        for sample in self._samples:
            sample.send(tick_ns + self._epoch_ns)


def main() -> int:
    """Entry point of ``ros2 run teleop_core haptic_master``."""
    return run(HapticMasterNode)


if __name__ == "__main__":
    sys.exit(main())
