"""Network: a stage between the master's side and the slave's, which delays and loses packets.

Commands go to the slave, and the slave's values come back. The stages on each side get the values that arrived, with
the original stamps, so that the age of the values is known.
"""

import math

import numpy as np

from teleop_core.base import fill
from teleop_core.coupling.network import CHANCES, NETWORKS, deadband, link, packet_size
from teleop_core.coupling.network.presets import NetworkParameters, WayParameters
from teleop_core.graph import DT, Row, RunningStage, Stage, assign
from teleop_core.graph.topics import (
    ENERGY,
    MASTER_ENERGY,
    NETWORK_JAW_SERVO_JP,
    NETWORK_MASTER_ENERGY,
    NETWORK_MEASURED_CF,
    NETWORK_MEASURED_CP,
    NETWORK_REACH,
    NETWORK_SERVO_CF,
    NETWORK_SERVO_CP,
    NETWORK_SETPOINT_CP,
    NETWORK_SLAVE_ENERGY,
    NETWORK_STATE,
    NO_COMMAND_NS,
    SLAVE_ENERGY,
    SLAVE_JAW_SERVO_JP,
    SLAVE_MEASURED_CF,
    SLAVE_MEASURED_CP,
    SLAVE_REACH,
    SLAVE_SERVO_CF,
    SLAVE_SERVO_CP,
    SLAVE_SETPOINT_CP,
    Topic,
)
from teleop_core.kernels import Array, Vector3, inner, kernel, record

THERE, BACK = 0, 1
_TOLD = 20
"""Number of ticks from one report to the next."""
_FOLLOWS_NS = 100_000_000
"""A slave does not follow if the command of its setpoint is older than this [ns]."""
_SETPOINT, _POSE, _FORCE, _REACH = 0, 7, 14, 20
_ENERGY = _REACH + len(SLAVE_REACH.columns)
"""Indices in a packet from the slave: setpoint, measured pose, force, reach, energies."""
_ENERGY_THERE = 7  # index of the energies in a packet to the slave, after the command
_JAW_THERE = _ENERGY_THERE + len(ENERGY)
_FORCE_THERE = _JAW_THERE + 1
_WIDTHS = (_FORCE_THERE + 6, _ENERGY + len(ENERGY))
_CARRIED = (
    (SLAVE_SERVO_CP, MASTER_ENERGY, SLAVE_JAW_SERVO_JP, SLAVE_SERVO_CF),
    (SLAVE_SETPOINT_CP, SLAVE_MEASURED_CP, SLAVE_MEASURED_CF, SLAVE_REACH, SLAVE_ENERGY),
)
"""Topics of a packet to the slave, and topics of a packet from the slave, in the order of their stamps."""


class NetworkRecord(NetworkParameters, link.LinkRecord, deadband.DeadbandRecord):
    """Parameter record of the network."""

    is_incremental: int
    clock_offset_ns: int


def derive(p: NetworkRecord, parameters: NetworkParameters, dt: float) -> None:
    """Write what follows from the parameters, their preset and the tick [s]."""
    p.is_incremental = parameters.commands == "incremental"
    p.clock_offset_ns = round(1e9 * parameters.clock_offset)
    deadband.derive(p, parameters.deadband, dt)
    for k, given in enumerate(parameters.ways):
        p.least_delay[k], p.loss[k], p.queue[k] = given.least_delay, given.loss, given.queue
        p.keeps_order[k] = given.packet_order == "kept"
        p.every[k] = max(1, math.floor(1.0 / (given.packet_rate * dt) + 0.5))
        p.byte_ticks[k] = 8.0 / (given.bandwidth * dt) if given.bandwidth else 0.0


class NetworkState(deadband.DeadbandState):
    """State record of the network."""

    sent_ns: int
    first_ns: int  # time of the first tick
    base: Vector3  # origin of increments [m]


@inner
def _pack(row_values: Array, packet: Array, at: int) -> None:
    for i in range(row_values.shape[0]):
        packet[at + i] = row_values[i]


@inner
def _unpack(packet: Array, at: int, row_values: Array) -> None:
    for i in range(row_values.shape[0]):
        row_values[i] = packet[at + i]


@inner
def _clock_ahead(p: NetworkRecord, s: NetworkState, time_ns: int) -> int:
    """Lead of the slave's clock over our clock [ns], at a time [ns] of our clock."""
    return p.clock_offset_ns + int(1e-6 * p.clock_drift * (time_ns - s.first_ns))


@inner
def _as_stamped_there(p: NetworkRecord, s: NetworkState, stamp_ns: int) -> int:
    """Stamp on the slave's clock of a sample whose time on our clock is ``stamp_ns`` [ns]."""
    if stamp_ns <= NO_COMMAND_NS:
        return stamp_ns
    # A stamp of 0 or less means that there is no sample.
    return max(stamp_ns + _clock_ahead(p, s, stamp_ns), NO_COMMAND_NS)


@inner
def _send_there(p: NetworkRecord, s: NetworkState, there: link.Direction, row: Row, dt: float) -> None:
    """Send the command if it is new, and if the master's side has received a pose of the slave."""
    is_new = row.slave_servo_cp_ns not in (0, s.sent_ns)
    if not (is_new and s.newest[BACK] > 0 and link.may_send(p, s, THERE)):
        return
    force = row.slave_servo_cf[:3]
    moves_jaw = row.slave_jaw_servo_jp[0] != there.packet[_JAW_THERE]
    if not (moves_jaw or deadband.is_worth_telling(p, s, THERE, row.slave_servo_cp, force)):
        return
    for i in range(3):
        if s.sent_ns != 0:
            there.moved[0, i] = row.slave_servo_cp[i] - s.told_pose[THERE, i]
    deadband.remember_told(s, THERE, row.slave_servo_cp, force)
    s.sent_ns = row.slave_servo_cp_ns
    _pack(row.slave_servo_cp, there.packet, 0)
    _pack(row.master_energy, there.packet, _ENERGY_THERE)
    _pack(row.slave_jaw_servo_jp, there.packet, _JAW_THERE)
    _pack(row.slave_servo_cf, there.packet, _FORCE_THERE)
    there.packet_ns[0], there.packet_ns[1] = row.slave_servo_cp_ns, row.master_energy_ns
    there.packet_ns[2], there.packet_ns[3] = row.slave_jaw_servo_jp_ns, row.slave_servo_cf_ns
    link.send_packet(p, s, there, THERE, dt)


@inner
def _send_back(p: NetworkRecord, s: NetworkState, back: link.Direction, row: Row, dt: float) -> None:
    """Send the slave's values as soon as there are values."""
    if row.slave_setpoint_cp_ns == 0 or not link.may_send(p, s, BACK):
        return
    force = row.slave_measured_cf[:3]
    if not deadband.is_worth_telling(p, s, BACK, row.slave_measured_cp, force):
        return
    deadband.remember_told(s, BACK, row.slave_measured_cp, force)
    _pack(row.slave_setpoint_cp, back.packet, _SETPOINT)
    _pack(row.slave_measured_cp, back.packet, _POSE)
    _pack(row.slave_measured_cf, back.packet, _FORCE)
    _pack(row.slave_reach, back.packet, _REACH)
    _pack(row.slave_energy, back.packet, _ENERGY)
    # Setpoint and reach have the stamp of a command, on our clock; all other stamps are on the slave's clock.
    back.packet_ns[0], back.packet_ns[3] = row.slave_setpoint_cp_ns, row.slave_reach_ns
    back.packet_ns[1] = _as_stamped_there(p, s, row.slave_measured_cp_ns)
    back.packet_ns[2] = _as_stamped_there(p, s, row.slave_measured_cf_ns)
    back.packet_ns[4] = _as_stamped_there(p, s, row.slave_energy_ns)
    link.send_packet(p, s, back, BACK, dt)


@inner
def _take_there(p: NetworkRecord, s: NetworkState, there: link.Direction, row: Row) -> None:
    """Take the command that arrived; increments are added to the slave's setpoint, or to its last command."""
    link.take_packet(s, there, THERE)
    if s.arrived[THERE]:
        _unpack(there.came, 0, row.network_servo_cp)
        _unpack(there.came, _ENERGY_THERE, row.network_master_energy)
        _unpack(there.came, _JAW_THERE, row.network_jaw_servo_jp)
        _unpack(there.came, _FORCE_THERE, row.network_servo_cf)
        row.network_servo_cp_ns, row.network_master_energy_ns = there.came_ns[0], there.came_ns[1]
        row.network_jaw_servo_jp_ns, row.network_servo_cf_ns = there.came_ns[2], there.came_ns[3]
    if p.is_incremental == 0:
        return
    setpoint_ns = row.slave_setpoint_cp_ns
    is_led = setpoint_ns > NO_COMMAND_NS and there.came_ns[0] - setpoint_ns <= _FOLLOWS_NS
    for i in range(3):
        before = s.base[i] if is_led else row.slave_setpoint_cp[i]
        s.base[i] = before + there.moved[1, i]
        if s.arrived[THERE]:
            row.network_servo_cp[i] = s.base[i]


@inner
def _take_back(s: NetworkState, back: link.Direction, row: Row) -> None:
    link.take_packet(s, back, BACK)
    if s.arrived[BACK] == 0:
        return
    _unpack(back.came, _SETPOINT, row.network_setpoint_cp)
    _unpack(back.came, _POSE, row.network_measured_cp)
    _unpack(back.came, _FORCE, row.network_measured_cf)
    _unpack(back.came, _REACH, row.network_reach)
    _unpack(back.came, _ENERGY, row.network_slave_energy)
    row.network_setpoint_cp_ns, row.network_measured_cp_ns = back.came_ns[0], back.came_ns[1]
    row.network_measured_cf_ns, row.network_reach_ns = back.came_ns[2], back.came_ns[3]
    row.network_slave_energy_ns = back.came_ns[4]


@kernel
def network_step(
    p: NetworkRecord, s: NetworkState, there: link.Direction, back: link.Direction, row: Row, dt: float
) -> None:
    """One tick: send the new values of each side, and write the values that arrive at the other side.

    Args:
        p: Parameter record.
        s: State record; written.
        there: :class:`~teleop_core.coupling.network.link.Direction` to the slave; written.
        back: :class:`~teleop_core.coupling.network.link.Direction` from the slave; written.
        row: Signals.
        dt: Tick [s].
    """
    s.tick += 1
    if s.first_ns == 0:
        s.first_ns = row.now_ns
    link.serve_line(p, s, there, THERE, dt)
    link.serve_line(p, s, back, BACK, dt)
    _send_there(p, s, there, row, dt)
    _send_back(p, s, back, row, dt)
    _take_there(p, s, there, row)
    _take_back(s, back, row)
    s.next += 1
    if s.tick % _TOLD == 1:
        state = row.network_state
        for k in range(2):
            state[3 * k], state[3 * k + 1] = s.sent[k], s.lost[k]
            state[3 * k + 2] = s.sent[k] - s.newest[k]
        state[6] = 1e-9 * _clock_ahead(p, s, row.now_ns)


class NetworkLink(RunningStage):
    """Stage between both sides: two directions, each a calendar of packets.

    Raises:
        ParameterError: A trace cannot be read.
    """

    def __init__(self, parameters: NetworkParameters, dt: float = DT) -> None:
        super().__init__(NETWORK, 0, dt)
        self.parameters, self.state = record(NetworkRecord), record(NetworkState)
        self.kernel, self._seed, self.ahead = network_step, parameters.seed, link.BLOCK
        self._ways = [
            self._made(width, topics, given)
            for width, topics, given in zip(_WIDTHS, _CARRIED, parameters.ways, strict=True)
        ]
        self.arguments = (self.parameters, self.state, *self._ways)
        self._begin = self.signals.copy()
        self.retune(parameters)
        self.reset()

    @staticmethod
    def _made(width: int, topics: tuple[Topic, ...], given: WayParameters) -> link.Direction:
        kind = NETWORKS.find(given.kind.kind)
        numbers = kind.numbers(given.kind.parameters)
        return link.make_way(width, packet_size.message_sizes(topics), kind.draw_pointer, numbers)

    def reset(self) -> None:
        """Empty both directions, and restart the random numbers from the seed."""
        assign(self.state, 0)
        assign(self.signals, self._begin)
        for way in self._ways:
            way.clear()
        self._rng = np.random.default_rng((self._seed, *b"network"))
        self.state["next"] = link.BLOCK

    def retune(self, parameters: NetworkParameters) -> None:
        """Take another network from the next packet on; packets in transit arrive as before."""
        fill(self.parameters, parameters)
        derive(self.parameters, parameters, self.dt)
        for k, given in enumerate(parameters.ways):
            self._take_kind(k, given)

    def _take_kind(self, k: int, given: WayParameters) -> None:
        way, kind = self._ways[k], NETWORKS.find(given.kind.kind)
        numbers = kind.numbers(given.kind.parameters)
        if kind.draw_pointer is way.draw and len(numbers) == len(way.numbers):
            way.numbers[:] = numbers  # in place, so that the composed tick stays valid
            return
        way.memory[:] = 0.0
        self._ways[k] = way._replace(draw=kind.draw_pointer, numbers=numbers)
        self.arguments = (self.parameters, self.state, *self._ways)
        self._bound = None

    def prepare(self, ticks: int) -> None:
        """Draw the random numbers of the next ticks."""
        used = int(self.state["next"])
        if used + ticks <= link.BLOCK:
            return
        for way in self._ways:
            way.chances[: link.BLOCK - used] = way.chances[used:]
            way.chances[link.BLOCK - used :] = self._rng.random((used, CHANCES + 1))
        self.state["next"] = 0

    def concerns(self) -> list[str]:
        """Text about a direction in which no packets arrive."""
        s, found = self.state, []
        for k, way in ((THERE, "to the slave"), (BACK, "from the slave")):
            behind = int(s["sent"][k] - s["newest"][k])
            if behind and s["sent"][k] == s["lost"][k]:
                found.append(f"the network lost all {int(s['lost'][k])} packets {way}")
        return found


_TAKEN = (
    SLAVE_SERVO_CP, SLAVE_SETPOINT_CP, SLAVE_MEASURED_CP, SLAVE_MEASURED_CF, SLAVE_REACH,
    MASTER_ENERGY, SLAVE_ENERGY, SLAVE_JAW_SERVO_JP, SLAVE_SERVO_CF,
)  # fmt: skip
NETWORK = Stage(
    "network",
    NetworkParameters,
    reads=_TAKEN,
    writes=(
        NETWORK_SERVO_CP, NETWORK_SETPOINT_CP, NETWORK_MEASURED_CP, NETWORK_MEASURED_CF,
        NETWORK_REACH, NETWORK_MASTER_ENERGY, NETWORK_SLAVE_ENERGY, NETWORK_JAW_SERVO_JP,
        NETWORK_SERVO_CF, NETWORK_STATE,
    ),
    late=(SLAVE_SETPOINT_CP, SLAVE_MEASURED_CP, SLAVE_MEASURED_CF, SLAVE_REACH, SLAVE_ENERGY),
    optional=(MASTER_ENERGY, SLAVE_ENERGY, SLAVE_JAW_SERVO_JP, SLAVE_SERVO_CF),
    replaces=_TAKEN,
    spares=(
        "slave/servo_cp@display", "slave/measured_cf@passivity", "slave/measured_cp@passivity",
        "slave/measured_cf@impedance", "slave/setpoint_cp@impedance",
    ),
    on_demand=(
        NETWORK_MASTER_ENERGY, NETWORK_SLAVE_ENERGY, NETWORK_JAW_SERVO_JP, NETWORK_SERVO_CF,
    ),
    make=NetworkLink,
    node="teleop_core.nodes.network:NetworkNode",
)  # fmt: skip
