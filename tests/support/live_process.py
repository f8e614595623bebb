"""The command ``teleop live`` as a process, with all that it starts."""

import os
import re
import signal
import subprocess
import sys
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import psutil

import patience
from teleop_core.bags.reader import Bag

TIMEOUT = 90.0
CALM = "operation.longest_outage=0.0"
"""A busy machine is no outage: no slave is paused because its session stood still."""
QUICK = ("operator.approach_time=1.0", "operator.patience=0.0", CALM)


class LiveProcess:
    """A session started from the command line, recorded in ``folder``/bag.

    It lasts for ten minutes, unless it is told another time or ended before: what it comes to in a
    time is not known on a busy machine. Its temporary files go to ``folder``/tmp. It ignores some
    signals from the start, as a process does that a shell starts in the background.
    """

    def __init__(
        self,
        folder: Path,
        *arguments: str,
        scenario: str = "coarse_box",
        duration: float = 600.0,
        env: Mapping[str, str] | None = None,
        ignores: tuple[int, ...] = (),
        settings: tuple[str, ...] = QUICK,
    ) -> None:
        self.bag, self.temporary, self._log = folder / "bag", folder / "tmp", folder / "live.log"
        self._duration = duration
        self.temporary.mkdir()
        command = [sys.executable, "-m", "teleop_core.commands.cli", "live", "--out", str(self.bag)]
        command += ["--duration", f"{duration}", "--scenario", scenario, *arguments]
        command += [word for setting in settings for word in ("--set", setting)]
        with self._log.open("wb") as log:
            self.process = subprocess.Popen(
                command,
                stdin=subprocess.DEVNULL,
                stdout=log,
                stderr=log,
                env=os.environ | {"TMPDIR": str(self.temporary)} | dict(env or {}),
                preexec_fn=lambda: [signal.signal(n, signal.SIG_IGN) for n in ignores],  # noqa: PLW1509
            )

    @property
    def text(self) -> str:
        """What it has written so far."""
        return self._log.read_text(errors="replace")

    def wait_text(self, text: str, timeout: float = 300.0) -> None:
        """Wait until it has written a text."""

        def written() -> bool:
            assert self.process.poll() is None or text in self.text, self.text
            return text in self.text

        wait_until(written, f"{text!r} of teleop live", timeout)

    def wait_running(self) -> None:
        """Wait for a line of progress by which the slave made a hundred ticks and more."""
        line = re.compile(rf"\d/{self._duration:g} s  .* [1-9]\d\d+ Hz")

        def told() -> bool:
            assert self.process.poll() is None, self.text
            return line.search(self.text) is not None

        wait_until(told, "progress of teleop live", 300.0)

    def nodes(self, name: str = "") -> list[psutil.Process]:
        """Processes of its nodes, or those of one."""
        children: list[psutil.Process] = psutil.Process(self.process.pid).children()
        found: list[psutil.Process] = children[0].children() if children else []
        return [process for process in found if not name or name in words(process)]

    def signal(self, number: int) -> list[psutil.Process]:
        """Send a signal to the command alone; returns its nodes."""
        nodes = self.nodes()
        self.process.send_signal(number)
        return nodes

    def wait(self, timeout: float = TIMEOUT) -> int:
        """Exit code."""
        wait_until(lambda: self.process.poll() is not None, "end of teleop live", timeout)
        return self.process.returncode

    def recorded(self) -> Bag:
        """Recording, which must have been closed."""
        assert (self.bag / "metadata.yaml").exists(), self.text
        return Bag(self.bag)

    def close(self) -> None:
        """End it if it still runs."""
        if self.process.poll() is None:
            self.process.terminate()
            self.process.wait(60)


def wait_until(condition: Callable[[], Any], what: str, timeout: float = TIMEOUT) -> Any:
    """Result of ``condition`` as soon as it is true."""
    return patience.wait_until(condition, what, timeout)


def has_recorded(status: Any, counts: Mapping[str, int]) -> bool:
    """Whether a recorder's report tells of more samples than these of each topic."""
    return status is not None and all(status.number(f"received.{name}") > count for name, count in counts.items())


def words(process: psutil.Process) -> list[str]:
    """Words of a process's command line; none once it has ended."""
    try:
        return " ".join(process.cmdline()).replace("\0", " ").split()
    except psutil.NoSuchProcess:
        return []


def are_gone(processes: list[Any]) -> bool:
    """Whether processes have ended."""
    return all(not p.is_running() or p.status() == psutil.STATUS_ZOMBIE for p in processes)
