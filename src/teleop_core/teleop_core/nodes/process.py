"""Process: the only main loop of the nodes, from the command line to a clean end."""

import atexit
import os
import sys
import traceback
from collections.abc import Callable
from contextlib import ExitStack
from typing import Protocol

from teleop_core.base.errors import TeleopError
from teleop_core.middleware.platform import Executor, Platform, PlatformEndedError, TransitionResult
from teleop_core.middleware.ros import BAD_ARGUMENTS, ROS
from teleop_core.nodes.base import CoreNode
from teleop_core.nodes.discovery import beyond_this_machine, choose_transport
from teleop_core.nodes.files import checked_arguments
from teleop_core.nodes.parent import Parent
from teleop_core.nodes.watch import Crew, Watch, signal_pipe


def run(make_crew: Callable[[], Crew]) -> int:
    """Run one node, or several together, until a signal or the parent's end.

    SIGINT, SIGTERM, SIGHUP and SIGQUIT end the nodes in order.

    Args:
        make_crew: Class of the node, or of a crew of several nodes.

    Returns:
        Exit code: 0 without a failure; 1 after a failure at work; 2 if a parameter or file is wrong.
    """
    signals, parent = signal_pipe(), Parent.of_environment()
    try:
        sys.argv[:] = checked_arguments(sys.argv)
        choose_transport()
        ROS.init(sys.argv)
        crew = make_crew()
    except TeleopError as error:
        print(error, file=sys.stderr)
        return _finish(2)
    except BAD_ARGUMENTS as error:
        print(f"ROS arguments: {' '.join(str(error).split())}", file=sys.stderr)
        return _finish(2)
    if reach := beyond_this_machine():
        crew.nodes[0].ros.get_logger().info(reach)
    # Two threads share the interpreter: the loop must not wait 5 ms for its turn.
    sys.setswitchinterval(2e-4)
    watch = Watch(crew, signals, parent)
    code = serve(crew, watch, ROS)
    if not code:
        watch.word = "leaving"  # all important work is done
        for node in crew.nodes:
            node.ros.destroy_node()
        _finish(code)
    _leave(code)
    return code


class Watching(Protocol):
    """Watcher that ends a process.

    Attributes:
        word: Activity of the process: starting, at work, ending, leaving.
    """

    word: str


def serve(crew: Crew, watch: Watching, platform: Platform) -> int:
    """Start the nodes, serve them until the end, and end them; returns the exit code."""
    executor, nodes = platform.executor(), crew.nodes
    first = nodes[0]
    for node in nodes:
        executor.add_node(node.ros)
        node.ended, node.ending = first.ended, first.ending
    first.ended.add_done_callback(lambda _: executor.wake())
    with ExitStack() as end:  # end the nodes in reverse order, and each node even if another one fails
        end.callback(executor.shutdown)
        for node in reversed(nodes):
            end.callback(node.flush)  # flush blocks all threads of the process
        for node in nodes:  # the node that was started first ends last
            end.callback(node.finish)
        end.callback(_begin_end, crew, watch)
        code = _autostart(nodes, platform)
        watch.word = "at work"
        while not code and not first.ended.done():
            _spin_once(executor, first)
    return max(code, *(node.exit_code for node in nodes), 0)


def _spin_once(executor: Executor, node: CoreNode) -> None:
    """Serve one parameter, service or timer of any node."""
    try:
        executor.spin_once()
    except PlatformEndedError:
        node.end(1)
    except Exception:  # a request cannot be read, such as a forged one
        node.ros.get_logger().error(f"a request failed:\n{traceback.format_exc()}", throttle_duration_sec=10.0)


def _begin_end(crew: Crew, watch: Watching) -> None:
    watch.word = "ending"
    with crew.nodes[0].ending:  # the thread that asked for the end no longer uses the executor
        pass
    crew.halt()


def _autostart(nodes: tuple[CoreNode, ...], platform: Platform) -> int:
    """Configure all nodes, which takes long, before activating any; returns the exit code so far."""
    willing = [node for node in nodes if node.options.autostart]
    for node in willing:
        if node.ended.done():
            return 0
        if node.ros.trigger("configure") is not TransitionResult.SUCCESS:
            return 2
    platform.tidy()
    if nodes[0].ended.done():
        return 0
    return 1 if any(node.ros.trigger("activate") is not TransitionResult.SUCCESS for node in willing) else 0


def _finish(code: int) -> int:
    ROS.shutdown()
    return code


def _leave(code: int) -> None:
    """End the process, whatever its other threads are doing, and without Python's cleanup.

    After a failure, topics are not closed one by one either. Fast DDS 2.14 sometimes crashes
    (StatefulWriter::matched_reader_add) if a writer is closed while others are being discovered. This happens in a
    node that fails right after its start, and its exit code would be lost.
    """
    sys.stdout.flush()
    sys.stderr.flush()
    atexit._run_exitfuncs()
    os._exit(code)
