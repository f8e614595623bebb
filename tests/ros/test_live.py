"""Whole live sessions, as ``teleop live`` and ``teleop play`` run them."""

import io
import re
import threading
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import psutil
import pytest
from rich.console import Console
from rosbags.highlevel import AnyReader

from live_process import wait_until, words
from teleop_core.bags.reader import Bag
from teleop_core.base import RecordingError, SessionError
from teleop_core.graph import BUILT_IN, RECORDER_NAME, topics
from teleop_core.nodes.live import live
from teleop_core.session.configuration import Configuration, configure

if TYPE_CHECKING:
    from ros.conftest import Peer

pytestmark = [pytest.mark.ros, pytest.mark.slow]
EXAMPLE = Path(__file__).resolve().parents[2] / "bags" / "example"
RATE = 0.5
SESSION_TIMEOUT = 300.0
"""Until a session runs, whose kernels may have to be compiled first [s]."""


def quick(duration: float) -> Configuration:
    return configure("coarse_box", settings=[f"teleop.duration={duration}", "operator.approach_time=1.0"])


def console() -> Any:
    return Console(file=io.StringIO(), width=200)


def is_running(show: Any) -> re.Match[str] | None:
    """Whether a line of progress was shown: of the first second, unless the machine was busy."""
    return re.search(r"\d/600 s  ", show.file.getvalue())


def children(name: str = "") -> list[Any]:
    """Processes of nodes that this test has started."""
    found = []
    for process in psutil.Process().children(recursive=True):
        line = words(process)
        if "teleop_core.nodes" in line and (not name or name in line):
            found.append(process)
    return found


def test_a_live_session_is_recorded_on_every_topic(
    peer: "Peer", session_until: Callable[..., tuple[Bag, str]], tmp_path: Path
) -> None:
    enough = {topic.name: 1000 for topic in topics.STREAMS}
    bag, text = session_until(quick(600.0), lambda: peer.has_recorded(enough))
    assert all(f"{name} is ready" in text for name in (*BUILT_IN, RECORDER_NAME))
    assert "slave" in text
    assert children() == []
    assert bag.metadata["scenario"] == "coarse_box"
    for topic in topics.STREAMS:
        assert bag.topics[topic.name].count > 1000, topic.name
    measured = bag.read(topics.SLAVE_MEASURED_JS)
    assert (np.diff(measured.stamp_ns) > 0).all()
    for topic in (topics.HAND_SERVO_CP, topics.MASTER_MEASURED_CP, topics.SLAVE_TRUE_CP):
        assert (np.diff(bag.read(topic).stamp_ns) > 0).all(), topic.name  # none twice
    # One sample for each step, and none for the time that a busy machine dropped.
    assert (np.diff(measured.stamp_ns) % 1_000_000 == 0).all()
    statuses = {report.name: report for report in bag.reports(topics.DIAGNOSTICS)}
    assert set(statuses) == {*BUILT_IN, RECORDER_NAME, "frames"}
    slave = statuses["slave_sim"]
    told = (measured.stamp_ns <= slave.stamp_ns).sum()
    assert int(slave.values["ticks"]) + float(slave.values["dropped_time_ms"]) >= told > 0
    with AnyReader([tmp_path / "bag"]) as reader:
        counts = {connection.topic: connection.msgcount for connection in reader.connections}
        first = next(reader.messages())
        assert reader.deserialize(first[2], first[0].msgtype) is not None
    assert counts["/slave/measured_js"] == len(measured)


def test_an_existing_directory_is_refused_before_anything_starts(tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match="exists already") as caught:
        live(quick(3.0), tmp_path, console())
    assert caught.value.path == tmp_path
    assert children() == []


def test_a_node_that_dies_is_named_and_the_recording_is_closed(tmp_path: Path) -> None:
    show = console()

    def kill_when_running() -> None:
        wait_until(lambda: is_running(show), "the first second", SESSION_TIMEOUT)
        children("inverse_kinematics")[0].kill()

    killer = threading.Thread(target=kill_when_running, daemon=True)
    killer.start()
    with pytest.raises(SessionError, match="hand_side ended with signal SIGKILL"):
        live(quick(600.0), tmp_path / "bag", show)
    killer.join()
    assert children() == []
    assert Bag(tmp_path / "bag").topics["slave/measured_js"].count > 0


def test_a_node_that_cannot_start_is_named_with_its_reason(tmp_path: Path) -> None:
    wrong = configure("coarse_box", settings=["operator=bag", "operator.bag=/no/such/bag"])
    with pytest.raises(SessionError, match=r"(?s)hand_side ended with exit code 2.*no/such"):
        live(wrong, tmp_path / "bag", console())
    assert children() == []
