"""Taking: messages of a subscription with the identity of their sender, which rclpy leaves out.

rclpy hands over the number that a sender gave to a message, but not who the sender is; only both
together show that a message was lost. So this module itself calls what rclpy calls,
``rcl_take_serialized_message``. All that depends on the layout of rcl's structures is in here.
"""

import ctypes
from typing import Any

_OK, _NOTHING = 0, 401  # RCL_RET_OK, RCL_RET_SUBSCRIPTION_TAKE_FAILED
_ROOM = 64  # bytes at the beginning; rcl enlarges them


class _Allocator(ctypes.Structure):
    """rcutils_allocator_t."""

    _fields_ = [(name, ctypes.c_void_p) for name in (
        "allocate", "deallocate", "reallocate", "zero_allocate", "state"
    )]  # fmt: skip


class _Bytes(ctypes.Structure):
    """rcutils_uint8_array_t."""

    _fields_ = [
        ("buffer", ctypes.c_void_p), ("length", ctypes.c_size_t), ("capacity", ctypes.c_size_t),
        ("allocator", _Allocator),
    ]  # fmt: skip


class _Info(ctypes.Structure):
    """rmw_message_info_t of ROS 2 Jazzy."""

    _fields_ = [
        ("source_timestamp", ctypes.c_int64), ("received_timestamp", ctypes.c_int64),
        ("publication_sequence_number", ctypes.c_uint64),
        ("reception_sequence_number", ctypes.c_uint64),
        ("implementation", ctypes.c_char_p), ("gid", ctypes.c_uint8 * 16),
        ("from_intra_process", ctypes.c_bool),
    ]  # fmt: skip


class Taker:
    """Takes the messages of one subscription by hand; a look at an empty one takes 0.5 µs.

    Args:
        subscription: An rclpy subscription that no executor serves.
    """

    def __init__(self, subscription: Any) -> None:
        rcl, rcutils = ctypes.CDLL("librcl.so"), ctypes.CDLL("librcutils.so")
        self._bytes, self._info = _Bytes(), _Info()
        rcutils.rcutils_get_default_allocator.restype = _Allocator
        allocator = rcutils.rcutils_get_default_allocator()
        self._free, self._forget_error = (
            rcutils.rcutils_uint8_array_fini,
            rcutils.rcutils_reset_error,
        )
        rcutils.rcutils_uint8_array_init(
            ctypes.byref(self._bytes), ctypes.c_size_t(_ROOM), ctypes.byref(allocator)
        )
        self._handle = subscription.handle
        self._take = rcl.rcl_take_serialized_message
        self._take.argtypes, self._take.restype = [ctypes.c_void_p] * 4, ctypes.c_int
        self._places = ctypes.addressof(self._bytes), ctypes.addressof(self._info)

    def take(self) -> tuple[bytes, bytes, int] | None:
        """Oldest waiting message: its bytes, its sender, its number there; None if there is none.

        A message that the middleware cannot hand over is passed over.
        """
        while (answer := self._take(self._handle.pointer, *self._places, None)) != _NOTHING:
            if answer != _OK:
                self._forget_error()
                return None
            info = self._info
            data = ctypes.string_at(self._bytes.buffer, self._bytes.length)
            return data, bytes(info.gid), int(info.publication_sequence_number)
        return None

    def close(self) -> None:
        """Give back the room for a message; the subscription is its owner's to destroy."""
        self._free(ctypes.byref(self._bytes))
