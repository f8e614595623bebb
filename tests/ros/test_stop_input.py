"""Stop input: what a process hears of a stop button that was pressed while it stood still."""

import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import psutil
import pytest
from rclpy.publisher import Publisher
from std_msgs.msg import Bool

from present import present
from teleop_core.nodes.children import environment
from teleop_core.nodes.operation import STOP_TOPIC

if TYPE_CHECKING:
    from ros.conftest import Peer

pytestmark = pytest.mark.ros
READER = Path(__file__).resolve().parents[1] / "support" / "stop_reader.py"


@pytest.fixture
def start(peer: "Peer") -> Iterator[Callable[..., object]]:
    """Function that starts a process which listens for so many presses."""
    started = []

    def start(presses: int) -> subprocess.Popen[str]:
        words, env = [sys.executable, str(READER), str(presses)], environment()
        process = subprocess.Popen(words, stdout=subprocess.PIPE, text=True, env=env | {"ROS_DOMAIN_ID": peer.domain})
        started.append(process)
        assert present(process.stdout).readline() == "ready\n"
        peer.wait(lambda: peer.node.count_subscribers(STOP_TOPIC) == 3, "all three readers")
        return process

    yield start
    for process in started:
        process.kill()
        process.wait()
        present(process.stdout).close()


def button_of(peer: "Peer") -> Publisher:
    button = peer.node.create_publisher(Bool, STOP_TOPIC, 10)
    peer.wait(lambda: button.get_subscription_count() == 2, "both who hear reliable senders")
    return button


def say(button: Publisher, released: int) -> None:
    """A press, and so many releases after it, as fast as they go."""
    for is_pressed in (True,) + (False,) * released:
        button.publish(Bool(data=is_pressed))


def stand_still(peer: "Peer", reader: Any) -> float:
    reader.send_signal(signal.SIGSTOP)
    process = psutil.Process(reader.pid)
    peer.wait(lambda: process.status() == psutil.STATUS_STOPPED, "a reader that stands still")
    return time.monotonic()


def go_on(peer: "Peer", reader: Any, since: float) -> None:
    """Go on after a standstill of a third of a second at least."""
    peer.wait(lambda: time.monotonic() > since + 0.3, "a standstill")
    reader.send_signal(signal.SIGCONT)


def test_a_press_that_is_the_first_word_of_a_button_is_heard_though_the_middleware_lost_it(
    peer: "Peer", start: Callable[..., Any]
) -> None:
    """The middleware keeps the newest messages for who stands still; no number tells of others."""
    reader, button = start(1), button_of(peer)
    assert reader.stdout.readline() == "found\n"
    since = stand_still(peer, reader)
    say(button, 6000)
    go_on(peer, reader, since)
    assert reader.wait(30) == 0


def test_presses_of_buttons_that_were_made_while_the_listener_stood_still_are_heard(
    peer: "Peer", start: Callable[..., Any]
) -> None:
    """A button keeps its last ten messages for who has not found it yet.

    Often all of them arrive nevertheless: hence several buttons.
    """
    reader = start(12)
    since = stand_still(peer, reader)
    for _ in range(12):
        say(button_of(peer), 100)
    go_on(peer, reader, since)
    assert reader.wait(30) == 0
