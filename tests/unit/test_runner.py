"""Runner: what a session in virtual time records, and under which stamps."""

import numpy as np

from teleop_core import topics
from teleop_core.bags.reader import Bag
from teleop_core.session.configuration import configure
from teleop_core.session.runner import simulate
from teleop_core.signals import TICK_NS

DELAY_TICKS = 20


def test_setpoints_are_recorded_with_the_stamp_of_the_command_in_force(tmp_path):
    settings = ["duration=0.5", f"teleop.delays=[slave/servo_jp={DELAY_TICKS * 1e-3}]"]
    simulate(configure(settings=settings), tmp_path / "bag")
    bag = Bag(tmp_path / "bag")
    sampled = bag.read(topics.MASTER_MEASURED_CP).stamp_ns
    in_force = np.maximum(sampled - DELAY_TICKS * TICK_NS, 0)
    for topic in (topics.SLAVE_SETPOINT_JS, topics.SLAVE_SETPOINT_CP):
        assert np.array_equal(bag.read(topic).stamp_ns, in_force), topic.name
    for topic in (topics.SLAVE_SERVO_CP, topics.SLAVE_SERVO_JP, topics.SLAVE_MEASURED_JS):
        assert np.array_equal(bag.read(topic).stamp_ns, sampled), topic.name
