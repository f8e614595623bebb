"""Cluster: workers of a Dask scheduler, all with the code of this process."""

from collections.abc import Callable
from typing import TYPE_CHECKING

from teleop_core.base.errors import SessionError

if TYPE_CHECKING:
    from distributed import Client

TRIES = 3
"""Number of times that a task is repeated, as after the death of its worker."""


def connect(address: str) -> "Client":
    """Connect to a Dask scheduler.

    Raises:
        SessionError: The address has no scheduler, or Dask is not installed.
    """
    try:
        from distributed import Client
    except ImportError as error:
        raise SessionError("--scheduler needs Dask: pip install distributed") from error
    try:
        return Client(address, timeout="10s", set_as_default=False)
    except (OSError, ValueError) as error:
        raise SessionError(f"no Dask scheduler answers at {address}") from error


def codes(client: "Client", digest: Callable[[], str]) -> tuple[list[str], dict[str, object]]:
    """Addresses of the workers with the same code as this process, and the code of all other workers."""
    own, found = digest(), client.run(digest, on_error="return")
    return [worker for worker, code in found.items() if code == own], {w: c for w, c in found.items() if c != own}


def check_codes(client: "Client", digest: Callable[[], str]) -> list[str]:
    """Check that there are workers, all with the code of this process; returns their addresses.

    Args:
        client: Connection to the cluster.
        digest: Function that returns a digest of the code of its process; a worker must be able to import it.

    Raises:
        SessionError: The code of a worker differs from the code of this process, or the cluster has no worker.
    """
    fit, others = codes(client, digest)
    for worker, code in others.items():
        raise SessionError(f"worker {worker} has code {code}, must be ours, {digest()}")
    if not fit:
        raise SessionError(f"{client.scheduler.address} has no workers")  # type: ignore[union-attr]
    return fit


def check_code(code: str, digest: Callable[[], str]) -> None:
    """Check on a worker, which may have joined later, that its code is that of the caller.

    Raises:
        SessionError: It differs.
    """
    if digest() != code:
        raise SessionError(f"this worker has code {digest()}, must be {code}")
