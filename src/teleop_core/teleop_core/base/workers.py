"""Workers: processes of this machine that compute, and end with their caller, whatever ends it."""

import ctypes
import os
import pickle
import signal
import tempfile
import traceback
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from multiprocessing import active_children, get_context, parent_process
from threading import Thread
from typing import TypeVar

from teleop_core.base.errors import SessionError

Result = TypeVar("Result")
_DEATH_SIGNAL = 1  # PR_SET_PDEATHSIG: the signal that a process gets when its parent dies


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


def apart(work: Callable[[], Result]) -> Result:
    """Result of a function that runs in a copy of this process, whose memory is free again afterwards.

    The copy has everything that this process has imported, compiled and loaded, and ends with this process. Its result
    must be one that pickles.

    Raises:
        SessionError: The copy died.
    """
    reading, writing = os.pipe()
    child = os.fork()
    if child == 0:
        try:
            ctypes.CDLL(None).prctl(_DEATH_SIGNAL, signal.SIGKILL)
            with open(writing, "wb") as file:
                pickle.dump(work(), file)
            os._exit(0)
        except BaseException:
            traceback.print_exc()
        finally:
            os._exit(1)
    os.close(writing)
    with open(reading, "rb") as file:
        data = file.read()
    _, status = os.waitpid(child, 0)
    if status:
        raise SessionError("a process that computes died; its error stands above if it had one")
    found: Result = pickle.loads(data)
    return found


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
