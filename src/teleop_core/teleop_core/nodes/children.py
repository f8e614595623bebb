"""Children: starts, watches and ends the processes of a live session."""

import atexit
import os
import random
import signal
import socket
import subprocess
import sys
import tempfile
from collections import deque
from collections.abc import Iterable, Sequence
from contextlib import suppress
from typing import IO, Any, cast

from teleop_core.base.errors import SessionError
from teleop_core.middleware.domains import VARIABLE, checked_domain, domain_of_environment
from teleop_core.nodes import parent
from teleop_core.nodes.chances import Chances
from teleop_core.nodes.discovery import choose_transport
from teleop_core.nodes.start import SESSION
from teleop_core.nodes.starter import NODE, Starter

# Signals that end a process, with the wait after each [s]. SIGINT is not used: a process that a shell started in the
# background ignores SIGINT, and so do its children.
_PATIENCE = ((signal.SIGTERM, 30.0), (signal.SIGKILL, 5.0))
# signals that end a process that is suspended, with the wait after each [s]
_STILL_PATIENCE = ((signal.SIGTERM, 2.0), (signal.SIGKILL, 5.0))
_TROUBLE = ("[ERROR]", "[FATAL]", "Traceback")
_STILL = 3.0  # longest silence of a process at work [s]; a separate thread reports ten times a second
_STILL_STARTING = 60.0  # longest silence of a starting process [s]; the interpreter may load from a cold disk


def environment(domain: int | None = None) -> dict[str, str]:
    """Environment variables of the nodes. By default, nodes communicate within this machine only, in a free domain.

    Variables that this process needs too are also set in its own environment. The domain is not set there, because one
    process may run several sessions.

    Args:
        domain: ROS domain; None for the domain in ``ROS_DOMAIN_ID``, or for a free domain if this is not set.

    Raises:
        ParameterError: The domain is not the number of a domain.
    """
    given = domain_of_environment() if domain is None else checked_domain("domain", domain)
    os.environ.setdefault("AMENT_PREFIX_PATH", sys.prefix)
    choose_transport()
    return dict(os.environ) | {VARIABLE: free_domain() if given is None else str(given)}


_reserved: deque[socket.socket] = deque()
_KEPT = 8
"""Largest number of sockets that reserve domains. A deque of bounded length would drop them without closing them."""


@atexit.register
def _release() -> None:
    while _reserved:
        _reserved.pop().close()


def free_domain() -> str:
    """Number of a DDS domain without participants on this machine.

    The first participant of domain d listens on UDP port 7410 + 250 d (DDSI-RTPS 2.5, 9.6.1.1). Until then, a TCP
    socket with the same port number prevents other sessions from choosing the domain.
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
        _reserved.append(mark)
        while len(_reserved) > _KEPT:
            _reserved.popleft().close()
        return str(domain)
    raise SessionError("all ROS domains of this machine are in use; set ROS_DOMAIN_ID")


class Child:
    """Process of one node, or of a whole session.

    The child ends in order when this process ends for any reason. It leaves nothing on the disk: its output goes to a
    file without a name.

    Args:
        name: Name of a stage with its namespace, or of a whole session.
        parameters: Open parameter file.
        env: Environment variables of the process.
        starter: Starter that starts the process.
        command: Command of the process; by default, the process runs the node ``name``.
        main: ``module:function`` that runs the command in a copy of the starter; empty: a program runs it.
        nodes: Nodes in the process. If there are several, or one with another name, the process is one side of a
            session.

    Attributes:
        name: As given.
        doing: Activity that the process reports: starting, compiling kernels, at work, ending.
        is_told: Whether the end of the process has already been reported.
    """

    def __init__(
        self,
        name: str,
        parameters: IO[Any],
        env: dict[str, str],
        starter: Starter,
        command: Sequence[str] = (),
        nodes: Sequence[str] = (),
        main: str = "",
    ) -> None:
        arm, _, stage = name.rpartition("/")
        self.name, self.doing = name, "starting"
        self.is_told = self._is_asked = False
        self._line, theirs = socket.socketpair()
        self._line.setblocking(False)
        self._text = b""
        # The system closes this file when this process ends, because no other process opens it by name.
        self._log = cast("IO[bytes]", tempfile.TemporaryFile())  # noqa: SIM115
        is_side = bool(nodes) and tuple(nodes) != (name,)
        ours = [SESSION, *nodes] if is_side else [stage]
        ours += ["--ros-args", "--params-file", "/dev/fd/<parameters>"]
        ours += ["-r", f"__ns:=/{arm}"] if arm and not is_side else []
        log = self._log.fileno()
        files = {"out": log, "err": log, "line": theirs.fileno(), "parameters": parameters.fileno()}
        with theirs:
            variables = env | {parent.VARIABLE: "<line>"}
            self._process = starter.start(
                command or ["teleop_core.nodes", *ours], variables, files, main=main if command else NODE
            )
        self._chances, self._silent = Chances(self._process.pid), 0.0

    @property
    def pid(self) -> int:
        """Process id."""
        return self._process.pid

    @property
    def is_running(self) -> bool:
        """Whether the process is still running."""
        return self._process.poll() is None

    def check(self) -> None:
        """Make sure that the child runs and reports.

        Raises:
            SessionError: The child has ended or hangs. The error contains the reason and its last output.
        """
        code = self._process.poll()
        if code is not None:
            self.is_told = True
            raise SessionError(f"{self.name} ended with {_in_words(code)}{self.last_words()}")
        if silence := self._silence():
            text = f"{self.name} does not run: no sign of life from its process for {silence:.0f} s"
            raise SessionError(text + self.last_words())

    def _silence(self) -> float:
        """Processor time in which the child could have reported but did not [s]; 0 while its silence is normal."""
        with suppress(OSError):
            while came := self._line.recv(4096):
                self._text += came
        *words, self._text = self._text.split(b"\n")
        self._silent += self._chances.look()
        if words:
            self._silent, self.doing = 0.0, words[-1].decode()
        patience = _STILL if self.doing in {"at work", "ending", "leaving"} else _STILL_STARTING
        return self._silent if self._silent > patience else 0.0

    def last_words(self) -> str:
        """Error lines of the child, or, if there are none, its last lines of output, each indented."""
        size = os.fstat(self._log.fileno()).st_size
        tail = os.pread(self._log.fileno(), 20_000, max(0, size - 20_000))
        lines = tail.decode(errors="replace").splitlines()
        wrong = [number for number, line in enumerate(lines) if line.startswith(_TROUBLE)]
        if wrong:
            lines = [line for line in lines[wrong[0] :] if not line.startswith("[INFO]")]
            lines = lines if len(lines) <= 16 else [*lines[:4], "…", *lines[-11:]]
        else:
            lines = lines[-5:]
        return ":" + "".join(f"\n  {line}" for line in lines) if lines else "; it wrote nothing"

    def ask(self) -> None:
        """Ask the process to end, without waiting."""
        if self._process.poll() is None and not self._is_asked:
            self._is_asked = True  # a second signal would only disturb its end
            self._process.send_signal(signal.SIGTERM)

    def end(self) -> int:
        """End the child with stronger and stronger signals; returns its exit code."""
        for number, patience in _STILL_PATIENCE if self._silence() else _PATIENCE:
            if number == signal.SIGTERM:
                self.ask()
            elif self._process.poll() is None:
                self._process.send_signal(number)
            try:
                return self._process.wait(patience)
            except subprocess.TimeoutExpired:
                continue
        return self._process.wait()

    def close(self) -> None:
        """Close the child's output and its socket, after the child has ended."""
        self._line.close()
        self._log.close()


def _in_words(code: int) -> str:
    return f"exit code {code}" if code >= 0 else f"signal {signal.Signals(-code).name}"


def end_all(children: Iterable[Child]) -> list[str]:
    """End several processes in parallel; returns texts about problems of their ends."""
    pending = list(children)
    for child in pending:
        child.ask()
    failures = []
    for child in pending:
        code = child.end()
        if code and not child.is_told:
            failures.append(f"{child.name} ended with {_in_words(code)}{child.last_words()}")
        child.close()
    return failures
