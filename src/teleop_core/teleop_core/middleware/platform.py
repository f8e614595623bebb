"""Platform: the interface that nodes use for middleware, time and threads.

The methods have the same names and meaning as in rclpy and in Python's ``threading``.
"""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from enum import Enum
from typing import Any, NamedTuple, Protocol

from teleop_core.base.background import Background
from teleop_core.base.parameters import Spec, Value
from teleop_core.graph.layers import RealTimeParameters


@dataclass(frozen=True, kw_only=True)
class Qos:
    """Quality of service of a publisher or subscription.

    Attributes:
        depth: Length of the queue; not used with ``keeps_all``.
        is_reliable: Whether lost messages are sent again.
        is_latched: Whether late readers get the last messages (transient local).
        keeps_all: Whether the queue keeps all messages, without limit.
    """

    depth: int = 10
    is_reliable: bool = True
    is_latched: bool = False
    keeps_all: bool = False


class Taken(NamedTuple):
    """A received message.

    Attributes:
        data: Bytes of the message.
        sender: Publisher that sent the message.
        number: Number of the message in the sequence of that publisher, from 1 on; 0 if the message has no number.
        sent_ns: Time of sending, by the clock of the sender [ns].
        came_ns: Time at which the middleware received the message [ns].
    """

    data: bytes
    sender: bytes
    number: int
    sent_ns: int
    came_ns: int


class Endpoint(NamedTuple):
    """Publisher or reader of a topic, as known from discovery.

    Attributes:
        node: Name of the node that owns it, with the namespace and a leading slash.
        sender: As in :class:`Taken`; for a reader, the reader's own identifier.
        ros_type: Type of the messages, such as ``sensor_msgs/msg/JointState``.
        is_reliable: As in :class:`Qos`.
        is_latched: As in :class:`Qos`.
    """

    node: str
    sender: bytes
    ros_type: str
    is_reliable: bool
    is_latched: bool


class TransitionResult(Enum):
    """Result of a transition of the lifecycle."""

    SUCCESS = "done"
    FAILURE = "refused"
    ERROR = "crashed"


# -- time and threads ------------------------------------------------------------------------------


class Lock(Protocol):
    """Lock between the threads of a process."""

    def acquire(self, blocking: bool = ..., timeout: float = ..., /) -> bool:
        """Lock; return whether this was possible within the timeout [s], which is unlimited by default."""

    def release(self) -> None:
        """Unlock."""

    def __enter__(self) -> object:
        """Lock."""

    def __exit__(self, kind: Any, error: Any, trace: Any, /) -> object:
        """Unlock."""


class Thread(Protocol):
    """Thread of a process."""

    @property
    def ident(self) -> int | None:
        """Number of the thread in Python; None before it has begun."""

    @property
    def native_id(self) -> int | None:
        """Number of the thread in the operating system."""

    def start(self) -> None:
        """Start the thread."""

    def join(self, timeout: float | None = None) -> None:
        """Wait until the thread has ended, at most for ``timeout`` [s]."""

    def is_alive(self) -> bool:
        """Whether the thread still runs."""


class Line(Protocol):
    """Connection for bytes between two processes of one machine; its methods never wait."""

    def send(self, data: bytes | bytearray | memoryview) -> int:
        """Write as many bytes as the connection accepts now; return the number of bytes written.

        Raises:
            BlockingIOError: The connection accepts nothing now.
            OSError: The other end is gone.
        """

    def recv(self, size: int) -> bytes:
        """Read the received bytes, at most ``size``; empty if the other process has closed the connection.

        Raises:
            BlockingIOError: No bytes were received.
            OSError: The other end is gone.
        """

    def close(self) -> None:
        """Close the connection."""


class Listener(Protocol):
    """Accepts connections from processes of the same machine."""

    def accept(self) -> Line | None:
        """Next connection from a process of this user; None if there is none."""

    def close(self) -> None:
        """Stop accepting connections."""


# -- topics, services, parameters ------------------------------------------------------------------


class Publisher(Protocol):
    """Publisher of a topic."""

    def publish(self, message: Any) -> None:
        """Send a message, or the bytes of one; a node that is not active sends nothing."""

    def send(self, data: bytes) -> None:
        """Send the bytes of a message; faster than :meth:`publish`."""

    def get_subscription_count(self) -> int:
        """Number of discovered readers."""

    def wait_for_all_acked(self, seconds: float) -> None:
        """Wait until all readers have received all messages, at most for some time [s]."""


class Taker(Protocol):
    """Subscription to a topic; its messages are read without an executor.

    Attributes:
        type: Class of its messages.
    """

    type: Any

    def take(self) -> Taken | None:
        """Oldest queued message; None if the queue is empty."""

    @property
    def lost(self) -> int:
        """Number of messages of all senders that should have been delivered but were not."""

    def wait(self, seconds: float) -> None:
        """Wait for a message, at most for some time [s]; no executor is needed."""

    def close(self) -> None:
        """Stop listening."""


class Timer(Protocol):
    """Calls a function periodically."""

    def cancel(self) -> None:
        """Pause the timer."""

    def reset(self) -> None:
        """Continue the timer; the next call is one period from now."""

    def is_canceled(self) -> bool:
        """Whether the timer is paused."""


class GuardCondition(Protocol):
    """Calls a function once in the executor, after it was triggered."""

    def trigger(self) -> None:
        """Let the executor call the function soon, once for all triggers until then; may be called from any thread."""


class Client(Protocol):
    """Client of a service; to receive answers, some thread must spin the node's executor."""

    srv_name: str

    def service_is_ready(self) -> bool:
        """Whether the service was found."""

    def wait_for_service(self, timeout_sec: float | None = None) -> bool:
        """Wait until the service is found; return whether it was found."""

    def call_async(self, request: Any) -> Any:
        """Send a request; returns a future of the answer."""

    def remove_pending_request(self, future: Any) -> None:
        """Stop waiting for an answer."""


class Log(Protocol):
    """Log of a node."""

    def info(self, text: str) -> object:
        """Log information."""

    def warning(self, text: str) -> object:
        """Log a warning."""

    def error(self, text: str, *, throttle_duration_sec: float = 0.0) -> object:
        """Log an error, at most once in some seconds."""

    def fatal(self, text: str) -> object:
        """Log an error after which the node ends."""


class Node(Protocol):
    """A node. Names of topics without a leading slash are below the namespace of the node."""

    def get_name(self) -> str:
        """Name of the node."""

    def get_namespace(self) -> str:
        """Namespace of the node, with a leading slash."""

    def get_logger(self) -> Log:
        """Log of the node."""

    def resolve_topic_name(self, name: str) -> str:
        """Full name of a topic."""

    def create_publisher(self, kind: Any, name: str, qos: Qos) -> Publisher:
        """Publisher of messages of a class."""

    def create_taker(self, kind: Any, name: str, qos: Qos) -> Taker:
        """Subscription whose messages are read without an executor."""

    def create_subscription(self, kind: Any, name: str, callback: Callable[[Any], None], qos: Qos) -> object:
        """Subscription whose messages the executor passes to ``callback``."""

    def create_service(self, kind: Any, name: str, callback: Callable[[Any, Any], Any]) -> object:
        """Service that the executor answers."""

    def create_client(self, kind: Any, name: str) -> Client:
        """Client of a service."""

    def create_timer(self, period: float, callback: Callable[[], None]) -> Timer:
        """Call ``callback`` periodically; the period is in [s]."""

    def create_guard_condition(self, callback: Callable[[], None]) -> GuardCondition:
        """Guard that calls ``callback`` when it is triggered."""

    def destroy(self, entity: Any) -> None:
        """Destroy an object that one of these methods has made."""

    def defer(self, work: Callable[..., object], *arguments: object) -> None:
        """Let the executor call ``work`` soon; without an executor nothing happens. May be called from any thread."""

    def count_publishers(self, name: str) -> int:
        """Number of discovered publishers of a topic."""

    def publishers(self, name: str) -> list[Endpoint]:
        """Discovered publishers of a topic."""

    def readers(self, name: str) -> list[Endpoint]:
        """Discovered readers of a topic."""

    def get_topic_names_and_types(self) -> list[tuple[str, list[str]]]:
        """Discovered topics."""

    def get_service_names_and_types(self) -> list[tuple[str, list[str]]]:
        """Discovered services."""

    def destroy_node(self) -> None:
        """Destroy the node."""


class Hooks(Protocol):
    """Functions that a lifecycle node calls in its transitions."""

    def on_configure(self) -> TransitionResult:
        """Make everything that the node needs."""

    def on_activate(self) -> TransitionResult:
        """Begin the node's work; the publishers of the node are already open."""

    def on_deactivate(self) -> TransitionResult:
        """Stop the node's work; the publishers of the node are still open."""

    def on_cleanup(self) -> TransitionResult:
        """Close everything, so that the node can be configured again."""

    def on_shutdown(self) -> TransitionResult:
        """Stop the node's work and close everything; the node cannot be configured again."""

    def on_error(self) -> TransitionResult:
        """Close everything after a crash."""

    def on_no_transition(self, wanted: str) -> None:
        """Called if a requested transition does not exist in the current state."""


class LifecycleNode(Node, Protocol):
    """Node with parameters and a lifecycle, as in ROS.

    Attributes:
        given: Parameters of the command line and of parameter files that are not declared yet.
    """

    given: Mapping[str, Any]

    def create_lifecycle_publisher(self, kind: Any, name: str, qos: Qos) -> Publisher:
        """Publisher that sends only while the node is active."""

    def declare(
        self, specs: Iterable[Spec], values: Mapping[str, Value], accept: Callable[[Mapping[str, Value]], str]
    ) -> None:
        """Declare parameters.

        Args:
            specs: Declarations of the parameters.
            values: Values of the parameters.
            accept: Called with a whole change before it is made; returns the reason to refuse the change, or an empty
                text to accept it.
        """

    def show(self, values: Mapping[str, Value]) -> None:
        """Show values that the node has changed by itself; ``accept`` is not called."""

    def trigger(self, transition: str) -> TransitionResult:
        """Execute ``configure``, ``activate``, ``deactivate`` or ``shutdown``."""


class Executor(Protocol):
    """Serves timers, services and subscriptions of nodes, in the thread that spins it."""

    def add_node(self, node: Node) -> None:
        """Add a node to the nodes that this executor serves."""

    def spin_once(self, timeout_sec: float | None = None) -> None:
        """Serve one event, or nothing if no event comes within the time [s].

        Raises:
            PlatformEndedError: The middleware was shut down.
        """

    def wake(self) -> None:
        """Let :meth:`spin_once` return; may be called from any thread."""

    def shutdown(self) -> None:
        """Stop serving the nodes."""


class PlatformEndedError(Exception):
    """The middleware was shut down."""


class Platform(Protocol):
    """Everything outside of the nodes of one process."""

    @property
    def background(self) -> Background:
        """Functions for writing recordings."""

    def functions(self) -> Mapping[str, int]:
        """Addresses of the C functions by which kernels reach the middleware and the clock; empty if there are none.

        The names are the fields of :class:`teleop_core.nodes.wire.Calls`.
        """

    def monotonic_ns(self) -> int:
        """Time of a monotonic clock [ns]."""

    def time_ns(self) -> int:
        """Time of the system's clock [ns]."""

    def sleep(self, seconds: float) -> None:
        """Wait for a time [s]."""

    def lock(self) -> Lock:
        """Lock between threads."""

    def thread(self, name: str, work: Callable[[], None]) -> Thread:
        """Thread that calls ``work`` when it is started; the process does not wait for it at its end."""

    def thread_ident(self) -> int:
        """Number of the calling thread in Python."""

    def take_real_time(self, options: RealTimeParameters) -> list[str]:
        """Apply real-time options to the calling thread; returns one line for each refused option."""

    def give_way(self) -> None:
        """Take the real-time priority from the calling thread."""

    def thread_time_ns(self) -> int:
        """Processor time that the calling thread has used [ns]."""

    def tidy(self) -> None:
        """Free the memory of objects that remain from the start, before the loops run."""

    def connect(self, place: str) -> Line:
        """Connection to the listener at an address of this machine; raises OSError if there is no listener."""

    def listen(self, place: str) -> Listener:
        """Listen at an address of this machine; raises OSError if another process already listens there."""

    def feed_place(self) -> str:
        """Address at which the recorder of this machine listens, for the domain of this process."""

    def node(self, name: str, **options: Any) -> Node:
        """A node; options are those of the class in rclpy."""

    def lifecycle_node(self, name: str, hooks: Hooks, **options: Any) -> LifecycleNode:
        """A node with parameters and a lifecycle; options are those of the class in rclpy.

        Raises:
            ParameterError: The node is configured to use ROS's simulated time, which stages cannot use.
        """

    def executor(self) -> Executor:
        """Executor for the nodes of this process or of this guest."""

    def guest(self, domain: int | None = None) -> "Platform":
        """This platform for a guest: a program that is not part of the session and has its own context."""

    def shutdown(self) -> None:
        """Shut the middleware down."""


class Owner(Protocol):
    """Owner of publishers and subscriptions: a node of a session, or a guest."""

    @property
    def platform(self) -> Platform:
        """Platform of the owner."""

    @property
    def ros(self) -> Node:
        """Node of the owner."""
