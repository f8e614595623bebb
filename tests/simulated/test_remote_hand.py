"""A person as the hand over topics: what they send moves the slave, silence holds it."""

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from numpy.typing import ArrayLike

from peers import at_rest
from teleop_core.graph.topics import (
    MASTER_BUTTONS,
    MASTER_MEASURED_CP,
    OPERATOR_BUTTONS,
    OPERATOR_SERVO_CP,
    SLAVE_MEASURED_CP,
)
from teleop_core.hand.input_device import UNHELD
from teleop_core.hand.operators.rest import rest_pose
from teleop_core.kernels.geometry import Array

if TYPE_CHECKING:
    from peers import AnyPeer as Peer

# A device without friction and noise goes where the hand is.
EXACT: dict[str, Any] = {"device__friction": 0.0, "device__gimbal_noise": 0.0}
GAIN = 0.5
PATIENT = 5.0
"""Silence that lets go [s], the longest there is: on a busy machine poses stay away for seconds."""


class Person:
    """Sends poses at 50 Hz, as a page does."""

    def __init__(self, peer: "Peer") -> None:
        self.peer = peer
        peer.publisher(OPERATOR_SERVO_CP)

    def hold(self, place: Sequence[float] | Array, until: Callable[[], object] | Callable[[], bool], what: str) -> None:
        """Want the stylus at a place from the inkwell [m] until something is so."""
        pose = rest_pose()
        pose[:3] += place

        def turn() -> object:
            self.peer.send(OPERATOR_SERVO_CP, self.peer.time_ns(), pose)
            self.peer.sleep(0.02)  # the rate of poses, not a wait
            return until()

        self.peer.wait(turn, what)

    def drag(self, begin: ArrayLike, end: ArrayLike, poses: int = 25) -> None:
        """Want it along a straight line, over half a second."""
        for share in np.linspace(0.0, 1.0, poses):
            self.hold((1.0 - share) * np.array(begin) + share * np.array(end), lambda: True, "")


@pytest.fixture
def session(compose: Callable[..., object]) -> object:
    """Composed session whose hand is a person's; a machine that stands still is no outage here."""
    return compose(
        operator={"kind": "remote", "remote": {"timeout": PATIENT}},
        haptic_master={"device": {"friction": 0.0, "gimbal_noise": 0.0}},
        motion_scaling={"reach_force": {"is_on": False}, "coarse_gain": GAIN},
        slave={"starts_at_home": True, "operation": {"longest_outage": 0.0}},
    )


def is_held(peer: "Peer") -> Callable[[], object]:
    return lambda: peer.status("operator").values.get("hand.is_held") == "1"


def test_the_slave_goes_with_a_person_holds_without_and_no_grip_makes_it_jump(peer: "Peer", session: object) -> None:
    peer.wait(lambda: peer.status("operator").message.endswith(UNHELD), "a hand that waits")
    peer.wait_value("operator", "has_begun", lambda n: n == 1)
    tips, person = peer.listen(SLAVE_MEASURED_CP), Person(peer)
    person.hold([0.0, 0.0, 0.0], is_held(peer), "a grip")
    person.hold([0.0, 0.0, 0.0], at_rest(tips), "rest")
    begin = tips.values[-1][:3]

    person.drag([0.0, 0.0, 0.0], [0.010, 0.0, 0.008])
    tips.forget()  # the rest of before
    person.hold([0.010, 0.0, 0.008], at_rest(tips), "rest after the way")
    # The slave's x, y, z are -z, -x, y of the master.
    way = tips.values[-1][:3] - begin
    np.testing.assert_allclose(way, GAIN * np.array([-0.008, -0.010, 0.0]), atol=3e-4)

    peer.wait(lambda: not is_held(peer)(), "silence lets go")
    there = tips.values[-1][:3]
    peer.wait(at_rest(tips), "rest in silence")
    assert np.abs(tips.values[-1][:3] - there).max() < 1e-4

    tips.forget()
    elsewhere = np.array([-0.05, 0.03, 0.02])
    person.hold(elsewhere, is_held(peer), "a second grip")
    person.hold(elsewhere, at_rest(tips), "rest in the second grip")
    assert np.abs(np.array(tips.values)[:, :3] - there).max() < 2e-4
    end = np.add(elsewhere, [0.004, 0.0, 0.0])
    person.drag(elsewhere, end)
    tips.forget()
    person.hold(end, at_rest(tips), "rest at the end")
    np.testing.assert_allclose(tips.values[-1][:3] - there, [0.0, -GAIN * 0.004, 0.0], atol=3e-4)


def test_a_node_of_its_own_hears_buttons_and_refuses_what_is_no_pose(peer: "Peer") -> None:
    poses, buttons = peer.listen(MASTER_MEASURED_CP), peer.listen(MASTER_BUTTONS)
    hand: dict[str, Any] = {"operator__kind": "remote", "operator__remote__timeout": PATIENT}
    peer.start("haptic_master", patience=0.0, **hand, **EXACT)
    peer.wait(lambda: buttons.take() and buttons.values[-1][0] == 1.0, "a pressed clutch")
    person = Person(peer)

    def follows() -> Any:
        poses.take()
        return np.abs(poses.values[-1][:3] - rest_pose()[:3] - [0.01, 0.0, 0.0]).max() < 1e-4

    person.hold([0.0, 0.0, 0.0], is_held(peer), "a grip")
    person.drag([0.0, 0.0, 0.0], [0.01, 0.0, 0.0])
    person.hold([0.01, 0.0, 0.0], follows, "the stylus where it is wanted")
    buttons.take()
    assert buttons.values[-1][0] == 0.0
    person.hold([np.nan, 0.0, 0.0], lambda: not is_held(peer)(), "NaN to be no hand")
    peer.wait_value("operator", "refused.operator/servo_cp.not_finite", lambda n: n > 0)

    buttons.forget()
    deep = peer.publisher(OPERATOR_BUTTONS, readers=0)
    peer.wait(deep.get_subscription_count, "a reader of the buttons")
    for pressed in ([0.0, 1.0, 0.0], [0.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 0.0]):
        peer.send(OPERATOR_BUTTONS, peer.time_ns(), pressed)

    def presses() -> bool:
        is_there = buttons.take() > 1
        return is_there and (np.diff(np.array(buttons.values)[:, 1]) > 0.0).sum() == 2

    peer.wait(presses, "two presses of the fixture button")
