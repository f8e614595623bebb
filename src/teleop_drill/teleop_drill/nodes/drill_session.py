"""Processes of a drill: the nodes of one session; the drill may break and restart each of them."""

import os
import resource
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import IO, Any

from teleop_core.base.errors import SessionError
from teleop_core.base.own_parts import VARIABLE
from teleop_core.base.plain_yaml import written
from teleop_core.graph.graph import RECORDER_NAME
from teleop_core.middleware.platform import Platform
from teleop_core.middleware.ros import ROS
from teleop_core.nodes.children import Child, end_all, environment, free_domain
from teleop_core.nodes.interrupt import Interrupt
from teleop_core.nodes.live import session_parameters
from teleop_core.nodes.observer import ReportReader
from teleop_core.nodes.start import SESSION as SESSION_NODE
from teleop_core.nodes.starter import START_TIMEOUT, Starter
from teleop_core.session.configuration import Configuration
from teleop_drill.drill import inside
from teleop_drill.drill.exercise import Master
from teleop_drill.nodes.drill_site import Steering

_NEVER_NS = 2**62
_HAND, _MASTER = "operator", "haptic_master"
SIMULATOR = "slave_sim"
"""Node that foreign drives replace."""
ARM = "arm"
"""Process that the drives command; it is started first, and the drill does not break it."""
_BUSY = "while True: pass"
_BYSTANDER = "from teleop_drill.nodes.drill_tap import stand_by; stand_by()"
_MIDDLEWARE = ("FASTRTPS_", "FASTDDS_", "ROS_AUTOMATIC", "ROS_LOCALHOST", "ROS_STATIC")


class DrillSession:
    """The nodes of a session, in processes that this process starts; no other processes are affected.

    Args:
        configuration: Configuration of the session.
        folder: Folder of the recordings.
        env: Environment of the processes.
        observer: Node that receives the reports of the session.
        is_composed: Whether all nodes share one process.
        master: Kind of operator that moves the hand.
        foreign: Command lines of processes of other software, by name: drives that replace the simulator, and the arm
            that these drives command.

    Attributes:
        recordings: Recordings so far, the present recording last.
    """

    def __init__(
        self, configuration: Configuration, folder: Path, env: dict[str, str], observer: ReportReader,
        *, is_composed: bool, master: Master, foreign: Mapping[str, Sequence[str]],
        interrupt: Interrupt,
    ) -> None:  # fmt: skip
        self._configuration, self._folder, self._env = configuration, folder, env
        self._observer, self._is_composed, self._interrupt = observer, is_composed, interrupt
        self._has_device = master is Master.DEVICE
        self._foreign = {name: command for name, command in foreign.items() if command}
        self._starter = Starter("" if is_composed else configuration.text(), env)
        self._children: dict[str, Child] = {}
        self._files: list[IO[str]] = []
        self._others: list[subprocess.Popen[Any]] = []
        self._bystander: subprocess.Popen[str] | None = None
        self.recordings: list[Path] = []
        self._begun_ns: list[int] = []
        names = [member.name for member in configuration.graph.members]
        self._nodes = [n for n in names if self._has_device or n not in {_HAND, _MASTER}]

    # -- start and end ---------------------------------------------------------------------------

    def start(self) -> None:
        """Start all processes that do not run, the recorder first, and wait until all are ready.

        Raises:
            SessionError: A process ends, or is not ready within three minutes.
        """
        for crew in self._crews():
            waiting = []
            for process, nodes in crew.items():
                if not self.is_running(process):
                    waiting += nodes
                    self._launch(process)
            self._await([name for name in waiting if name not in self._foreign])

    def _crews(self) -> tuple[dict[str, list[str]], ...]:
        if self._is_composed:
            return ({SESSION_NODE: [RECORDER_NAME, *self._nodes]},)
        first = [RECORDER_NAME, *([ARM] if ARM in self._foreign else [])]
        return ({name: [name] for name in first}, {name: [name] for name in self._nodes})

    def _launch(self, process: str) -> None:
        if process in {RECORDER_NAME, SESSION_NODE}:
            self.recordings.append(self._folder / f"recording_{len(self.recordings) + 1}")
            self._begun_ns.append(time.time_ns())
        # The file stays open, because processes that are started later read it too.
        file = tempfile.TemporaryFile("w+")  # noqa: SIM115
        file.write(self._parameters())
        file.flush()
        self._files.append(file)
        if process in self._children:
            self._children[process].end()
        command = self._foreign.get(process, ())
        self._children[process] = Child(process, file, self._env, self._starter, command)

    def _parameters(self) -> str:
        content = session_parameters(self._configuration, str(self.recordings[-1]))
        for name in () if self._has_device else (_HAND, _MASTER):
            content[f"/{name}"]["ros__parameters"]["autostart"] = False
        return written(content)

    def _await(self, nodes: list[str]) -> None:
        for name in nodes:
            self._observer.statuses.pop(name, None)
        deadline = time.monotonic() + START_TIMEOUT
        while not all(self._observer.is_active(name) for name in nodes):
            self._interrupt.check()
            self._observer.listen(0.05)
            self.check()
            if time.monotonic() > deadline:
                raise SessionError(f"{', '.join(nodes)}: not at work after {START_TIMEOUT:g} s")

    def check(self) -> None:
        """Check that all processes run, including foreign ones.

        Raises:
            SessionError: A process has ended; the message contains its exit code and its last output.
        """
        for child in self._children.values():
            if not child.is_running:
                child.check()

    def close(self) -> None:
        """End all processes in order."""
        for other in self._others:
            other.kill()
            other.wait()
        self._others.clear()
        for child in self._children.values():
            with suppress(ProcessLookupError):
                os.kill(child.pid, signal.SIGCONT)
        recorder = self._children.pop(RECORDER_NAME, None)
        end_all(self._children.values())
        end_all([recorder] if recorder else [])
        self._children.clear()
        self._starter.close()
        for file in self._files:
            file.close()

    def until_ns(self, recording: Path) -> int:
        """Time at which the recording after the given one began [ns]; later than all times if there is none."""
        place = self.recordings.index(recording) + 1
        return self._begun_ns[place] if place < len(self._begun_ns) else _NEVER_NS

    # -- what can be done to them ----------------------------------------------------------------

    def is_running(self, node: str) -> bool:
        """Whether the process of a node runs."""
        child = self._children.get(self._process(node))
        return child is not None and child.is_running

    def dead(self) -> list[str]:
        """Processes that have ended."""
        return [name for name in self._children if not self.is_running(name)]

    def _process(self, node: str) -> str:
        return SESSION_NODE if self._is_composed else node

    def _pid(self, node: str) -> int:
        return self._children[self._process(node)].pid

    def send(self, node: str, number: int) -> None:
        """Send a signal to a node's process."""
        os.kill(self._pid(node), number)

    def await_end(self, node: str, timeout: float) -> None:
        """Wait until a node's process has ended, for at most `timeout` [s]."""
        deadline = time.monotonic() + timeout
        while self.is_running(node) and time.monotonic() < deadline:
            time.sleep(0.01)

    def limit_files(self, node: str, room: int | None) -> None:
        """Let files of a node's process grow by at most `room` bytes; None for no limit."""
        if not self.is_running(node):
            return
        pid = self._pid(node)
        _, hard = resource.prlimit(pid, resource.RLIMIT_FSIZE)
        size = sum(file.stat().st_size for file in self.recordings[-1].glob("*.mcap"))
        soft = hard if room is None else size + room
        resource.prlimit(pid, resource.RLIMIT_FSIZE, (soft, hard))

    def hog(self) -> None:
        """Start a process on each core that only consumes processor time."""
        for _ in range(os.cpu_count() or 1):
            self._others.append(subprocess.Popen([sys.executable, "-S", "-c", _BUSY]))

    def relieve(self) -> None:
        """End the processes of :meth:`hog`."""
        while self._others:
            other = self._others.pop()
            other.kill()
            other.wait()

    def start_bystander(self) -> None:
        """Start a ROS process with the middleware's default settings that subscribes to all streams."""
        env = {k: v for k, v in self._env.items() if not k.startswith(_MIDDLEWARE)}
        self._bystander = subprocess.Popen(
            [sys.executable, "-c", _BYSTANDER], env=env, stdout=subprocess.PIPE, text=True
        )
        self._others.append(self._bystander)
        assert self._bystander.stdout is not None
        if self._bystander.stdout.readline() != "listens\n":
            raise SessionError("the bystander did not start")

    def kill_bystander(self) -> None:
        """Kill the process of :meth:`start_bystander`."""
        if self._bystander is not None:
            self._bystander.kill()
            self._bystander.wait()


class LiveSite:
    """Site of a drill on this machine, with its own ROS domain.

    Args:
        configuration: Configuration of the session.
        folder: Folder of the recordings and of the drill's own file.
        master: Kind of operator that moves the hand.
        interrupt: Object that ends a wait of the drill with KeyboardInterrupt.
        is_composed: Whether all nodes share one process.
        foreign: Command lines of processes of other software, by name.
    """

    platform: Platform = ROS

    def __init__(
        self,
        configuration: Configuration,
        folder: Path,
        master: Master,
        interrupt: Interrupt,
        *,
        is_composed: bool,
        foreign: Mapping[str, Sequence[str]],
    ) -> None:
        self.is_composed, self.master = is_composed, master
        self.interrupt = interrupt
        self._configuration, self._folder, self._foreign = configuration, folder, foreign
        self._env = environment() | {"ROS_DOMAIN_ID": free_domain()}
        if master is Master.DEVICE:
            self._env.pop(VARIABLE, None)
        self.domain = int(self._env["ROS_DOMAIN_ID"])
        file = folder / "control"
        self.control: Steering = inside.Control.make(file)
        self._env[inside.VARIABLE] = str(file)

    def load(self) -> float:
        """Load of the machine, divided by the number of processors."""
        return os.getloadavg()[0] / (os.cpu_count() or 1)

    def session(self, observer: ReportReader) -> DrillSession:
        """Return the processes of a session; the observer receives their reports."""
        return DrillSession(
            self._configuration,
            self._folder,
            self._env,
            observer,
            is_composed=self.is_composed,
            master=self.master,
            foreign=self._foreign,
            interrupt=self.interrupt,
        )
