"""Real nodes as processes, and a peer that talks to them over real topics."""

import atexit
import io
import os
import re
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, contextmanager
from functools import cache
from pathlib import Path
from typing import Any

import pytest
import yaml
from rclpy.context import Context
from rclpy.node import Node
from rich.console import Console

import patience
from middleware_faults import check_end
from peers import JOINTS as JOINTS  # noqa: PLC0414  for tests
from peers import TIMEOUT, AnyPeer
from peers import Listener as Listener  # noqa: PLC0414
from present import present
from teleop_core.bags.reader import Bag
from teleop_core.graph.graph import BUILT_IN, RECORDER_NAME
from teleop_core.middleware import ros, ros_node
from teleop_core.nodes.children import environment, free_domain
from teleop_core.nodes.crews import Processes
from teleop_core.nodes.interrupt import Interrupt
from teleop_core.nodes.live import live
from teleop_core.nodes.observer import ReportReader
from teleop_core.nodes.starter import NODE, Started, Starter
from teleop_core.robots import load_robot
from teleop_core.session.configuration import Configuration, configure

SESSION_TIMEOUT = 300.0
"""Of a whole session, whose kernels may have to be compiled first [s]."""


def wait_until(condition: Callable[[], Any], what: str, timeout: float = TIMEOUT) -> Any:
    """Result of ``condition`` as soon as it is true."""
    return patience.wait_until(condition, what, timeout, pause=0.002)


@cache
def _starter() -> Starter:
    """Who starts the nodes of all tests of this process; it ends with it."""
    made = Starter(configure("coarse_box").text(), environment())
    atexit.register(made.close)
    return made


def start_node(
    words: list[str], env: Mapping[str, str], log: Path, *, is_fresh: bool = False
) -> "subprocess.Popen[bytes] | Started":
    """Start a node as ``teleop live`` does, or as a user does, in a fresh Python.

    Args:
        words: Name of the node and its arguments.
        env: Its environment.
        log: File for what it writes to standard error.
        is_fresh: Whether its Python is to begin with this environment.
    """
    with log.open("wb") as file:
        if is_fresh:
            command = [sys.executable, "-m", "teleop_core.nodes", *words]
            return subprocess.Popen(command, stderr=file, env=env)
        with open(os.devnull, "wb") as nowhere:
            files = {"out": nowhere.fileno(), "err": file.fileno()}
            return _starter().start(["teleop_core.nodes", *words], env, files, main=NODE)


class NodeProcess:
    """One node as a user starts it, in a namespace if ``arm`` is not empty."""

    def __init__(
        self,
        name: str,
        parameters: dict[str, Any],
        domain: str,
        folder: Path,
        arm: str = "",
        env: Mapping[str, str] | None = None,
    ) -> None:
        self.name = f"{arm}/{name}" if arm else name
        file = folder / f"{name}_{time.monotonic_ns()}.yaml"
        file.write_text(yaml.safe_dump({name: {"ros__parameters": parameters}}))
        words = [name, "--ros-args", "--params-file", str(file)]
        words += ["-r", f"__ns:=/{arm}"] if arm else []
        named = {"ROS_DOMAIN_ID": domain, "PYTHONFAULTHANDLER": "1", **(env or {})}
        self.stderr = file.with_suffix(".log")
        is_fresh = bool(env) or "PYTHONPATH" in os.environ  # which a Python reads as it begins
        self.process = start_node(words, environment() | named, self.stderr, is_fresh=is_fresh)

    def end(self, number: int = signal.SIGINT) -> int:
        """Send a signal; returns the exit code as :meth:`wait` does."""
        self.process.send_signal(number)
        return self.wait()

    def wait(self, timeout: float = TIMEOUT) -> int:
        """Exit code of the process.

        Raises:
            MiddlewareCrashError: That is how it ended.
        """
        wait_until(lambda: self.process.poll() is not None, f"end of {self.name}", timeout)
        code = present(self.process.returncode)
        check_end(self.name, code, self.stderr.read_text(errors="replace"))
        return code


class Peer(AnyPeer):
    """A ROS node of the test beside the nodes under test, on a domain of its own."""

    def __init__(self, folder: Path) -> None:
        super().__init__()
        self.domain, self._folder = free_domain(), folder
        environment()
        self.context = Context()
        self.context.init(args=[], domain_id=int(self.domain))
        self.node = Node("peer", context=self.context, use_global_arguments=False, enable_rosout=False)
        self.platform, self.ros = ros.RosPlatform(self.context), ros_node.RosNode(self.node)
        self.executor = self.platform.executor()
        self.executor.add_node(self.ros)
        self.observer = ReportReader(int(self.domain))

    def close(self) -> None:
        """End the nodes, then leave: a participant that goes while others talk to it can crash.

        Nodes are asked to end: a process that is killed leaves shared memory behind.
        """
        running = [node.process for node in self.nodes if node.process.poll() is None]
        for process in running:
            process.terminate()
        for process in running:
            try:
                process.wait(20)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()
        self.observer.close()
        self.executor.shutdown()
        self.node.destroy_node()
        self.context.try_shutdown()

    def launch(self, name: str, parameters: dict[str, Any], arm: str, env: Mapping[str, str] | None) -> NodeProcess:
        return NodeProcess(name, parameters, self.domain, self._folder, arm, env)

    def until(self, condition: Callable[[], Any], what: str, timeout: float) -> Any:
        return wait_until(condition, what, timeout)


@contextmanager
def _made_peer() -> Any:
    with tempfile.TemporaryDirectory() as folder:
        made = Peer(Path(folder))
        try:
            yield made
        finally:
            made.close()


@pytest.fixture
def peer() -> Any:
    """A peer on a ROS domain that nobody else uses; the nodes it started end with the test."""
    with _made_peer() as made:
        yield made


@pytest.fixture(scope="module")
def common_peer() -> Iterator[Peer]:
    """A peer that the tests of a file share."""
    with _made_peer() as made:
        yield made


@contextmanager
def _composed(peer: Peer, folder: Path, namespace: str, parameters: dict[str, dict[str, Any]]) -> Any:
    common = {
        "recorder": {"out": str(folder / "bag")},
        "slave": {"start": load_robot("rcrt1").home.tolist()},  # follows at once
    }
    file = folder / "session.yaml"
    groups = {name: {"ros__parameters": p} for name, p in (common | parameters).items()}
    file.write_text(yaml.safe_dump(groups))
    words = ["teleop_session", "--ros-args", "--params-file", str(file)]
    words += ["-r", f"__ns:=/{namespace}"] if namespace else []
    env = environment() | {"ROS_DOMAIN_ID": peer.domain}
    process = start_node(words, env, folder / "session.log")
    try:
        for name in (*BUILT_IN, RECORDER_NAME):
            peer.wait_state(f"{namespace}/{name}" if namespace else name, "active")
        yield process
    finally:
        if process.poll() is None:
            process.terminate()
        try:
            process.wait(TIMEOUT)
        finally:
            process.kill()


@pytest.fixture
def compose(peer: Peer, tmp_path: Path) -> Iterator[Callable[..., object]]:
    """Starter of a composed session with parameters; all its nodes are active, its arm at home."""
    with ExitStack() as stack:

        def start(namespace: str = "", **parameters: dict[str, Any]) -> "subprocess.Popen[bytes] | Started":
            return stack.enter_context(_composed(peer, tmp_path, namespace, parameters))

        yield start


@pytest.fixture(scope="module")
def composed_session(tmp_path_factory: pytest.TempPathFactory) -> Callable[..., object]:
    """Composed session that tests of a file share, as a context: peer, process, recording."""

    @contextmanager
    def run(**parameters: Any) -> Iterator[tuple[Peer, "subprocess.Popen[bytes]", Path]]:
        folder = tmp_path_factory.mktemp("session")
        with _made_peer() as peer, _composed(peer, folder, "", parameters) as process:
            yield peer, process, folder / "bag"

    return run


def run_until(
    peer: Peer,
    until: Callable[[], Any],
    out: Path,
    configuration: Configuration,
    processes: Processes = Processes.SIDES,
) -> tuple[Bag, str]:
    """Run a live session until something is so; its recording, and what was shown of it.

    On a busy machine nobody knows what a session comes to in a time: it lasts until it has come to
    what its test is about. The peer's domain must be that of the environment.
    """
    show: Any
    show, interrupt = Console(file=io.StringIO(), width=200), Interrupt()
    with ThreadPoolExecutor() as pool:
        session = pool.submit(live, configuration, out, show, processes=processes, interrupt=interrupt)

        def reached() -> Any:
            if session.done():
                session.result()
                raise AssertionError(f"it ended before: {show.file.getvalue()}")
            # Before its first line of progress it is not ready to be ended well.
            return until() and re.search(r"\d/\d+ s  ", show.file.getvalue())

        try:
            wait_until(reached, "what the session is to come to", SESSION_TIMEOUT)
        finally:
            interrupt.ask()
    session.result()
    return Bag(out), show.file.getvalue()


@pytest.fixture
def session_until(peer: Peer, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[..., tuple[Bag, str]]:
    """Runner of a live session in the peer's domain, as :func:`run_until` says."""
    monkeypatch.setenv("ROS_DOMAIN_ID", peer.domain)

    def run(configuration: Configuration, until: Callable[[], Any], **options: Processes) -> tuple[Bag, str]:
        return run_until(peer, until, tmp_path / "bag", configuration, **options)

    return run
