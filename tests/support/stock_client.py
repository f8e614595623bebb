"""A stock CRTK client, for tests of nodes; needs crtk_msgs."""

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from geometry_msgs.msg import PoseStamped, TwistStamped
from sensor_msgs.msg import JointState

from foreign_hand import stamp
from teleop_core.kernels.geometry import Array
from teleop_core.middleware.platform import Qos

if TYPE_CHECKING:
    from peers import AnyPeer as Peer

crtk = pytest.importorskip("crtk_msgs.msg")
MIDDLE = [0.1, 1.7, 0.36, 0.2, 0.5, 0.1]
# A busy machine is no fault of the arm's.
CALM: dict[str, Any] = {"operation__longest_outage": 0.0, "command_timeout": 5.0, "start": MIDDLE, "start_speed": 1.0}


class StockClient:
    """What crtk_python_client does: reliable, ten deep, stamped now, joints without names."""

    def __init__(self, peer: "Peer", arm: str = "slave") -> None:
        self.peer, self.arm, self.was_busy = peer, arm, False
        self.newest: dict[str, Any] = {}
        self.commands: dict[str, Any] = {}
        for name, kind in (
            ("operating_state", crtk.OperatingState),
            ("setpoint_cp", PoseStamped),
            ("setpoint_js", JointState),
            ("goal_js", JointState),
            ("measured_cv", TwistStamped),
        ):
            peer.ros.create_subscription(kind, f"{arm}/{name}", self.taker(name), Qos())

    def taker(self, name: str) -> Callable[..., Any]:
        def take(message: Any) -> None:
            self.newest[name] = message
            if name == "operating_state":
                self.was_busy = self.was_busy or message.is_busy

        return take

    def spin(self) -> None:
        self.peer.executor.spin_once(timeout_sec=0.02)

    def wait(self, condition: Callable[[], object] | Callable[[], bool], what: str) -> Any:
        def turn() -> object:
            self.spin()
            return condition()

        return self.peer.wait(turn, what)

    def send(self, name: str, message: Any) -> None:
        if name not in self.commands:
            own = self.peer.ros.create_publisher(type(message), f"{self.arm}/{name}", Qos())
            self.commands[name] = own
            self.wait(lambda: own.get_subscription_count() > 0, f"a reader of {name}")
        if hasattr(message, "header"):
            stamp(message, self.peer.time_ns())
        self.commands[name].publish(message)

    def state(self) -> tuple[Any, Any, Any] | None:
        found = self.newest.get("operating_state")
        return found and (found.state, found.is_homed, found.is_busy)

    def reaches(self, state: tuple[str, bool, bool]) -> Any:
        return self.wait(lambda: self.state() == state, f"{state}, not {self.state()}")

    def joints(self) -> Array:
        return np.array(self.newest["setpoint_js"].position)

    @classmethod
    def of_slave(cls, peer: "Peer") -> "StockClient":
        """Client of a slave that it starts, enabled in the middle of its joints."""
        peer.start("slave", **CALM)
        client = cls(peer)
        client.reaches(("ENABLED", True, False))
        client.wait(lambda: len(client.newest) >= 3, "setpoints")
        return client
