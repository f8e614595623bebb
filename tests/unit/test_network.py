"""Network: what is sent arrives late, lost or overtaken as its law says, and never otherwise."""

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

import teleop_core as tc
from teleop_core.bags.reader import Bag
from teleop_core.base import NoParameters, PartError, TeleopError, build
from teleop_core.coupling.network import LOST, NETWORKS, Network, register_network
from teleop_core.coupling.network.network import NETWORK, NetworkLink
from teleop_core.coupling.network.presets import PRESETS, NetworkParameters
from teleop_core.evaluation.metrics.network import _Ages
from teleop_core.kernels import Array, kernel
from teleop_core.session import configuration, virtual

MS = 1_000_000


def link(**values: str | float | bool) -> NetworkLink:
    """Network at work; double underscores in names stand for dots."""
    named = {name.replace("__", "."): value for name, value in values.items()}
    return NetworkLink(build(NetworkParameters, named))


def through(
    network: NetworkLink, places: Array, setpoints: Any = None, begin: int = 0
) -> tuple[Array, NDArray[np.int64]]:
    """What arrives, tick by tick, of places (N, 3) sent to the slave: places, stamps, losses.

    The slave says where it is from a tick before on; by default it is where it is led.
    """
    row, came = network.signals, []
    row["slave_setpoint_cp"][3] = 1.0
    for tick, place in enumerate(places, start=begin + 1):
        row["now_ns"] = row["slave_servo_cp_ns"] = (tick + 1) * MS
        row["slave_servo_cp"][:3] = place
        row["slave_setpoint_cp_ns"] = max(int(row["network_servo_cp_ns"]), 1)
        if setpoints is not None:
            row["slave_setpoint_cp"][:3] = setpoints[tick - begin - 1]
        network.step()
        came.append((*row["network_servo_cp"][:3], int(row["network_servo_cp_ns"])))
    table = np.array(came)
    return table[:, :3], table[:, 3].astype(np.int64)


def walk(count: int, seed: int = 3) -> Array:
    """Places (count, 3) [m] of a hand that wanders."""
    return np.cumsum(np.random.default_rng(seed).normal(0.0, 1e-4, (count, 3)), axis=0)


@settings(max_examples=20, deadline=None)
@given(delay=st.integers(0, 400))
def test_a_constant_delay_shifts_every_command_by_as_many_ticks(delay: int) -> None:
    places = walk(600)
    came, stamps = through(link(there__least_delay=delay * 1e-3), places)
    # The first tick sends nothing: nobody has heard yet where the slave is.
    np.testing.assert_array_equal(came[delay + 1 :], places[1 : len(places) - delay])
    np.testing.assert_array_equal(stamps[delay + 1 :], MS * np.arange(3, len(places) - delay + 2))
    assert (stamps[: delay + 1] == 0).all()


def test_both_directions_have_delays_of_their_own() -> None:
    network = link(there__least_delay=0.03, back__least_delay=0.1)
    row, seen = network.signals, []
    for tick in range(1, 400):
        row["now_ns"] = tick * MS
        for name in ("slave_servo_cp", "slave_setpoint_cp", "slave_measured_cp", "slave_reach"):
            row[f"{name}_ns"] = tick * MS
        row["slave_measured_cf_ns"], row["slave_measured_cf"][2] = tick * MS, tick
        network.step()
        seen.append(
            (
                row["network_servo_cp_ns"],
                row["network_measured_cf_ns"],
                MS * row["network_measured_cf"][2],
                row["network_reach_ns"],
            )
        )
    ages = (MS * np.arange(1, 400)[:, None] - np.array(seen))[200:] / MS
    assert (ages == [30, 100, 100, 100]).all()


@pytest.mark.parametrize("order", ["newest", "kept"])
@settings(max_examples=10, deadline=None)
@given(
    mean=st.floats(1e-3, 0.2), loss=st.floats(0.0, 0.9), hold=st.sampled_from([0.0, 0.05]), seed=st.integers(0, 10**6)
)
def test_nothing_overtakes_nothing_is_invented_and_what_arrives_was_sent(
    order: str, mean: float, loss: float, hold: float, seed: int
) -> None:
    places = walk(800, seed)
    came, stamps = through(
        link(
            seed=seed,
            there__kind="jitter",
            there__jitter__mean=mean,
            there__loss=loss,
            there__jitter__hold=hold,
            there__packet_order=order,
        ),
        places,
    )
    assert (np.diff(stamps) >= 0).all()
    sent = stamps // MS - 2
    has_come = stamps > 0
    np.testing.assert_array_equal(came[has_come], places[sent[has_come]])
    assert (sent[has_come] <= np.flatnonzero(has_come)).all()


def test_where_order_is_kept_the_reader_gets_older_commands() -> None:
    """An independent computation of both, packet by packet, agrees with what arrives."""
    level = {f"there__{name.replace('.', '__')}": value for name, value in PRESETS["delay_100"]["there"].items()}
    for order in ("newest", "kept"):
        network = link(there__packet_order=order, **level)
        places = walk(30_000)
        _, stamps = through(network, places)
        age = np.arange(2, len(places) + 2) - stamps / MS
        rng = np.random.default_rng(5)
        slow = rng.random(len(places)) < 0.274
        drawn = 70.0 + rng.exponential(np.where(slow, 1 / 0.0853, 1 / 0.0271))
        due = np.arange(len(places)) + drawn
        if order == "kept":
            due = np.maximum.accumulate(due)
        newest = np.zeros(len(places))
        for packet, at in enumerate(np.ceil(due).astype(int)):
            if at < len(newest):
                newest[at] = max(newest[at], packet)
        expected = np.arange(len(places)) - np.maximum.accumulate(newest)
        own, theirs = age[3000:].mean(), expected[3000:].mean()
        assert own == pytest.approx(theirs, rel=0.05)
        # Published beside them: 76 ms where the newest wins, 213 ms in order, of "100 ms".
        assert own == pytest.approx(76 if order == "newest" else 213, rel=0.1)


@kernel
def draw_all(draw: Any, numbers: Any, memory: Any, chances: Any, period: float, found: Any) -> None:
    for i in range(found.shape[0]):
        found[i] = draw(numbers, memory, chances[i], i * period)


def drawn(
    name: str,
    values: Mapping[str, str | float | tuple[float, float]],
    packets: int,
    seed: int = 2,
    period: float = 1e-3,
) -> Array:
    """What a kind says of packets sent in a row (packets,)."""
    part, found = NETWORKS.find(name), np.empty(packets)
    numbers, memory = part.numbers(build(part.parameters, values)), np.zeros(4)
    chances = np.random.default_rng(seed).random((packets, 3))
    draw_all(part.draw_pointer, numbers, memory, chances, period, found)
    return found


def of_level(level: str) -> dict[str, Any]:
    """Parameters of the kind of a preset's way to the slave."""
    return {name.partition(".")[2]: value for name, value in PRESETS[level]["there"].items() if "." in name}


def burst_loss(to_bad: float, stay_bad: float, *lengths: tuple[float, float]) -> float:
    """Share of packets lost where times change at every packet, from the chain of bursts.

    A burst of n packets and the one that passes are n + 1 steps of the chain of times, after which
    it is bad with chance ``bad + (was_bad - bad) (stay_bad - to_bad)^(n + 1)``.
    """
    n = np.arange(200_000)
    # P(int(X) = n) of a Pareto II distribution (Lomax), from its survival function.
    chance = [(1.0 + n / scale) ** -shape - (1.0 + (n + 1.0) / scale) ** -shape for shape, scale in lengths]
    mean = [float((n * p).sum()) for p in chance]
    kept = [float(((stay_bad - to_bad) ** (n + 1.0) * p).sum()) for p in chance]
    bad = to_bad / (1.0 + to_bad - stay_bad)
    # Share of bursts that begin in bad times: q = (1 - q) P(bad | good) + q P(bad | bad).
    to, stay = bad * (1.0 - kept[0]), bad + (1.0 - bad) * kept[1]
    q = to / (1.0 + to - stay)
    burst = (1.0 - q) * mean[0] + q * mean[1]
    return burst / (burst + 1.0)


@pytest.mark.parametrize(
    ("level", "lost", "burst"), [("loss_10", 9.8, 1.4), ("loss_30", 30.4, 1.8), ("loss_50", 50.4, 2.5)]
)
def test_the_published_levels_of_loss_lose_what_their_chain_says_in_bursts_as_long(
    level: str, lost: float, burst: float
) -> None:
    given = of_level(level)
    exact = burst_loss(0.05, 0.9, given["good"], given["bad"])
    assert 100.0 * exact == pytest.approx(lost, abs=0.15)
    found = drawn("gilbert_elliott", given, 600_000) == LOST
    edges = np.diff(np.concatenate(([0], found.astype(int), [0])))
    lengths = np.flatnonzero(edges < 0) - np.flatnonzero(edges > 0)
    assert found.mean() == pytest.approx(exact, abs=0.004)
    assert lengths.mean() == pytest.approx(burst, rel=0.1)


def test_bad_times_end_within_bursts_too() -> None:
    """Bursts last 10.6 packets in the mean: seldom is the time still bad at the end of one."""
    given: dict[str, Any] = {"to_bad": 0.02, "stay_bad": 0.9, "good": (100.0, 1e-3), "bad": (10.0, 100.0)}
    exact = burst_loss(*given.values())
    found = drawn("gilbert_elliott", given, 600_000) == LOST
    assert found.mean() == pytest.approx(exact, abs=0.01)
    # With times that change once a burst, bad ones would follow each other: 64 % lost.
    assert exact < 0.4


@pytest.mark.parametrize(
    ("level", "mean", "sd"), [("delay_100", 100.0, 34), ("delay_300", 299.6, 91), ("delay_500", 500.2, 95)]
)
def test_the_published_levels_of_delay_have_their_mean_and_spread(level: str, mean: float, sd: int) -> None:
    there = PRESETS[level]["there"]
    given = {k.partition(".")[2]: v for k, v in there.items() if k.startswith("jitter.")}
    found = 1e3 * (there["least_delay"] + drawn("jitter", given, 200_000))
    assert found.mean() == pytest.approx(mean, rel=0.01)
    assert found.std() == pytest.approx(sd, rel=0.04)


def test_a_delay_that_holds_has_the_same_spread_but_changes_seldom() -> None:
    own = drawn("jitter", {"mean": 0.03}, 100_000)
    held = drawn("jitter", {"mean": 0.03, "hold": 0.02}, 400_000)
    assert held.mean() == pytest.approx(own.mean(), rel=0.05)
    assert held.std() == pytest.approx(own.std(), rel=0.05)
    changes = np.count_nonzero(np.diff(held))
    assert changes == pytest.approx(400_000 * (1.0 - math.exp(-0.05)), rel=0.05)


@pytest.mark.parametrize("in_packets", [False, True])
def test_outages_last_for_any_time_up_to_the_longest_and_pause_after_each(in_packets: bool) -> None:
    times = {"pause": 2.0, "longest": 1.0}
    if in_packets:  # 400 a second here
        times = {name: 400.0 * value for name, value in times.items()}
    given: dict[str, Any] = {**times, "in_packets": in_packets}
    found = drawn("outages", given, 200_000, period=1.0 / 400.0) == LOST
    assert found[0]  # the first packet begins one
    edges = np.diff(found.astype(int))
    begins, ends = np.flatnonzero(edges > 0), np.flatnonzero(edges < 0)
    np.testing.assert_allclose(begins - ends[: len(begins)], 800, atol=1)
    whole = min(len(ends) - 1, len(begins))
    lengths = ends[1 : whole + 1] - begins[:whole]
    assert 1 <= lengths.min() < lengths.max() <= 401
    assert lengths.mean() == pytest.approx(200.0, rel=0.15)


@pytest.mark.parametrize(
    ("level", "lost"), [("3_of_8", 1.5 / 10.0), ("3_of_8_packets", 1.5 / 10.0), ("1_of_1", 0.5 / 1.5), ("2_of_1", 0.5)]
)
def test_the_published_outages_lose_the_share_that_outage_and_pause_give(level: str, lost: float) -> None:
    name = f"outages_{level}"
    rate = PRESETS[name]["there"].get("packet_rate", 1000.0)
    shares = [np.mean(drawn("outages", of_level(name), 1_000_000, seed, 1.0 / rate) == LOST) for seed in (2, 3)]
    # The standard deviation of two million packets is 0.009 at 3_of_8, less at the others.
    assert np.mean(shares) == pytest.approx(lost, abs=0.02)


def test_a_trace_is_played_row_by_row_and_begins_anew_at_its_end(tmp_path: Path) -> None:
    file = tmp_path / "pings.csv"
    file.write_text("time,delay\n10.0,0.05\n10.1,\n10.2,0.07\n")
    found = drawn("trace", {"file": str(file)}, 700)
    one = np.repeat([0.05, LOST, 0.07], 100)
    differing = np.flatnonzero(found != np.concatenate((one, one, one))[:700])
    assert len(differing) <= 2  # where a sum of milliseconds is a bit beside a border
    seldom = drawn("trace", {"file": str(file)}, 50, period=0.77)
    np.testing.assert_array_equal(seldom, np.array([0.05, LOST, 0.07])[(np.arange(50) * 0.77 % 0.3 / 0.1).astype(int)])
    network = link(there__kind="trace", there__trace__file=str(file))
    _, stamps = through(network, walk(700))
    age = np.arange(2, 702) - stamps / MS
    assert age[60:95] == pytest.approx(50.0)


def test_with_increments_a_lost_packet_is_lost_motion() -> None:
    places = walk(2000)
    network = link(there__loss=0.5, commands="incremental")
    came, stamps = through(network, places)
    sent = stamps // MS - 2
    arrived = np.unique(sent[stamps > 0])
    steps = np.diff(places, axis=0, prepend=places[:1])
    # From the first packet on, of which nobody knows a motion: the steps of those that came.
    expected = steps[arrived[arrived > 1]].sum(axis=0)
    assert 0.4 < 1.0 - len(arrived) / len(places) < 0.6
    np.testing.assert_allclose(came[-1], expected, atol=1e-12)
    whole, _ = through(link(there__loss=0.5), places)
    np.testing.assert_allclose(whole[-1], places[sent[-1]], atol=1e-12)


def test_increments_count_from_where_a_slave_is_that_goes_its_own_way() -> None:
    places, network = walk(300), link(commands="incremental")
    row = network.signals
    row["slave_setpoint_cp"][3], row["slave_setpoint_cp_ns"] = 1.0, 1
    for tick, place in enumerate(places, start=2):  # no command is in force
        row["now_ns"] = row["slave_servo_cp_ns"] = tick * MS
        row["slave_servo_cp"][:3] = place
        row["slave_setpoint_cp"][:3] = (0.4, 0.1, -0.2)
        network.step()
        step = np.linalg.norm(row["network_servo_cp"][:3] - (0.4, 0.1, -0.2))
        assert tick < 4 or step < 1e-3


def test_a_packet_that_would_take_longer_than_the_calendar_is_lost_not_early() -> None:
    network = link(there__kind="jitter", there__least_delay=10.0, there__jitter__mean=5.0)
    row = network.signals
    row["slave_setpoint_cp"][3], row["slave_setpoint_cp_ns"] = 1.0, 1
    least = 10**12
    for tick in range(1, 40_000):
        row["now_ns"] = row["slave_servo_cp_ns"] = tick * MS
        network.step()
        if row["network_servo_cp_ns"]:
            least = min(least, tick * MS - int(row["network_servo_cp_ns"]))
    assert least >= 10_000 * MS
    lost = network.state["lost"][0] / network.state["sent"][0]
    assert lost == pytest.approx(math.exp(-(16.384 - 10.0) / 5.0), rel=0.05)


def test_the_same_seed_gives_the_same_network_and_another_seed_another() -> None:
    given: dict[str, Any] = {"there__kind": "jitter", "there__loss": 0.3}
    places, first = walk(400), link(**given)
    came = through(first, places)[1]
    first.reset()
    assert (through(first, places)[1] == came).all()
    first.reset()
    first.retune(build(NetworkParameters, {"there.loss": 1.0}))
    assert (through(first, places)[1] == 0).all()
    assert (through(link(**given), places)[1] == came).all()
    assert (through(link(seed=2, **given), places)[1] != came).any()


def test_ages_of_live_arrivals_grow_between_them() -> None:
    """Against a look at every tenth of a millisecond."""
    rng = np.random.default_rng(4)
    logs = np.cumsum(rng.integers(200_000, 30 * MS, 400)) + 10 * MS
    stamps = logs - rng.integers(MS, 40 * MS, 400)
    ages = _Ages()
    for begin in range(0, 400, 100):  # window by window, each with the arrival before it
        after = int(logs[begin]) if begin == 0 else int(logs[begin - 1]) + MS
        until = int(logs[begin + 99]) + MS
        known = slice(max(begin - 1, 0), begin + 100)
        ages.add(logs[known], stamps[known], after, until)
    looks = np.arange(int(logs[0]), int(logs[-1]), MS // 10)
    expected = (looks - stamps[np.searchsorted(logs, looks, side="right") - 1]) / MS
    score = ages.score(0.0, None)
    assert score.age_mean_ms == pytest.approx(expected.mean(), rel=0.02)
    assert score.age_p99_ms == pytest.approx(np.percentile(expected, 99), rel=0.02)


def test_packets_go_no_faster_than_their_rate_and_a_network_that_loses_all_says_so() -> None:
    network = link(there__loss=1.0)
    assert (through(network, walk(50))[1] == 0).all()
    assert network.concerns() == ["the network lost all 49 packets to the slave"]
    network = link(there__packet_rate=100.0)
    assert network.concerns() == []
    _, stamps = through(network, walk(1000))
    assert len(np.unique(stamps)) == pytest.approx(100, abs=1)
    assert (np.diff(np.unique(stamps)[1:]) == 10 * MS).all()


@pytest.mark.parametrize("place", [1e-4, 1e-3])
@pytest.mark.parametrize("pause", [1, 7, 50])
def test_behind_a_deadband_a_command_is_off_by_no_more_than_that_nor_silent_for_long(place: float, pause: int) -> None:
    places = walk(800)
    network = link(deadband__is_on=True, deadband__place=place, deadband__longest_pause=pause * 1e-3)
    came, stamps = through(network, places)
    assert np.linalg.norm(came[1:] - places[1:], axis=1).max() <= place
    assert (np.arange(2, 802)[1:] - stamps[1:] / MS).max() <= pause - 1
    sent = len(np.unique(stamps[1:]))
    assert (sent == 799) if pause == 1 else (sent >= 799 // pause)
    if pause == 50:  # walk() goes 0.17 mm in a step
        assert sent < 40 if place == 1e-3 else 799
        for is_on, packets in ((True, 20), (False, 1000)):  # of a hand that rests
            resting = link(deadband__is_on=is_on, deadband__longest_pause=0.05)
            assert len(np.unique(through(resting, np.zeros((1000, 3)))[1])) == pytest.approx(packets, abs=1)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_turn_counts_by_its_angle_whatever_the_sign_of_its_quaternion(sign: float) -> None:
    network, told = link(deadband__is_on=True, deadband__turn=0.1, deadband__longest_pause=1.0), []
    row = network.signals
    for tick in range(1, 400):
        angle = 1e-3 * tick
        row["now_ns"] = row["slave_servo_cp_ns"] = (tick + 1) * MS
        turn = np.array([math.cos(0.5 * angle), 0.0, 0.0, math.sin(0.5 * angle)])
        row["slave_servo_cp"][3:] = turn if tick % 2 else sign * turn
        row["slave_setpoint_cp_ns"] = max(int(row["network_servo_cp_ns"]), 1)
        network.step()
        told.append(int(row["network_servo_cp_ns"]))
    sent = np.unique(told)[1:]
    np.testing.assert_allclose(np.diff(sent) / MS, 101.0, atol=1.0)


def test_a_force_behind_a_deadband_is_off_by_no_more_than_its_share() -> None:
    given = [
        "reflection.architecture=position_force",
        *(f"network.deadband.{text}" for text in ("is_on=true", "place=1e-3", "turn=0.05")),
    ]
    run = session(*given, scenario="palpation")
    rows = run.run(run.lead + 10_000)
    own, there = (rows[f"{name}_measured_cf"][:, :3] for name in ("slave", "network"))
    known = rows["network_measured_cf_ns"] > 0
    # What came at a tick is what the slave said a tick ago.
    off = np.linalg.norm(own[:-1] - there[1:], axis=1)[known[1:]]
    most = np.maximum(0.1 * np.linalg.norm(there[1:], axis=1), 0.02)[known[1:]]
    assert np.linalg.norm(own, axis=1).max() > 0.5
    assert (off <= most + 1e-12).all()
    assert off.max() > 0.03  # a larger force may be off by more
    sent = rows["network_state"][-1][3]
    assert sent < 0.35 * len(rows)


def test_increments_behind_a_deadband_lose_no_motion() -> None:
    places = walk(2000)
    network = link(commands="incremental", deadband__is_on=True, deadband__place=1e-3)
    row = network.signals
    came, _ = through(network, places)
    assert row["network_state"][0] < 400
    assert np.linalg.norm(came[-1] - came[1] - (places[-1] - places[1])) <= 2e-3


def test_another_network_takes_over_and_what_is_on_its_way_still_arrives() -> None:
    network, places = link(there__least_delay=0.1), walk(600)
    through(network, places[:300])
    network.retune(
        build(NetworkParameters, {"there.least_delay": 0.02, "there.kind": "jitter", "there.jitter.mean": 0.0})
    )
    _, stamps = through(network, places[300:], begin=300)
    age = np.arange(302, 602) - stamps / MS
    assert age[0] == 100.0
    assert (age[25:] == 20.0).all()


def session(*given: str, scenario: str = "free_motion") -> virtual.VirtualTime:
    """Session in virtual time with a network."""
    return virtual.VirtualTime(configuration.configure(scenario, settings=["teleop.stages=[network]", *given]))


AT_HOME = "slave.starts_at_home=true"


def test_a_network_without_delay_changes_no_command() -> None:
    plain = virtual.VirtualTime(configuration.configure("free_motion", settings=[AT_HOME])).run(4000)
    through_it = session(AT_HOME).run(4000)
    own, other = plain["slave_servo_cp"], through_it["network_servo_cp"]
    # Following begins two ticks later, at the same place.
    assert np.abs(own[100:] - other[100:])[:, :3].max() < 1e-4
    assert np.ptp(other[100:, :3], axis=0).max() > 5e-3


@pytest.mark.parametrize("preset", ["iss", "ets7", "delay_500", "loss_50"])
def test_a_slave_behind_any_network_is_followed_without_a_jump_and_stands_still_before_it_is(preset: str) -> None:
    run = session(AT_HOME, f"network.preset={preset}")
    rows = run.run(40_000 if preset == "ets7" else 24_000)
    following = rows["teleop_state"][:, 0] > 0.0
    first = int(following.argmax())
    assert following[-4000:].mean() > 0.9
    still = rows["slave_setpoint_cp"][: first + 100, :3]
    assert np.abs(still - still[0]).max() < 1e-4
    # News of a far slave are old: where they fail for a moment, the command holds.
    assert np.abs(np.diff(rows["slave_servo_cp"][first:, :3], axis=0)).max() < 5e-4
    assert preset != "ets7" or not following[first:].all()


def test_a_command_holds_while_nothing_is_heard_of_a_far_slave_and_goes_on_from_there() -> None:
    ways = {"there.least_delay": 0.3, "back.least_delay": 0.3}
    run = session(AT_HOME, *(f"network.{name}={value}" for name, value in ways.items()))
    parts = [run.run(8000)]
    for loss, ticks in ((1.0, 2000), (0.0, 3000)):
        run.stages["network"].retune(build(NetworkParameters, {**ways, "back.loss": loss}))
        parts.append(run.run(ticks))
    commands = np.concatenate([rows["slave_servo_cp"][:, :3] for rows in parts])
    assert np.abs(np.diff(commands[7500:], axis=0)).max() < 5e-4
    assert np.ptp(commands[7000:8000], axis=0).max() > 5e-3  # the hand moved meanwhile
    following = parts[1]["teleop_state"][:, 0]
    assert following[0] == 1.0
    assert following[-1] == 0.0
    assert parts[2]["teleop_state"][-1000:, 0].all()


def test_a_slave_that_was_stopped_far_away_is_taken_up_where_it_rests() -> None:
    run = session(AT_HOME, "network.preset=iss", "slave.operation.events=[stop@6, reset@9, enable@9.1, resume@9.2]")
    rows = run.run(16_000)
    stopped = rows["slave_setpoint_cp"][7500, :3]
    echo = rows["slave_servo_cp"][8500, :3]
    assert rows["teleop_state"][8500, 0] == 0.0
    np.testing.assert_allclose(echo, stopped, atol=1e-6)


def test_a_force_from_behind_a_network_is_felt_and_fades_where_nothing_comes() -> None:
    given = ["reflection.architecture=position_force", "network.back.least_delay=0.3"]
    run = session(*given, scenario="palpation")
    rows = run.run(run.lead + 14_000)
    pushed = np.linalg.norm(rows["master_servo_cf"][:, :3], axis=1)
    touched = np.linalg.norm(rows["slave_measured_cf"][:, :3], axis=1)
    assert pushed.max() == pytest.approx(min(touched.max(), 3.3), rel=0.1)
    first = int((touched > 0.1).argmax())
    assert 295 <= int((pushed > 0.1).argmax()) - first <= 330
    gone = build(NetworkParameters, {"back.loss": 1.0, "back.least_delay": 0.3})
    last = int(np.flatnonzero(touched > 0.2)[-1])
    other = session(*given, scenario="palpation")
    other.run(last - 400)
    other.stages["network"].retune(gone)
    after = np.linalg.norm(other.run(1500)["master_servo_cf"][:, :3], axis=1)
    assert after[-500:].max() == 0.0
    assert np.abs(np.diff(after[302:])).max() < 0.1


def test_a_kind_of_ones_own_is_one_call_and_a_wrong_one_is_refused() -> None:
    @kernel
    def every_other(numbers: Any, memory: Any, chances: Any, now: Any) -> float:
        memory[0] = 1.0 - memory[0]
        return LOST if memory[0] > 0.0 else 0.0

    register_network(Network("every_other", NoParameters, every_other))
    try:
        _, stamps = through(link(there__kind="every_other"), walk(100))
        assert (np.diff(np.unique(stamps)[1:]) == 2 * MS).all()
    finally:
        NETWORKS.remove("every_other")
    for wrong in (
        lambda n, m, c, now: math.nan,
        lambda n, m, c: 0.0,
        lambda n, m, c, now: m.base[4:].fill(0.0) or 0.0,  # behind what it may remember
    ):
        with pytest.raises(PartError):
            register_network(Network("wrong", NoParameters, wrong))  # type: ignore[arg-type]
    assert "wrong" not in NETWORKS.names()


def test_settings_of_a_network_that_is_not_there_are_refused_with_the_way_to_have_one() -> None:
    with pytest.raises(TeleopError, match=r"add stages=\[network\]"):
        configuration.configure("free_motion", settings=["network.preset=iss"])
    configuration.configure("free_motion", settings=["seed=3"])
    assert [topic.name for topic in NETWORK.replaced] == [topic.name for topic in NETWORK.reads]


def test_the_score_tells_the_age_at_the_reader_and_the_losses(tmp_path: Path) -> None:
    out = tmp_path / "bag"
    ran = tc.run("free_motion", out=out, duration=6.0, stages="network", preset="loss_50")
    score = ran.score()
    series = Bag(out).read("network/servo_cp")
    age = (series.log_ns - series.stamp_ns)[series.stamp_ns > 0] / MS
    assert score.value("network.there.age_mean_ms") == pytest.approx(age.mean(), rel=1e-3)
    assert score.value("network.there.age_p99_ms") == pytest.approx(np.percentile(age, 99), abs=1.0)
    assert score.value("network.there.lost_share") == pytest.approx(0.506, abs=0.05)
    assert score.value("network.back.lost_share") == 0.0
    assert score.value("network.there.packet_rate_hz") == pytest.approx(1000.0, rel=0.01)
