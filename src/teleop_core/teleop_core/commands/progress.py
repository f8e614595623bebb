"""Progress of a long command: a bar on a terminal, nothing when piped."""

import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager


class Progress:
    """What a session tells of its ticks; shown by a bar if there is one."""

    def __init__(self) -> None:
        self.ticks = 0
        self.show: Callable[[int, int], None] | None = None

    def __call__(self, done: int, total: int) -> None:
        """Take how many ticks are done, of how many."""
        self.ticks = done
        if self.show is not None:
            self.show(done, total)

    @property
    def seconds(self) -> float:
        """Time of the ticks so far."""
        from teleop_core.signals import DT

        return round(self.ticks * DT, 9)


@contextmanager
def shown_progress(text: str) -> Iterator[Progress]:
    """Progress bar on a terminal, nothing when piped."""
    progress = Progress()
    patience = threading.Timer(2.0, say_compiling, (progress,))
    patience.daemon = True
    patience.start()
    try:
        yield from _shown(text, progress)
    finally:
        patience.cancel()


def say_compiling(progress: Progress) -> None:
    """Say what takes so long before the first tick."""
    if not progress.ticks:
        print("compiling kernels, once for this graph …", file=sys.stderr)


def _shown(text: str, progress: Progress) -> Iterator[Progress]:
    if not sys.stderr.isatty():
        yield progress
        return
    from rich.console import Console
    from rich.progress import BarColumn, TextColumn, TimeRemainingColumn
    from rich.progress import Progress as Bar

    columns = (TextColumn(text), BarColumn(), TextColumn("{task.percentage:.0f} %"))
    with Bar(*columns, TimeRemainingColumn(), console=Console(stderr=True)) as bar:
        task = bar.add_task(text, total=None)
        progress.show = lambda done, total: bar.update(task, completed=done, total=total)
        yield progress
