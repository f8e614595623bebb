"""Play: publish a recording on live topics, for machines without ``ros2 bag``."""

import math
import os
import sys
import time
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from typing import Any

from builtin_interfaces.msg import Time
from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn
from rosgraph_msgs.msg import Clock

from teleop_core.bags.messages import SECOND_NS
from teleop_core.bags.reader import Bag
from teleop_core.bags.transforms import ROBOT_DESCRIPTION, TF
from teleop_core.base.errors import ParameterError, RecordingError
from teleop_core.graph.topics import BY_NAME, Quality
from teleop_core.middleware.ros_messages import write_message
from teleop_core.middleware.world import Qos
from teleop_core.nodes.discovery import choose_transport
from teleop_core.nodes.guest import Guest
from teleop_core.nodes.interrupt import Interrupt
from teleop_core.nodes.quality import profile
from teleop_core.nodes.streams import message_type

CLOCK = "clock"
_KNOWN = BY_NAME | {topic.name: topic for topic in (TF, ROBOT_DESCRIPTION)}
DISCOVERY_TIME = 1.0
"""Time for subscribers to be found before the first message [s]."""


def play(bag: Bag, topics: Iterable[str] | None, rate: float, console: Console, clock: float = 0.0) -> int:
    """Publish a recording with its own bytes and spacing, until its end or Ctrl-C.

    Args:
        bag: The recording.
        topics: Topics to publish; None for all, without ``/tf`` where its type is not installed.
        rate: Times real time, > 0.
        console: Where the progress is shown, if it is a terminal.
        clock: How often the recording's time is published on ``/clock``, [1/s] of that time; 0 for
            never. A recorded ``/clock`` is left out then.

    Returns:
        Number of messages published.

    Raises:
        ParameterError: The rate is not a positive number, or the clock's not from 0 to 1000 Hz.
        RecordingError: A topic is missing, or its message type is not installed.
    """
    if not (math.isfinite(rate) and rate > 0.0):
        raise ParameterError("--rate", rate, "a number above 0")
    if not 0.0 <= clock <= 1000.0:
        raise ParameterError("--clock", clock, "from 0 to 1000 Hz")
    names = [name.removeprefix("/") for name in topics or ()]
    bag.require(names)
    if topics is None:
        names = [name for name in bag.topics if name != TF.name or _is_installed(bag, name)]
    clock_ns = round(1e9 / clock) if clock else 0
    if clock_ns:
        names = [name for name in names if name != CLOCK]
    sent, interrupt = 0, Interrupt()
    with (
        interrupt.caught(),
        _publishers(bag, names, has_clock=clock > 0.0) as publishers,
        _progress(bag, console) as show,
    ):
        try:
            _sleep_until(time.monotonic() + DISCOVERY_TIME, interrupt)
            for name, log_ns, data in _paced(bag, names, rate, clock_ns, interrupt):
                publishers[name].publish(data)
                sent += name != CLOCK or not clock_ns
                show(log_ns)
        except KeyboardInterrupt:
            console.print(f"stopped after {sent} messages", highlight=False)
    return sent


def _sleep_until(deadline: float, interrupt: Interrupt) -> None:
    """Sleep until a time of the monotonic clock [s], unless a signal comes."""
    interrupt.check()
    while (ahead := deadline - time.monotonic()) > 1e-4:
        time.sleep(min(ahead, 0.1))
        interrupt.check()


def _paced(
    bag: Bag, names: list[str], rate: float, clock_ns: int, interrupt: Interrupt
) -> Iterator[tuple[str, int, bytes]]:
    """Messages in the order of their log times, each when its time has come, and the time."""
    begin, told_ns = time.monotonic(), bag.start_ns

    def wait(log_ns: int) -> None:
        _sleep_until(begin + (log_ns - bag.start_ns) * 1e-9 / rate, interrupt)

    for name, _, log_ns, data in bag.raw(names):
        while clock_ns and told_ns <= log_ns:
            wait(told_ns)
            yield CLOCK, told_ns, _clock(told_ns)
            told_ns += clock_ns
        wait(log_ns)
        yield name, log_ns, data


@contextmanager
def _publishers(bag: Bag, names: list[str], *, has_clock: bool) -> Iterator[dict[str, Any]]:
    os.environ.setdefault("AMENT_PREFIX_PATH", sys.prefix)
    choose_transport()
    types = {name: _type_in(bag, name) for name in names}
    with Guest("teleop_play") as guest:
        ros, publishers = guest.ros, {}
        for name, kind in types.items():
            topic = _KNOWN.get(name)
            publishers[name] = ros.create_publisher(kind, name, profile(topic) if topic else Qos())
        if has_clock:
            publishers[CLOCK] = ros.create_publisher(Clock, f"/{CLOCK}", Qos(depth=1))
        yield publishers
        for name, publisher in publishers.items():
            if name not in _KNOWN or _KNOWN[name].quality is not Quality.STREAM:
                publisher.wait_for_all_acked(1.0)


def _is_installed(bag: Bag, name: str) -> bool:
    """Whether messages of a topic can be published; ``tf2_msgs`` comes with ROS alone."""
    try:
        _type_in(bag, name)
    except RecordingError:
        return False
    return True


def _type_in(bag: Bag, name: str) -> Any:
    ros_type = bag.topics[name].type
    try:
        return message_type(ros_type)
    except (ImportError, AttributeError, ValueError) as error:
        reason = f"{name} is a {ros_type}, which is not installed; choose others with --topics"
        raise RecordingError(bag.path, reason) from error


@contextmanager
def _progress(bag: Bag, console: Console) -> Iterator[Any]:
    columns = (TextColumn("playing"), BarColumn(), TimeElapsedColumn())
    with Progress(*columns, console=console, disable=not console.is_terminal) as bar:
        task = bar.add_task("", total=bag.end_ns - bag.start_ns)
        next_ns = 0

        def show(log_ns: int) -> None:
            nonlocal next_ns
            if not 0 <= next_ns - log_ns <= 100_000_000:  # ten times a second, and after a rewind
                bar.update(task, completed=log_ns - bag.start_ns)
                next_ns = log_ns + 100_000_000

        yield show


def _clock(time_ns: int) -> bytes:
    """Message of ``/clock`` at a time [ns]."""
    seconds, nanoseconds = divmod(time_ns, SECOND_NS)
    return write_message(Clock(clock=Time(sec=seconds, nanosec=nanoseconds)))
