"""Workers: compute points by the processes of this machine, or by the workers of a Dask cluster."""

import atexit
import os
import tempfile
from collections.abc import Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Executor, Future, wait
from concurrent.futures.process import BrokenProcessPool
from functools import lru_cache, partial
from multiprocessing import current_process
from pathlib import Path
from shutil import rmtree
from typing import TYPE_CHECKING

from teleop_core.base.cluster import TRIES, check_code, check_codes, codes
from teleop_core.base.errors import SessionError
from teleop_core.base.own_parts import forget_own_parts, load_own_parts, named_files
from teleop_core.base.workers import workers
from teleop_lab.studies.point import Point, PointResult, code_digest, compute
from teleop_lab.studies.store import write_result

if TYPE_CHECKING:
    from distributed import Client

BATCH = 100
"""Largest number of sessions per task of a cluster; a scheduler can manage about 0.2 million tasks."""
_FOLDER = "teleop_parts_"


def in_processes(
    points: Sequence[Point],
    metrics: Sequence[str],
    parts: Sequence[Path],
    jobs: int | None,
    store: Path | None,
    recordings: Path | str | None = None,
) -> Iterator[PointResult]:
    """Yield results as they are computed by processes of this machine, each with one session at a time.

    The process that computes a result writes it. If a process dies, the sessions that were running are repeated.

    Raises:
        SessionError: No process can be started.
    """
    if getattr(current_process(), "_inheriting", False):
        raise SystemExit(1)  # the caller's program starts processes without a guard; the caller reports this
    place = None if recordings is None else Path(recordings)
    do = partial(_computed, metrics=tuple(metrics), store=store, recordings=place)
    count = max(1, min(jobs or len(os.sched_getaffinity(0)), len(points)))
    if count == 1:
        yield from map(do, points)
        return
    left = {point.name: point for point in points}
    for _ in range(TRIES):
        with workers(count, partial(load_own_parts, tuple(parts))) as pool:
            try:
                for result in _as_they_come(pool, do, list(left.values()), 2 * count):
                    del left[result.name]
                    yield result
            except BrokenProcessPool:
                if len(left) < len(points):
                    continue
                text = "no process of the study begins; each reads your program first: call the study"
                raise SessionError(f"{text} below `if __name__ == '__main__':`, in a file") from None
        return
    for point in left.values():
        yield PointResult(point.name, point.key, {}, f"its process died {TRIES} times", 0.0)


def _as_they_come(pool: Executor, do: "partial[PointResult]", points: list[Point], most: int) -> Iterator[PointResult]:
    waiting: set[Future[PointResult]] = set()
    rest = iter(points)
    while True:
        while len(waiting) < most and (point := next(rest, None)) is not None:
            waiting.add(pool.submit(do, point))
        if not waiting:
            return
        done, waiting = wait(waiting, return_when=FIRST_COMPLETED)
        for future in done:
            yield future.result()


def _computed(point: Point, metrics: tuple[str, ...], store: Path | None, recordings: Path | None) -> PointResult:
    result = compute(point, metrics, recordings)
    if store is not None:
        write_result(store, result)
    return result


def on_dask(
    client: "Client", points: Sequence[Point], metrics: Sequence[str], parts: Sequence[Path]
) -> Iterator[PointResult]:
    """Yield results as they are computed by the workers of a Dask cluster, which share no folder with this machine.

    Raises:
        SessionError: The code of a worker differs from the code of this process, or the cluster has no worker.
    """
    from distributed import as_completed

    fit = check_codes(client, code_digest)
    texts = tuple((part.name, part.read_text("utf-8")) for part in parts)
    do = partial(_batch, metrics=tuple(metrics), parts=texts, code=code_digest())
    size = max(1, min(BATCH, len(points) // (4 * len(fit)) or 1))
    batches = [points[at : at + size] for at in range(0, len(points), size)]
    futures = {client.submit(do, batch, pure=False, retries=TRIES): batch for batch in batches}
    repeated = set[object]()
    waiting = as_completed(list(futures), loop=client.loop)
    try:
        for future in waiting:
            batch = futures.pop(future)
            if future.status == "finished":
                yield from future.result()
            elif future.key not in repeated and all(found := codes(client, code_digest)):
                # a worker with other code joined later
                again = client.submit(do, batch, pure=False, retries=TRIES, workers=found[0])
                futures[again] = batch
                repeated.add(again.key)
                waiting.add(again)
            else:
                raised = future.exception()
                text = f"{type(raised).__name__}: {' '.join(str(raised).split())}"
                for point in batch:
                    yield PointResult(point.name, point.key, {}, text, 0.0)
            future.release()
    finally:
        client.cancel(list(futures))


def _batch(
    points: Sequence[Point], metrics: tuple[str, ...], parts: tuple[tuple[str, str], ...], code: str
) -> list[PointResult]:
    """Results of some points on a worker; parts of a user travel as texts.

    Raises:
        SessionError: This worker joined later, and its code differs.
    """
    check_code(code, code_digest)
    load_own_parts(_written(parts))
    return [compute(point, metrics, None) for point in points]


@lru_cache(1)
def _written(parts: tuple[tuple[str, str], ...]) -> list[Path]:
    """Write the study's parts to files and return them with the worker's own.

    The files exist until this process ends or another study begins.
    """
    own = [path for path in named_files() if not path.parent.name.startswith(_FOLDER)]
    forget_own_parts()
    folder = Path(tempfile.mkdtemp(prefix=_FOLDER))
    atexit.register(rmtree, folder, ignore_errors=True)
    for name, text in parts:
        (folder / name).write_text(text, "utf-8")
    return [*own, *(folder / name for name, _ in parts)]
