"""Compiled tick: three topics taken, checked and passed on, in Python and in one compiled call.

A source sends three PoseStamped a millisecond, a reader takes what comes of them. Between them a
loop of 1 kHz does what a tick of a session does without its stages: take the newest sound message
of each topic, decode it, encode it, publish it. Once it goes the way that nodes go, once it is one
function of numba, without the interpreter's lock, that sleeps, takes and publishes by itself; each
beside a thread in Python that works for a share of the time, and does not let go of the lock then.
"""

import argparse
import ctypes
import os
import sys
import threading
import time
from dataclasses import replace
from multiprocessing import get_context
from typing import Any

import numpy as np
from numba import njit

from teleop_core.bags.layouts import layout
from teleop_core.graph.topics import MASTER_MEASURED_CP
from teleop_core.middleware.real_time import is_priority_granted
from teleop_core.nodes.discovery import choose_transport
from teleop_core.nodes.guest import Guest
from teleop_core.nodes.rate import Schedule
from teleop_core.nodes.streams import Input, Output, message_type, profile

COUNT, PRIORITY, ROOM = 3, 20, 512
IN, OUT = ([replace(MASTER_MEASURED_CP, name=f"{w}{i}") for i in range(COUNT)] for w in "ab")
KIND = message_type(MASTER_MEASURED_CP.ros_type)
POSE = np.array([0.1, 0.2, 0.3, 1.0, 0.0, 0.0, 0.0])


def _function(library: str, name: str, count: int) -> Any:
    found = getattr(ctypes.CDLL(library or None), name)
    found.argtypes, found.restype = [ctypes.c_size_t] * count, ctypes.c_int
    return found


TAKE = _function("librcl.so", "rcl_take_serialized_message", 4)
PUBLISH = _function("librcl.so", "rcl_publish_serialized_message", 3)
SLEEP, NOW = _function("", "clock_nanosleep", 4), _function("", "clock_gettime", 2)


@njit(nogil=True)
def compiled(readers, writers, messages, data, infos, at, timers, late, took):  # type: ignore[no-untyped-def]
    """All ticks: writes how late each began and how long it took, (N,) [ns]."""
    last, numbers, values = np.zeros(3, np.int64), np.zeros(3, np.uint64), np.zeros((3, 7))
    NOW(1, timers[1].ctypes.data)
    due = timers[1, 0] * 1_000_000_000 + timers[1, 1]
    for tick in range(late.shape[0]):
        due += 1_000_000
        timers[0, 0], timers[0, 1] = due // 1_000_000_000, due % 1_000_000_000
        SLEEP(1, 1, timers[0].ctypes.data, 0)
        NOW(1, timers[1].ctypes.data)
        late[tick] = timers[1, 0] * 1_000_000_000 + timers[1, 1] - due
        for i in range(readers.shape[0]):
            while TAKE(readers[i], messages[i].ctypes.data, infos[i].ctypes.data, 0) == 0:
                stamps = data[i, 4:12].view(np.uint32)
                stamp = np.int64(stamps[0]) * 1_000_000_000 + stamps[1]
                pose = data[i, at : at + 56].view(np.float64)
                if stamp > last[i] and infos[i, 2] > numbers[i] and np.isfinite(pose).all():
                    last[i], numbers[i] = stamp, infos[i, 2]
                    values[i] = pose
            data[i, at : at + 56].view(np.float64)[:] = values[i]
            if last[i]:
                PUBLISH(writers[i], messages[i].ctypes.data, 0)
        NOW(1, timers[1].ctypes.data)
        took[tick] = timers[1, 0] * 1_000_000_000 + timers[1, 1] - due - late[tick]


def in_python(node: Any, publishers: list[Any], late: Any, took: Any) -> None:
    """All ticks as nodes make them, with their classes."""
    targets = np.tile(POSE, (COUNT, 1))
    inputs = [Input(node, t, t.name, (), row) for t, row in zip(IN, targets, strict=True)]
    outputs = [Output(node, p, layout(OUT[i], ()), targets[i]) for i, p in enumerate(publishers)]
    schedule, tick = Schedule(time.monotonic_ns, time.sleep, len(late)), 0
    while tick < len(late):
        for due_ns in schedule.due()[: len(late) - tick]:
            woken_ns = time.monotonic_ns()
            for entry, output in zip(inputs, outputs, strict=True):
                if entry.newest() or entry.stamp_ns:
                    output.send(entry.stamp_ns or 0)
            late[tick], took[tick] = woken_ns - due_ns, time.monotonic_ns() - woken_ns
            tick += 1


def in_numba(node: Any, publishers: list[Any], late: Any, took: Any) -> None:
    """All ticks in one call of :func:`compiled`."""
    takers = [node.ros.create_taker(KIND, t.name, profile(t, 20, "subscription")) for t in IN]
    readers, writers = (
        np.array([each.handle.pointer for each in of], np.uint64)
        for of in (takers, [publisher.own for publisher in publishers])
    )
    data, infos = np.zeros((COUNT, ROOM), np.uint8), np.zeros((COUNT, 16), np.uint64)
    messages = np.zeros((COUNT, 8), np.uint64)  # buffer, length, capacity, allocator
    for row, room, taker in zip(messages, data, takers, strict=True):
        row[:] = np.frombuffer(bytes(taker._bytes), np.uint64)
        row[:3] = room.ctypes.data, 0, ROOM
    at = layout(IN[0], ()).encode_one(1, POSE).index(POSE[:3].tobytes())
    own = (readers, writers, messages, data, infos, at, np.zeros((2, 2), np.int64))
    compiled(*own, late[:0], took[:0])
    compiled(*own, late, took)


def measure(way: Any, ticks: int, priority: int, share: float) -> list[float]:
    """Numbers of a row of the table."""
    node = Guest(f"relay{time.monotonic_ns()}")
    publishers = [node.ros.create_publisher(KIND, t.name, profile(t)) for t in OUT]
    late, took, has_ended = np.zeros(ticks, np.int64), np.zeros(ticks, np.int64), threading.Event()

    def work() -> None:
        if priority:
            os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(priority))
        way(node, publishers, late, took)
        has_ended.set()

    threading.Thread(target=work).start()
    while not has_ended.wait(0.1 * (1.0 - share)):
        end = time.monotonic() + 0.1 * share
        while time.monotonic() < end:
            pass
    node.close()
    late_ms, took_us = late[1000:] * 1e-6, took[1000:] * 1e-3
    missed = 100.0 * float(np.mean(late_ms >= 1.0))
    return [*np.percentile(took_us, (50, 99)), *np.percentile(late_ms, (50, 99, 100)), missed]


def beside(is_source: bool) -> None:
    """Be the source, or the reader."""
    node, form = Guest("source" if is_source else "reader").ros, layout(IN[0], ())
    publishers = [node.create_publisher(KIND, t.name, profile(t)) for t in IN if is_source]
    takers = [node.create_taker(KIND, t.name, profile(t, 20, "subscription")) for t in OUT]
    schedule = Schedule(time.monotonic_ns, time.sleep)
    while True:
        for _ in schedule.due():
            for publisher in publishers:
                publisher.publish(form.encode_one(time.time_ns(), POSE))
            while any(taker.take() for taker in takers if not is_source):
                pass


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=8.0, help="length of each part")
    ticks = round(1e3 * parser.parse_args().seconds)
    os.environ.setdefault("AMENT_PREFIX_PATH", sys.prefix)
    os.environ.setdefault("ROS_DOMAIN_ID", "87")
    choose_transport()
    sys.setswitchinterval(2e-4)  # as in the processes of nodes
    for is_source in (True, False):
        get_context("spawn").Process(target=beside, args=(is_source,), daemon=True).start()
    print(f"{'':34}{'tick, us':>16}{'late, ms':>24}{'missed, %':>11}")
    print(f"{'':34}{'median':>8}{'p99':>8}{'median':>8}{'p99':>8}{'max':>8}")
    for priority in (0, PRIORITY) if is_priority_granted(PRIORITY) else (0,):
        for share in (0.0, 0.05, 1.0):
            for way, name in ((in_python, "as nodes do it"), (in_numba, "one compiled call")):
                row = measure(way, ticks, priority, share)
                where = f"{'FIFO' if priority else 'fair'}, lock {100 * share:3.0f} %"
                numbers = "{:8.1f}{:8.1f}{:8.3f}{:8.3f}{:8.2f}{:11.2f}".format(*row)
                print(f"{name:18}{where:16}{numbers}", flush=True)


if __name__ == "__main__":
    main()
