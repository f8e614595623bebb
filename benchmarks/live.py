"""Live: sessions of four graphs, by side and in one process, beside bare relay chains, in one run.

A chain is source -> 2 relays -> sink, PoseStamped at 1 kHz: as many hops as a master's sample
takes to the slave's command (haptic_master -> motion_scaling -> inverse_kinematics -> reader),
without any work on the way. Seconds differ between machines and hours; the ratios count.
"""

import argparse
import json
import os
import re
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import psutil

RELAYS = 2
_FAIR = ("--set", "real_time.priority=0")
_NETWORK = ("--set", "network.preset=delay_100", "teleop.stages=[display,task,network]")
_TANK = ("--set", "teleop.stages=[network,passivity]", "reflection.passivity=tank", "network.preset=delay_100")
GRAPHS = {
    "plain (coarse_box)": ("coarse_box",),
    "display and task (point)": ("point",),
    "the same, with a network": ("point", *_NETWORK),
    "network and tank (palpation)": ("palpation", *_TANK),
}
"""Sessions: scenario and options."""
WAYS = {"by side": (), "one process": ("--composed",)}
BUSY = 4  # processes that compete for the processors


def chain(seconds: float, style: str) -> dict[str, float]:
    """Run a bare relay chain; latency [ms], loss [%] and processor share [%] of all its parts."""
    start = [sys.executable, __file__, "--style", style, "--role"]
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    relays = [subprocess.Popen([*start, "relay", "--position", str(i)], env=os.environ) for i in range(RELAYS)]
    sink = subprocess.Popen([*start, "sink", "--seconds", str(seconds)], stdout=subprocess.PIPE, text=True)
    others = [*relays, subprocess.Popen([*start, "source"])]
    begin = time.monotonic()
    out, _ = sink.communicate(timeout=seconds + 60)
    elapsed = time.monotonic() - begin
    for process in others:
        process.kill()
        process.wait()
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    used = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return {**json.loads(out), "cpu": 100.0 * used / elapsed}


def _quality(style: str) -> Any:
    from rclpy.qos import QoSProfile, ReliabilityPolicy

    if style == "typed":
        return QoSProfile(depth=10, reliability=ReliabilityPolicy.RELIABLE)
    return QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)


def _spin(position: int, style: str, handle: Any) -> None:
    """Listen on hop ``position`` until terminated; ``handle(publisher, message)`` on each."""
    import rclpy
    from geometry_msgs.msg import PoseStamped
    from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor

    rclpy.init()
    node, qos = rclpy.create_node(f"hop{position}"), _quality(style)
    publisher = node.create_publisher(PoseStamped, f"hop{position + 1}", qos)
    node.create_subscription(
        PoseStamped, f"hop{position}", lambda data: handle(publisher, data), qos, raw=style == "raw"
    )
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    try:
        while not getattr(handle, "is_done", False):
            executor.spin_once(timeout_sec=0.1)
    except (KeyboardInterrupt, ExternalShutdownException):
        pass


def relay(position: int, style: str) -> None:
    """Pass messages on."""
    _spin(position, style, lambda publisher, message: publisher.publish(message))


def sink(seconds: float, style: str) -> None:
    """Collect delays of the last hop for some seconds and print them as JSON."""
    delays, stamps = [], []

    def handle(_: object, message: Any) -> None:
        now = time.time_ns()
        if style == "raw":
            second, nanosecond = map(int, np.frombuffer(message, "<u4", 2, 4))
        else:
            second, nanosecond = message.header.stamp.sec, message.header.stamp.nanosec
        stamps.append(second * 10**9 + nanosecond)
        delays.append((now - stamps[-1]) * 1e-6)
        handle.is_done = (stamps[-1] - stamps[0]) * 1e-9 > seconds  # type: ignore[attr-defined]

    _spin(RELAYS, style, handle)
    expected = (stamps[-1] - stamps[0]) * 1e-6 + 1
    print(
        json.dumps(
            {
                "median": float(np.median(delays)),
                "p99": float(np.percentile(delays, 99)),
                "lost": 100.0 * (1.0 - len(delays) / expected),
            }
        )
    )


def source(style: str) -> None:
    """Publish stamped poses at 1 kHz with absolute deadlines until terminated."""
    import rclpy
    from geometry_msgs.msg import PoseStamped

    rclpy.init()
    node = rclpy.create_node("source")
    publisher = node.create_publisher(PoseStamped, "hop0", _quality(style))
    message = PoseStamped()
    message.header.frame_id = "base"
    due = time.perf_counter()
    epoch = time.time() - due
    while True:
        due += 1e-3
        time.sleep(max(0.0, due - time.perf_counter()))
        # The stamp is when the sample was due, as the master's is: a late wake-up counts.
        stamp = round((epoch + due) * 1e9)
        message.header.stamp.sec, message.header.stamp.nanosec = divmod(stamp, 10**9)
        publisher.publish(message)


def live(seconds: float, scenario: str, *options: str) -> dict[str, float]:
    """Run a live session for some seconds; numbers from its recording, and the shares of its processes [%]."""
    with tempfile.TemporaryDirectory() as folder:
        bag = Path(folder) / "bag"
        command = [sys.executable, "-u", "-m", "teleop_core.commands.cli", "live", "--scenario", scenario]
        command += ["--duration", str(seconds), "--out", str(bag), *options]
        with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
            watched = _watch(process)
        if process.returncode:
            raise SystemExit("teleop live failed")
        return {**score(bag), **watched}


def _watch(process: "subprocess.Popen[str]") -> dict[str, float]:
    """Processor share of the stages' processes and of the recorder [%], late ticks [%], refused messages.

    Between the first status line and the last one.
    """
    samples, counts = [], []
    assert process.stdout is not None
    for line in process.stdout:
        if " Hz" in line:
            used = {True: 0.0, False: 0.0}
            for node in psutil.Process(process.pid).children(recursive=True):
                used["recorder" in node.cmdline()] += sum(node.cpu_times()[:2])
            samples.append((time.monotonic(), used))
            counts.append([sum(map(float, re.findall(rf"{name} (\d+)", line))) for name in ("late", "refused")])
    (begin, first), (end, last) = samples[0], samples[-1]
    stages, recorder = (100.0 * (last[of] - first[of]) / (end - begin) for of in (False, True))
    late = 100.0 * (counts[-1][0] - counts[0][0]) / (1e3 * (end - begin))
    return {"cpu": stages, "recorder": recorder, "late": late, "refused": counts[-1][1]}


def score(bag: Path, since_ns: int = 0, until_ns: int = 2**63 - 1) -> dict[str, float]:
    """What became of the samples of the master in a recording.

    Delay to the setpoint that follows them [ms], messages missing of all topics [%], ticks of the
    slave made up late [%], steps of it a second.

    Args:
        bag: The recording.
        since_ns: What was stamped before [ns] does not count; nor does what was in the first 2 s.
        until_ns: What was stamped later does not count.
    """
    from teleop_core.bags.reader import Bag
    from teleop_core.evaluation import evaluate

    names = ("slave/setpoint_js", "slave/measured_js")
    found = Bag(bag).read_many(names)
    command, slave = (found[name] for name in names)
    # Start-up is not what is measured: the nodes come up one after the other.
    since_ns = max(since_ns, command.stamp_ns[0] + 2 * 10**9)
    is_new = np.diff(command.stamp_ns, prepend=0) > 0  # a command stays in force until the next
    is_steady = is_new & (command.stamp_ns > since_ns) & (command.stamp_ns < until_ns)
    delay = (command.log_ns - command.stamp_ns)[is_steady] * 1e-6
    whole = evaluate(Bag(bag))
    missing = sum(topic.gaps or 0 for topic in whole.topics.values())
    count = sum(topic.count for topic in whole.topics.values())
    steps = slave.stamp_ns[(slave.stamp_ns > since_ns) & (slave.stamp_ns < until_ns)]
    span = (steps[-1] - steps[0]) * 1e-9
    return {
        "median": float(np.median(delay)), "p99": float(np.percentile(delay, 99)),
        "lost": 100.0 * missing / (count + missing), "missing": missing, "steps": (len(steps) - 1) / span,
        "made_up": 100.0 * (whole.ticks.made_up or 0) / whole.ticks.executed,
    }  # fmt: skip


def lateness(seconds: float) -> dict[str, float]:
    """Lateness [ms] of a bare sleep loop with absolute deadlines: what the machine can do."""
    late, due = [], time.perf_counter()
    for _ in range(round(seconds * 1e3)):
        due += 1e-3
        time.sleep(max(0.0, due - time.perf_counter()))
        late.append((time.perf_counter() - due) * 1e3)
    return {"median": float(np.median(late)), "p99": float(np.percentile(late, 99))}


def medians(run: Callable[[], dict[str, float]], runs: int) -> dict[str, float]:
    """Median of each number of some runs."""
    found = [run() for _ in range(runs)]
    return {key: float(np.median([one[key] for one in found])) for key in found[0]}


def graphs(seconds: float, runs: int, busy: int) -> None:
    """Print a table of all graphs, both ways, beside some busy processes; numbers after the first status line."""
    beside = f", beside {busy} busy processes" if busy else ""
    print(f"\n{'master sample -> setpoint' + beside:44}{'median':>8}{'p99':>8}{'late':>8}{'made up':>9}", end="")
    print(f"{'missing':>9}{'refused':>9}{'stages':>8}{'recorder':>10}")
    print(f"{'':44}{'ms':>8}{'ms':>8}{'%':>8}{'%':>9}{'':18}{'% of a core':>18}", flush=True)
    others = [subprocess.Popen([sys.executable, "-c", "while True: pass"]) for _ in range(busy)]
    for name, options in GRAPHS.items():
        for way, more in WAYS.items():
            found = medians(partial(live, seconds, *options, *more), runs)
            print(f"{f'{name}, {way}':44}{found['median']:8.2f}{found['p99']:8.2f}{found['late']:8.2f}", end="")
            print(f"{found['made_up']:9.2f}{found['missing']:9.0f}{found['refused']:9.0f}", end="")
            print(f"{found['cpu']:8.0f}{found['recorder']:10.0f}", flush=True)
    for one in others:
        one.kill()
        one.wait()


def compare(seconds: float, runs: int) -> None:
    """Print everything side by side, medians of some runs, as ratios to the raw chain too."""
    of = f", medians of {runs} runs" if runs > 1 else ""
    print(f"\nlive, {seconds:g} s each{of}, one after the other: master sample -> setpoint")
    print(f"{'':44}{'median':>9}{'p99':>9}{'lost':>8}{'late':>8}{'CPU':>7}{'ratio':>14}")
    print(f"{'':44}{'ms':>9}{'ms':>9}{'%':>8}{'%':>8}{'%':>7}{'median, p99':>14}")
    raw: dict[str, float] = {}
    spin = "while True: pass"
    for name, run in (
        ("bare sleep loop, lateness", lambda: lateness(min(seconds, 10.0))),
        ("bare relay chain, typed, reliable", lambda: chain(seconds, "typed")),
        ("bare relay chain, raw, best effort", lambda: chain(seconds, "raw")),
        ("by side", lambda: live(seconds, "coarse_box")),
        ("the same, fair shares", lambda: live(seconds, "coarse_box", *_FAIR)),
        ("one process", lambda: live(seconds, "coarse_box", "--composed")),
        ("the same, fair shares", lambda: live(seconds, "coarse_box", "--composed", *_FAIR)),
        ("a process for each node, fair shares", lambda: live(seconds, "coarse_box", "--processes", "nodes")),
        ("by side, a busy process beside", lambda: live(seconds, "coarse_box")),
        ("one process, a busy process beside", lambda: live(seconds, "coarse_box", "--composed")),
    ):
        beside = subprocess.Popen([sys.executable, "-c", spin]) if "busy" in name else None
        found = medians(run, runs)
        if beside is not None:
            beside.kill()
            beside.wait()
        raw = found if "raw" in name else raw
        columns = [f"{found['median']:9.3f}{found['p99']:9.3f}"]
        for key, width, digits in (("lost", 8, 2), ("made_up", 8, 2), ("cpu", 7, 0)):
            columns.append(f"{found[key]:{width}.{digits}f}" if key in found else " " * width)
        if raw:
            ratios = found["median"] / raw["median"], found["p99"] / raw["p99"]
            columns.append("{:8.2f}{:6.2f}".format(*ratios))
        print(f"{name:44}{''.join(columns)}", flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=60.0, help="length of each part")
    parser.add_argument("--runs", type=int, default=1, help="runs of each part")
    parser.add_argument("--only-graphs", action="store_true", help="leave out the bare chains")
    parser.add_argument("--busy", type=int, default=-1, help=f"busy processes beside (default: none, then {BUSY})")
    parser.add_argument("--role", choices=("relay", "sink", "source"), help=argparse.SUPPRESS)
    parser.add_argument("--position", type=int, default=0, help=argparse.SUPPRESS)
    parser.add_argument("--style", choices=("raw", "typed"), help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    os.environ.setdefault("AMENT_PREFIX_PATH", sys.prefix)
    os.environ.setdefault("ROS_DOMAIN_ID", "87")
    if arguments.role == "relay":
        relay(arguments.position, arguments.style)
    elif arguments.role == "sink":
        sink(arguments.seconds, arguments.style)
    elif arguments.role == "source":
        source(arguments.style)
    else:
        if not arguments.only_graphs:
            compare(arguments.seconds, max(1, arguments.runs))
        for busy in (0, BUSY) if arguments.busy < 0 else (arguments.busy,):
            graphs(arguments.seconds, max(1, arguments.runs), busy)


if __name__ == "__main__":
    main()
