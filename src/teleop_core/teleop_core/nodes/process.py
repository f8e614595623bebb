"""Process: the only main loop of the nodes, from the command line to a clean end."""

import atexit
import gc
import os
import sys
import traceback
from collections.abc import Callable
from contextlib import ExitStack

import rclpy
import rclpy.utilities
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.signals import SignalHandlerOptions

from teleop_core.base.errors import TeleopError
from teleop_core.nodes.base import SUCCESS, CoreNode
from teleop_core.nodes.discovery import beyond_this_machine, choose_transport
from teleop_core.nodes.files import checked_arguments
from teleop_core.nodes.parent import Parent
from teleop_core.nodes.watch import Crew, Watch, signal_pipe

_BAD_ARGUMENTS = (
    rclpy_implementation.RCLError,
    rclpy_implementation.UnknownROSArgsError,
    rclpy_implementation.RCLInvalidROSArgsError,
)


def run(make_crew: Callable[[], Crew]) -> int:
    """Run one node, or several together, until a signal or the parent's end.

    SIGINT, SIGTERM, SIGHUP and SIGQUIT end it in order.

    Args:
        make_crew: The node's class, or that of what holds several.

    Returns:
        Exit code: 0; 1 after a failure at work; 2 if a parameter or file is wrong.
    """
    signals, parent = signal_pipe(), Parent.of_environment()
    try:
        sys.argv[:] = checked_arguments(sys.argv)
        choose_transport()
        rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
        crew = make_crew()
    except TeleopError as error:
        print(error, file=sys.stderr)
        return _finish(2)
    except _BAD_ARGUMENTS as error:
        print(f"ROS arguments: {' '.join(str(error).split())}", file=sys.stderr)
        return _finish(2)
    if reach := beyond_this_machine():
        crew.nodes[0].get_logger().info(reach)
    # Two threads share the interpreter: the loop must not wait 5 ms for its turn.
    sys.setswitchinterval(2e-4)
    watch = Watch(crew, signals, parent)
    code = _serve(crew, watch)
    if not code:
        watch.word = "leaving"  # all that matters is done
        for node in crew.nodes:
            node.destroy_node()
        _finish(code)
    _leave(code)
    return code


def _serve(crew: Crew, watch: Watch) -> int:
    """Start, work and end; returns the exit code."""
    executor, nodes = SingleThreadedExecutor(), crew.nodes
    first = nodes[0]
    for node in nodes:
        executor.add_node(node)
        node.ended, node.ending = first.ended, first.ending
    first.ended.add_done_callback(lambda _: executor.create_task(_wake))
    with ExitStack() as end:  # last first, and each whatever becomes of the others
        end.callback(executor.shutdown)
        for node in reversed(nodes):
            end.callback(node.flush)  # which blocks all threads of the process
        for node in nodes:  # the one that was started first sees all others end
            end.callback(node.finish)
        end.callback(_begin_end, crew, watch)
        code = _autostart(nodes)
        watch.word = "at work"
        while not code and not first.ended.done():
            _spin_once(executor, first)
    return max(code, *(node.exit_code for node in nodes), 0)


def _spin_once(executor: SingleThreadedExecutor, node: CoreNode) -> None:
    """Serve one parameter, service or timer of any node."""
    try:
        executor.spin_once()
    except ExternalShutdownException:
        node.end(1)
    except Exception:  # of a request that cannot be read, such as one that others forged
        node.get_logger().error(
            f"a request failed:\n{traceback.format_exc()}", throttle_duration_sec=10.0
        )


def _wake() -> None:
    """Have something to do, so that the executor looks whether it is to end."""


def _begin_end(crew: Crew, watch: Watch) -> None:
    watch.word = "ending"
    with crew.nodes[0].ending:  # who asked for the end uses the executor no longer
        pass
    crew.halt()


def _autostart(nodes: tuple[CoreNode, ...]) -> int:
    """Configure all, which takes long, before any is at work; returns the exit code so far."""
    willing = [node for node in nodes if node.options.autostart]
    for node in willing:
        if node.ended.done():
            return 0
        if node.trigger_configure() is not SUCCESS:
            return 2
    gc.collect()  # compiling leaves millions of objects; to look through them at work takes seconds
    if nodes[0].ended.done():
        return 0
    return 1 if any(node.trigger_activate() is not SUCCESS for node in willing) else 0


def _finish(code: int) -> int:
    rclpy.utilities.try_shutdown()
    return code


def _leave(code: int) -> None:
    """End the process, whatever its other threads are doing, and without what Python tidies up.

    After a failure topics are not even closed one by one: Fast DDS 2.14 crashes now and then
    (StatefulWriter::matched_reader_add) when a writer goes while others are being discovered, as
    in a node that fails right after its start; its exit code would be lost.
    """
    sys.stdout.flush()
    sys.stderr.flush()
    atexit._run_exitfuncs()
    os._exit(code)
