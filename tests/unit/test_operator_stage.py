"""Operator as a stage: what it sees, what the device does without it, and a replay of the hand."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import teleop_core as tc
from present import present
from teleop_core.base.errors import ParameterError, RecordingError
from teleop_core.hand.master.haptic_master import HapticMaster, HapticMasterParameters
from teleop_core.hand.operators.rest import rest_pose
from teleop_core.kernels.geometry import Array
from teleop_core.session import configuration, virtual

MS = 1_000_000
ELSEWHERE = np.array([0.05, 0.03, 0.02])


class Held:
    """Device whose hand is told tick by tick."""

    def __init__(self) -> None:
        self.device = HapticMaster(HapticMasterParameters())
        self.now = 0

    def go(
        self, ticks: int, place: Array | None = None, buttons: tuple[float, float, float] = (0.0, 0.0, 0.0)
    ) -> tuple[Array, Array]:
        """Go on; ``place`` from the inkwell [m], None for a hand that is silent.

        Returns the clutch (ticks,) and the places (ticks, 3) [m].
        """
        row, out = self.device.signals, np.empty((ticks, 4))
        for one in out:
            self.now += MS
            row["now_ns"] = self.now
            if place is not None:
                row["hand_servo_cp"] = rest_pose()
                row["hand_servo_cp"][:3] += place
                row["hand_servo_cp_ns"], row["hand_buttons"] = self.now, buttons
            self.device.step()
            one[:] = [row["master_buttons"][0], *self.device.state["position"]]
        return out[:, 0], out[:, 1:]


def test_a_silent_hand_lets_go_and_the_clutch_is_released_once_it_has_the_stylus_again() -> None:
    held = Held()
    clutch, _ = held.go(1000, np.zeros(3))
    assert not clutch.any()
    clutch, places = held.go(700)
    assert not clutch[:499].any()
    assert clutch[501:].all()
    assert np.ptp(places, axis=0).max() < 1e-6
    clutch, _ = held.go(10, np.array([1e-3, 0.0, 0.0]))
    assert not clutch.any()  # it is where it was
    held.go(700)
    clutch, places = held.go(1000, ELSEWHERE)
    assert clutch[:299].all()
    assert not clutch[301:].any()
    # What is left of 62 mm when the clutch is released.
    assert np.abs(places[300:] - places[-1]).max() < 2e-4
    assert np.abs(places[-1] - rest_pose()[:3] - ELSEWHERE).max() < 1e-3


@pytest.mark.parametrize("ticks", [0, 500])
def test_a_hand_that_is_suddenly_elsewhere_is_another_grip(ticks: int) -> None:
    held = Held()
    if ticks:
        held.go(ticks, np.zeros(3))
    clutch, _ = held.go(600, ELSEWHERE)
    assert clutch[:299].all()
    assert not clutch[301:].any()


def test_a_hand_as_fast_as_hands_are_keeps_its_grip() -> None:
    held = Held()
    held.go(100, np.zeros(3))
    for k in range(40):  # at 1 m/s
        clutch, _ = held.go(1, np.array([1e-3 * k, 0.0, 0.0]))
        assert not clutch.any()


def test_buttons_of_the_hand_are_those_of_the_device() -> None:
    held = Held()
    held.go(10, np.zeros(3), (0.0, 1.0, 1.0))
    assert held.device.signals["master_buttons"].tolist() == [0.0, 1.0, 1.0]


def seen_by(*texts: str) -> tuple[Array, Array]:
    """Places of the slave (N, 3) [m] that were told, and that an operator saw when it was asked."""
    rows = []

    def make(_: tc.NoParameters, setting: tc.Setting) -> Callable[[Array], Array]:
        def motion(times: Array) -> Array:
            rows.append(present(setting.seen).slave[:3].copy())
            return np.zeros((len(times), 3))

        return motion

    tc.register_operator("looks", tc.Operator("looks", make, ahead=1))
    session = virtual.VirtualTime(configuration.configure(settings=["operator=looks", "patience=0.0", *texts]))
    return session.run(400)["slave_measured_cp"][:, :3], np.array(rows)


@pytest.mark.usefixtures("own_parts")
@pytest.mark.parametrize("delay", [0, 50])
def test_an_operator_sees_the_slave_as_late_as_the_link_says(delay: int) -> None:
    texts = [f"teleop.delays=[slave/measured_cp@operator={1e-3 * delay}]"] if delay else []
    told, seen = seen_by(*texts)
    # What was told in a tick is read in the next one, before which the next motion was drawn.
    late = delay + 2
    np.testing.assert_array_equal(seen[late + 1 :], told[1 : len(seen) - late])
    assert np.ptp(told[:, 0]) > 1e-3


SESSION: dict[str, Any] = {"duration": 1.5, "seed": 4, "buttons.fixture": [0.3], "operator": "human"}


@pytest.fixture(scope="module")
def recorded() -> tc.Recording:
    return tc.run("coarse_box", settings=SESSION)


def test_a_session_in_virtual_time_misses_no_message_of_what_is_sent_where_it_changes(recorded: tc.Recording) -> None:
    topics = recorded.score().topics
    assert topics["hand/tremor"].gaps is None
    assert not sum(topic.gaps or 0 for topic in topics.values())


def test_a_replayed_hand_feels_another_fixture(recorded: tc.Recording) -> None:
    loose = tc.replay(recorded, begin="hand", device__friction=0.0)
    assert np.array_equal(loose["hand/servo_cp"].values, recorded["hand/servo_cp"].values)
    assert not np.array_equal(loose["master/measured_cp"].values, recorded["master/measured_cp"].values)


def test_a_replay_that_cannot_begin_there_says_so(recorded: tc.Recording) -> None:
    with pytest.raises(ParameterError, match="device or hand"):
        tc.replay(recorded, begin="slave")  # type: ignore[arg-type]
    with pytest.raises(RecordingError, match="hand/servo_cp"):
        tc.replay("bags/example", begin="hand")
