"""Messages of a file one by one in the order of their log times, holding few of them at a time."""

import sys
from bisect import bisect_left
from collections.abc import Iterator
from itertools import chain
from operator import itemgetter
from typing import NamedTuple

import numpy as np

from teleop_core.bags.source import McapSource, Records


class _Message(NamedTuple):
    log_ns: int
    place: int  # offset in the file of what holds it
    channel: int
    begin: int
    end: int
    records: Records


_log_time = itemgetter(0)
_order = itemgetter(0, 1)


def in_order(source: McapSource, channels: frozenset[int]) -> Iterator[tuple[int, int, bytes]]:
    """Channel, log time [ns] and CDR bytes of messages; equal times in the order of the file.

    Chunks may overlap in time: a message is held back until no later chunk can precede it.
    """
    places = sorted(
        (p for p in source.contents.places if p.channels is None or p.channels & channels),
        key=lambda place: place.start_ns,
    )
    starts = chain((place.start_ns for place in places[1:]), [sys.maxsize])
    waiting: list[_Message] = []
    tables = source.records(places, window=sys.maxsize)
    for place, records, next_start in zip(places, tables, starts, strict=False):
        waiting += _messages(place.offset, records, channels)
        waiting.sort(key=_order)
        ready = bisect_left(waiting, next_start, key=_log_time)
        for message in waiting[:ready]:
            data = message.records.data[message.begin : message.end].tobytes()
            yield message.channel, message.log_ns, data
        del waiting[:ready]


def _messages(place: int, records: Records, channels: frozenset[int]) -> Iterator[_Message]:
    own = np.flatnonzero(np.isin(records.channel, list(channels)))
    ends = (records.begin + records.size)[own]
    columns = (records.log_ns[own], records.channel[own], records.begin[own], ends)
    for log_ns, channel, begin, end in zip(*(c.tolist() for c in columns), strict=True):
        yield _Message(log_ns, place, channel, begin, end, records)
