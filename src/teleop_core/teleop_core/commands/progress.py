"""Progress of a long command: a bar on a terminal, or one line per minute if the output is piped."""

import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

PATIENCE = 2.0
"""Time [s] without progress after which the reason is shown."""
EVERY = 60.0
"""Time [s] between two lines of progress where there is no terminal."""


class Progress:
    """Collects the ticks of successive sessions, and shows them in a bar if there is one."""

    def __init__(self) -> None:
        self.ticks = self.sessions = 0
        self.show: Callable[[int, int], None] | None = None
        self.say: Callable[[str], None] | None = None

    def __call__(self, done: int, total: int) -> None:
        """Set the number of finished ticks and the total number of ticks."""
        self.sessions += done < self.ticks or not self.sessions
        self.ticks = done
        if self.show is not None:
            self.show(done, total)

    @property
    def seconds(self) -> float:
        """Simulated time of all ticks so far [s]."""
        from teleop_core.graph.signals import DT

        return round(self.ticks * DT, 9)


@contextmanager
def shown_progress(text: str) -> Iterator[Progress]:
    """Progress bar on a terminal; when piped, a line on the standard error every :data:`EVERY` seconds."""
    progress, ended = Progress(), threading.Event()
    threading.Thread(target=_watch, args=(progress, ended), daemon=True).start()
    try:
        yield from _shown(text, progress)
    finally:
        ended.set()


def _watch(progress: Progress, ended: threading.Event) -> None:
    """Wait for work that takes long, and show it: in the bar, or once as a line if there is no bar."""
    wait = PATIENCE
    while not ended.wait(wait) and not progress.ticks:
        if say_work(progress.say) and progress.say is None:
            return
        wait = 0.2


def say_work(say: Callable[[str], None] | None = None) -> bool:
    """Show current one-time work, such as compiling kernels; return whether there was any.

    Args:
        say: Function that shows a text in place of the last text; None prints a line.
    """
    from teleop_core.kernels.progress import in_work

    if not (work := in_work()):
        return False
    if say is None:
        print(f"{work.partition(' (')[0]}, once …", file=sys.stderr)
    else:
        say(work)
    return True


def _lines(text: str) -> Callable[[int, int], None]:
    """Function that prints a line of progress, the first one after :data:`EVERY` seconds."""
    begin = last = time.monotonic()

    def show(done: int, total: int) -> None:
        nonlocal last
        now = time.monotonic()
        if now - last >= EVERY:
            last = now
            print(f"{text}: {100 * done // max(total, 1)} % after {now - begin:.0f} s", file=sys.stderr, flush=True)

    return show


def _shown(text: str, progress: Progress) -> Iterator[Progress]:
    if not sys.stderr.isatty():
        progress.show = _lines(text)
        yield progress
        return
    from rich.console import Console
    from rich.progress import BarColumn, TextColumn, TimeElapsedColumn, TimeRemainingColumn
    from rich.progress import Progress as Bar

    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        TextColumn("{task.percentage:.0f} %"),
        TimeElapsedColumn(),
        TimeRemainingColumn(),
    )
    with Bar(*columns, console=Console(stderr=True)) as bar:
        task = bar.add_task(text, total=None)

        def show(done: int, total: int) -> None:
            number = f", session {progress.sessions}" if progress.sessions > 1 else ""
            bar.update(task, completed=done, total=total, description=text + number)

        progress.show = show
        progress.say = lambda words: bar.update(task, description=words)
        yield progress
