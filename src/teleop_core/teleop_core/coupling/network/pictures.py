"""Pictures over the network: each picture is one packet from the slave, by the laws of ``network.back``.

Pictures have a line of their own: they wait for each other, and not for the packets of the stage ``network``.
"""

import numpy as np

from teleop_core.base import fill
from teleop_core.coupling.network import NETWORKS, link
from teleop_core.coupling.network.network import BACK, NetworkRecord, NetworkState, derive
from teleop_core.coupling.network.presets import NetworkParameters
from teleop_core.graph import DT
from teleop_core.kernels import Integers, kernel, record


@kernel
def carry(
    p: NetworkRecord, s: NetworkState, way: link.Direction, size: int, ticks: int, due: Integers, dt: float
) -> None:
    """Send a picture in the present tick, and let time pass.

    Args:
        p: Parameter record.
        s: State record; written.
        way: The direction from the slave; written.
        size: Bytes of the picture; 0: none is sent.
        ticks: Ticks that pass, at most :data:`~teleop_core.coupling.network.link.BLOCK`.
        due: Tick of arrival of each picture, by its number modulo the length; written when the line transmits it, and
            0 for a lost one.
        dt: Tick [s].
    """
    s.next = 0
    if size > 0:
        if link.may_send(p, s, BACK):
            way.sizes[0], way.packet_ns[0] = size, 1  # bytes of a topic without a stamp do not count
            link.queue_packet(p, s, way, BACK)
        else:
            s.sent[BACK] += 1
            s.lost[BACK] += 1
        due[s.sent[BACK] % due.shape[0]] = 0
    for k in range(ticks + 1):
        while s.waits[BACK] > 0 and s.free[BACK] <= s.tick:
            number = way.waiting_ns[s.head[BACK], 1]
            due[number % due.shape[0]] = link.transmit(p, s, way, BACK, dt)
        if k < ticks:
            s.tick += 1
            s.next = k


class PictureWay:
    """Way of the pictures of one camera over the network, by all parameters of ``network.back``.

    A picture that a newer one has overtaken arrives all the same, as a recording keeps both; with the order ``kept``
    the newer one waits for it.

    Args:
        network: Parameters of the network; None: pictures arrive at once.
        number: Number of the camera; each camera has its own random numbers.

    Raises:
        ParameterError: A trace cannot be read.
    """

    def __init__(self, network: NetworkParameters | None, number: int = 0) -> None:
        network = network or NetworkParameters()
        given = network.ways[BACK]
        kind = NETWORKS.find(given.kind.kind)
        self._p, self._s = record(NetworkRecord), record(NetworkState)
        fill(self._p, network)
        derive(self._p, network, DT)
        self._way = link.make_way(1, np.zeros(1), kind.draw_pointer, kind.numbers(given.kind.parameters))
        self._rng = np.random.default_rng((network.seed, number, *b"pictures"))
        self._due = np.zeros(2 * link.QUEUE, np.int64)
        self._waiting = list[int]()  # numbers of pictures that the line has not transmitted yet
        self._s["tick"] = 1  # a picture that is due at tick 0 would count as lost

    def pass_time(self, ticks: int, size: int = 0) -> list[tuple[int, int]]:
        """Send a picture now, and let time pass.

        Args:
            ticks: Number of ticks that pass.
            size: Bytes of the picture; 0: none is sent.

        Returns:
            Each picture whose fate was decided meanwhile: its number, from 0, and the tick of its arrival, counted from
            the making of this object; -1 for a lost one.
        """
        if size > 0:
            self._waiting.append(int(self._s["sent"][BACK]) + 1)
        left, is_first = max(ticks, 0), True
        while left > 0 or is_first:
            now = min(left, link.BLOCK)
            self._way.chances[:] = self._rng.random(self._way.chances.shape)
            carry(self._p, self._s, self._way, size if is_first else 0, now, self._due, DT)
            left, is_first = left - now, False
        head, waits = int(self._s["head"][BACK]), int(self._s["waits"][BACK])
        queued = {int(self._way.waiting_ns[(head + k) % link.QUEUE, 1]) for k in range(waits)}
        done = {n: int(self._due[n % len(self._due)]) for n in self._waiting if n not in queued}
        self._waiting = [n for n in self._waiting if n in queued]
        return [(number - 1, due - 1) for number, due in done.items()]
