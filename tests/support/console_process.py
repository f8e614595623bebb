"""Console process: ``teleop console`` as people start it."""

import re
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

from browser import until
from page_client import TOKEN

STARTS = 180.0  # s; kernels may have to be compiled
ENDS = 120.0  # s; a session gives its nodes 35 to end in order, then its recorder as many


class ConsoleProcess:
    """The command as a process; what it says is in ``text``, where its page is in ``url``.

    Works in ``folder``; ``arguments`` are those of the command.
    """

    def __init__(self, folder: Path, *arguments: object) -> None:
        self.folder, self._log = folder, folder / "console.log"
        command = [sys.executable, "-m", "teleop_core.commands.cli", "console", *map(str, arguments)]
        with self._log.open("wb") as log:
            self.process = subprocess.Popen(
                [*command, "--port", "0", "--no-browser", "--token", TOKEN], stdout=log, stderr=log, cwd=folder
            )
        told: Any = until(lambda: re.search(r"console at (http://\S+);", self.text), "an address", STARTS)
        self.url = told[1]

    @property
    def text(self) -> str:
        """What it has said so far."""
        return self._log.read_text(errors="replace")

    def end(self) -> int:
        """Exit code after Ctrl-C; one that does not end is killed, and has failed."""
        if self.process.poll() is None:
            self.process.send_signal(signal.SIGINT)
        try:
            return self.process.wait(ENDS)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait()
            raise
