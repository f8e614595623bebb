"""Runner: what a session in virtual time records, and under which stamps."""

from pathlib import Path
from typing import Any

import numpy as np

from teleop_core.bags.reader import Bag
from teleop_core.graph import TICK_NS, topics
from teleop_core.robots import load_robot
from teleop_core.session import api, runner, virtual
from teleop_core.session.configuration import Configuration, configure

HOME = load_robot("rcrt1").home.tolist()
DELAY_TICKS = 20


def test_setpoints_are_recorded_with_the_stamp_of_the_command_in_force(tmp_path: Path) -> None:
    settings = ["duration=0.5", f"slave.start={HOME}"]
    settings.append(f"teleop.delays=[slave/servo_jp={DELAY_TICKS * 1e-3}]")
    runner.simulate(configure(settings=settings), tmp_path / "bag")
    bag = Bag(tmp_path / "bag")
    sampled = bag.read(topics.MASTER_MEASURED_CP).stamp_ns
    in_force = np.maximum(sampled - DELAY_TICKS * TICK_NS, topics.NO_COMMAND_NS)
    for topic in (topics.SLAVE_SETPOINT_JS, topics.SLAVE_SETPOINT_CP):
        assert np.array_equal(bag.read(topic).stamp_ns, in_force), topic.name
    for topic in (topics.SLAVE_SERVO_CP, topics.SLAVE_SERVO_JP, topics.SLAVE_MEASURED_JS):
        assert np.array_equal(bag.read(topic).stamp_ns, sampled), topic.name


def test_recording_of_before_is_read_and_replayed_from_where_it_began(tmp_path: Path) -> None:
    # Its configuration has former names: path, pid, fixture.size.
    bag = Bag(Path(__file__).parents[2] / "bags" / "example")
    assert "path.kind" in bag.metadata["configuration"]
    layer, scenario = runner.recorded_configuration(bag)
    configuration = Configuration.from_layers([layer], scenario)
    assert runner.replay(bag, configuration, tmp_path / "again") == 2000
    again = Bag(tmp_path / "again")
    for topic in (topics.MASTER_MEASURED_CP, topics.MASTER_MEASURED_CV, topics.MASTER_BUTTONS):
        assert np.array_equal(bag.read(topic).values, again.read(topic).values), topic.name
    # Since then commands are drawn back where the arm cannot follow, as at home, at the end of d3.
    limits = again.read(topics.SLAVE_REACH).values[:, topics.SLAVE_REACH.columns.index("limit")]
    assert (limits == topics.Limit.JOINT).any()
    before, after = (b.read(topics.SLAVE_SETPOINT_CP).values[:, :3] for b in (bag, again))
    assert np.array_equal(before[0], after[0])
    # The slave is no farther from where it was than commands were from what it could follow.
    asked = bag.read(topics.SLAVE_SERVO_CP).values[:, :3]
    followed = load_robot("rcrt1").fk(bag.read(topics.SLAVE_SERVO_JP).values)[:, :3, 3]
    beyond = np.linalg.norm(asked - followed, axis=1).max()
    assert np.linalg.norm(before - after, axis=1).max() < beyond


def test_arms_that_begin_farther_away_are_waited_for_before_the_recorded_hand_moves() -> None:
    at_home = api.run("coarse_box", duration=1.0, slave__start=HOME)
    again = api.replay(at_home)
    for topic in ("slave/setpoint_js", "slave/measured_cp"):
        assert np.array_equal(again[topic].values, at_home[topic].values)
    elsewhere: dict[str, Any] = {"slave.start": [], "slave.starts_at_home": False}
    later = api.replay(at_home, settings=elsewhere)
    state, first_ns = at_home["teleop/state"], int(at_home["master/measured_cp"].stamp_ns[0])
    follows_ns = int(state.stamp_ns[np.argmax(state["is_following"] > 0.0)])
    waited = (follows_ns - first_ns) // TICK_NS
    lead = virtual.VirtualTime(configure("coarse_box", settings=["starts_at_home=false"])).lead
    assert len(later["slave/measured_js"]) == len(at_home["slave/measured_js"]) + lead - waited
    commands, hand = later["slave/servo_cp"][["x", "y", "z"]], later["master/measured_cp"]
    moved = hand[["z", "x", "y"]] * (-1.0, -1.0, 1.0)  # in the slave's axes
    # The slave is engaged at the second sample, while the hand still waits; then nothing is lost.
    assert not np.diff(moved, axis=0)[:2].any()
    steps = np.diff(commands, axis=0)[2:], np.diff(moved, axis=0)[2:]
    assert np.allclose(*steps, rtol=0, atol=1e-15)  # rounding of sums below a metre
