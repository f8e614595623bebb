"""Real-time options: privileges of a loop, such as a real-time priority, that the system may grant."""

import ctypes
import gc
import os
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress

from teleop_core.graph.layers import RealTimeParameters

_EVERYTHING = 3  # MCL_CURRENT | MCL_FUTURE of mlockall(2)
_LOWEST = 1
"""Priority of the other threads of the loop's process. The loop may wait for a thread that holds the interpreter's
lock, so that thread must not wait for other processes."""


def apply_options(options: RealTimeParameters) -> list[str]:
    """Apply the options to the calling thread and its process.

    Args:
        options: Wanted options; all off by default.

    Returns:
        One line for each option that the system refused, with advice how to allow it.
    """
    refusals = []
    if options.cpus:
        refusals += _cpus(options.cpus)
    if options.priority > 0:
        refusals += _priority(options.priority)
    if options.lock_memory and ctypes.CDLL(None, use_errno=True).mlockall(_EVERYTHING):
        refusals.append(
            f"real_time.lock_memory refused: {os.strerror(ctypes.get_errno())}; allow it with "
            "'ulimit -l unlimited' or a memlock line in /etc/security/limits.conf"
        )
    if options.freeze_gc:
        gc.collect()
        gc.freeze()
    return refusals


def _cpus(cpus: tuple[int, ...]) -> list[str]:
    try:
        os.sched_setaffinity(0, cpus)
    except OSError as error:
        allowed = sorted(os.sched_getaffinity(0))
        return [f"real_time.cpus {list(cpus)} refused: {error.strerror}; this process may use {allowed}"]
    return []


def is_priority_granted(priority: int) -> bool:
    """Whether the system allows this process a priority of SCHED_FIFO."""
    with ThreadPoolExecutor(1) as pool:
        return not pool.submit(_take, priority).result()


def give_way() -> None:
    """Take the real-time priority from the calling thread."""
    os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))


def _priority(priority: int) -> list[str]:
    if refusal := _take(priority):
        return [
            f"real_time.priority {priority} refused: {refusal}; allow it with an "
            "rtprio line in /etc/security/limits.conf or CAP_SYS_NICE"
        ]
    for thread in map(int, os.listdir("/proc/self/task")):
        with suppress(ProcessLookupError):
            if os.sched_getscheduler(thread) == os.SCHED_OTHER:
                _take(_LOWEST, thread)
    return []


def _take(priority: int, thread: int = 0) -> str:
    """Give a thread a priority that its children do not inherit. Return the reason if the system refuses, else ""."""
    try:
        policy = os.SCHED_FIFO | os.SCHED_RESET_ON_FORK
        os.sched_setscheduler(thread, policy, os.sched_param(priority))
    except ProcessLookupError:
        raise
    except OSError as error:
        return str(error.strerror)
    return ""
