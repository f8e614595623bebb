"""Owner: finds the sender that commands the arm, from sent messages, taken messages, and the slave's own report."""

import struct

from teleop_core.graph.topics import NO_COMMAND_NS, SLAVE_SERVO_JP
from teleop_core.middleware.platform import Taken
from teleop_core.nodes.tuned import NodeParameters
from teleop_drill.simulation.bus import Bus
from teleop_drill.simulation.ends import Reader
from teleop_drill.simulation.machine import Process

_TOPIC, _SLAVE = f"/{SLAVE_SERVO_JP.name}", "/slave"
_STAMP = struct.Struct("<4xiI")
_SLACK_NS = 10_000_000
"""Tolerance for the time between two readings of a clock, or between two turns of a loop [ns]."""
_SILENCE_NS = round(1e9 * NodeParameters().owner_silence) - _SLACK_NS
"""Silence of the commanding sender after which another sender may command."""
_STREAM = 3
"""Number of commands in a row that no other sender may interrupt."""


class Owner:
    """Detects whether two senders command an arm at the same time.

    Args:
        bus: The middleware, whose commands are observed.
        timeout: Silence after which a stream no longer commands the arm [s].

    Attributes:
        followed_ns: Time at which a setpoint last followed a new command [ns].
    """

    def __init__(self, bus: Bus, timeout: float) -> None:
        self._bus, self._timeout_ns = bus, round(1e9 * timeout) - _SLACK_NS
        self._senders: dict[int, bytes] = {}  # sender of each command, by the stamp of the command
        self._silences: dict[int, int] = {}  # silence of the commanding sender before each change of the sender [ns]
        self._heard_ns: dict[bytes, int] = {}
        self._process: Process | None = None
        self._forget(None)
        bus.seen[_TOPIC], bus.heard[_TOPIC] = self._note_sent, self._note_taken

    @property
    def leader(self) -> bytes:
        """Sender of the command that a setpoint followed last; empty before the first."""
        return self._leader

    def _forget(self, process: Process | None) -> None:
        self._process, self._leader, self._is_driven = process, b"", False
        self._stamp_ns = self._new_ns = self.followed_ns = self._in_row = 0

    def judge(self, process: Process | None, stamp_ns: int, *, is_driven: bool) -> str:
        """Text about an error in the ownership of the arm; empty if there is none.

        Args:
            process: Process of the setpoint.
            stamp_ns: Stamp of the command that it follows [ns].
            is_driven: Whether a speed command moves the arm.
        """
        now_ns = self._bus.scheduler.now_ns
        if process is not self._process:
            self._forget(process)
        if not stamp_ns:
            return "a setpoint has the stamp 0, which clients take for none"
        begins, self._is_driven = is_driven and not self._is_driven, is_driven
        silence_ns = now_ns - self.followed_ns
        if begins and self._in_row >= _STREAM and silence_ns < self._timeout_ns:
            return f"follows a speed command {1e-06 * silence_ns:.0f} ms after a command of a stream"
        last_ns, self._new_ns = self._new_ns, 0
        if stamp_ns not in {NO_COMMAND_NS, self._stamp_ns}:
            self._in_row = self._in_row + 1 if silence_ns < self._timeout_ns else 0
            self._stamp_ns, self.followed_ns, self._new_ns = stamp_ns, now_ns, stamp_ns
        # A session in one process sends its setpoint before the command that it follows.
        return self._judge_sender(last_ns) if last_ns else ""

    def _judge_sender(self, stamp_ns: int) -> str:
        sender, before = self._senders.get(stamp_ns), self._leader
        if sender is None:
            return f"follows a command of stamp {stamp_ns}, which no process has sent"
        self._leader = sender
        writers = {one.sender: one for one in self._bus.writers.get(_TOPIC, ())}
        if not any(one.node == _SLAVE for one in self._bus.readers.get(_TOPIC, ())):
            is_inside = sender in writers and writers[sender].process is self._process
            return "" if is_inside else "follows another process than its own"
        silence_ns = self._silences.get(stamp_ns, _SILENCE_NS)
        if before in writers and before != sender and silence_ns < _SILENCE_NS:
            return f"follows a second sender {1e-06 * silence_ns:.0f} ms after a message of the first one"
        return ""

    def _note_sent(self, taken: Taken) -> None:
        if len(taken.data) >= _STAMP.size:
            self._senders.setdefault(stamp_of(taken), taken.sender)

    def _note_taken(self, reader: Reader, taken: Taken) -> None:
        if reader.node != _SLAVE or len(taken.data) < _STAMP.size:
            return
        now_ns = self._bus.scheduler.now_ns
        self._heard_ns[taken.sender] = now_ns
        if self._leader and taken.sender != self._leader:
            self._silences[stamp_of(taken)] = now_ns - self._heard_ns.get(self._leader, 0)


def stamp_of(taken: Taken) -> int:
    """Stamp of a message with a header [ns]."""
    seconds, nanoseconds = _STAMP.unpack_from(taken.data)
    return int(seconds) * 1_000_000_000 + int(nanoseconds)
