"""Live: the five nodes beside a bare relay chain of the same length, in one run.

The chain is source -> 3 relays -> sink, PoseStamped at 1 kHz, best effort, depth 1, raw bytes
passed on: what ROS 2 topics between Python processes cost without any work in them.
"""

import argparse
import json
import os
import subprocess
import sys
import tempfile
import threading
import time
from pathlib import Path

import numpy as np

RELAYS = 3
WARM_UP = 3.0


def chain(seconds: float) -> dict[str, float]:
    """Run the bare relay chain; latency [ms] and loss [%] from source to sink."""
    start = [sys.executable, __file__, "--role"]
    relays = [
        subprocess.Popen([*start, "relay", "--position", str(i)], env=os.environ)
        for i in range(RELAYS)
    ]
    sink = subprocess.Popen(
        [*start, "sink", "--seconds", str(seconds)], stdout=subprocess.PIPE, text=True
    )
    source = subprocess.Popen([*start, "source", "--seconds", str(seconds + WARM_UP)])
    out, _ = sink.communicate(timeout=seconds + 60)
    source.wait(timeout=60)
    for relay in relays:
        relay.terminate()
        relay.wait(timeout=10)
    result: dict[str, float] = json.loads(out)
    return result


def _spin(position: int, handle: object) -> None:
    """Listen on hop ``position`` until terminated; ``handle(publisher, bytes)`` on each message."""
    import rclpy
    from geometry_msgs.msg import PoseStamped
    from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
    from rclpy.qos import QoSProfile, ReliabilityPolicy

    rclpy.init()
    node = rclpy.create_node(f"hop{position}")
    qos = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
    publisher = node.create_publisher(PoseStamped, f"hop{position + 1}", qos)
    node.create_subscription(
        PoseStamped, f"hop{position}", lambda data: handle(publisher, data), qos, raw=True
    )
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    try:
        while not getattr(handle, "is_done", False):
            executor.spin_once(timeout_sec=0.1)
    except (KeyboardInterrupt, ExternalShutdownException):
        pass


def relay(position: int) -> None:
    """Pass bytes on."""
    _spin(position, lambda publisher, data: publisher.publish(data))


def sink(seconds: float) -> None:
    """Collect delays of the last hop for some seconds and print them as JSON."""
    delays, stamps = [], []

    def handle(_: object, data: bytes) -> None:
        now = time.time_ns()
        second, nanosecond = np.frombuffer(data, "<u4", 2, 4)
        stamps.append(int(second) * 10**9 + int(nanosecond))
        delays.append((now - stamps[-1]) * 1e-6)
        handle.is_done = (stamps[-1] - stamps[0]) * 1e-9 > seconds  # type: ignore[attr-defined]

    _spin(RELAYS, handle)
    expected = (stamps[-1] - stamps[0]) * 1e-6 + 1
    print(
        json.dumps(
            {
                "median": float(np.median(delays)),
                "p99": float(np.percentile(delays, 99)),
                "lost_percent": 100.0 * (1.0 - len(delays) / expected),
            }
        )
    )


def source(seconds: float) -> None:
    """Publish stamped poses at 1 kHz with absolute deadlines."""
    import rclpy
    from geometry_msgs.msg import PoseStamped
    from rclpy.qos import QoSProfile, ReliabilityPolicy

    rclpy.init()
    node = rclpy.create_node("source")
    qos = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
    publisher, message = node.create_publisher(PoseStamped, "hop0", qos), PoseStamped()
    message.header.frame_id = "base"
    due = time.perf_counter()
    while seconds > 0:
        now = time.time_ns()
        message.header.stamp.sec, message.header.stamp.nanosec = divmod(now, 10**9)
        publisher.publish(message)
        seconds -= 1e-3
        due += 1e-3
        time.sleep(max(0.0, due - time.perf_counter()))


def live(seconds: float) -> dict[str, object]:
    """Run the five nodes for some seconds and score the recording."""
    with tempfile.TemporaryDirectory() as folder:
        bag, scores = Path(folder) / "bag", Path(folder) / "scores.json"
        teleop = [sys.executable, "-m", "teleop_core.cli"]
        arguments = ["--scenario", "coarse_box", "--duration", str(seconds), "--out", str(bag)]
        subprocess.run([*teleop, "live", *arguments], check=True, stdout=subprocess.DEVNULL)
        subprocess.run(
            [*teleop, "evaluate", str(bag), "--json", str(scores)],
            check=True, stdout=subprocess.DEVNULL,
        )  # fmt: skip
        result: dict[str, object] = json.loads(scores.read_text())
        return result


def busy(seconds: float) -> float:
    """Lateness [ms], 99th percentile, of a bare sleep loop: what the machine itself can do."""
    late, due = [], time.perf_counter()
    for _ in range(round(seconds * 1e3)):
        due += 1e-3
        time.sleep(max(0.0, due - time.perf_counter()))
        late.append((time.perf_counter() - due) * 1e3)
    return float(np.percentile(late, 99))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=20.0)
    parser.add_argument("--role", choices=("relay", "sink", "source"), help=argparse.SUPPRESS)
    parser.add_argument("--position", type=int, default=0, help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    roles = {
        "relay": lambda: relay(arguments.position),
        "sink": lambda: sink(arguments.seconds),
        "source": lambda: source(arguments.seconds),
    }
    if arguments.role:
        roles[arguments.role]()
        return
    print(f"\nlive, {arguments.seconds:g} s each, one after the other")
    print(f"  bare sleep loop, lateness p99 [ms]          {busy(3.0):8.2f}")
    bare = chain(arguments.seconds)
    print(f"  bare relay chain, median / p99 [ms]         {bare['median']:8.2f}{bare['p99']:8.2f}")
    print(f"  bare relay chain, lost [%]                  {bare['lost_percent']:8.2f}")
    print(json.dumps(live(arguments.seconds), indent=1)[:2000])


if __name__ == "__main__":
    threading.stack_size(2**20)
    main()
