"""Cluster: Dask workers of this machine."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest


@contextmanager
def cluster(folder: Path, workers: int = 2) -> Iterator[Any]:
    """Client of a cluster with some workers."""
    distributed = pytest.importorskip("distributed", reason="Dask is not installed")
    with (
        distributed.LocalCluster(
            n_workers=workers, threads_per_worker=1, processes=True, dashboard_address=None, local_directory=str(folder)
        ) as made,
        distributed.Client(made, set_as_default=False) as client,
    ):
        yield client
