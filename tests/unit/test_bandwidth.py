"""Bandwidth: a packet waits for the line, takes its size over the bandwidth, or finds no place."""

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from teleop_core.bags.cdr import template
from teleop_core.base import build
from teleop_core.coupling.network.network import NETWORK, NetworkLink
from teleop_core.coupling.network.packet_size import HEADER, message_size
from teleop_core.coupling.network.presets import NetworkParameters
from teleop_core.graph import topics
from teleop_core.kernels.geometry import Array
from teleop_core.session import configuration, virtual

MS = 1_000_000
BITS = 8 * (HEADER + message_size(topics.SLAVE_SERVO_CP))
"""Of a packet to the slave that carries a command alone."""


def link(**values: str | float) -> NetworkLink:
    """Network at work; double underscores in names stand for dots."""
    named = {name.replace("__", "."): value for name, value in values.items()}
    return NetworkLink(build(NetworkParameters, named))


def line(service: float, **values: str | float) -> NetworkLink:
    """Network whose line to the slave takes ``service`` ticks for a packet."""
    return link(there__bandwidth=1e3 * BITS / service, **values)


def arrivals(network: NetworkLink, sent: Any, ticks: int) -> NDArray[np.int64]:
    """Commands that arrive (N, 2): tick at which each was sent, and tick at which it came.

    Args:
        network: What they go through.
        sent: Ticks at which they are sent, from 2 on.
        ticks: Ticks to make.
    """
    row, came, sent = network.signals, [], set(sent)
    row["slave_setpoint_cp"][3] = row["slave_servo_cp"][3] = 1.0
    row["slave_setpoint_cp_ns"] = 1
    for tick in range(1, ticks + 1):
        row["now_ns"] = tick * MS
        if tick in sent:
            row["slave_servo_cp_ns"] = tick * MS
        network.step()
        if network.state["arrived"][0]:
            came.append((row["network_servo_cp_ns"] // MS, tick))
    return np.array(came, np.int64).reshape(-1, 2)


def departures(sent: NDArray[np.int64], service: float) -> Array:
    """When the transmission of each packet ends, computed by hand (N,)."""
    ends, end = [], 0.0
    for tick in sent:
        end = max(float(tick), end) + service
        ends.append(end)
    return np.array(ends)


@pytest.mark.parametrize("topic", [*NETWORK.reads, *NETWORK.writes], ids=lambda topic: topic.name)
def test_a_message_has_the_size_with_which_it_is_recorded(topic: topics.Topic) -> None:
    recorded = template(topic.kind, topic.names(()), topic.frame_id).template
    assert message_size(topic) == len(recorded)


def test_a_command_takes_84_bytes_in_a_datagram_with_28_of_headers() -> None:
    network = link(there__bandwidth=8 * 112 * 100.0)  # a hundred of them in a second
    np.testing.assert_array_equal(arrivals(network, [10], 50), [[10, 20]])


@pytest.mark.parametrize("order", ["newest", "kept"])
@settings(max_examples=15, deadline=None)
@given(service=st.floats(1.01, 30.0), share=st.floats(0.02, 0.9), seed=st.integers(0, 10**6))
def test_a_packet_departs_a_service_time_after_it_came_or_after_the_one_before(
    order: str, service: float, share: float, seed: int
) -> None:
    rng = np.random.default_rng(seed)
    sent = 2 + np.flatnonzero(rng.random(1500) < share / service)
    came = arrivals(line(service, there__packet_order=order, there__queue=1000), sent, 4000)
    np.testing.assert_array_equal(came[:, 0], sent)
    assert np.abs(came[:, 1] - departures(sent, service)).max(initial=0.0) <= 0.5 + 1e-9


def test_the_mean_wait_is_that_of_the_queue_with_random_arrivals_and_equal_services() -> None:
    """Geo/D/1 (Meisling 1958), whose limit of short ticks is M/D/1 (Pollaczek-Khinchine)."""
    service, load = 20, 0.7
    rng = np.random.default_rng(1)
    sent = 2 + np.flatnonzero(rng.random(120_000) < load / service)
    came = arrivals(line(service, there__queue=1000), sent, 121_000)
    waited = came[:, 1] - came[:, 0] - service
    assert waited.mean() == pytest.approx(load * (service - 1) / (2 * (1 - load)), rel=0.1)


@pytest.mark.parametrize("order", ["newest", "kept"])
@pytest.mark.parametrize("queue", [1, 20])
def test_more_than_the_line_carries_is_lost_and_the_rest_as_old_as_the_queue_is_long(order: str, queue: int) -> None:
    service, ticks = 2.5, 8000
    network = line(service, there__packet_order=order, there__queue=queue)
    came = arrivals(network, range(2, ticks), ticks)
    lost = network.state["lost"][0] / network.state["sent"][0]
    assert lost == pytest.approx(1.0 - 1.0 / service, abs=0.005)
    assert len(came) == pytest.approx(ticks / service, abs=queue + 2)
    ages = np.diff(came[500:], axis=1).mean()
    # Newest: the queue holds the packets of the last ticks. Kept: it is full of services.
    expected = service + queue - 0.5 if order == "newest" else service * (queue + 1) - 0.5
    assert ages == pytest.approx(expected, abs=1.0)
    assert (np.diff(came[:, 0]) > 0).all()


def test_a_line_that_is_wide_enough_or_without_a_bound_adds_no_delay() -> None:
    sent = range(2, 500)
    for network in (link(), line(0.4)):
        came = arrivals(network, sent, 600)
        np.testing.assert_array_equal(came[:, 0], came[:, 1])
    slow = arrivals(line(3.0, there__least_delay=0.05), [10], 100)
    np.testing.assert_array_equal(slow, [[10, 63]])


def test_what_waits_goes_at_once_when_the_line_becomes_wide() -> None:
    network = line(50.0)
    assert len(arrivals(network, range(2, 60), 60)) == 1
    network.retune(build(NetworkParameters, {}))
    came = arrivals(network, [], 60)
    assert came[-1, 0] == 59
    assert network.state["waits"][0] == 0


def test_a_packet_that_waits_keeps_its_own_values_and_increments_add_up() -> None:
    network = line(4.0, commands="incremental", there__packet_order="kept", there__queue=500)
    row, places = network.signals, np.random.default_rng(3).normal(0.0, 1e-3, (100, 3))
    row["slave_setpoint_cp"][3], seen = 1.0, []
    for tick in range(1, 600):
        row["now_ns"] = tick * MS
        row["slave_setpoint_cp_ns"] = max(int(row["network_servo_cp_ns"]), 1)
        if 2 <= tick < 102:
            row["slave_servo_cp"][:3], row["slave_servo_cp_ns"] = places[tick - 2], tick * MS
        network.step()
        if network.state["arrived"][0]:
            seen.append(row["network_servo_cp"][:3] + places[0])
    np.testing.assert_allclose(seen, places, atol=1e-12)


def test_a_session_over_a_narrow_line_tells_its_losses_and_ages() -> None:
    given = [
        "teleop.stages=[network]",
        "slave.starts_at_home=true",
        f"network.there.bandwidth={500 * BITS}",
        "network.there.queue=1",
    ]
    rows = virtual.VirtualTime(configuration.configure("free_motion", settings=given)).run(6000)
    state = rows["network_state"][-1]
    assert state[1] / state[0] == pytest.approx(0.5, abs=0.01)
    ages = (rows["now_ns"] - rows["network_servo_cp_ns"])[3000:] / MS
    assert 2.0 <= ages.min() <= ages.max() <= 5.0
    assert rows["teleop_state"][-2000:, 0].all()
