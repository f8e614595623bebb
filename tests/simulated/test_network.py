"""Network over topics: a foreign publisher behind it, and a session across it."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from rcl_interfaces.msg import Parameter, ParameterType, ParameterValue
from rcl_interfaces.srv import SetParameters

from teleop_core.graph.topics import (
    DISPLAY_MEASURED_CP,
    NETWORK_SERVO_CP,
    NETWORK_SETPOINT_CP,
    SLAVE_SERVO_CP,
    SLAVE_SETPOINT_CP,
    SLAVE_SETPOINT_JS,
)
from teleop_core.session.configuration import configure

if TYPE_CHECKING:
    from peers import AnyPeer as Peer

MS = 1_000_000
DELAY = 0.15


class Sender:
    """A program that knows nothing of the network: commands, and where a slave is."""

    def __init__(self, peer: "Peer") -> None:
        self.sent_ns: dict[Any, Any]
        self.peer, self.sent_ns = peer, {}

    def send(self) -> None:
        stamp = (len(self.sent_ns) + 2) * MS
        pose = (1e-9 * stamp, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0)
        self.peer.send(SLAVE_SETPOINT_CP, stamp, (0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0))
        self.sent_ns[stamp] = self.peer.platform.monotonic_ns()
        self.peer.send(SLAVE_SERVO_CP, stamp, pose)


def test_a_foreign_publisher_is_behind_the_network_and_nothing_comes_before_its_time(peer: "Peer") -> None:
    came, back = peer.listen(NETWORK_SERVO_CP), peer.listen(NETWORK_SETPOINT_CP)
    peer.start("network", there__least_delay=DELAY)
    ages: list[Any]
    sender, ages = Sender(peer), []

    def many() -> int:
        sender.send()
        before = len(came.stamps)
        came.take()
        now_ns = peer.platform.monotonic_ns()
        ages.extend(now_ns - sender.sent_ns[stamp] for stamp in came.stamps[before:])
        return len(ages) > 200 and back.take()

    peer.wait(many, "commands that arrive")
    assert min(ages) >= (DELAY - 1e-3) * 1e9
    assert (np.diff(came.stamps) > 0).all()
    np.testing.assert_allclose(np.array(came.values)[:, 0], 1e-9 * np.array(came.stamps))
    value = ParameterValue(type=ParameterType.PARAMETER_DOUBLE, double_value=1.0)
    request = SetParameters.Request(parameters=[Parameter(name="there.loss", value=value)])
    assert peer.call(SetParameters, "/network/set_parameters", request).results[0].successful
    set_ns = peer.platform.monotonic_ns()

    def quiet() -> bool:
        sender.send()
        came.take()
        return peer.platform.monotonic_ns() - set_ns > 3 * DELAY * 1e9

    peer.wait(quiet, "what was on its way has come")
    last = came.stamps[-1]
    assert sender.sent_ns[last] < set_ns + 50 * MS < max(sender.sent_ns.values())


def test_a_slave_is_led_across_a_network_and_the_recording_tells_the_age(peer: Any, tmp_path: Path) -> None:
    settings = [
        "teleop.stages=[network]",
        "network.there.least_delay=0.2",
        "network.back.least_delay=0.2",
        "slave.starts_at_home=true",
        "slave.operation.longest_outage=0",
    ]
    setpoints = peer.listen(SLAVE_SETPOINT_JS)

    def is_led() -> bool:
        setpoints.take()
        q = setpoints.values
        return len(q) > 1000 and np.abs(q[-1] - q[0]).max() > 2e-3

    bag = peer.run(configure("free_motion", settings=settings), is_led, tmp_path / "bag")
    said = [one.text for one in peer.machine.log]
    assert not any("not newer" in text for text in said)  # what did not arrive anew is not sent again
    series = bag.read(NETWORK_SERVO_CP.name)
    ages = (series.log_ns - series.stamp_ns)[series.stamp_ns > 0]
    assert ages.min() >= 199 * MS
    sent = bag.read(SLAVE_SERVO_CP.name)
    known = dict(zip(sent.stamp_ns, sent.values, strict=True))
    pairs = [(known[s], v) for s, v in zip(series.stamp_ns, series.values, strict=True) if s in known]
    assert len(pairs) > 0.5 * len(series.stamp_ns)
    for own, arrived in pairs:
        np.testing.assert_array_equal(own, arrived)


def test_a_frame_that_a_display_shows_again_is_not_refused(peer: Any) -> None:
    peer.start("motion_scaling", links=["slave/measured_cp=display/measured_cp"])
    received, name = 0.0, "received.display/measured_cp"
    stamp = peer.time_ns()
    while received < 30:  # the same frame, shown in many ticks
        peer.send(DISPLAY_MEASURED_CP, stamp, [0.4, 0.0, -0.2, 1.0, 0.0, 0.0, 0.0])
        received = peer.status("motion_scaling").number(name) if peer.status("motion_scaling") else 0.0
        peer.spin()
    status = peer.status("motion_scaling")
    assert status.values["refused"] == "0"
