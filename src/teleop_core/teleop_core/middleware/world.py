"""World: what nodes ask of the middleware, of time and of threads.

The methods have the names and the meaning that they have in rclpy and in Python's ``threading``.
"""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from enum import Enum
from typing import Any, NamedTuple, Protocol

from teleop_core.bags.background import Background
from teleop_core.base.parameters import Spec, Value
from teleop_core.graph.layers import RealTimeParameters


@dataclass(frozen=True, kw_only=True)
class Qos:
    """Quality of service of one end of a topic.

    Attributes:
        depth: How many messages wait, unless all do.
        is_reliable: Whether lost messages are sent again.
        is_latched: Whether who comes late gets the last messages (transient local).
        keeps_all: Whether all messages wait, however many.
    """

    depth: int = 10
    is_reliable: bool = True
    is_latched: bool = False
    keeps_all: bool = False


class Taken(NamedTuple):
    """A message as it came.

    Attributes:
        data: Its bytes.
        sender: Which publisher sent it.
        number: Its number in the sequence of that publisher, from 1 on; 0 where it has none.
        sent_ns: When it was sent, by the clock of the sender [ns].
        came_ns: When the middleware received it [ns].
    """

    data: bytes
    sender: bytes
    number: int
    sent_ns: int
    came_ns: int


class Endpoint(NamedTuple):
    """Publisher or reader of a topic, as discovery knows it.

    Attributes:
        node: Name of its node, with the namespace and a slash before it.
        sender: As of :class:`Taken`; of a reader its own number.
        ros_type: Type of its messages, such as ``sensor_msgs/msg/JointState``.
        is_reliable: As of :class:`Qos`.
        is_latched: As of :class:`Qos`.
    """

    node: str
    sender: bytes
    ros_type: str
    is_reliable: bool
    is_latched: bool


class Outcome(Enum):
    """What became of a transition of the lifecycle."""

    SUCCESS = "done"
    FAILURE = "refused"
    ERROR = "crashed"


# -- time and threads ------------------------------------------------------------------------------


class Lock(Protocol):
    """Lock between the threads of a process."""

    def acquire(self, blocking: bool = ..., timeout: float = ..., /) -> bool:
        """Take it; whether that was possible within the timeout [s], by default without end."""

    def release(self) -> None:
        """Give it back."""

    def __enter__(self) -> object:
        """Take it."""

    def __exit__(self, kind: Any, error: Any, trace: Any, /) -> object:
        """Give it back."""


class Thread(Protocol):
    """Thread of a process."""

    @property
    def ident(self) -> int | None:
        """Number by which Python knows it; None before it has begun."""

    @property
    def native_id(self) -> int | None:
        """Number by which the system knows it."""

    def start(self) -> None:
        """Begin."""

    def join(self, timeout: float | None = None) -> None:
        """Wait for its end, for ``timeout`` [s] at most."""

    def is_alive(self) -> bool:
        """Whether it works still."""


class Line(Protocol):
    """End of a stream of bytes between two processes of one machine; it never waits."""

    def send(self, data: bytes | bytearray) -> int:
        """Write what it takes; how much that was.

        Raises:
            BlockingIOError: It takes nothing now.
            OSError: The other end is gone.
        """

    def recv(self, size: int) -> bytes:
        """Read what has come, ``size`` bytes at most; nothing when the other end is closed.

        Raises:
            BlockingIOError: Nothing has come.
            OSError: The other end is gone.
        """

    def close(self) -> None:
        """Close it."""


class Listener(Protocol):
    """Where lines of a machine arrive."""

    def accept(self) -> Line | None:
        """Next line of a process of this user; None if there is none."""

    def close(self) -> None:
        """Accept none any more."""


# -- topics, services, parameters ------------------------------------------------------------------


class Publisher(Protocol):
    """One end of a topic."""

    def publish(self, message: Any) -> None:
        """Send a message, or the bytes of one; a node that is not active sends nothing."""

    def send(self, data: bytes) -> None:
        """As :meth:`publish`, of bytes alone, in the shortest time."""

    def get_subscription_count(self) -> int:
        """Readers that were found."""

    def wait_for_all_acked(self, seconds: float) -> None:
        """Wait until all readers have all messages, for some time [s] at most."""


class Taker(Protocol):
    """Other end of a topic, whose messages are taken by hand.

    Attributes:
        type: Class of its messages.
    """

    type: Any

    def take(self) -> Taken | None:
        """Oldest waiting message; None if there is none."""

    @property
    def lost(self) -> int:
        """Messages of all its senders that should have been handed over and were not."""

    def wait(self, seconds: float) -> None:
        """Return when there is a message, or after some time [s]; no executor is needed."""

    def close(self) -> None:
        """Stop listening."""


class Timer(Protocol):
    """Calls again and again."""

    def cancel(self) -> None:
        """Pause."""

    def reset(self) -> None:
        """Go on; the next call is one period from now."""

    def is_canceled(self) -> bool:
        """Whether it is paused."""


class Guard(Protocol):
    """Calls once soon."""

    def trigger(self) -> None:
        """Have the executor call soon, once for all triggers until then; from any thread."""


class Client(Protocol):
    """Who asks a service; the executor of the node must be spun meanwhile, by whomever."""

    srv_name: str

    def service_is_ready(self) -> bool:
        """Whether the service was found."""

    def wait_for_service(self, timeout_sec: float | None = None) -> bool:
        """Wait until the service is found; whether it was."""

    def call_async(self, request: Any) -> Any:
        """Ask; the answer is the result of a future."""

    def remove_pending_request(self, future: Any) -> None:
        """Wait for an answer no longer."""


class Log(Protocol):
    """What a node tells people."""

    def info(self, text: str) -> object:
        """Say what is so."""

    def warning(self, text: str) -> object:
        """Say what should not be so."""

    def error(self, text: str, *, throttle_duration_sec: float = 0.0) -> object:
        """Say what has failed, once in some seconds at most."""

    def fatal(self, text: str) -> object:
        """Say what ends the node."""


class Node(Protocol):
    """A node; names of topics are below its namespace unless they begin with a slash."""

    def get_name(self) -> str:
        """Its name."""

    def get_namespace(self) -> str:
        """Its namespace, with a slash before it."""

    def get_logger(self) -> Log:
        """Its log."""

    def resolve_topic_name(self, name: str) -> str:
        """Full name of a topic."""

    def create_publisher(self, kind: Any, name: str, qos: Qos) -> Publisher:
        """Publisher of messages of a class."""

    def create_taker(self, kind: Any, name: str, qos: Qos) -> Taker:
        """Subscription whose messages are taken by hand."""

    def create_subscription(self, kind: Any, name: str, callback: Callable[[Any], None], qos: Qos) -> object:
        """Subscription whose messages the executor hands over."""

    def create_service(self, kind: Any, name: str, callback: Callable[[Any, Any], Any]) -> object:
        """Service that the executor answers."""

    def create_client(self, kind: Any, name: str) -> Client:
        """Client of a service."""

    def create_timer(self, period: float, callback: Callable[[], None]) -> Timer:
        """Call again and again after a period [s]."""

    def create_guard_condition(self, callback: Callable[[], None]) -> Guard:
        """Call when it is triggered."""

    def destroy(self, entity: Any) -> None:
        """Withdraw what one of these methods has made."""

    def defer(self, work: Callable[..., object], *arguments: object) -> None:
        """Have the executor do something soon; nothing without one. From any thread."""

    def count_publishers(self, name: str) -> int:
        """Publishers of a topic that were found."""

    def publishers(self, name: str) -> list[Endpoint]:
        """The same, one by one."""

    def readers(self, name: str) -> list[Endpoint]:
        """Readers of a topic that were found."""

    def get_topic_names_and_types(self) -> list[tuple[str, list[str]]]:
        """Topics that were found."""

    def get_service_names_and_types(self) -> list[tuple[str, list[str]]]:
        """Services that were found."""

    def destroy_node(self) -> None:
        """Leave."""


class Hooks(Protocol):
    """What a lifecycle node does in its transitions."""

    def on_configure(self) -> Outcome:
        """Make what it needs."""

    def on_activate(self) -> Outcome:
        """Begin to work; its publishers are open already."""

    def on_deactivate(self) -> Outcome:
        """Stop to work; its publishers are open still."""

    def on_cleanup(self) -> Outcome:
        """Close everything: it can be configured anew."""

    def on_shutdown(self) -> Outcome:
        """Stop and close everything for good."""

    def on_error(self) -> Outcome:
        """After a crash, close everything."""

    def on_no_transition(self, wanted: str) -> None:
        """Somebody asked for a transition that there is not now."""


class LifecycleNode(Node, Protocol):
    """Node with parameters and a lifecycle, as of ROS.

    Attributes:
        given: Parameters of the command line and of parameter files that belong to no one yet.
    """

    given: Mapping[str, Any]

    def create_lifecycle_publisher(self, kind: Any, name: str, qos: Qos) -> Publisher:
        """Publisher that is silent unless the node is active."""

    def declare(
        self, specs: Iterable[Spec], values: Mapping[str, Value], accept: Callable[[Mapping[str, Value]], str]
    ) -> None:
        """Declare parameters.

        Args:
            specs: What they are.
            values: What they are set to.
            accept: Told all of a change before it is made; why it is refused, empty if it is not.
        """

    def show(self, values: Mapping[str, Value]) -> None:
        """Show values that the node has changed by itself: nobody is asked."""

    def trigger(self, transition: str) -> Outcome:
        """Bring about ``configure``, ``activate``, ``deactivate`` or ``shutdown``."""


class Executor(Protocol):
    """Serves timers, services and subscriptions of nodes, in the thread that spins it."""

    def add_node(self, node: Node) -> None:
        """Serve a node too."""

    def spin_once(self, timeout_sec: float | None = None) -> None:
        """Serve one thing, or none within the time [s].

        Raises:
            WorldEndedError: The middleware was shut down.
        """

    def wake(self) -> None:
        """Let :meth:`spin_once` return; from any thread."""

    def shutdown(self) -> None:
        """Serve nothing any more."""


class WorldEndedError(Exception):
    """The middleware was shut down."""


class World(Protocol):
    """Everything outside of the nodes of one process."""

    @property
    def background(self) -> Background:
        """Where recordings are written."""

    def monotonic_ns(self) -> int:
        """Time of a clock that never goes back [ns]."""

    def time_ns(self) -> int:
        """Time of the system's clock [ns]."""

    def sleep(self, seconds: float) -> None:
        """Wait [s]."""

    def lock(self) -> Lock:
        """Lock between threads."""

    def thread(self, name: str, work: Callable[[], None]) -> Thread:
        """Thread that does something, once it is started; the process does not wait for it."""

    def thread_ident(self) -> int:
        """Number by which Python knows the thread that calls."""

    def take_real_time(self, options: RealTimeParameters) -> list[str]:
        """Take options for the thread that calls; one line for everything that is refused."""

    def tidy(self) -> None:
        """Throw away what the start has left behind, before loops work."""

    def connect(self, place: str) -> Line:
        """Line to who listens at a place of this machine; raises OSError if nobody does."""

    def listen(self, place: str) -> Listener:
        """Listen at a place of this machine; raises OSError if another one does."""

    def feed_place(self) -> str:
        """Where the recorder of this machine listens, on the domain of this process."""

    def node(self, name: str, **options: Any) -> Node:
        """A node; options as of the class in rclpy."""

    def lifecycle_node(self, name: str, hooks: Hooks, **options: Any) -> LifecycleNode:
        """A node with parameters and a lifecycle; options as of the class in rclpy.

        Raises:
            ParameterError: It is to use simulated time of ROS, by which no stage can step.
        """

    def executor(self) -> Executor:
        """Executor of the nodes of this process, or guest."""

    def guest(self, domain: int | None = None) -> "World":
        """The same world as seen by who is none of the session: a context of its own."""

    def shutdown(self) -> None:
        """Leave the middleware."""


class Owner(Protocol):
    """Who owns ends of topics: a node of a session, or a guest."""

    @property
    def world(self) -> World:
        """Where it is."""

    @property
    def ros(self) -> Node:
        """Its node."""
