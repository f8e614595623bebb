"""Emergency stops of running sessions: time from the message to the first setpoint that is still.

    python benchmarks/stops.py --count 100                   # composed and in processes
    python benchmarks/stops.py --count 100 --load 4          # beside four busy processes
    python benchmarks/stops.py --count 15 --graphs           # with display, network and tank too

A button as anybody would write it (std_msgs/Bool, no priority) is pressed at random times while
the arm moves. The time ends where the slave publishes the first setpoint that equals the one
before. It begins and ends by time stamps of the middleware: how long the button's own process,
which is as ordinary as the load, has to wait for a processor is no part of it.
"""

import argparse
import itertools
import os
import random
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np
from rclpy.context import Context
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from std_msgs.msg import Bool

from teleop_core.bags.layouts import layout
from teleop_core.graph.topics import SLAVE_SETPOINT_JS
from teleop_core.nodes.children import environment, free_domain
from teleop_core.nodes.guest import Guest
from teleop_core.nodes.operation import STOP_TOPIC
from teleop_core.nodes.remote_control import RemoteControl
from teleop_core.nodes.streams import Subscription
from teleop_core.robots import load_robot

_LATCHED = QoSProfile(depth=10, durability=DurabilityPolicy.TRANSIENT_LOCAL)
_JOINTS = load_robot("rcrt1").joint_names
_PATIENCE = 120.0
_STILL = 60  # equal setpoints that are a standstill
GRAPHS: dict[str, tuple[str, ...]] = {
    "plain": (),
    "display": ("teleop.stages=[display]",),
    "display, network": ("teleop.stages=[display,network]", "network.preset=delay_100"),
    "network, tank": ("teleop.stages=[network,passivity]", "reflection.passivity=tank", "network.preset=delay_100"),
}
"""Settings of each graph."""
_MOVES = 5e-4  # what the fastest joint comes on in as many ticks [rad or m]


class Tap:
    """Setpoints of a session and when they were sent, and a stop button."""

    def __init__(self, domain: int) -> None:
        self._context = Context()
        self._context.init(args=[], domain_id=domain)
        self._node = Node("stops", context=self._context, use_global_arguments=False)
        self._own = Guest("stops_tap", domain)
        topic = SLAVE_SETPOINT_JS
        self._setpoints = Subscription(self._own, topic, f"/{topic.name}", 5000)
        self._layout = layout(topic, _JOINTS)
        self.button = self._node.create_publisher(Bool, STOP_TOPIC, _LATCHED)
        self._heard = self._node.create_subscription(Bool, STOP_TOPIC, lambda _: None, 10)
        self.rows: list[tuple[int, Any]] = []

    def take(self) -> None:
        """Take what has come: time of sending [ns] and joints."""
        while (taken := self._setpoints.take()) is not None:
            found = self._layout.decode_one(taken.data)
            if found is not None:
                self.rows.append((taken.sent_ns, np.array(found[1])))

    def press(self) -> int:
        """Press the button; returns when that was sent [ns]."""
        self.button.publish(Bool(data=True))
        deadline = time.monotonic() + _PATIENCE
        while time.monotonic() < deadline:
            with self._heard.handle:
                taken = self._heard.handle.take_message(Bool, False)
            if taken is not None and taken[0].data:
                return int(taken[1]["source_timestamp"])
            time.sleep(1e-4)
        raise SystemExit("the button does not hear itself: is ROS_AUTOMATIC_DISCOVERY_RANGE off?")

    def wait(self, moves: bool) -> None:
        """Wait until the last setpoints go on, or are all the same."""
        deadline = time.monotonic() + _PATIENCE
        while True:
            self.take()
            last = np.array([row for _, row in self.rows[-_STILL:]])
            if len(last) == _STILL:
                way = np.ptp(last, axis=0).max()
                if (way > _MOVES) if moves else way == 0.0:
                    return
            if time.monotonic() > deadline:
                raise SystemExit(f"the arm does not {'move' if moves else 'stop'}")
            time.sleep(1e-3)

    def close(self) -> None:
        """Leave."""
        self._node.destroy_node()
        self._context.try_shutdown()


def one_stop(tap: Tap) -> float:
    """Time from the message to the first still setpoint [s]."""
    tap.wait(moves=True)
    time.sleep(random.uniform(0.0, 0.05))
    tap.take()
    del tap.rows[:-2]
    pressed_ns = tap.press()
    tap.wait(moves=False)
    stamps = np.array([stamp for stamp, _ in tap.rows])
    moved = np.abs(np.diff([row for _, row in tap.rows], axis=0)).max(axis=1) > 0.0
    first = int(np.flatnonzero(moved)[-1]) + 2  # it did move between the two that came before
    tap.button.publish(Bool(data=False))
    return float(stamps[first] - pressed_ns) * 1e-9


def session(
    folder: Path, domain: str, priority: int, processes: str, settings: tuple[str, ...]
) -> subprocess.Popen[bytes]:
    """Start a session in which the hand never rests."""
    command = [sys.executable, "-m", "teleop_core.commands.cli", "live", "--out", str(folder / "bag")]
    command += ["--scenario", "free_motion", "--duration", "3600"]
    own = f"real_time.priority={priority}", "operator.approach_time=1.0", "operator.patience=0.0"
    for setting in (*own, *settings):
        command += ["--set", setting]
    return subprocess.Popen(
        [*command, "--processes", processes], stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL, env=environment() | {"ROS_DOMAIN_ID": domain},
    )  # fmt: skip


def measure(count: int, priority: int, processes: str, settings: tuple[str, ...] = ()) -> list[float]:
    """Times of some stops of one session [s]."""
    environment()
    domain = free_domain()
    with tempfile.TemporaryDirectory() as folder:
        running = session(Path(folder), domain, priority, processes, settings)
        tap, found = Tap(int(domain)), []
        try:
            with RemoteControl(int(domain), patience=_PATIENCE) as operator:
                while not operator.look()[""].values["is_homed"]:
                    operator.listen()
                for _ in range(count):
                    found.append(one_stop(tap))
                    operator.go_on()
        finally:
            tap.close()
            running.send_signal(signal.SIGINT)
            running.wait(60)
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--count", type=int, default=100, help="stops of each kind")
    parser.add_argument("--priority", type=int, default=-1, help="SCHED_FIFO of the session; 0: none; -1: its default")
    parser.add_argument("--load", type=int, default=0, help="busy processes beside the session")
    parser.add_argument("--kinds", nargs="+", default=["sides", "one"], choices=("sides", "one", "nodes"))
    parser.add_argument("--graphs", action="store_true", help="all graphs, not the plain one alone")
    given = parser.parse_args()
    busy = [subprocess.Popen([sys.executable, "-c", "while 1: pass"]) for _ in range(given.load)]
    try:
        graphs = list(GRAPHS) if given.graphs else ["plain"]
        for graph, kind in itertools.product(graphs, given.kinds):
            times = 1e3 * np.sort(measure(given.count, given.priority, kind, GRAPHS[graph]))
            within = np.count_nonzero(times <= 2.0)
            print(f"{graph}, {kind}, priority {given.priority}, load {os.getloadavg()[0]:.1f}: median "
                  f"{np.median(times):.2f} ms, within 2 ms {within} of {len(times)}, largest "
                  f"{', '.join(f'{t:.1f}' for t in times[-3:])} ms", flush=True)  # fmt: skip
    finally:
        for process in busy:
            process.kill()


if __name__ == "__main__":
    main()
