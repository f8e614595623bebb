"""Play: publishes a recording on live topics, for machines without ``ros2 bag``."""

import math
import os
import sys
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from typing import Any

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

from teleop_core.bags.reader import Bag
from teleop_core.bags.transforms import ROBOT_DESCRIPTION, TF
from teleop_core.base.errors import ParameterError, RecordingError
from teleop_core.graph.topics import BY_NAME, Quality
from teleop_core.middleware.platform import Platform, Qos
from teleop_core.middleware.ros import ROS
from teleop_core.nodes.discovery import choose_transport
from teleop_core.nodes.guest import Guest
from teleop_core.nodes.interrupt import Interrupt
from teleop_core.nodes.quality import profile
from teleop_core.nodes.streams import message_type

_KNOWN = BY_NAME | {topic.name: topic for topic in (TF, ROBOT_DESCRIPTION)}
_DISCOVERY_NS = 1_000_000_000
"""Waiting time for the discovery of subscribers before the first message [ns]."""
_EARLY_NS = 100_000
"""Largest time by which a message may be published too early [ns]."""


def play(
    bag: Bag,
    topics: Iterable[str] | None,
    rate: float,
    console: Console,
    platform: Platform = ROS,
    interrupt: Interrupt | None = None,
) -> int:
    """Publish a recording with its original bytes and time intervals, until its end or an ending signal.

    Args:
        bag: The recording.
        topics: Topics to publish; None for all, except ``/tf`` if its type is not installed.
        rate: Speed relative to real time, > 0.
        console: Console that shows the progress, if it is a terminal.
        platform: Platform in which the recording is published.
        interrupt: Object that ends the playback, in addition to signals of this process.

    Returns:
        Number of messages published.

    Raises:
        ParameterError: The rate is not a positive number.
        RecordingError: A topic is missing, or its message type is not installed.
    """
    if not (math.isfinite(rate) and rate > 0.0):
        raise ParameterError("--rate", rate, "a number above 0")
    names = [name.removeprefix("/") for name in topics or ()]
    bag.require(names)
    if topics is None:
        names = [name for name in bag.topics if name != TF.name or _is_installed(bag, name)]
    sent, interrupt = 0, interrupt or Interrupt()
    with interrupt.caught(), _publishers(bag, names, platform) as publishers, _progress(bag, console) as show:
        begin_ns = platform.monotonic_ns() + _DISCOVERY_NS
        try:
            for name, _, log_ns, data in bag.raw(names):
                _sleep_until(begin_ns + round((log_ns - bag.start_ns) / rate), platform, interrupt)
                publishers[name].publish(data)
                sent += 1
                show(log_ns)
        except KeyboardInterrupt:
            console.print(f"stopped after {sent} messages", highlight=False)
    return sent


def _sleep_until(time_ns: int, platform: Platform, interrupt: Interrupt) -> None:
    """Sleep until a time of the monotonic clock, unless a signal comes."""
    while True:
        interrupt.check()
        ahead_ns = time_ns - platform.monotonic_ns()
        if ahead_ns <= _EARLY_NS:
            return
        platform.sleep(min(1e-9 * ahead_ns, 0.1))


@contextmanager
def _publishers(bag: Bag, names: list[str], platform: Platform) -> Iterator[dict[str, Any]]:
    os.environ.setdefault("AMENT_PREFIX_PATH", sys.prefix)
    choose_transport()
    types = {name: _type_in(bag, name) for name in names}
    with Guest("teleop_play", platform=platform) as guest:
        ros, publishers = guest.ros, {}
        for name, kind in types.items():
            topic = _KNOWN.get(name)
            publishers[name] = ros.create_publisher(kind, name, profile(topic) if topic else Qos())
        yield publishers
        for name, publisher in publishers.items():
            if name not in _KNOWN or _KNOWN[name].quality is not Quality.STREAM:
                publisher.wait_for_all_acked(1.0)


def _is_installed(bag: Bag, name: str) -> bool:
    """Whether messages of a topic can be published; ``tf2_msgs`` is available only with ROS."""
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
