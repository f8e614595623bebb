"""Pictures on their way over the network: one packet each, by the laws of the other packets from the slave."""

import numpy as np
import pytest

from teleop_core.base import build
from teleop_core.coupling.network.pictures import PictureWay
from teleop_core.coupling.network.presets import NetworkParameters

PERIOD, SIZE, COUNT = 33, 30_000, 3000
"""Ticks from picture to picture, their bytes, and their number."""


def ages(back: dict[str, object], number: int = 0, size: int = SIZE) -> np.ndarray[tuple[int], np.dtype[np.int64]]:
    """Ticks that each picture is on its way; -1 for a lost one."""
    way = PictureWay(build(NetworkParameters, {f"back.{name}": value for name, value in back.items()}), number)
    found, told = np.full(COUNT, -1), list[int]()
    for k in range(COUNT):
        for which, tick in way.pass_time(PERIOD if k + 1 < COUNT else 16_000, size):
            told.append(which)
            found[which] = tick - which * PERIOD if tick >= 0 else -1
    assert sorted(told) == list(range(COUNT))  # the fate of each picture is told once
    return found


@pytest.mark.parametrize("size", [1, SIZE])
def test_without_a_network_a_picture_arrives_in_the_tick_of_its_capture(size: int) -> None:
    way = PictureWay(None)
    assert [way.pass_time(PERIOD, size) for _ in range(3)] == [[(0, 0)], [(1, PERIOD)], [(2, 2 * PERIOD)]]


def test_every_picture_has_the_delay_of_the_way_back_and_its_share_is_lost() -> None:
    found = ages({"least_delay": 0.1, "loss": 0.2})
    assert set(found) == {-1, 100}
    assert np.mean(found < 0) == pytest.approx(0.2, abs=0.03)
    assert (ages({"least_delay": 0.1}) == 100).all()


def test_the_way_to_the_slave_delays_no_picture() -> None:
    assert PictureWay(build(NetworkParameters, {"preset": "delay_300"})).pass_time(0, SIZE) == [(0, 0)]
    assert PictureWay(build(NetworkParameters, {"preset": "iss"})).pass_time(0, SIZE)[0][1] >= 400


def test_pictures_overtake_each_other_unless_their_order_is_kept() -> None:
    jitter = {"kind": "jitter", "jitter.mean": 0.05}
    came = ages(jitter) + PERIOD * np.arange(COUNT)
    kept = ages(jitter | {"packet_order": "kept"}) + PERIOD * np.arange(COUNT)
    assert (np.diff(came) < 0).sum() > 100
    np.testing.assert_array_equal(kept, np.maximum.accumulate(came))  # those behind a late one wait, and none is lost


def test_a_picture_occupies_the_line_for_its_bytes() -> None:
    whole = 8e3 * (SIZE + 28)  # bits per second that carry a picture in one millisecond
    assert (ages({"bandwidth": whole / 20.0}) == 20).all()
    narrow = ages({"bandwidth": whole / 66.0, "queue": 3})  # of two pictures one passes
    assert np.mean(narrow < 0) == pytest.approx(0.5, abs=0.01)
    assert narrow.max() <= 66 * 4
    assert np.mean(ages({"bandwidth": whole / 66.0, "queue": 3, "packet_order": "kept"}) < 0) == pytest.approx(
        0.5, abs=0.01
    )


def test_more_pictures_than_the_rate_of_packets_are_lost() -> None:
    assert np.mean(ages({"packet_rate": 10.0}) < 0) == pytest.approx(0.75, abs=0.01)


def test_cameras_share_no_random_numbers_and_a_session_repeats_its_own() -> None:
    jitter = {"kind": "jitter", "jitter.mean": 0.05}
    assert (ages(jitter) == ages(jitter)).all()
    assert (ages(jitter) != ages(jitter, 1)).mean() > 0.9
