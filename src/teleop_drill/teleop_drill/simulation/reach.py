"""Reach: C functions by which kernels take, publish and read the clock in simulated time, as they do with ROS.

Most calls of a turn only find that no message waits, or read the clock; compiled code answers these. A message that
comes or goes is handled by the Python code of its reader or writer.
"""

import ctypes
from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
from numba import int64

from teleop_core.kernels import IS_COMPILED, inner, pointer
from teleop_core.kernels.fields import Cells, Fields, record
from teleop_core.kernels.memory import call, floats, integers

BEGIN_NS = 1_000_000_000_000
"""First value of monotonic clocks [ns]."""
EPOCH_NS = 1_800_000_000_000_000_000
"""Offset of the system's clocks from the monotonic clocks [ns]."""
LOOK_NS = 60
"""Time to read a clock [ns]; it makes time pass in a loop that only reads the clock."""
TAKE_NS = 900
"""Time that the middleware needs to take a message, measured with rclpy [ns]."""
NEVER_NS = 2**62
_SECOND_NS = 1_000_000_000
_EMPTY = 401  # RCL_RET_SUBSCRIPTION_TAKE_FAILED
_FOUR = int64(int64, int64, int64, int64)
_Callback = ctypes.CFUNCTYPE(ctypes.c_int32, *[ctypes.c_int64] * 4)


class Context(Fields):
    """Clocks of a process: address of the monotonic time [ns], error of its system's clock [ns], and its drift."""

    now_at: int
    offset_ns: int
    drift: float


class End(Fields):
    """A reader or a writer for kernels.

    ``now_at`` is the address of the monotonic time. ``since_ns`` is the time at which the oldest message of a reader
    arrives, or at which a writer has discovered its first reader. ``handle`` is the address of its Python function.
    """

    now_at: int
    since_ns: int
    handle: int


@inner
def _clock(kind: int, time_at: int, context: int, _: int) -> int:
    """As ``clock_gettime``, with the address of a :class:`Context`."""
    own, time = integers(context, 2), integers(time_at, 2)
    now = integers(own[0], 1)
    now[0] += LOOK_NS
    time_ns = now[0]
    if kind == 0:
        drift = floats(context, 3)[2]
        time_ns += EPOCH_NS + own[1]
        if drift != 0.0:
            time_ns += np.int64(np.rint(drift * (now[0] - BEGIN_NS)))
    time[0], time[1] = time_ns // _SECOND_NS, time_ns % _SECOND_NS
    return 0


@inner
def _take(reader: int, message_at: int, info_at: int, _: int) -> int:
    """As ``rcl_take_serialized_message``."""
    own = integers(reader, 3)
    now = integers(own[0], 1)
    if own[1] > now[0] + TAKE_NS:
        now[0] += TAKE_NS
        return _EMPTY
    return call(own[2], message_at, info_at, 0, 0)


@inner
def _publish(writer: int, message_at: int, _: int, __: int) -> int:
    """As ``rcl_publish_serialized_message``."""
    return call(integers(writer, 3)[2], message_at, 0, 0, 0)


@inner
def _matched(writer: int, count_at: int, _: int, __: int) -> int:
    """As ``rcl_publisher_get_subscription_count``, but counts at most one reader."""
    own = integers(writer, 3)
    integers(count_at, 1)[0] = own[1] <= integers(own[0], 1)[0]
    return 0


@cache
def functions() -> dict[str, int]:
    """Addresses of the C functions, by the names of :class:`~teleop_core.nodes.wire.Calls`; none without a compiler."""
    if not IS_COMPILED:
        return {}
    made: dict[str, Any] = {"clock": _clock, "take": _take, "publish": _publish, "matched": _matched}
    return {name: pointer(one, _FOUR)._wrapper_address for name, one in made.items()}  # type: ignore[attr-defined]


class Reached:
    """Record of a reader or writer for kernels, and the Python function that handles its messages.

    Args:
        now_at: Address of the monotonic time.
        handle: Called with the address of the message, ``rcutils_uint8_array_t``, and of the information about it;
            returns what rcl would return.
        keep: Receives an exception, which cannot pass through compiled code.

    Attributes:
        address: Address of the record.
    """

    def __init__(self, now_at: int, handle: Callable[[int, int], int], keep: Callable[[BaseException], None]) -> None:
        def answer(message_at: int, info_at: int, _: int, __: int) -> int:
            try:
                return handle(message_at, info_at)
            except BaseException as error:
                keep(error)
                return _EMPTY

        self._callback = _Callback(answer)
        own = self._own = record(End)
        own["now_at"], own["since_ns"] = now_at, NEVER_NS
        own["handle"] = ctypes.cast(self._callback, ctypes.c_void_p).value
        self.address = int(np.asarray(own).ctypes.data)
        self._since = Cells(own).number("since_ns")

    def since(self, time_ns: int) -> None:
        """Set the time from which on the Python function is called [ns]."""
        self._since[0] = time_ns
