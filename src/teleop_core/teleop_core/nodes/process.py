"""Process: the only main loop of the nodes, from the command line to a clean end."""

import os
import signal
import sys
import threading
from collections.abc import Callable

import rclpy
import rclpy.utilities
from rclpy.executors import SingleThreadedExecutor
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.signals import SignalHandlerOptions

from teleop_core.errors import TeleopError
from teleop_core.nodes.base import SUCCESS, CoreNode

_BAD_ARGUMENTS = (
    rclpy_implementation.RCLError,
    rclpy_implementation.UnknownROSArgsError,
    rclpy_implementation.RCLInvalidROSArgsError,
)


def run(make_node: Callable[[], CoreNode]) -> int:
    """Run one node until SIGINT or SIGTERM.

    Args:
        make_node: The node's class.

    Returns:
        Exit code: 0; 1 after a failure at work; 2 if a parameter or file is wrong.
    """
    signals = _signal_pipe()
    try:
        rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
        node = make_node()
    except TeleopError as error:
        print(error, file=sys.stderr)
        return _finish(2)
    except _BAD_ARGUMENTS as error:
        print(f"ROS arguments: {' '.join(str(error).split())}", file=sys.stderr)
        return _finish(2)
    # Two threads share the interpreter: the loop must not wait 5 ms for its turn.
    sys.setswitchinterval(2e-4)
    threading.Thread(target=_await_signal, args=(signals, node), daemon=True).start()
    code = _serve(node)
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


def _serve(node: CoreNode) -> int:
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    if node.options.autostart:
        if node.trigger_configure() is not SUCCESS:
            return 2
        if node.trigger_activate() is not SUCCESS:
            return 1
    executor.spin_until_future_complete(node.ended)
    node.trigger_shutdown()
    executor.shutdown()
    return node.exit_code


def _finish(code: int) -> int:
    rclpy.utilities.try_shutdown()
    return code
