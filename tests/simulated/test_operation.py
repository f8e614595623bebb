"""Operation over real topics: who may move, how an arm is stopped, and how it goes on."""

import signal
from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from std_msgs.msg import Bool
from std_srvs.srv import Trigger

from teleop_core.bags.reports import read_reports
from teleop_core.graph.operation import State
from teleop_core.graph.topics import SLAVE_OPERATION, SLAVE_SERVO_JP, SLAVE_SETPOINT_JS
from teleop_core.middleware.platform import Publisher, Qos
from teleop_core.nodes.operation import STOP_TOPIC, StopButton
from teleop_core.nodes.streams import Subscription
from teleop_core.robots import load_robot
from teleop_core.slave.operation import Fault

if TYPE_CHECKING:
    from peers import AnyPeer as Peer

HOME = load_robot("rcrt1").home


class Streamer:
    """Commands that swing joint 1, and what the slave makes of them."""

    def __init__(self, peer: "Peer") -> None:
        self.peer, self.begin = peer, peer.now()
        self.setpoints = peer.listen(SLAVE_SETPOINT_JS)
        peer.publisher(SLAVE_SERVO_JP)

    def send(self) -> None:
        """One command of the swing."""
        goal = HOME.copy()
        goal[0] += 0.1 * np.sin(2.0 * np.pi * (self.peer.now() - self.begin))
        self.peer.send(SLAVE_SERVO_JP, self.peer.time_ns(), goal)
        self.setpoints.take()

    def until(self, condition: Any, what: str) -> Any:
        """Send commands until something is so."""

        def turn() -> object:
            self.send()
            self.peer.sleep(0.001)  # the rate of commands, not a wait
            return condition()

        return self.peer.wait(turn, what)

    def moves(self) -> bool:
        """Whether the last setpoints differ."""
        last = self.setpoints.values[-50:]
        return len(last) == 50 and np.ptp(np.array(last)[:, 0]) > 1e-3

    def rests(self) -> bool:
        """Whether the last setpoints are one and the same."""
        last = self.setpoints.values[-50:]
        return len(last) == 50 and np.ptp(np.array(last)[:, 0]) == 0.0


def state(peer: "int | Peer") -> State | None:
    status = operation(peer)
    return None if status is None else State(int(float(status["state"])))


def operation(peer: Any) -> Any:
    """Newest report of the slave's operation, by name."""
    if not hasattr(peer, "operation"):
        peer.operation, peer.read = Subscription(peer, SLAVE_OPERATION, "slave/operation"), {}
    while (taken := peer.operation.take()) is not None:
        for report in read_reports(taken.data):
            peer.read = report.values
    return peer.read or None


def command(peer: "Peer", name: str, arm: str = "") -> Any:
    answer = peer.call(Trigger, f"{arm}/slave/{name}", Trigger.Request())
    return answer.success, answer.message


def found_button(peer: "Peer", readers: int = 2, **qos: Any) -> Publisher:
    """A stop button as anybody would write it, once it is found."""
    made = peer.ros.create_publisher(Bool, STOP_TOPIC, Qos(**qos))
    peer.wait(lambda: made.get_subscription_count() == readers, "readers of the stop")
    return made


def test_a_stop_message_stops_the_setpoint_until_reset_and_enable_follow_its_release(peer: "Peer") -> None:
    peer.start("slave")
    streamer = Streamer(peer)
    streamer.until(streamer.moves, "motion")
    button = peer.ros.create_publisher(Bool, STOP_TOPIC, Qos())
    streamer.until(lambda: button.get_subscription_count() >= 1, "a reader of the stop")
    button.publish(Bool(data=True))
    streamer.until(lambda: state(peer) is State.FAULT, "FAULT")
    streamer.until(streamer.rests, "standstill")
    streamer.until(lambda: float(operation(peer)["rest_time"]) > 0.0, "rest")
    count = len(streamer.setpoints.values)
    streamer.until(lambda: len(streamer.setpoints.values) > count + 100, "more setpoints")
    assert np.ptp(np.array(streamer.setpoints.values)[count - 50 :, 0]) == 0.0
    assert float(operation(peer)["is_stopped"]) == 1.0
    ok, text = command(peer, "enable")
    assert not ok
    assert "reset" in text
    assert not command(peer, "reset")[0]  # still pressed
    button.publish(Bool(data=False))
    streamer.until(lambda: command(peer, "reset")[0], "a reset after the release")
    streamer.until(lambda: command(peer, "enable")[0], "enabled")
    streamer.until(streamer.moves, "motion after the stop")


def test_an_arm_that_waits_for_people_moves_when_it_is_enabled_and_homed(peer: "Peer") -> None:
    peer.start("slave", operation__starts_enabled=False)
    streamer = Streamer(peer)
    streamer.until(lambda: state(peer) is State.DISABLED, "DISABLED")
    streamer.until(lambda: len(streamer.setpoints.values) > 300, "setpoints")
    assert np.ptp(np.array(streamer.setpoints.values)[:, 0]) == 0.0
    ok, text = command(peer, "home")
    assert not ok
    assert "enable first" in text
    assert command(peer, "enable")[0]
    assert command(peer, "home")[0]
    streamer.until(streamer.moves, "motion")
    assert command(peer, "pause")[0]
    streamer.until(lambda: state(peer) is State.PAUSED, "PAUSED")
    streamer.until(streamer.rests, "standstill")
    streamer.until(lambda: command(peer, "resume")[0], "resumed, once it is at rest")
    streamer.until(streamer.moves, "motion again")


def is_refused(peer: "Peer", arm: str) -> bool:
    """Whether an arm does not resume, for it is at a fault."""
    return "FAULT" in command(peer, "resume", arm)[1]


def test_every_arm_in_a_namespace_has_its_own_commands_and_one_stop_for_all(peer: "Peer") -> None:
    peer.start("slave", arm="left")
    peer.start("slave", arm="right")
    for arm in ("/left", "/right"):
        assert command(peer, "pause", arm)[0]
    assert command(peer, "resume", "/left")[0]
    found_button(peer, readers=4).publish(Bool(data=True))
    for arm in ("/left", "/right"):
        peer.wait(partial(is_refused, peer, arm), f"{arm} stopped")


@pytest.fixture
def button(peer: "Peer") -> Publisher:
    """A button that was found by a slave that is enabled."""
    peer.start("slave")
    return found_button(peer)


def is_enabled(peer: "Peer") -> bool:
    """Whether the arm says that it is; asks for it if not, again and again: what it said before is of another stop."""
    if state(peer) is State.ENABLED:
        return True
    for name in ("reset", "enable"):
        command(peer, name)
    return False


def go_on(peer: "Peer") -> None:
    peer.wait(lambda: is_enabled(peer), "enabled again")


def say(button: Publisher, *, pressed: int, released: int) -> None:
    """So many presses, and so many releases, as fast as they go."""
    for is_pressed in (True,) * pressed + (False,) * released:
        button.publish(Bool(data=is_pressed))


def test_a_press_that_releases_follow_at_once_stops_the_arm(peer: "Peer", button: Publisher) -> None:
    button.publish(Bool(data=False))
    for released in (1, 12, 30, 100) * 3:
        say(button, pressed=1, released=released)
        peer.wait(lambda: state(peer) is State.FAULT, f"FAULT before {released} releases")
        go_on(peer)


@pytest.mark.parametrize("released", [15, 35, 6000])
def test_a_press_while_the_slave_stands_still_stops_the_arm(peer: "Peer", button: Publisher, released: int) -> None:
    (slave,) = (node for node in peer.nodes if node.name == "slave")
    say(button, pressed=0, released=1)
    slave.send_signal(signal.SIGSTOP)
    say(button, pressed=5, released=released)
    slave.send_signal(signal.SIGCONT)
    peer.wait(lambda: state(peer) is State.FAULT, "FAULT after the stall")
    go_on(peer)


def test_a_button_that_was_pressed_before_the_slave_began_stops_it(peer: "Peer") -> None:
    button = StopButton(peer)
    button.say(is_pressed=True)
    peer.start("slave")
    peer.wait(lambda: state(peer) is State.FAULT, "FAULT by a button that was pressed before")
    assert not command(peer, "reset")[0]
    button.say(is_pressed=False)
    go_on(peer)


def test_a_button_that_has_said_nothing_counts_as_pressed_until_it_speaks_or_is_overridden(peer: "Peer") -> None:
    """Nobody knows whether it was pressed before it was found."""
    peer.start("slave")
    peer.wait(lambda: state(peer) is State.ENABLED, "ENABLED")
    first = peer.ros.create_publisher(Bool, STOP_TOPIC, Qos())
    peer.wait(lambda: state(peer) is State.FAULT, "FAULT by a button that is there")
    ok, text = command(peer, "reset")
    assert not ok
    assert "peer" in text
    first.publish(Bool(data=False))
    go_on(peer)
    peer.ros.create_publisher(Bool, STOP_TOPIC, Qos())
    peer.wait(lambda: state(peer) is State.FAULT, "FAULT by another one")
    assert command(peer, "release")[0]
    go_on(peer)
    since = peer.now()
    peer.wait(lambda: peer.now() > since + 2.0, "a while")
    assert state(peer) is State.ENABLED


@pytest.mark.parametrize("is_latched", [True, False])
def test_a_button_that_tells_whoever_comes_what_it_is_stops_nothing(peer: "Peer", is_latched: bool) -> None:
    peer.start("slave")
    peer.wait(lambda: state(peer) is State.ENABLED, "ENABLED")
    button = peer.ros.create_publisher(Bool, STOP_TOPIC, Qos(is_latched=is_latched))
    since = peer.now()

    def beat() -> bool:
        if not is_latched and button.get_subscription_count() == 2:
            button.publish(Bool(data=False))
        peer.sleep(0.2)  # the rate of a slow button, not a wait
        return peer.now() > since + 3.0

    peer.wait(beat, "three seconds")
    assert state(peer) is State.ENABLED


def test_a_stop_is_released_by_the_button_that_pressed_it_alone(peer: "Peer", button: Publisher) -> None:
    other = found_button(peer)
    for one in (button, other):
        one.publish(Bool(data=False))
    button.publish(Bool(data=True))
    peer.wait(lambda: state(peer) is State.FAULT, "FAULT")
    for _ in range(5):
        other.publish(Bool(data=False))
        ok, text = command(peer, "reset")
        assert not ok
        assert "still pressed" in text
        assert "peer" in text  # who presses
    assert float(operation(peer)["is_pressed"]) == 1.0
    button.publish(Bool(data=False))
    peer.wait(lambda: float(operation(peer)["is_pressed"]) == 0.0, "released")
    assert command(peer, "reset")[0]


def test_release_overrides_a_button_that_is_gone_names_it_and_lets_reset_follow_at_once(
    peer: "Peer", button: Publisher
) -> None:
    button.publish(Bool(data=True))
    peer.wait(lambda: state(peer) is State.FAULT, "FAULT")
    peer.ros.destroy(button)
    ok, text = command(peer, "release")
    assert ok
    assert "overrides" in text
    assert "peer" in text
    assert command(peer, "reset")[0]  # no wait: the arm itself took the release
    assert "no stop button" in command(peer, "release")[1]


def test_each_button_that_was_heard_has_its_own_heartbeat(peer: "Peer") -> None:
    peer.start("slave", operation__heartbeat=0.5)
    buttons = [found_button(peer, depth=100) for _ in range(2)]

    def beat(*alive: Publisher, until: Callable[[], Any], what: str) -> None:
        def turn() -> Any:
            for one in alive:
                one.publish(Bool(data=False))
            peer.sleep(0.02)  # the rate of heartbeats, not a wait
            return until()

        peer.wait(turn, what)

    beat(*buttons, until=lambda: is_enabled(peer), what="enabled: both beat")
    beat(buttons[0], until=lambda: state(peer) is State.FAULT, what="FAULT: one is silent")
    assert float(operation(peer)["fault"]) == Fault.HEARTBEAT
    assert not command(peer, "reset")[0]
    beat(*buttons, until=lambda: is_enabled(peer), what="enabled: both beat again")
