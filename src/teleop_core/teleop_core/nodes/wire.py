"""Wire: the compiled part of a live turn, from the bytes of the middleware to a stage's signals and back.

A record for each input and each output holds the form of its messages, its rules, its counts, and addresses: of the
signals, of buffers, and of the middleware's objects. One call then takes, admits, reads and accepts all messages of a
stage, or writes or sends all of them, without the interpreter. Python decides only what is rare: a message of another
form, a link with a delay, a report.

The middleware is reached in two ways. ROS and the simulated machine give the addresses of C functions, so that kernels
take and send by themselves. A platform without them takes and sends in Python; admission, reading, acceptance and
writing are the same kernels.
"""

from typing import Annotated

import numpy as np

from teleop_core.bags.messages import QUATERNION_TOLERANCE, Refusal
from teleop_core.graph.topics import NO_COMMAND_NS, SELDOM_NS
from teleop_core.kernels import inner, kernel
from teleop_core.kernels.fields import Fields, Integers
from teleop_core.kernels.geometry import Array
from teleop_core.kernels.memory import call, floats, integers, octets, shorts

REASONS = tuple(Refusal)
"""Reasons of a refusal; kernels name a reason by its place in this tuple, counted from 1."""
SECOND_NS = 1_000_000_000
SILENCE_NS = 2_000_000_000
"""After this time without a valid message, a sender may restart with any stamp [ns]."""
NOTHING, NEW, FOREIGN = 0, 1, 2
"""Answers of :func:`take`: no valid message is waiting; a valid message was written to the signals; the message in the
buffer has another form, and Python must read it."""

_NOT_FINITE = 1 + REASONS.index(Refusal.NOT_FINITE)
_NOT_UNIT = 1 + REASONS.index(Refusal.NOT_UNIT)
_NOT_NEWER = 1 + REASONS.index(Refusal.NOT_NEWER)
_SECOND_PUBLISHER = 1 + REASONS.index(Refusal.SECOND_PUBLISHER)
_FLOOD = 1 + REASONS.index(Refusal.FLOOD)
_EMPTY = 401  # RCL_RET_SUBSCRIPTION_TAKE_FAILED: the queue is empty
_HEADER = 4  # bytes before the first number; numbers are aligned from there
_FRAME = 20  # bytes of a feed's frame before its message


class Calls(Fields):
    """Addresses of the C functions of the middleware and of the clock; all 0 on a platform that has none.

    The function of the clock also gets ``context``, which the system's function does not read.

    What they answer is written into the record itself: seconds and nanoseconds of the clock, and a number of
    subscriptions. Memory beside it could be freed while a kernel that holds the record still has its address.
    """

    take: int
    forget_error: int
    publish: int
    matched: int
    clock: int
    context: int
    time: Annotated[Integers, 2]
    count: Annotated[Integers, 1]


class Form(Fields):
    """Form of the messages of one stream, as :class:`~teleop_core.bags.layouts.Layout` has it.

    ``places_at`` is the place of each value among the message's numbers: float64 or, if ``is_whole``, int32.
    """

    has_form: int
    is_pose: int
    is_whole: int
    width: int
    size: int
    template_at: int
    mask_at: int
    places_at: int


class Reading(Form):
    """An input: its form and rules, its middleware objects, its target, and what is known of its sender.

    The five fields from ``received`` on are also written by a sender in the same process.
    """

    reader: int
    message_at: int
    info_at: int
    target_at: int
    row_at: int
    stamp_at: int
    port: int
    is_buttons: int
    may_repeat: int
    needs_python: int
    received: int
    has_stamp: int
    stamp_ns: int
    arrival_ns: int
    is_new: int
    answer: int
    has_found: int
    refused: Annotated[Integers, 10]
    limit: int
    silence_ns: int
    has_owner: int
    owner_low: int
    owner_high: int
    number: int
    heard_ns: int
    window_ns: int
    in_window: int
    gaps: int
    repeats: int
    reordered: int
    owners: int
    has_other: int
    conflict: int
    fault: int
    newest_age_ns: int
    ages_at: int
    ages: int
    ages_count_at: int


ZERO, FROZEN, BACKWARDS = 1, 2, 3
"""Faults of a sender's stamps, as ``Reading.fault`` names them; 0: none."""


class Writing(Form):
    """An output: its form and rules, its buffer, its readers in this process, and its middleware object."""

    source_at: int
    stamp_at: int
    buffer_at: int
    passes_on: int
    last_ns: int
    is_seldom: int
    has_kept: int
    kept_at: int
    kept_ns: int
    is_silent: int
    readers_at: int
    readers: int
    is_pending: int
    pending_ns: int
    written: int
    sent: int
    writer: int
    message_at: int
    is_latched: int
    is_fed: int
    fed_index: int
    fed: int


class Block(Fields):
    """Bytes that a loop feeds to the recorder: ``fill`` of ``room`` bytes at an address are used."""

    is_open: int
    at: int
    room: int
    fill: int


# -- clocks ----------------------------------------------------------------------------------------


@inner
def read_clock(calls: Calls, kind: int) -> int:
    """Time of a clock of the system [ns]; ``kind`` is 0 for the time of day, 1 for the monotonic clock."""
    call(calls.clock, kind, calls.time.ctypes.data, calls.context, 0)
    return calls.time[0] * SECOND_NS + calls.time[1]


# -- inputs ----------------------------------------------------------------------------------------


@kernel
def admit(r: Reading, low: int, high: int, number: int, now_ns: int) -> int:
    """Reason to refuse a message before it is read; 0 for a message of the owner.

    Args:
        r: The input.
        low: First eight bytes of the publisher's identifier.
        high: Last eight bytes of the publisher's identifier.
        number: Number of the message in the publisher's sequence; 0 if the middleware has no numbers.
        now_ns: Monotonic time [ns].
    """
    if now_ns - r.window_ns >= SECOND_NS:
        r.window_ns, r.in_window = now_ns, 0
    r.in_window += 1
    if r.in_window > r.limit:
        return _FLOOD
    if not (r.has_owner and low == r.owner_low and high == r.owner_high):
        if r.has_owner and now_ns - r.heard_ns <= r.silence_ns:
            r.has_other = 1
            return _SECOND_PUBLISHER
        r.has_owner, r.owner_low, r.owner_high = 1, low, high
        r.number, r.has_other = 0, 0
        r.owners += 1
    r.heard_ns = now_ns
    if number > r.number:  # a message that was only overtaken is not lost
        if r.number:
            r.gaps += number - r.number - 1
        r.number = number
    if r.has_other:  # the owner still sends
        r.conflict = 1
    return 0


@kernel
def note_stamp(r: Reading, stamp_ns: int, time_ns: int) -> None:
    """Store the age of a valid message; ``time_ns`` is the time of the system's clock [ns]."""
    r.newest_age_ns, r.fault = time_ns - stamp_ns, 0
    count = integers(r.ages_count_at, 1)
    floats(r.ages_at, r.ages)[count[0] % r.ages] = r.newest_age_ns
    count[0] += 1


@kernel
def note_old(r: Reading, stamp_ns: int, last_ns: int) -> None:
    """Count a message whose stamp is not newer than the last stamp."""
    if stamp_ns < last_ns:
        r.reordered += 1
        r.fault = BACKWARDS
    else:
        r.repeats += 1
        r.fault = FROZEN
    if stamp_ns == 0:
        r.fault = ZERO


@kernel
def read(r: Reading, address: int, length: int) -> int:
    """Write the values of a message of the input's own form to its row; return the stamp [ns], or -1."""
    if not r.has_form or length < r.size:
        return -1
    words = r.size // 8
    given, template, mask = integers(address, words), integers(r.template_at, words), integers(r.mask_at, words)
    for i in range(words):
        if (given[i] ^ template[i]) & mask[i]:
            return -1
    ends, last, bits = octets(address, r.size), octets(r.template_at, r.size), octets(r.mask_at, r.size)
    for i in range(8 * words, r.size):
        if (ends[i] ^ last[i]) & bits[i]:
            return -1
    row, places = floats(r.row_at, r.width), integers(r.places_at, r.width)
    head = shorts(address, length // 4)
    if r.is_whole:
        for i in range(r.width):
            row[i] = head[places[i]]
    else:
        numbers = floats(address + _HEADER, (length - _HEADER) // 8)
        for i in range(r.width):
            row[i] = numbers[places[i]]
    return int(head[1]) * SECOND_NS + (int(head[2]) & 0xFFFFFFFF)


@inner
def _fault(r: Reading, row: Array, stamp_ns: int, has_last: bool, last_ns: int) -> int:
    """Reason to refuse the values of a message; 0 for a valid one.

    Values that are not finite, a quaternion that is not of unit length, or a stamp that is not newer than the last one.
    """
    total = 0.0
    for i in range(r.width):
        total += row[i]
    if not np.isfinite(total):
        return _NOT_FINITE
    if r.is_pose:
        square = row[3] * row[3] + row[4] * row[4] + row[5] * row[5] + row[6] * row[6]
        if not abs(np.sqrt(square) - 1.0) <= QUATERNION_TOLERANCE:
            return _NOT_UNIT
    return _NOT_NEWER if has_last and stamp_ns <= last_ns else 0


@kernel
def accept(r: Reading, stamp_ns: int, now_ns: int, time_ns: int) -> int:
    """Write the values in the row to the signals if the message is valid; return 1 if so, else 0.

    Args:
        r: The input.
        stamp_ns: Stamp of the message [ns].
        now_ns: Monotonic time [ns].
        time_ns: Time of the system's clock [ns].
    """
    row = floats(r.row_at, r.width)
    has_last, last_ns = bool(r.has_stamp), r.stamp_ns
    if now_ns - r.arrival_ns > SILENCE_NS or (r.may_repeat and stamp_ns <= NO_COMMAND_NS):
        has_last = False
    elif r.may_repeat:
        last_ns -= 1
    reason = _fault(r, row, stamp_ns, has_last, last_ns)
    if reason:
        r.refused[reason - 1] += 1
        if reason == _NOT_NEWER:
            note_old(r, stamp_ns, last_ns)
        return 0
    if r.may_repeat:
        r.fault = 0
    else:
        note_stamp(r, stamp_ns, time_ns)
    target = floats(r.target_at, r.width)
    for i in range(r.width):
        target[i] = row[i]
    r.has_stamp, r.stamp_ns, r.arrival_ns = 1, stamp_ns, now_ns
    return 1


@kernel
def look(r: Reading, given: Integers) -> None:
    """Admit and read a message that Python has taken; ``r.answer`` is :data:`NOTHING` if it was refused.

    Args:
        r: The input.
        given: The two halves of the publisher's identifier, the number of the message, the monotonic time [ns], and the
            address and length of the message. The first is set to the stamp [ns].
    """
    r.received += 1
    reason = admit(r, given[0], given[1], given[2], given[3])
    if reason:
        r.refused[reason - 1] += 1
        r.answer = NOTHING
        return
    given[0] = read(r, given[4], given[5])
    r.answer = NEW if given[0] >= 0 else FOREIGN


@kernel
def answer_accept(r: Reading, given: Integers) -> None:
    """:func:`accept` of a stamp and two times, with its answer in the record."""
    r.answer = accept(r, given[0], given[1], given[2])


@kernel
def take(r: Reading, calls: Calls) -> int:
    """Take messages from the middleware until one is valid, and write it to the signals.

    Returns:
        :data:`NOTHING`, :data:`NEW` or :data:`FOREIGN`.
    """
    if not r.reader:
        is_new, r.is_new = r.is_new, 0
        return is_new
    while True:
        answer = call(calls.take, r.reader, r.message_at, r.info_at, 0)
        if answer == _EMPTY:
            return NOTHING
        if answer != 0:  # a message that the middleware cannot deliver is skipped
            call(calls.forget_error, 0, 0, 0, 0)
            return NOTHING
        r.received += 1
        info, message = integers(r.info_at, 7), integers(r.message_at, 2)  # rmw_message_info_t, rcutils_uint8_array_t
        now_ns = read_clock(calls, 1)
        reason = admit(r, info[5], info[6], info[2], now_ns)
        if reason:
            r.refused[reason - 1] += 1
            continue
        stamp_ns = read(r, message[0], message[1])
        if stamp_ns < 0:
            return FOREIGN
        if accept(r, stamp_ns, now_ns, read_clock(calls, 0)):
            return NEW


@kernel
def answer_take(r: Reading, calls: Calls) -> None:
    """:func:`take`, with its answer in the record."""
    r.answer = take(r, calls)


@kernel
def answer_newest(r: Reading, calls: Calls) -> None:
    """:func:`newest`, with its answer in the record."""
    r.answer = newest(r, calls)


@kernel
def take_raw(places: Integers, calls: Calls, place: Integers) -> None:
    """Take one message of any subscription into the subscription's own buffer.

    Args:
        places: Addresses of each subscription, of its buffer and of its information (n, 3).
        calls: C functions.
        place: Number of subscriptions to look at, the first ones. Set to the index of the one of the message, or left
            if none has a message.
    """
    for i in range(place[0]):
        answer = call(calls.take, places[i, 0], places[i, 1], places[i, 2], 0)
        if answer == 0:
            place[0] = i
            return
        if answer != _EMPTY:
            call(calls.forget_error, 0, 0, 0, 0)


@kernel
def newest(r: Reading, calls: Calls) -> int:
    """Write the newest valid message to the signals; return as :func:`take`.

    For buttons, the first message that presses or releases a button is written, so that no press is missed.
    """
    if not r.reader:
        is_new, r.is_new = r.is_new, 0
        return is_new
    found, target = NOTHING, floats(r.target_at, r.width)
    clutch, fixture, mode = 0.0, 0.0, 0.0
    if r.is_buttons:
        clutch, fixture, mode = target[0], target[1], target[2]
    while True:
        answer = take(r, calls)
        if answer != NEW:
            r.has_found = found  # before a message of another form
            return FOREIGN if answer == FOREIGN else found
        found = NEW
        if r.is_buttons and not (target[0] == clutch and target[1] == fixture and target[2] == mode):
            return found


@kernel
def read_all(inputs: Array, calls: Calls, place: Integers) -> None:
    """Write the newest valid messages of inputs to the signals, with their stamps.

    Args:
        inputs: Records of :class:`Reading` (n,).
        calls: C functions.
        place: The first input to read; then the port to leave out, or -1. The first is set to the index of an input
            that Python must read, or to n if all are done.
    """
    for i in range(place[0], inputs.shape[0]):
        r = inputs[i]
        if r.port == place[1]:
            continue
        if r.needs_python or newest(r, calls) == FOREIGN:
            place[0] = i
            return
        if r.stamp_at and r.has_stamp:
            integers(r.stamp_at, 1)[0] = r.stamp_ns
    place[0] = inputs.shape[0]


# -- outputs ---------------------------------------------------------------------------------------


@kernel
def are_sound(outputs: Array, place: Integers) -> None:
    """Set ``place[0]`` to whether all values of outputs, records of :class:`Writing` (n,), are finite."""
    place[0] = 1
    for i in range(outputs.shape[0]):
        source = floats(outputs[i].source_at, outputs[i].width)
        for k in range(outputs[i].width):
            if not np.isfinite(source[k]):
                place[0] = 0


@inner
def _is_due(w: Writing, stamp_ns: int) -> bool:
    """Whether an output has something to say: a new answer, and for seldom ones a change or a pause."""
    if w.passes_on:
        if w.last_ns == stamp_ns:
            return False
        w.last_ns = stamp_ns
    if w.is_seldom:
        values, kept = integers(w.source_at, w.width), integers(w.kept_at, w.width)
        is_same = bool(w.has_kept)
        for i in range(w.width):
            is_same = is_same and values[i] == kept[i]
        if is_same and stamp_ns - w.kept_ns < SELDOM_NS:
            return False
        for i in range(w.width):
            kept[i] = values[i]
        w.has_kept, w.kept_ns = 1, stamp_ns
    return True


@kernel
def write_one(w: Writing, stamp_ns: int, now_ns: int, time_ns: int) -> None:
    """Write a message into the buffer of an output, and pass its values to the readers in this process.

    Args:
        w: The output.
        stamp_ns: Stamp of the message [ns].
        now_ns: Monotonic time [ns].
        time_ns: Time of the system's clock [ns].
    """
    source = floats(w.source_at, w.width)
    readers = integers(w.readers_at, 3 * w.readers)
    for i in range(w.readers):
        target, state = floats(readers[3 * i], w.width), integers(readers[3 * i + 1], 5)
        for k in range(w.width):
            target[k] = source[k]
        state[0] += 1
        state[1], state[2], state[3], state[4] = 1, stamp_ns, now_ns, 1
        if readers[3 * i + 2]:
            integers(readers[3 * i + 2], 1)[0] = stamp_ns
    head, places = shorts(w.buffer_at, w.size // 4), integers(w.places_at, w.width)
    head[1] = np.int32(stamp_ns // SECOND_NS)
    head[2] = np.int32(stamp_ns % SECOND_NS)
    if w.is_whole:
        for i in range(w.width):
            head[places[i]] = np.int32(source[i])
    else:
        numbers = floats(w.buffer_at + _HEADER, (w.size - _HEADER) // 8)
        for i in range(w.width):
            numbers[places[i]] = source[i]
    w.is_pending, w.pending_ns = 1, time_ns
    w.written += 1


@kernel
def write_all(outputs: Array, calls: Calls, place: Integers, times: Integers) -> None:
    """Write the messages of outputs that are due.

    Args:
        outputs: Records of :class:`Writing` (n,).
        calls: C functions.
        place: The first output to write; then the stamp of outputs that pass on no stamp [ns]. The first is set to
            the index of an output whose last message must be sent first, or to n if all are written.
        times: Monotonic time and time of the system's clock [ns], on a platform without C functions.
    """
    if calls.clock:
        times[0], times[1] = read_clock(calls, 1), read_clock(calls, 0)
    for i in range(place[0], outputs.shape[0]):
        w = outputs[i]
        if w.is_silent:
            continue
        if w.is_pending:
            place[0] = i
            return
        stamp_ns = integers(w.stamp_at, 1)[0] if w.stamp_at else place[1]
        if _is_due(w, stamp_ns):
            write_one(w, stamp_ns, times[0], times[1])
    place[0] = outputs.shape[0]


@kernel
def is_due(w: Writing, stamp_ns: int) -> bool:
    """Whether an output has something to say; see :func:`write_all`."""
    return _is_due(w, stamp_ns)


@inner
def _feed(w: Writing, block: Block) -> bool:
    """Append a message to the recorder's block; return whether there was room."""
    if block.fill + _FRAME + w.size > block.room:
        return False
    at = block.at + block.fill
    head = shorts(at, 3)
    head[0] = np.int32(w.size)
    head[1] = np.int32(w.fed_index | 1 << 16)
    head[2] = np.int32(w.fed + 1)
    integers(at + 12, 1)[0] = w.pending_ns
    data, given = octets(at + _FRAME, w.size), octets(w.buffer_at, w.size)
    for i in range(w.size):
        data[i] = given[i]
    block.fill += _FRAME + w.size
    return True


@kernel
def send_all(outputs: Array, calls: Calls, block: Block, place: Integers) -> None:
    """Send what is written: to the middleware if anyone reads it there, and to the recorder.

    A topic that nobody reads is not published: a later reader of a volatile topic would not receive it either.

    Args:
        outputs: Records of :class:`Writing` (n,).
        calls: C functions.
        block: Bytes for the recorder.
        place: The first output to send; set to the index of an output that Python must send, or for which the block
            has no room, or to n if all are sent.
    """
    for i in range(place[0], outputs.shape[0]):
        w = outputs[i]
        if not w.is_pending:
            continue
        if not w.writer or (w.is_fed and block.is_open and not _feed(w, block)):
            place[0] = i
            return
        calls.count[0] = 1
        if not w.is_latched:
            call(calls.matched, w.writer, calls.count.ctypes.data, 0, 0)
        if calls.count[0]:
            call(calls.publish, w.writer, w.message_at, 0, 0)
        if w.is_fed:
            w.fed += 1
        w.is_pending = 0
        w.sent += 1
    place[0] = outputs.shape[0]
