"""The command ``teleop live`` as a process, with all that it starts."""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import psutil

from teleop_core.bags.reader import Bag

TIMEOUT = 90.0
QUICK = ("operator.approach_time=1.0", "haptic_master.patience=0.0")


class LiveProcess:
    """A session started from the command line, recorded in ``folder``/bag.

    Its temporary files go to ``folder``/tmp. It ignores some signals from the start, as a process
    does that a shell starts in the background.
    """

    def __init__(
        self, folder: Path, *arguments: str, duration: float = 60.0,
        env: Mapping[str, str] | None = None, ignores: tuple[int, ...] = (),
    ) -> None:  # fmt: skip
        self.bag, self.temporary, self._log = folder / "bag", folder / "tmp", folder / "live.log"
        self.temporary.mkdir()
        command = [sys.executable, "-m", "teleop_core.cli", "live", "--out", str(self.bag)]
        command += ["--duration", f"{duration}", "--scenario", "coarse_box", *arguments]
        command += [word for setting in QUICK for word in ("--set", setting)]
        with self._log.open("wb") as log:
            self.process = subprocess.Popen(
                command, stdin=subprocess.DEVNULL, stdout=log, stderr=log,
                env=os.environ | {"TMPDIR": str(self.temporary)} | dict(env or {}),
                preexec_fn=lambda: [signal.signal(n, signal.SIG_IGN) for n in ignores],  # noqa: PLW1509
            )  # fmt: skip

    @property
    def text(self) -> str:
        """What it has written so far."""
        return self._log.read_text(errors="replace")

    def wait_text(self, text: str, timeout: float = 120.0) -> None:
        """Wait until it has written a text."""

        def written() -> bool:
            assert self.process.poll() is None or text in self.text, self.text
            return text in self.text

        wait_until(written, f"{text!r} of teleop live", timeout)

    def nodes(self, name: str = "") -> list[psutil.Process]:
        """Processes of its nodes, or those of one."""
        found = psutil.Process(self.process.pid).children()
        return [process for process in found if not name or name in process.cmdline()]

    def signal(self, number: int) -> list[psutil.Process]:
        """Send a signal to the command alone; returns its nodes."""
        nodes = self.nodes()
        self.process.send_signal(number)
        return nodes

    def wait(self, timeout: float = 60.0) -> int:
        """Exit code."""
        return self.process.wait(timeout)

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
    deadline = time.monotonic() + timeout
    while not (result := condition()):
        assert time.monotonic() < deadline, f"not within {timeout} s: {what}"
        time.sleep(0.01)
    return result


def are_gone(processes: list[Any]) -> bool:
    """Whether processes have ended."""
    return all(not p.is_running() or p.status() == psutil.STATUS_ZOMBIE for p in processes)
