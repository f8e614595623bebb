"""Workers: processes of this machine that compute, and end with their caller, whatever ends it."""

import os
import signal
import tempfile
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from multiprocessing import active_children, get_context, parent_process
from threading import Thread

from teleop_core.base.errors import SessionError


@contextmanager
def workers(count: int, prepare: Callable[[], object] | None = None) -> Iterator[ProcessPoolExecutor]:
    """Pool of processes. If its block ends with an exception, such as Ctrl-C, running tasks are killed at once.

    Temporary files of the tasks are removed with the pool. No process is replaced after a number of tasks: before
    Python 3.13 such a pool waits without end (python/cpython#115634). Open another pool in its place.

    Args:
        count: Number of processes.
        prepare: Function that each process calls before its first task.

    Raises:
        SessionError: A process died, and the block does not handle it.
    """
    before = set(active_children())
    with tempfile.TemporaryDirectory(prefix="teleop_", ignore_cleanup_errors=True) as folder:
        pool = ProcessPoolExecutor(count, get_context("spawn"), _begin, (folder, prepare))
        try:
            yield pool
        except BaseException as error:
            for process in set(active_children()) - before:
                process.kill()
            pool.shutdown(cancel_futures=True)
            if isinstance(error, BrokenProcessPool):
                text = "one of the processes that compute died, as if killed for want of memory; use fewer of them"
                raise SessionError(text) from error
            raise
        pool.shutdown()


def _begin(folder: str, prepare: Callable[[], object] | None) -> None:
    """Prepare a worker process: its caller alone hears Ctrl-C, and it exits when its caller no longer exists."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    Thread(target=_end_with, args=(parent_process(),), daemon=True).start()
    tempfile.tempdir = folder
    if prepare is not None:
        prepare()


def _end_with(other: object) -> None:
    other.join()  # type: ignore[attr-defined]
    os._exit(1)  # files are written whole, so that all results on the disk are complete
