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

import numpy as np
import pytest
import yaml
from rcl_interfaces.msg import Parameter as ParameterMessage
from rcl_interfaces.srv import SetParameters, SetParametersAtomically
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.qos import QoSProfile
from rich.console import Console

import patience
from live_process import has_recorded
from middleware_faults import MiddlewareLossError, check_end
from present import present
from teleop_core.bags.messages import discover, layout
from teleop_core.bags.reader import Bag
from teleop_core.base.parameters import specs
from teleop_core.graph.graph import BUILT_IN, RECORDER_NAME
from teleop_core.graph.topics import Topic
from teleop_core.nodes.children import environment, free_domain
from teleop_core.nodes.crews import Processes
from teleop_core.nodes.interrupt import Interrupt
from teleop_core.nodes.live import live
from teleop_core.nodes.observer import Observer
from teleop_core.nodes.quality import profile
from teleop_core.nodes.starter import NODE, Started, Starter
from teleop_core.nodes.streams import Subscription, message_type
from teleop_core.robots import load_robot
from teleop_core.session.configuration import Configuration, configure
from teleop_core.slave.slave import SlaveParameters
from teleop_core.slave.slave_sim import SlaveSimParameters

TIMEOUT = 90.0
SESSION_TIMEOUT = 300.0
"""Of a whole session, whose kernels may have to be compiled first [s]."""
JOINTS = load_robot("rcrt1").joint_names


def wait_until(condition: Callable[[], Any], what: str, timeout: float = TIMEOUT) -> Any:
    """Result of ``condition`` as soon as it is true."""
    return patience.wait_until(condition, what, timeout, pause=0.002)


class Listener:
    """What came on one topic since the test listens: stamps and values.

    The middleware keeps no more than 5000 messages for it; take some now and then.
    """

    def __init__(self, node: Node, topic: Topic) -> None:
        self.topic, self._subscription = topic, Subscription(node, topic, topic.name, 5000)
        self._layout: Any = None
        self._number = self.lost = 0
        self.stamps: list[int] = []
        self.values: list[np.ndarray] = []

    def take(self) -> int:
        """Take what has come; returns how many there are in all."""
        while (taken := self._subscription.take()) is not None:
            if self._layout is None:
                self._layout = discover(self.topic.kind, taken.data)
            number = taken.number
            self.lost += number - self._number - 1 if 0 < self._number < number else 0
            self._number = number
            stamp_ns, values = self._layout.decode_one(taken.data)
            self.stamps.append(stamp_ns)
            self.values.append(values)
        return len(self.stamps)

    def insist_on_all(self) -> None:
        """Make sure that every sample came since the first one, of the one publisher there is.

        Raises:
            MiddlewareLossError: Some did not.
        """
        self.take()
        if self.lost:
            raise MiddlewareLossError(f"{self.lost} of {self.topic.name} on the way to the test")

    def forget(self) -> None:
        """Throw away what has come so far."""
        self.take()
        self.stamps, self.values = [], []


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
        self, name: str, parameters: dict[str, Any], domain: str, folder: Path, arm: str = "",
        env: Mapping[str, str] | None = None,
    ) -> None:  # fmt: skip
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


def _is_of_arm(key: str) -> bool:
    """Whether a parameter, with double underscores for dots, is that of a simulated arm alone."""
    name = key.replace("__", ".")
    mine, its = ({spec.name for spec in specs(g)} for g in (SlaveParameters, SlaveSimParameters))
    return name in its - mine


def _is_of_hand(key: str) -> bool:
    """Whether a parameter, with double underscores for dots, is that of the operator alone."""
    return key == "patience" or key.startswith(("operator__", "buttons__"))


class Peer:
    """A ROS node of the test beside the nodes under test, on a domain of its own."""

    def __init__(self, folder: Path) -> None:
        self.domain, self._folder = free_domain(), folder
        environment()
        self.context = Context()
        self.context.init(args=[], domain_id=int(self.domain))
        self.node = Node(
            "peer", context=self.context, use_global_arguments=False, enable_rosout=False
        )
        self._executor = SingleThreadedExecutor(context=self.context)
        self._executor.add_node(self.node)
        self.observer = Observer(int(self.domain))
        self.nodes: list[NodeProcess] = []
        self._publishers: dict[str, Any] = {}

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
        self._executor.shutdown()
        self.node.destroy_node()
        self.context.try_shutdown()

    def wait(self, condition: Callable[[], Any], what: str, timeout: float = TIMEOUT) -> Any:
        """Result of ``condition`` as soon as it is true.

        Raises:
            AssertionError: It did not become true; with what each node says.
        """
        try:
            return wait_until(condition, what, timeout)
        except AssertionError as error:
            self.observer.listen(0.0)
            said = (f"{name}: {each.message}" for name, each in self.observer.statuses.items())
            raise AssertionError("\n".join([str(error), *said])) from error

    # -- nodes -----------------------------------------------------------------------------------

    def start(
        self, name: str, wait: str = "active", arm: str = "", env: Mapping[str, str] | None = None,
        has_arm: bool = True, **parameters: Any,
    ) -> NodeProcess:  # fmt: skip
        """Start a node; double underscores in names stand for dots.

        A slave starts at home unless it is told otherwise, so that it follows at once. With one
        that is to work, its simulated arm is started, which gets the parameters that are its own,
        and with a haptic master the operator who holds it.
        """
        if name == "haptic_master":
            own = {key: parameters.pop(key) for key in set(parameters) if _is_of_hand(key)}
            if (
                has_arm
                and parameters.get("autostart", True)
                and self._runs("operator", arm) is None
            ):
                named = {key.removeprefix("operator__"): value for key, value in own.items()}
                self.start("operator", wait, arm=arm, env=env, **named)
        if name == "slave_sim" and not parameters and (running := self._runs(name, arm)):
            return running
        if name == "slave":
            own = {key: parameters.pop(key) for key in set(parameters) if _is_of_arm(key)}
            if (
                has_arm
                and parameters.get("autostart", True)
                and self._runs("slave_sim", arm) is None
            ):
                robot = {key: parameters[key] for key in ("robot",) if key in parameters}
                self.start("slave_sim", wait, arm=arm, env=env, **robot, **own)
            home = load_robot(parameters.get("robot", "rcrt1")).home.tolist()
            parameters = {"start": home} | parameters
        named = {key.replace("__", "."): value for key, value in parameters.items()}
        node = NodeProcess(name, named, self.domain, self._folder, arm, env)
        self.nodes.append(node)
        self.observer.statuses.pop(node.name, None)
        if wait:
            self.wait_state(node.name, wait)
        return node

    def _runs(self, stage: str, arm: str) -> NodeProcess | None:
        """Node of a stage in a namespace that runs."""
        name = f"{arm}/{stage}" if arm else stage
        found = (n for n in self.nodes if n.name == name and n.process.poll() is None)
        return next(found, None)

    def status(self, name: str) -> Any:
        """Newest report of a node; None before the first."""
        self.observer.listen(0.0)
        return self.observer.statuses.get(name)

    def wait_state(self, name: str, state: str) -> None:
        def reached() -> bool:
            for node in self.nodes:
                died = node.name == name and node is self._newest(name) and node.process.poll()
                assert not died or node.wait() == 0, node.stderr.read_text()
            status = self.status(name)
            return status is not None and status.values["state"] == state

        self.wait(reached, f"{name} {state}")

    def _newest(self, name: str) -> NodeProcess:
        return next(node for node in reversed(self.nodes) if node.name == name)

    def wait_value(self, name: str, key: str, accept: Callable[[float], bool]) -> float:
        """Number that a node reports under a key, once it is accepted."""

        def accepted() -> tuple[float] | None:
            status = self.status(name)
            number = status.number(key) if status else 0.0
            return (number,) if status and accept(number) else None

        return self.wait(accepted, f"{name} {key}")[0]

    def has_recorded(self, counts: Mapping[str, int], recorder: str = "recorder") -> bool:
        """Whether a recorder reports more samples than these of each topic."""
        return has_recorded(self.status(recorder), counts)

    def insist_on_all(self, recorder: str) -> None:
        """Make sure that the last report of a recorder knows of no sample that was lost.

        Raises:
            MiddlewareLossError: It does.
        """
        values = self.status(recorder).values
        lost = {key: n for key, n in values.items() if key.startswith("lost.") and n != "0"}
        if lost:
            raise MiddlewareLossError(f"{lost} on the way to {recorder}")

    # -- topics ----------------------------------------------------------------------------------

    def listen(self, topic: Topic) -> Listener:
        return Listener(self.node, topic)

    def publisher(self, topic: Topic, readers: int = 1) -> Any:
        """Publisher of a topic, once that many subscriptions are there."""
        if topic.name not in self._publishers:
            kind = message_type(topic.kind.ros_type)
            reliable = profile(topic) if readers else QoSProfile(depth=10)
            self._publishers[topic.name] = self.node.create_publisher(kind, topic.name, reliable)
        own = self._publishers[topic.name]
        self.wait(lambda: own.get_subscription_count() >= readers, f"readers of {topic.name}")
        return own

    def send(self, topic: Topic, stamp_ns: int, values: Any, readers: int = 1) -> None:
        """Publish one message as our own nodes would, once that many subscriptions are there."""
        data = layout(topic, JOINTS).encode_one(stamp_ns, np.asarray(values, np.float64))
        self.publisher(topic, readers).publish(data)

    def spin(self) -> Any:
        """Serve what has come for the test's own node; returns nothing, in front of an ``or``."""
        self._executor.spin_once(0.01)

    def slave_holds(self) -> bool:
        """Whether the slave says that it holds: for want of commands, or paused since."""
        message = self.status("slave").message
        return "holds" in message or "PAUSED" in message

    # -- services --------------------------------------------------------------------------------

    def call(self, service: Any, name: str, request: Any) -> Any:
        """Answer of a service."""
        client = self.node.create_client(service, name)
        try:
            self.wait(client.service_is_ready, f"service {name}")
            future = client.call_async(request)
            self._executor.spin_until_future_complete(future, TIMEOUT)
            assert future.done(), f"no answer from {name}"
            return future.result()
        finally:
            self.node.destroy_client(client)

    def set(self, name: str, at_once: bool = False, **values: Any) -> list[Any]:
        """Results of setting parameters over the node's services."""
        messages: list[ParameterMessage] = [
            Parameter(key.replace("__", "."), value=value).to_parameter_msg()
            for key, value in values.items()
        ]
        if at_once:
            request = SetParametersAtomically.Request(parameters=messages)
            kind, service = SetParametersAtomically, "set_parameters_atomically"
            return [self.call(kind, f"/{name}/{service}", request).result]
        request = SetParameters.Request(parameters=messages)
        return self.call(SetParameters, f"/{name}/set_parameters", request).results  # type: ignore[no-any-return]


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
def _composed(
    peer: Peer, folder: Path, namespace: str, parameters: dict[str, dict[str, Any]]
) -> Any:
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

        def start(
            namespace: str = "", **parameters: dict[str, Any]
        ) -> "subprocess.Popen[bytes] | Started":
            return stack.enter_context(_composed(peer, tmp_path, namespace, parameters))

        yield start


@pytest.fixture(scope="module")
def composed_session(tmp_path_factory: pytest.TempPathFactory) -> Callable[..., object]:
    """Composed session that tests of a file share, as a context: peer, process, recording."""

    @contextmanager
    def run(
        **parameters: Any,
    ) -> Iterator[tuple[Peer, "subprocess.Popen[bytes]", Path]]:
        folder = tmp_path_factory.mktemp("session")
        with _made_peer() as peer, _composed(peer, folder, "", parameters) as process:
            yield peer, process, folder / "bag"

    return run


def run_until(
    peer: Peer, until: Callable[[], Any], out: Path, configuration: Configuration,
    processes: Processes = Processes.SIDES,
) -> tuple[Bag, str]:  # fmt: skip
    """Run a live session until something is so; its recording, and what was shown of it.

    On a busy machine nobody knows what a session comes to in a time: it lasts until it has come to
    what its test is about. The peer's domain must be that of the environment.
    """
    show: Any
    show, interrupt = Console(file=io.StringIO(), width=200), Interrupt()
    with ThreadPoolExecutor() as pool:
        session = pool.submit(
            live, configuration, out, show, processes=processes, interrupt=interrupt
        )

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
def session_until(
    peer: Peer, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> Callable[..., tuple[Bag, str]]:
    """Runner of a live session in the peer's domain, as :func:`run_until` says."""
    monkeypatch.setenv("ROS_DOMAIN_ID", peer.domain)

    def run(
        configuration: Configuration, until: Callable[[], Any], **options: Processes
    ) -> tuple[Bag, str]:
        return run_until(peer, until, tmp_path / "bag", configuration, **options)

    return run
