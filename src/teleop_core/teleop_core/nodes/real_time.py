"""Real-time options: what the system grants a loop beyond fair shares of time."""

import ctypes
import gc
import os

from teleop_core.session.layers import RealTimeParameters

_EVERYTHING = 3  # MCL_CURRENT | MCL_FUTURE of mlockall(2)


def apply_options(options: RealTimeParameters) -> list[str]:
    """Take the options for the calling thread and its process.

    Args:
        options: What is wanted; all off by default.

    Returns:
        One line for everything that the system refused, with how to allow it.
    """
    refusals = []
    if options.cpus:
        refusals += _cpus(options.cpus)
    if options.priority:
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
        return [f"real_time.cpus {list(cpus)} refused: {error.strerror}; this process may use "
                f"{allowed}"]  # fmt: skip
    return []


def _priority(priority: int) -> list[str]:
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(priority))
    except OSError as error:
        return [f"real_time.priority {priority} refused: {error.strerror}; allow it with an "
                "rtprio line in /etc/security/limits.conf or CAP_SYS_NICE"]  # fmt: skip
    return []
