"""Taking: reads raw messages of a subscription without an executor, with all information of the middleware.

rclpy does not return the sender of a message. A lost message, or a second publisher, can be detected only from the
sender and the message number together. Therefore this module calls ``rcl_take_serialized_message`` itself, as rclpy
does. All code that depends on the layout of rcl's structures is in this module.
"""

import ctypes
from functools import cached_property
from typing import Any

from rclpy.callback_groups import CallbackGroup
from rclpy.event_handler import QoSSubscriptionEventType, SubscriptionEventCallbacks
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.node import Node
from rclpy.qos import QoSProfile

from teleop_core.middleware.platform import Taken

_OK = 0  # RCL_RET_OK
_NOTHING = 401  # RCL_RET_SUBSCRIPTION_TAKE_FAILED
_ROOM = 64  # initial size of the buffer [bytes]; rcl enlarges it
_GID = 16


def functions() -> dict[str, int]:
    """Addresses of the C functions by which kernels take, publish, and read the clock."""
    rcl, rcutils, system = ctypes.PyDLL("librcl.so"), ctypes.PyDLL("librcutils.so"), ctypes.PyDLL(None)
    found = {
        "take": rcl.rcl_take_serialized_message,
        "forget_error": rcutils.rcutils_reset_error,
        "publish": rcl.rcl_publish_serialized_message,
        "matched": rcl.rcl_publisher_get_subscription_count,
        "clock": system.clock_gettime,
    }
    return {name: ctypes.cast(own, ctypes.c_void_p).value or 0 for name, own in found.items()}


class _Allocator(ctypes.Structure):
    """rcutils_allocator_t."""

    _fields_ = [(name, ctypes.c_void_p) for name in ("allocate", "deallocate", "reallocate", "zero_allocate", "state")]


class _Bytes(ctypes.Structure):
    """rcutils_uint8_array_t."""

    _fields_ = [
        ("buffer", ctypes.c_void_p),
        ("length", ctypes.c_size_t),
        ("capacity", ctypes.c_size_t),
        ("allocator", _Allocator),
    ]


class _Info(ctypes.Structure):
    """rmw_message_info_t of ROS 2 Jazzy."""

    _fields_ = [
        ("source_timestamp", ctypes.c_int64),
        ("received_timestamp", ctypes.c_int64),
        ("publication_sequence_number", ctypes.c_uint64),
        ("reception_sequence_number", ctypes.c_uint64),
        ("implementation", ctypes.c_char_p),
        ("gid", ctypes.c_uint8 * _GID),
        ("from_intra_process", ctypes.c_bool),
    ]


class Unattended(CallbackGroup):
    """Group that no executor ever serves: its subscriptions are read directly."""

    def can_execute(self, entity: Any) -> bool:
        """Return False: no executor serves this group."""
        return False

    def beginning_execution(self, entity: Any) -> bool:
        """Return False: no executor serves this group."""
        return False

    def ending_execution(self, entity: Any) -> None:
        """Nothing to end."""


class RosTaker:
    """Subscription whose messages are read without an executor; a call without a message takes 1 µs.

    Args:
        node: Node that owns the subscription.
        kind: Class of the messages.
        name: Name of the topic for the middleware.
        profile: Quality of service of the subscription.

    Attributes:
        type: As given.
        handle: Handle of the subscription in rcl.
    """

    @property
    def places(self) -> tuple[int, int, int]:
        """Addresses of the subscription, of the buffer for a message, and of the information about it."""
        return (int(self.handle.pointer), *self._places)

    def __init__(self, node: Node, kind: Any, name: str, profile: QoSProfile) -> None:
        self.type, self._node = kind, node
        self._own = node.create_subscription(
            kind,
            name,
            _ignore,
            profile,
            raw=True,
            callback_group=Unattended(),
            event_callbacks=SubscriptionEventCallbacks(use_default_callbacks=False),
        )
        self.handle: Any = self._own.handle
        # The call holds the interpreter's lock, so that no other thread destroys the subscription during the call.
        rcl, rcutils = ctypes.PyDLL("librcl.so"), ctypes.PyDLL("librcutils.so")
        self._bytes, self._info = _Bytes(), _Info()
        rcutils.rcutils_get_default_allocator.restype = _Allocator
        allocator = rcutils.rcutils_get_default_allocator()
        self._free, self._forget_error = (rcutils.rcutils_uint8_array_fini, rcutils.rcutils_reset_error)
        rcutils.rcutils_uint8_array_init(ctypes.byref(self._bytes), ctypes.c_size_t(_ROOM), ctypes.byref(allocator))
        self._take = rcl.rcl_take_serialized_message
        self._take.argtypes, self._take.restype = [ctypes.c_void_p] * 4, ctypes.c_int
        self._places = ctypes.addressof(self._bytes), ctypes.addressof(self._info)
        self.handle.__enter__()  # kernels take without the interpreter's lock: it must not be destroyed meanwhile
        self._gid = self._places[1] + _Info.gid.offset
        self._is_open = True

    def take(self) -> Taken | None:
        """Oldest queued message; None if the queue is empty.

        A message that the middleware cannot deliver is skipped.
        """
        if not self._is_open:
            return None
        answer = self._take(self.handle.pointer, *self._places, None)
        if answer == _NOTHING:
            return None
        if answer != _OK:
            self._forget_error()
            return None
        return self.taken()

    def taken(self) -> Taken:
        """The last message that was taken, also by a kernel."""
        found, info = self._bytes, self._info
        return Taken(
            ctypes.string_at(found.buffer, found.length),
            ctypes.string_at(self._gid, _GID),
            info.publication_sequence_number,
            info.source_timestamp,
            info.received_timestamp,
        )

    @property
    def lost(self) -> int:
        """Number of messages of all senders that the middleware should have delivered but did not deliver.

        This also counts messages before the first received message of a sender, which message numbers cannot show. A
        call takes 1 µs.
        """
        return int(self._loss.take_event().total_count) if self._is_open else 0

    @cached_property
    def _loss(self) -> Any:
        """Event of the middleware that carries the total number of lost messages."""
        kind = QoSSubscriptionEventType.RCL_SUBSCRIPTION_MESSAGE_LOST
        with self.handle:
            return rclpy_implementation.EventHandle(self.handle, kind)

    def wait(self, seconds: float) -> None:
        """Wait for a message, at most for some time [s]; no executor is needed."""
        waiting = self._waiting
        waiting.clear_entities()
        waiting.add_subscription(self.handle)
        waiting.wait(int(seconds * 1e9))

    @cached_property
    def _waiting(self) -> Any:
        """Wait set for messages: a call takes 1 µs instead of the 200 µs of an executor."""
        return rclpy_implementation.WaitSet(1, 0, 0, 0, 0, 0, self._node.context.handle)

    def close(self) -> None:
        """Stop listening."""
        if self._is_open:
            self._is_open = False
            self.__dict__.pop("_loss", None)
            self.__dict__.pop("_waiting", None)
            self._free(ctypes.byref(self._bytes))
            self.handle.__exit__(None, None, None)
            self._node.destroy_subscription(self._own)


def _ignore(data: bytes) -> None:
    """Placeholder for the callback, which is never called."""
