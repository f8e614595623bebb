"""Scheduler of the simulated machine: whose turn it is."""

from teleop_drill.simulation.machine import Machine, Process
from teleop_drill.simulation.scheduler import Scheduler


def test_a_thread_that_ends_lets_its_maker_wait_on() -> None:
    machine, begun = Machine(Scheduler(0)), 0

    def work(process: Process) -> int:
        nonlocal begun
        begun = machine.scheduler.now_ns
        machine.scheduler.spawn(process, "short", lambda: None).start()
        machine.scheduler.sleep(1.0)
        return machine.scheduler.now_ns

    assert machine.run(work) - begun >= 1_000_000_000
