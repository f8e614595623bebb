"""Scheduler of the simulated machine: whose turn it is."""

import pytest
from std_msgs.msg import Bool, Empty

from teleop_core.middleware.world import Qos
from teleop_drill.simulation.bus import Bus
from teleop_drill.simulation.machine import Machine, Process
from teleop_drill.simulation.scheduler import Scheduler
from teleop_drill.simulation.world import SimulatedWorld


def test_a_thread_that_ends_lets_its_maker_wait_on() -> None:
    machine, begun = Machine(Scheduler(0)), 0

    def work(process: Process) -> int:
        nonlocal begun
        begun = machine.scheduler.now_ns
        machine.scheduler.spawn(process, "short", lambda: None).start()
        machine.scheduler.sleep(1.0)
        return machine.scheduler.now_ns

    assert machine.run(work) - begun >= 1_000_000_000


def test_ends_of_different_types_do_not_match() -> None:
    machine = Machine(Scheduler(0))
    bus = Bus(machine.scheduler)

    def work(process: Process) -> tuple[bool, ...]:
        bus.watch(process)
        world = SimulatedWorld(bus, process)
        node = world.node("both")
        sent = node.create_publisher(Bool, "told", Qos())
        takers = [node.create_taker(kind, "told", Qos()) for kind in (Bool, Empty)]
        world.sleep(2.0)
        sent.publish(Bool(data=True))
        world.sleep(0.1)
        return tuple(taker.take() is not None for taker in takers)

    assert machine.run(work) == (True, False)


@pytest.mark.parametrize(
    ("breaks", "has_lock", "is_whole"), [(0.0, False, True), (0.1, False, False), (0.1, True, True)]
)
def test_threads_that_read_and_write_without_a_lock_lose_counts_where_turns_are_broken(
    breaks: float, has_lock: bool, is_whole: bool
) -> None:
    machine, total = Machine(Scheduler(0, breaks)), 0

    def work(process: Process) -> int:
        world = SimulatedWorld(Bus(machine.scheduler), process)
        lock = world.lock()

        def count() -> None:
            nonlocal total
            for _ in range(100):
                if has_lock:
                    lock.acquire()
                before = total
                world.monotonic_ns()
                total = before + 1
                if has_lock:
                    lock.release()
                world.sleep(1e-4)

        threads = [world.thread(name, count) for name in ("one", "other")]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        return total

    assert (machine.run(work) == 200) is is_whole
