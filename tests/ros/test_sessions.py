"""Several nodes together: safe with bad input, deaths and restarts, equal to virtual time."""

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from sensor_msgs.msg import JointState
from std_srvs.srv import Trigger

from teleop_core.graph import topics
from teleop_core.graph.topics import Topic
from teleop_core.kernels.geometry import Array
from teleop_core.robots import load_robot

if TYPE_CHECKING:
    from ros.conftest import Listener, Peer

pytestmark = pytest.mark.ros

ROBOT = load_robot("rcrt1")
HOME = ROBOT.home
MS = 1_000_000
STILL = 3e-4  # [rad or m], a few encoder steps: what counts as not moving


def drive(peer: "Peer", topic: Topic, wanted: Any, listener: "Listener", start: int = 0) -> int:
    """Send a value until the slave's setpoints carry its stamp; returns that stamp."""
    stamp = start

    def in_force() -> int | bool:
        nonlocal stamp
        stamp += MS
        peer.send(topic, stamp, wanted)
        return listener.take() and listener.stamps[-1] > start

    peer.wait(in_force, "command in force")
    return stamp


@pytest.mark.slow
def test_slave_refuses_bad_commands_and_holds(peer: "Peer") -> None:
    setpoints = peer.listen(topics.SLAVE_SETPOINT_JS)
    peer.start("slave")
    wanted = HOME - 0.001 * np.eye(6)[0]
    last = drive(peer, topics.SLAVE_SERVO_JP, wanted, setpoints)

    def there() -> int | bool:
        nonlocal last
        last += MS
        peer.send(topics.SLAVE_SERVO_JP, last, wanted)
        return setpoints.take() and np.allclose(setpoints.values[-1], wanted, atol=1e-9)

    peer.wait(there, "rest")
    setpoints.forget()

    def refuse(key: str, publish: Callable[..., object]) -> None:
        """Publish until one more is refused for this reason."""
        name = f"refused.slave/servo_jp.{key}"

        def refused() -> Any:
            nonlocal last
            last += MS
            publish(last)
            status = peer.status("slave")
            return status and status.number(name) > 0 and status.level == 1

        peer.wait(refused, name)

    near = HOME - 0.002 * np.eye(6)[0]
    publisher = peer.publisher(topics.SLAVE_SERVO_JP)

    def typed(names: list[Any] | tuple[str, ...], position: Any) -> Callable[..., object]:
        def publish(stamp: int) -> None:
            message = JointState(name=list(names), position=list(map(float, position)))
            message.header.stamp.sec, message.header.stamp.nanosec = divmod(stamp, 10**9)
            publisher.publish(message)

        return publish

    refuse("not_finite", lambda s: peer.send(topics.SLAVE_SERVO_JP, s, near * np.nan))
    refuse("not_finite", lambda s: peer.send(topics.SLAVE_SERVO_JP, s, near + np.inf))
    refuse("wrong_names", typed(["a", "b", "c", "d", "e", "f"], near))
    refuse("wrong_length", typed(ROBOT.joint_names, near[:4]))
    # So long without a good one is an outage, which may have paused the arm.
    assert peer.call(Trigger, "/slave/resume", Trigger.Request()).success
    setpoints.take()
    last = max(setpoints.stamps)
    good = drive(peer, topics.SLAVE_SERVO_JP, wanted, setpoints, last)

    def backwards() -> Any:
        peer.send(topics.SLAVE_SERVO_JP, good - MS, near)
        status = peer.status("slave")
        return status and status.number("refused.slave/servo_jp.not_newer") > 0

    peer.wait(backwards, "refused stamp")
    last = good + 10 * MS
    refuse("jump", lambda s: peer.send(topics.SLAVE_SERVO_JP, s, HOME - 0.9 * np.eye(6)[0]))
    setpoints.take()
    assert np.abs(np.array(setpoints.values) - wanted).max() < 1e-7


def rest(peer: "Peer", listener: "Listener") -> Array:
    """Joints of the slave once it has followed the hand to its rest."""

    def is_at_rest() -> bool:
        listener.take()
        q = np.array(listener.values[-1000:])[:, :6]
        travelled = np.abs(q[-1] - HOME).max() if len(q) else 0.0
        return travelled > 10.0 * STILL and len(q) == 1000 and np.ptp(q, axis=0).max() < STILL / 3

    peer.wait(is_at_rest, "slave at rest, away from home")
    return listener.values[-1][:6].copy()
