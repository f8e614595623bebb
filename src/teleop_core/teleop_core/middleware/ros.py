"""ROS: the platform of nodes that work in real time, on rclpy and the system's clock."""

import gc
import os
import socket
import struct
import threading
import time
from collections.abc import Callable, Sequence
from typing import Any

import rclpy
import rclpy.utilities
from rclpy.context import Context
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions

from teleop_core.base.background import SYSTEM, Background
from teleop_core.graph.layers import RealTimeParameters
from teleop_core.middleware import platform, real_time, ros_lifecycle, ros_node, ros_taking
from teleop_core.middleware.domains import checked_domain, domain_of_environment
from teleop_core.middleware.platform import Node as LocalNode
from teleop_core.middleware.ros_executor import RosExecutor

BAD_ARGUMENTS = (
    rclpy_implementation.RCLError,
    rclpy_implementation.UnknownROSArgsError,
    rclpy_implementation.RCLInvalidROSArgsError,
)
"""Exceptions that :meth:`RosPlatform.init` and nodes raise if ROS cannot read its arguments."""
_LOOPS = 64  # largest number of connections that wait to be accepted
_CREDENTIALS = struct.Struct("3i")  # process, user, group


class RosPlatform:
    """Platform in real time, with ROS as middleware.

    Args:
        context: Context of rclpy; None for the context of the whole process.
    """

    def __init__(self, context: Context | None = None) -> None:
        self._context = context

    background: Background = SYSTEM
    monotonic_ns = staticmethod(time.monotonic_ns)
    time_ns = staticmethod(time.time_ns)
    sleep = staticmethod(time.sleep)
    thread_ident = staticmethod(threading.get_ident)
    thread_time_ns = staticmethod(time.thread_time_ns)
    give_way = staticmethod(real_time.give_way)
    take_real_time: Callable[[RealTimeParameters], list[str]] = staticmethod(real_time.apply_options)

    functions = staticmethod(ros_taking.functions)

    def lock(self) -> platform.Lock:
        """See :class:`~teleop_core.middleware.platform.Platform`."""
        return threading.Lock()

    def thread(self, name: str, work: Callable[[], None]) -> platform.Thread:
        """See :class:`~teleop_core.middleware.platform.Platform`."""
        return threading.Thread(target=work, name=name, daemon=True)

    def tidy(self) -> None:
        """See :class:`~teleop_core.middleware.platform.Platform`."""
        gc.collect()  # compiling leaves millions of objects; one garbage collection of them takes seconds

    def connect(self, place: str) -> platform.Line:
        """See :class:`~teleop_core.middleware.platform.Platform`."""
        line = socket.socket(socket.AF_UNIX)
        line.setblocking(False)
        try:
            line.connect(place)
        except OSError:
            line.close()
            raise
        return line

    def listen(self, place: str) -> platform.Listener:
        """See :class:`~teleop_core.middleware.platform.Platform`."""
        return _Listener(place)

    def feed_place(self) -> str:
        """See :class:`~teleop_core.middleware.platform.Platform`."""
        return f"\0teleop_core.recorder.{os.environ.get('ROS_DOMAIN_ID') or 0}"

    def node(self, name: str, **options: Any) -> LocalNode:
        """See :class:`~teleop_core.middleware.platform.Platform`."""
        return ros_node.RosNode(Node(name, context=self._context, **options))

    def lifecycle_node(self, name: str, hooks: platform.Hooks, **options: Any) -> platform.LifecycleNode:
        """See :class:`~teleop_core.middleware.platform.Platform`."""
        return ros_lifecycle.RosLifecycleNode(name, hooks, **options)

    def executor(self) -> platform.Executor:
        """See :class:`~teleop_core.middleware.platform.Platform`."""
        return RosExecutor(self._context)

    def guest(self, domain: int | None = None) -> platform.Platform:
        """See :class:`~teleop_core.middleware.platform.Platform`."""
        number = domain_of_environment() if domain is None else checked_domain("domain", domain)
        context = Context()
        context.init(args=[], domain_id=number)
        return RosPlatform(context)

    def init(self, arguments: Sequence[str]) -> None:
        """Start the middleware with the arguments of a command line; signal handlers are not changed."""
        domain_of_environment()
        rclpy.init(args=list(arguments), signal_handler_options=SignalHandlerOptions.NO)

    def shutdown(self) -> None:
        """See :class:`~teleop_core.middleware.platform.Platform`."""
        rclpy.utilities.try_shutdown(context=self._context)

    def ok(self) -> bool:
        """Whether the middleware still works."""
        return bool(rclpy.utilities.ok(context=self._context))


class _Listener:
    """Socket at which loops of this machine and of the same user connect to the recorder."""

    def __init__(self, place: str) -> None:
        self._own = socket.socket(socket.AF_UNIX)
        self._own.setblocking(False)
        try:
            self._own.bind(place)
            self._own.listen(_LOOPS)
        except OSError:
            self._own.close()
            raise

    def accept(self) -> platform.Line | None:
        """Next connection from a process of this user; None if there is none."""
        while True:
            try:
                line, _ = self._own.accept()
            except OSError:
                return None
            told = line.getsockopt(socket.SOL_SOCKET, socket.SO_PEERCRED, _CREDENTIALS.size)
            if int(_CREDENTIALS.unpack(told)[1]) == os.getuid():
                line.setblocking(False)
                return line
            line.close()

    def close(self) -> None:
        """Stop accepting connections."""
        self._own.close()


ROS = RosPlatform()
"""The platform of a process that has one context of rclpy."""
