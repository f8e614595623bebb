"""Workers: points on the processes of this machine, or on those of a Dask cluster."""

import os
import tempfile
from collections.abc import Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from functools import partial
from multiprocessing import get_context
from pathlib import Path
from typing import TYPE_CHECKING

from teleop_core.base.errors import SessionError
from teleop_core.base.own_parts import load_own_parts
from teleop_lab.studies.point import Point, Result, code_digest, compute
from teleop_lab.studies.store import write_result

if TYPE_CHECKING:
    from distributed import Client

    from teleop_lab.studies.study import Study

BATCH = 100
"""Sessions of a task on a cluster, at most: a scheduler copes with some 0.2 million tasks."""
_TRIES = 3


def in_processes(
    study: "Study", points: Sequence[Point], jobs: int | None, store: Path | None, recordings: Path | str | None
) -> Iterator[Result]:
    """Results as they come, of processes of this machine with a session at a time each.

    Whoever computes a result writes it. A process that dies costs the sessions that were at work
    then, which are tried again.
    """
    place = None if recordings is None else Path(recordings)
    do = partial(_computed, metrics=tuple(study.metrics), store=store, recordings=place)
    count = max(1, min(jobs or len(os.sched_getaffinity(0)), len(points)))
    if count == 1:
        yield from map(do, points)
        return
    left = {point.name: point for point in points}
    for _ in range(_TRIES):
        with ProcessPoolExecutor(count, get_context("spawn"), load_own_parts, (tuple(study.parts),)) as pool:
            try:
                for result in _as_they_come(pool, do, list(left.values()), 2 * count):
                    del left[result.name]
                    yield result
            except BrokenProcessPool:
                continue
        return
    for point in left.values():
        yield Result(point.name, point.key, {}, f"its process died {_TRIES} times", 0.0)


def _as_they_come(pool: ProcessPoolExecutor, do: "partial[Result]", points: list[Point], most: int) -> Iterator[Result]:
    waiting: set[Future[Result]] = set()
    rest = iter(points)
    while True:
        while len(waiting) < most and (point := next(rest, None)) is not None:
            waiting.add(pool.submit(do, point))
        if not waiting:
            return
        done, waiting = wait(waiting, return_when=FIRST_COMPLETED)
        for future in done:
            yield future.result()


def _computed(point: Point, metrics: tuple[str, ...], store: Path | None, recordings: Path | None) -> Result:
    result = compute(point, metrics, recordings)
    if store is not None:
        write_result(store, result)
    return result


def on_dask(client: "Client", study: "Study", points: Sequence[Point]) -> Iterator[Result]:
    """Results as they come, of the workers of a Dask cluster, which share no folder with us.

    Raises:
        SessionError: A worker has other code, or there is none.
    """
    from distributed import as_completed

    own, found = code_digest(), client.run(code_digest)
    if not found:
        raise SessionError(f"{client.scheduler.address} has no workers")  # type: ignore[union-attr]
    for worker, code in found.items():
        if code != own:
            raise SessionError(f"worker {worker} has code {code}, must be ours, {own}")
    parts = tuple((part.name, part.read_text("utf-8")) for part in study.parts)
    size = max(1, min(BATCH, len(points) // (4 * len(found)) or 1))
    batches = [points[at : at + size] for at in range(0, len(points), size)]
    futures = {
        client.submit(_batch, batch, tuple(study.metrics), parts, pure=False, retries=_TRIES): batch
        for batch in batches
    }
    try:
        for future in as_completed(list(futures), loop=client.loop):
            batch = futures[future]
            if future.status == "finished":
                yield from future.result()
            else:
                raised = future.exception()
                text = f"{type(raised).__name__}: {' '.join(str(raised).split())}"
                for point in batch:
                    yield Result(point.name, point.key, {}, text, 0.0)
            future.release()
    finally:
        client.cancel(list(futures))


def _batch(points: Sequence[Point], metrics: tuple[str, ...], parts: tuple[tuple[str, str], ...]) -> list[Result]:
    """Results of some points on a worker; parts of a user travel as texts."""
    with tempfile.TemporaryDirectory() as folder:
        for name, text in parts:
            (Path(folder) / name).write_text(text, "utf-8")
        load_own_parts([Path(folder) / name for name, _ in parts])
        return [compute(point, metrics, None) for point in points]
