"""Process: the only main loop of the nodes, from the command line to a clean end."""

import atexit
import os
import signal
import sys
import threading
from collections.abc import Callable
from typing import Protocol

import rclpy
import rclpy.utilities
from rclpy.executors import SingleThreadedExecutor
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.signals import SignalHandlerOptions

from teleop_core.errors import TeleopError
from teleop_core.nodes.base import SUCCESS, CoreNode
from teleop_core.nodes.discovery import announce_often
from teleop_core.nodes.files import checked_arguments

_BAD_ARGUMENTS = (
    rclpy_implementation.RCLError,
    rclpy_implementation.UnknownROSArgsError,
    rclpy_implementation.RCLInvalidROSArgsError,
)


class Crew(Protocol):
    """What works in one process: a node, or several that are started in this order."""

    @property
    def nodes(self) -> "tuple[CoreNode, ...]":
        """The nodes."""
        ...


def run(make_crew: Callable[[], Crew]) -> int:
    """Run one node, or several together, until SIGINT or SIGTERM.

    Args:
        make_crew: The node's class, or that of what holds several.

    Returns:
        Exit code: 0; 1 after a failure at work; 2 if a parameter or file is wrong.
    """
    signals = _signal_pipe()
    try:
        sys.argv[:] = checked_arguments(sys.argv)
        announce_often()
        rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
        nodes = make_crew().nodes
    except TeleopError as error:
        print(error, file=sys.stderr)
        return _finish(2)
    except _BAD_ARGUMENTS as error:
        print(f"ROS arguments: {' '.join(str(error).split())}", file=sys.stderr)
        return _finish(2)
    # Two threads share the interpreter: the loop must not wait 5 ms for its turn.
    sys.setswitchinterval(2e-4)
    threading.Thread(target=_await_signal, args=(signals, nodes[0]), daemon=True).start()
    code = _serve(nodes)
    if code:
        _leave(code)
    for node in nodes:
        node.destroy_node()
    return _finish(code)


def _signal_pipe() -> int:
    """File that SIGINT and SIGTERM write to.

    Nothing is interrupted half-way, and the middleware is still there for an orderly end; the
    main thread waits in C, where a handler in Python would not run.
    """
    reading, writing = os.pipe()
    os.set_blocking(writing, False)
    signal.set_wakeup_fd(writing)
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: None)
    return reading


def _await_signal(signals: int, node: CoreNode) -> None:
    os.read(signals, 1)
    node.end(0)


def _serve(nodes: tuple[CoreNode, ...]) -> int:
    executor = SingleThreadedExecutor()
    for node in nodes:
        executor.add_node(node)
        node.ended = nodes[0].ended
    code = _autostart(nodes)
    if not code:
        executor.spin_until_future_complete(nodes[0].ended)
    for node in reversed(nodes):  # the one that was started first sees all others end
        node.trigger_shutdown()
    for node in nodes:  # which blocks all threads of the process
        node.flush()
    executor.shutdown()
    return max(code, *(node.exit_code for node in nodes), 0)


def _autostart(nodes: tuple[CoreNode, ...]) -> int:
    """Configure all, which takes long, before any is at work; returns the exit code so far."""
    willing = [node for node in nodes if node.options.autostart]
    if any(node.trigger_configure() is not SUCCESS for node in willing):
        return 2
    return 1 if any(node.trigger_activate() is not SUCCESS for node in willing) else 0


def _finish(code: int) -> int:
    rclpy.utilities.try_shutdown()
    return code


def _leave(code: int) -> None:
    """End the process without closing its topics one by one.

    Fast DDS 2.14 crashes now and then (StatefulWriter::matched_reader_add) when a writer goes
    while others are being discovered, as in a node that fails right after its start; its exit
    code would be lost.
    """
    sys.stderr.flush()
    atexit._run_exitfuncs()
    os._exit(code)
