"""Starter: a process that has loaded all modules that nodes need, and starts each node as a copy of the starter.

Python, NumPy, the middleware and a node's kernels take a second of processor time and 100 MB to load. A copy of a
process that has loaded them begins at once, and shares that memory as long as it does not write to it. The starter
itself does not use the middleware and has a single thread, so that it can be copied at any time.

The starter receives commands over one socket: each message names the program to start and contains the files for the
new process. Each message also contains a second socket, over which the starter returns the process number and, later,
the exit code. The starter ends when the first socket is closed; the processes that it started continue.
"""

import faulthandler
import gc
import inspect
import json
import os
import select
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import time
import traceback
from collections.abc import Mapping, Sequence
from contextlib import suppress
from importlib import import_module
from typing import IO, Any, cast

from setproctitle import setproctitle

from teleop_core.base.errors import SessionError

NODE = "teleop_core.nodes.start:main"
"""Function that runs a node: it has no arguments and reads ``sys.argv``."""
START_TIMEOUT = 180.0
"""Time without a report after which a starting process is given up [s]."""
LOST = 255
"""Exit code of a process whose starter ended earlier, so that the true exit code is unknown."""
_KIND = socket.SOCK_SEQPACKET  # messages stay whole, and the end is detected
_LARGEST = 1 << 20  # largest size of a message [bytes]
_TELLS = 0.1  # time between two reports while loading [s]


class Starter:
    """Starts processes whose modules are already loaded.

    The starter loads in the background; the first :meth:`start` waits for it.

    Args:
        configuration: Text of the configuration whose stages and kernels are loaded; empty: none.
        env: Environment variables of the starter.
        patience: Longest time without progress before the starter is given up [s].
    """

    def __init__(self, configuration: str, env: Mapping[str, str], patience: float = START_TIMEOUT) -> None:
        self._patience, self._last = patience, time.monotonic()
        self._line, theirs = socket.socketpair(type=_KIND)
        self._log = cast("IO[bytes]", tempfile.TemporaryFile())  # noqa: SIM115
        self._lock, self._is_ready, self.doing = threading.Lock(), False, "starting"
        with theirs, tempfile.TemporaryFile("w+", encoding="utf-8") as file:
            file.write(configuration)
            file.flush()
            numbers = (theirs.fileno(), file.fileno())
            self._process = subprocess.Popen(
                [sys.executable, "-m", __name__, *map(str, numbers)],
                pass_fds=numbers,
                stdin=subprocess.DEVNULL,
                stdout=self._log,
                stderr=self._log,
                env=dict(env),
                start_new_session=True,
            )

    @property
    def pid(self) -> int:
        """Process id."""
        return self._process.pid

    def is_ready(self, timeout: float) -> bool:
        """Whether the starter has loaded; waits at most ``timeout`` [s] for its report.

        Raises:
            SessionError: The starter has ended (the error contains its output), or made no progress for too long.
        """
        while not self._is_ready and select.select([self._line], (), (), timeout)[0]:
            word = self._line.recv(_LARGEST).decode()
            if not word:
                self._process.wait()
                text = os.pread(self._log.fileno(), 20_000, 0).decode(errors="replace").strip()
                code = self._process.returncode
                raise SessionError(f"the starter of the nodes ended with {code}: {text}")
            if word != self.doing:
                self._last = time.monotonic()
            self._is_ready, self.doing = word == "ready", word
            timeout = 0.0
        if not self._is_ready and time.monotonic() - self._last > self._patience:
            raise SessionError(f"the common start of the nodes made no progress for {self._patience:g} s: {self.doing}")
        return self._is_ready

    def start(
        self, command: Sequence[str], env: Mapping[str, str], files: Mapping[str, int], main: str = ""
    ) -> "Started":
        """Start a process in its own session, with empty standard input.

        Args:
            command: Command of the process, as in ``sys.argv``.
            env: Environment variables of the process.
            files: Files of the process: ``out`` and ``err`` for its output, and others. Names in angle brackets
                (``<parameters>``) in ``command`` and ``env`` are replaced by the file descriptors.
            main: ``module:function`` that runs in the copy; empty: the program in ``command`` replaces the copy.

        Raises:
            SessionError: The starter has ended, or made no progress for too long.
        """
        while not self.is_ready(1.0):
            pass
        request = {
            "command": list(command),
            "env": dict(env),
            "files": list(files),
            "main": main,
            "folder": os.getcwd(),
        }
        ours, theirs = socket.socketpair(type=_KIND)
        try:
            with theirs, self._lock:
                numbers = [theirs.fileno(), *files.values()]
                socket.send_fds(self._line, [json.dumps(request).encode()], numbers)
            return Started(ours)
        except OSError as error:
            ours.close()
            raise SessionError(f"the starter of the nodes has ended: {error}") from error

    def __enter__(self) -> "Starter":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """End the starter; the processes that it started continue."""
        self._line.close()
        self._process.terminate()  # the starter may be loading
        self._process.wait()
        self._log.close()


class Started:
    """A process that a :class:`Starter` started, with the interface of :class:`subprocess.Popen`.

    Args:
        line: Socket on which the starter reports about the process.

    Attributes:
        pid: Process id.
        returncode: Exit code; None while the process runs; minus the signal number if a signal ended it.
    """

    def __init__(self, line: socket.socket) -> None:
        self._line = line
        self.returncode: int | None = None
        text = line.recv(64)
        if not text:
            raise OSError("it told nothing of the process")
        self.pid = int(text)

    def poll(self) -> int | None:
        """Exit code; None while the process runs."""
        return self._look(0.0)

    def wait(self, timeout: float | None = None) -> int:
        """Wait for the end of the process and return its exit code.

        Raises:
            subprocess.TimeoutExpired: The process still runs after ``timeout`` [s].
        """
        code = self._look(timeout)
        if code is None:
            raise subprocess.TimeoutExpired(str(self.pid), timeout or 0.0)
        return code

    def _look(self, timeout: float | None) -> int | None:
        if self.returncode is None and select.select([self._line], (), (), timeout)[0]:
            self.returncode = int(self._line.recv(64) or LOST)
            self._line.close()
        return self.returncode

    def send_signal(self, number: int) -> None:
        """Send a signal to the process, unless the process has ended."""
        if self.poll() is None:
            with suppress(ProcessLookupError):  # the process has ended, and the starter will report this soon
                os.kill(self.pid, number)

    def terminate(self) -> None:
        """Ask the process to end."""
        self.send_signal(signal.SIGTERM)

    def kill(self) -> None:
        """End the process at once."""
        self.send_signal(signal.SIGKILL)


# -- in the process of the starter ---------------------------------------------------------------


class _Copies:
    """Work of the starter's process, after it has loaded.

    Args:
        line: Socket that receives the commands.
    """

    def __init__(self, line: socket.socket) -> None:
        self._line = line
        self._told: dict[int, socket.socket] = {}
        self._ended, self._wakes = os.pipe()
        os.set_blocking(self._wakes, False)
        signal.set_wakeup_fd(self._wakes, warn_on_full_buffer=False)
        signal.signal(signal.SIGCHLD, lambda *_: None)

    def serve(self) -> None:
        """Start the requested processes and report their ends, until the socket is closed."""
        self._line.send(b"ready")
        while True:
            waited: list[int] = [self._line.fileno(), self._ended]
            ready = select.select(waited, (), ())[0]
            if self._ended in ready:
                os.read(self._ended, 4096)
                self._tell_ends()
            if waited[0] in ready:
                data, files, _, _ = socket.recv_fds(self._line, _LARGEST, 32)
                if not data:
                    return
                self._copy(json.loads(data), files)

    def _tell_ends(self) -> None:
        while self._told:
            pid, status = os.waitpid(-1, os.WNOHANG)
            if not pid:
                return
            with self._told.pop(pid) as line:
                _tell(line, str(os.waitstatus_to_exitcode(status)))

    def _copy(self, request: dict[str, Any], files: list[int]) -> None:
        line = socket.socket(fileno=files[0])
        pid = os.fork()
        if not pid:
            signal.set_wakeup_fd(-1)
            signal.signal(signal.SIGCHLD, signal.SIG_DFL)
            for other in (self._line, line, *self._told.values()):
                other.close()
            os.close(self._ended)
            os.close(self._wakes)
            _become(request, dict(zip(request["files"], files[1:], strict=True)))
        for number in files[1:]:
            os.close(number)
        self._told[pid] = line
        _tell(line, str(pid))


def _tell(line: socket.socket, text: str) -> None:
    try:
        line.send(text.encode())
    except OSError:  # the receiver has ended
        return


def _become(request: dict[str, Any], files: dict[str, int]) -> None:
    """Become the requested process; does not return."""
    code = 1
    try:
        os.setsid()
        os.chdir(request["folder"])
        os.dup2(files.pop("out"), 1)
        os.dup2(files.pop("err"), 2)

        def filled(text: str) -> str:
            for name, number in files.items():
                text = text.replace(f"<{name}>", str(number))
            return text

        command = [filled(word) for word in request["command"]]
        env = {name: filled(text) for name, text in request["env"].items()}
        for number in files.values():
            os.set_inheritable(number, True)
        if not request["main"]:
            signal.signal(signal.SIGPIPE, signal.SIG_DFL)
            os.execvpe(command[0], command, env)
        module, _, function = request["main"].partition(":")
        # Before the environment changes: the memory of the process title is found by the position of the environment.
        setproctitle(" ".join([sys.executable, "-m", module.removesuffix(".start"), *command[1:]]))
        if env.get("PYTHONFAULTHANDLER"):
            faulthandler.enable()
        os.environ.clear()
        os.environ.update(env)
        sys.argv[:] = command
        code = int(getattr(import_module(module), function)() or 0)
    except SystemExit as error:
        code = error.code if isinstance(error.code, int) else int(error.code is not None)
    except BaseException:  # any exception: this process ends here and reports the reason
        traceback.print_exc()
    finally:
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(code)


def _load(configuration: str) -> None:
    """Load the modules and kernels that a session's nodes use. A failure is reported later, by the node concerned."""
    from teleop_core.bags.ros_types import typestore
    from teleop_core.base.own_parts import load_own_parts
    from teleop_core.graph.layers import parse_text
    from teleop_core.graph.signals import DT
    from teleop_core.middleware.ros_type_support import load_type_support
    from teleop_core.nodes import recorder, start, teleop_session  # noqa: F401
    from teleop_core.nodes.making import node_class
    from teleop_core.nodes.streams import message_type
    from teleop_core.session.configuration import Configuration
    from teleop_core.session.model import Model

    if not configuration:
        return
    load_own_parts()
    typestore()
    inspect.getmodule(inspect.currentframe())  # rclpy needs this for a node's first log line
    loaded = Configuration.from_layers([parse_text(configuration, "the configuration")])
    for member in loaded.graph.members:
        node_class(member.stage)
        load_type_support([message_type(topic.ros_type) for topic in member.stage.ports])
        try:
            member.stage.run(loaded.groups[member.name], DT).load()
        except Exception:  # an error of a part, of this package or of a user: its node will get the same error
            traceback.print_exc()
    Model(loaded)


def _loaded(configuration: str, line: socket.socket) -> None:
    """Load, and report progress meanwhile; afterwards no other thread is running."""
    from teleop_core.kernels.progress import in_work

    is_done = threading.Event()

    def tell() -> None:
        while not is_done.wait(_TELLS):
            _tell(line, in_work() or "loading")

    thread = threading.Thread(target=tell)
    thread.start()
    try:
        _load(configuration)
    finally:
        is_done.set()
        thread.join()


def main() -> None:
    """Load, then start the requested processes: ``starter LINE CONFIGURATION``; both are file descriptors."""
    line = socket.socket(fileno=int(sys.argv[1]))
    line.set_inheritable(False)
    with open(int(sys.argv[2]), encoding="utf-8") as file:
        file.seek(0)
        configuration = file.read()
    _loaded(configuration, line)
    gc.collect()
    gc.freeze()  # the garbage collector of a copy skips these objects, so that their memory stays shared
    _Copies(line).serve()


if __name__ == "__main__":
    main()
