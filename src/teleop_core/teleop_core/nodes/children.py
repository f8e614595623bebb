"""Children: the processes of a live session, each one node, from start to end."""

import atexit
import os
import random
import signal
import socket
import subprocess
import sys
from collections import deque
from collections.abc import Iterable
from pathlib import Path

from teleop_core.errors import SessionError
from teleop_core.nodes.discovery import announce_often

_PATIENCE = ((signal.SIGINT, 10.0), (signal.SIGTERM, 5.0), (signal.SIGKILL, 5.0))


def environment() -> dict[str, str]:
    """Environment of the nodes: this machine only, and a domain of their own, if nothing is said.

    What concerns this process as well is set here too.
    """
    os.environ.setdefault("AMENT_PREFIX_PATH", sys.prefix)
    os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    announce_often()
    return dict(os.environ) | {"ROS_DOMAIN_ID": os.environ.get("ROS_DOMAIN_ID") or free_domain()}


_reserved: deque[socket.socket] = deque(maxlen=8)


@atexit.register
def _release() -> None:
    while _reserved:
        _reserved.pop().close()


def free_domain() -> str:
    """Number of a DDS domain in which nobody takes part on this machine.

    The first participant of domain d listens on UDP port 7410 + 250 d (DDSI-RTPS 2.5, 9.6.1.1).
    Until it does, a TCP socket on the same number keeps other sessions away.
    """
    for domain in random.SystemRandom().sample(range(1, 102), 101):
        port = 7410 + 250 * domain
        mark = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
        try:
            mark.bind(("127.0.0.1", port))
            with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
                probe.bind(("", port))
        except OSError:
            mark.close()
            continue
        if len(_reserved) == _reserved.maxlen:
            _reserved.popleft().close()
        _reserved.append(mark)
        return str(domain)
    raise SessionError("all ROS domains of this machine are in use; set ROS_DOMAIN_ID")


class Child:
    """Process of one node.

    Args:
        name: Stage with its namespace, or a whole session.
        parameters: Parameter file.
        folder: Where its output is kept.
        env: Its environment.
    """

    def __init__(self, name: str, parameters: Path, folder: Path, env: dict[str, str]) -> None:
        arm, _, stage = name.rpartition("/")
        self.name, self._log = name, folder / f"{name.replace('/', '.')}.log"
        command = [sys.executable, "-m", "teleop_core.nodes", stage]
        command += ["--ros-args", "--params-file", str(parameters)]
        if arm:
            command += ["-r", f"__ns:=/{arm}"]
        with self._log.open("wb") as log:
            # A session of its own: Ctrl-C on the terminal reaches us, and we end it in order.
            self._process = subprocess.Popen(
                command, stdin=subprocess.DEVNULL, stdout=log, stderr=log, env=env,
                start_new_session=True,
            )  # fmt: skip

    @property
    def pid(self) -> int:
        """Process id."""
        return self._process.pid

    def check(self) -> None:
        """Make sure that it runs.

        Raises:
            SessionError: It has ended; says how, with what it wrote last.
        """
        code = self._process.poll()
        if code is not None:
            raise SessionError(f"{self.name} ended with {_in_words(code)}{self.last_words()}")

    def last_words(self) -> str:
        """Last lines that it wrote, each indented on a line of its own."""
        lines = self._log.read_text(errors="replace").splitlines()[-5:]
        return ":" + "".join(f"\n  {line}" for line in lines) if lines else "; it wrote nothing"

    def ask(self) -> None:
        """Ask it to end, without waiting."""
        if self._process.poll() is None:
            self._process.send_signal(signal.SIGINT)

    def end(self) -> int:
        """End it, more and more firmly; returns its exit code."""
        for number, patience in _PATIENCE:
            if self._process.poll() is None:
                self._process.send_signal(number)
            try:
                return self._process.wait(patience)
            except subprocess.TimeoutExpired:
                continue
        return self._process.wait()


def _in_words(code: int) -> str:
    return f"exit code {code}" if code >= 0 else f"signal {signal.Signals(-code).name}"


def end_all(children: Iterable[Child]) -> None:
    """End some processes side by side."""
    pending = list(children)
    for child in pending:
        child.ask()
    for child in pending:
        child.end()
