"""The simulated machine: what its middleware, processes and time do, as the real ones."""

import os
import subprocess
import sys
from contextlib import nullcontext
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from std_msgs.msg import Bool, Empty

from simulated.conftest import SimulatedPeer
from teleop_core.kernels.memory import call
from teleop_core.middleware.platform import Qos
from teleop_drill.simulation.bus import Bus, Line
from teleop_drill.simulation.machine import Machine, Process
from teleop_drill.simulation.platform import SimulatedPlatform
from teleop_drill.simulation.reach import BEGIN_NS, LOOK_NS
from teleop_drill.simulation.scheduler import Deadlock, Scheduler

FOUND = 2.0  # by then all have found each other [s]


class Pair:
    """Two processes that work, and whoever lets time pass."""

    def __init__(self, seed: int = 0) -> None:
        self.machine = Machine(Scheduler(seed))
        self.bus = Bus(self.machine.scheduler)
        self.outside = self.machine.outsider("test")
        self.here, self.there = (self._process(name) for name in ("here", "there"))

    def _process(self, name: str) -> SimulatedPlatform:
        def work(process: Process) -> int:
            while True:
                self.machine.scheduler.sleep(1e3)

        process = self.machine.start(name, work)
        self.bus.watch(process)
        return SimulatedPlatform(self.bus, process)

    def process(self, name: str) -> Process:
        return next(one for one in self.machine.processes if one.name == name)

    def sleep(self, seconds: float) -> None:
        self.machine.scheduler.sleep(seconds)


def test_what_is_sent_before_both_have_found_each_other_is_not_heard_but_latched_messages_are() -> None:
    for is_latched in (False, True):
        pair, qos = Pair(), Qos(depth=3, is_latched=is_latched)
        writer = pair.here.node("a").create_publisher(Bool, "/t", qos)
        for k in range(5):
            writer.publish(bytes([k]))
        reader = pair.there.node("b").create_taker(Bool, "/t", qos)
        pair.sleep(FOUND)
        writer.publish(b"last")
        pair.sleep(0.01)
        heard = []
        while (taken := reader.take()) is not None:
            heard.append((taken.number, taken.data))
        late = [(4, b"\x03"), (5, b"\x04"), (6, b"last")]  # a queue of three
        assert heard == (late if is_latched else [(6, b"last")])


def test_a_full_queue_loses_its_oldest_and_keep_all_loses_nothing() -> None:
    pair = Pair()
    writer = pair.here.node("a").create_publisher(Bool, "/t", Qos(depth=100))
    node = pair.there.node("b")
    short = node.create_taker(Bool, "/t", Qos(depth=2))
    whole = node.create_taker(Bool, "/t", Qos(keeps_all=True))
    pair.sleep(FOUND)
    for k in range(50):
        writer.publish(bytes([k]))
    pair.sleep(0.1)
    last = [taken.number for _ in range(9) if (taken := short.take()) is not None]
    every = [taken.number for _ in range(99) if (taken := whole.take()) is not None]
    assert last == [49, 50]
    assert every == list(range(1, 51))


def test_qualities_and_types_that_do_not_go_together_do_not_meet() -> None:
    pair = Pair()
    writer = pair.here.node("a").create_publisher(Bool, "/t", Qos(is_reliable=False))
    node = pair.there.node("b")
    strict, lenient = (node.create_taker(Bool, "/t", Qos(is_reliable=reliable)) for reliable in (True, False))
    other = node.create_taker(Empty, "/t", Qos(is_reliable=False))
    pair.sleep(FOUND)
    writer.publish(b"x")
    pair.sleep(0.01)
    assert writer.get_subscription_count() == 1
    assert strict.take() is other.take() is None
    assert lenient.take() is not None


@pytest.mark.parametrize(
    ("breaks", "has_lock", "is_whole"), [(0.0, False, True), (0.1, False, False), (0.1, True, True)]
)
def test_threads_that_read_and_write_without_a_lock_lose_counts_where_turns_are_broken(
    breaks: float, has_lock: bool, is_whole: bool
) -> None:
    machine, total = Machine(Scheduler(0, breaks)), 0

    def work(process: Process) -> int:
        platform = SimulatedPlatform(Bus(machine.scheduler), process)
        lock = platform.lock() if has_lock else nullcontext()

        def count() -> None:
            nonlocal total
            for _ in range(100):
                with lock:
                    before = total
                    platform.monotonic_ns()
                    total = before + 1
                platform.sleep(1e-4)

        threads = [platform.thread(name, count) for name in ("one", "other")]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        return total

    assert (machine.run(work) == 200) is is_whole


def test_a_reliable_message_is_late_on_a_bad_line_and_another_one_is_lost_and_counted() -> None:
    pair = Pair()
    pair.bus.lines["here", "there"] = Line(loss=0.5)
    writer = pair.here.node("a").create_publisher(Bool, "/t", Qos(depth=1000))
    node = pair.there.node("b")
    sure, fast = (node.create_taker(Bool, "/t", Qos(depth=1000, is_reliable=reliable)) for reliable in (True, False))
    pair.sleep(FOUND)
    for _ in range(200):
        writer.publish(b"x")
        pair.sleep(0.001)
    pair.sleep(1.0)
    numbers = [taken.number for _ in range(999) if (taken := sure.take()) is not None]
    got = [taken.number for _ in range(999) if (taken := fast.take()) is not None]
    assert numbers == list(range(1, 201))
    assert 50 < len(got) < 150
    assert fast.lost == 200 - len(got)


def test_a_process_that_stands_still_does_nothing_and_a_killed_one_never_again() -> None:
    pair, turns = Pair(), [0]

    def count(_: Process) -> int:
        while True:
            turns[0] += 1
            pair.sleep(0.01)

    process = pair.machine.start("counter", count)
    pair.sleep(1.0)
    process.stop()
    pair.sleep(0.1)
    still = turns[0]
    pair.sleep(1.0)
    assert turns[0] == still > 50
    process.go_on()
    pair.sleep(1.0)
    assert turns[0] > still + 50
    process.end(-9, is_orderly=False)
    gone = turns[0]
    pair.sleep(1.0)
    assert turns[0] == gone
    assert process.exit_code == -9


def test_a_lock_is_held_by_one_thread_and_given_to_the_next() -> None:
    pair, order = Pair(), list[str]()
    lock = pair.here.lock()

    def hold(name: str) -> None:
        with lock:
            order.append(f"{name} in")
            pair.sleep(0.05)
            order.append(f"{name} out")

    for name in "abc":
        pair.here.thread(name, lambda name=name: hold(name)).start()  # type: ignore[misc]
    pair.sleep(1.0)
    assert len(order) == 6
    assert all(one[0] == other[0] for one, other in zip(order[::2], order[1::2], strict=True))
    assert lock.acquire(True, 0.01)
    assert not lock.acquire(True, 0.01)


def orders(seed: int, depth: int) -> str:
    """Which of two threads runs first after a long turn of their process, twice; ``a`` is due 1 ms earlier."""
    machine, said = Machine(Scheduler(seed, depth=depth)), list[str]()

    def work(process: Process) -> int:
        platform = SimulatedPlatform(Bus(machine.scheduler), process)

        def rest_until(time: float) -> None:
            while (left := time - 1e-9 * (machine.scheduler.now_ns - BEGIN_NS)) > 0.0:
                platform.sleep(left if left < 0.3 else 0.3)

        def write(name: str, after: float) -> None:
            for begin in (1.0, 6.0):
                rest_until(begin + after)
                said.append(name)

        threads = [platform.thread(one, partial(write, one, after)) for one, after in (("a", 0.001), ("b", 0.002))]
        for thread in threads:
            thread.start()
        for begin in (1.0, 6.0):
            rest_until(begin - 0.001)
            process.slow_ns = 5_000_000  # this turn ends after both are due
            platform.sleep(0.0)
            process.slow_ns = 0
        for thread in threads:
            thread.join()
        return 0

    machine.run(work)
    return "".join(said)


def test_a_race_of_two_threads_is_lost_only_where_priorities_decide_and_the_same_seed_repeats_it() -> None:
    """A wrong order needs depth 1; an order that changes from one round to the next needs a change, so depth 2."""
    found = {depth: [orders(seed, depth) for seed in range(40)] for depth in (0, 1, 2)}
    assert set(found[0]) == {"abab"}
    assert set(found[1]) == {"abab", "baba"}
    assert {"abba", "baab"} & set(found[2])
    assert found[2] == [orders(seed, 2) for seed in range(40)]


def test_a_thread_of_low_priority_runs_while_the_others_never_rest() -> None:
    machine, said = Machine(Scheduler(0, depth=1)), list[int]()

    def work(process: Process) -> int:
        process.slow_ns = 1_000_000  # a turn takes longer than the pause after it
        platform = SimulatedPlatform(Bus(machine.scheduler), process)

        def go(k: int) -> None:
            while True:
                platform.sleep(1e-4)
                said.append(k)

        for k in range(5):
            platform.thread(f"{k}", partial(go, k)).start()
        platform.sleep(1.0)
        return 0

    machine.run(work)
    assert all(said.count(k) > 40 for k in range(5))


def test_whoever_waits_for_what_never_comes_is_told() -> None:
    scheduler = Scheduler(0)
    machine = Machine(scheduler)

    def wait(_: Process) -> None:
        scheduler.wait(None)

    with pytest.raises(Deadlock):
        machine.run(wait)


@pytest.mark.slow
def test_the_drill_gives_the_same_bits_in_processes_that_hash_otherwise(tmp_path: Path) -> None:
    """The same folder each time, for its name stands in the recording."""
    seen = []
    for hashed in ("1", "2"):
        place, file = tmp_path / "bags", tmp_path / "drill.json"
        words = ["drill", "--simulated", "--seed", "5", "stop_service"]
        done = subprocess.run(
            [sys.executable, "-m", "teleop_core.commands.cli", *words, "--out", place, "--json", file],
            env=os.environ | {"PYTHONHASHSEED": hashed},
            capture_output=True,
            check=False,
        )
        assert done.returncode == 0, done.stdout
        bags = {p.relative_to(place): p.read_bytes() for p in place.rglob("*") if p.is_file()}
        seen.append((file.read_bytes(), bags))
        place.rename(tmp_path / f"bags_{hashed}")
    assert len(seen[0][1]) == 2
    assert seen[0] == seen[1]


def test_a_thread_that_ends_wakes_nobody_but_who_waits_for_its_end() -> None:
    pair, order = Pair(), list[str]()

    def child() -> None:
        order.append("child ends")

    def parent() -> None:
        pair.here.thread("child", child).start()
        pair.sleep(1.0)
        order.append("parent goes on")

    begin_ns = pair.machine.scheduler.now_ns
    thread = pair.here.thread("parent", parent)
    thread.start()
    thread.join(5.0)
    assert order == ["child ends", "parent goes on"]
    assert pair.machine.scheduler.now_ns - begin_ns > 1_000_000_000


@pytest.mark.parametrize(("offset_ns", "drift"), [(0, 0.0), (-3_600_000_000_000, 0.0), (7, 1e-3)])
def test_a_kernel_reads_the_same_clocks_as_python(offset_ns: int, drift: float) -> None:
    pair = Pair()
    pair.machine.clock.offset_ns, pair.machine.clock.drift = offset_ns, drift
    pair.sleep(3.0)
    found, time = pair.here.functions(), np.zeros(2, np.int64)

    def read(kind: int) -> int:
        call(found["clock"], kind, time.ctypes.data, found["context"], 0)
        return int(time[0]) * 1_000_000_000 + int(time[1])

    assert read(1) == pair.machine.scheduler.now_ns
    assert abs(read(0) - (pair.here.time_ns() - LOOK_NS)) <= 1  # the drift of one look


def test_kernels_take_and_publish_in_a_simulated_session_themselves(peer: SimulatedPeer) -> None:
    session = peer.side("slave", "slave_sim")
    assert session.crew is not None
    ports = [node.ports for node in session.crew.nodes]
    assert not any(entry.own["needs_python"] for one in ports for entry in one.all_inputs() if entry.subscription)
    assert all(out.is_direct for one in ports for out in one.outputs.values())


def test_an_error_of_an_observer_ends_the_simulation(peer: SimulatedPeer) -> None:
    """It cannot pass through the kernel that publishes."""

    def fail(_: object) -> None:
        raise ZeroDivisionError

    peer.side("slave", "slave_sim")
    peer.bus.seen["/slave/measured_js"] = fail
    peer.bus.writers["/slave/measured_js"][0].note_links()
    with pytest.raises(ZeroDivisionError):
        peer.wait(lambda: False, "an error", 1.0)
